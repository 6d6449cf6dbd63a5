//! Features into the network's range and back: the last step before training, the first after decoding.
//!
//! Symmetric about the reference, one scale for rotations and one for stretches (method section 1): the reference is 0, so
//! rest maps to rest, and the runtime needs two numbers.

use super::acap::AcapFeatures;

/// No network value of the fitted shapes leaves this: tanh must reach it.
const VALUE_LIMIT: f64 = 0.95;

/// Least scale: data that never turns or stretches still has one.
const SCALE_FLOOR: f64 = 1e-6;

/// `x_r = r / rotation_scale`, `x_s = (S - I) / stretch_scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeatureScaler {
    /// Radians a network unit. Positive.
    pub rotation_scale: f32,
    /// Stretch a network unit. Positive.
    pub stretch_scale: f32,
}

impl FeatureScaler {
    /// Scales that bring the greatest rotation component of `shapes` to `rotation_reach` (at most 0.95: the paper's), and
    /// let a stretch count `stretch_weight` times a rotation of as many radians; without a weight the greatest stretch is
    /// brought to `rotation_reach` too. The stretch scale is raised where stretches would leave 0.95.
    pub fn fit(
        features: &AcapFeatures,
        shapes: &[usize],
        rotation_reach: f64,
        stretch_weight: Option<f64>,
    ) -> FeatureScaler {
        let greatest = shapes
            .iter()
            .map(|&m| Greatest::of(&features.shapes[m]))
            .fold(Greatest::default(), Greatest::or);
        Self::of_greatest(greatest, rotation_reach, stretch_weight)
    }

    /// The same of what was found over all shapes.
    pub fn of_greatest(greatest: Greatest, rotation_reach: f64, stretch_weight: Option<f64>) -> FeatureScaler {
        let Greatest { rotation, stretch } = greatest;
        let reach = rotation_reach.clamp(f64::MIN_POSITIVE, VALUE_LIMIT);
        let rotation_scale = (rotation / reach).max(SCALE_FLOOR);
        let stretch_scale = stretch_weight
            .map_or(stretch / reach, |weight| rotation_scale / weight)
            .max(stretch / VALUE_LIMIT)
            .max(SCALE_FLOOR);
        FeatureScaler {
            rotation_scale: rotation_scale as f32,
            stretch_scale: stretch_scale as f32,
        }
    }

    /// Network values of `features`. Shape: `[V][9]`.
    pub fn to_network(&self, features: &[[f64; 9]]) -> Vec<[f32; 9]> {
        let scales = self.scales();
        features
            .iter()
            .map(|feature| {
                let deviation = deviation(feature);
                core::array::from_fn(|c| (deviation[c] / scales[c]) as f32)
            })
            .collect()
    }

    /// Features of network values. Shape: `[V][9]`.
    pub fn from_network(&self, values: &[[f32; 9]]) -> Vec<[f64; 9]> {
        let scales = self.scales();
        values
            .iter()
            .map(|value| core::array::from_fn(|c| f64::from(value[c]) * scales[c] + super::acap::NEUTRAL_FEATURE[c]))
            .collect()
    }

    /// Feature units in one network unit, in the order of a feature.
    pub fn scales(&self) -> [f64; 9] {
        core::array::from_fn(|c| f64::from(if c < 3 { self.rotation_scale } else { self.stretch_scale }))
    }
}

/// The greatest magnitudes of differences from the reference.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Greatest {
    /// Of an entry of a rotation, radians.
    pub rotation: f64,
    /// Of an entry of a stretch.
    pub stretch: f64,
}

impl Greatest {
    /// Of one shape. Shape: `[V]`.
    pub fn of(features: &[[f64; 9]]) -> Self {
        let mut greatest = Self::default();
        for feature in features {
            let deviation = deviation(feature);
            let most = |start: f64, values: &[f64]| values.iter().fold(start, |most, x| most.max(x.abs()));
            greatest.rotation = most(greatest.rotation, &deviation[..3]);
            greatest.stretch = most(greatest.stretch, &deviation[3..]);
        }
        greatest
    }

    /// Of both.
    pub fn or(self, other: Self) -> Self {
        Self {
            rotation: self.rotation.max(other.rotation),
            stretch: self.stretch.max(other.stretch),
        }
    }
}

/// The feature less that of the reference.
pub fn deviation(feature: &[f64; 9]) -> [f64; 9] {
    core::array::from_fn(|c| feature[c] - super::acap::NEUTRAL_FEATURE[c])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::acap::NEUTRAL_FEATURE;

    /// One rounding to f32 and one of the scale.
    const TOLERANCE: f64 = 3e-7;

    fn features(rotation: f64, stretch: f64) -> AcapFeatures {
        let mut feature = NEUTRAL_FEATURE;
        (feature[1], feature[6], feature[7]) = (-rotation, 1.0 + stretch, -stretch / 2.0);
        AcapFeatures {
            shapes: vec![vec![NEUTRAL_FEATURE; 2], vec![NEUTRAL_FEATURE, feature]],
        }
    }

    #[test]
    fn there_and_back() {
        let features = features(2.0, 0.3);
        let scaler = FeatureScaler::fit(&features, &[0, 1], 0.4, Some(0.1));
        for shape in &features.shapes {
            let values = scaler.to_network(shape);
            assert!(
                values
                    .iter()
                    .flatten()
                    .all(|x| f64::from(x.abs()) <= VALUE_LIMIT + TOLERANCE)
            );
            for (a, b) in scaler
                .from_network(&values)
                .iter()
                .flatten()
                .zip(shape.iter().flatten())
            {
                assert!((a - b).abs() < TOLERANCE * b.abs().max(1.0));
            }
        }
        assert_eq!(scaler.to_network(&features.shapes[0]), vec![[0.0; 9]; 2]);
        assert!((f64::from(scaler.rotation_scale) - 5.0).abs() < 1e-6);
        assert!((f64::from(scaler.stretch_scale) - 50.0).abs() < 1e-5);
    }

    #[test]
    fn scaled_apart_rotations_and_stretches_both_fill_the_range() {
        let scaler = FeatureScaler::fit(&features(2.0, 0.1), &[1], 0.95, None);
        assert!((f64::from(scaler.rotation_scale) - 2.0 / 0.95).abs() < 1e-6);
        assert!((f64::from(scaler.stretch_scale) - 0.1 / 0.95).abs() < 1e-6);
    }

    #[test]
    fn stretches_stay_in_range_and_scales_stay_positive() {
        let scaler = FeatureScaler::fit(&features(0.01, 3.0), &[1], 0.95, Some(1.0));
        assert!((f64::from(scaler.stretch_scale) - 3.0 / 0.95).abs() < 1e-6);
        let constant = FeatureScaler::fit(&features(0.0, 0.0), &[0, 1], 0.4, Some(0.1));
        assert!(constant.rotation_scale > 0.0 && constant.stretch_scale > 0.0);
        assert_eq!(FeatureScaler::fit(&features(1.0, 1.0), &[], 0.4, Some(0.1)), constant);
    }
}
