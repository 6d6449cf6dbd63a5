//! Whole numbers that stand for a component's values, and their scales: one for log-rotation and one for stretch, because
//! the two differ in size and a common step would waste the digits of one.

use rkyv::{Archive, Serialize};

use super::FEATURE_COUNT;

/// Log-rotation is the first three of the features.
pub const ROTATION_FEATURES: usize = 3;

/// What the whole numbers of a component are multiples of.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct ValueScales {
    /// Of the first three features, log-rotation. Positive.
    pub rotation: f32,
    /// Of the other six, stretch. Positive.
    pub stretch: f32,
}

impl ValueScales {
    /// The greatest whole number that is used, either sign.
    pub const GREATEST: i16 = i16::MAX;

    /// Scales by which the greatest magnitudes, of log-rotation and of stretch, become [`Self::GREATEST`].
    pub fn for_greatest(rotation: f64, stretch: f64) -> Self {
        let scale = |greatest: f64| {
            let scale = (greatest / f64::from(Self::GREATEST)) as f32;
            // Of nothing, or of what a normal number cannot scale: any scale will do.
            if scale.is_normal() { scale } else { 1.0 }
        };
        Self {
            rotation: scale(rotation),
            stretch: scale(stretch),
        }
    }

    /// Scales for these values.
    pub fn for_values(values: &[[f32; FEATURE_COUNT]]) -> Self {
        let greatest = |features: core::ops::Range<usize>| {
            let numbers = values.iter().flat_map(|value| &value[features.clone()]);
            f64::from(numbers.fold(0.0_f32, |greatest, x| greatest.max(x.abs())))
        };
        Self::for_greatest(
            greatest(0..ROTATION_FEATURES),
            greatest(ROTATION_FEATURES..FEATURE_COUNT),
        )
    }

    /// One for each feature.
    pub fn by_feature(&self) -> [f32; FEATURE_COUNT] {
        core::array::from_fn(|c| {
            if c < ROTATION_FEATURES {
                self.rotation
            } else {
                self.stretch
            }
        })
    }

    /// What whole numbers stand for.
    pub fn widen(&self, whole: &[i16; FEATURE_COUNT]) -> [f32; FEATURE_COUNT] {
        let scales = self.by_feature();
        core::array::from_fn(|c| f32::from(whole[c]) * scales[c])
    }

    /// The nearest whole numbers.
    pub fn round(&self, values: &[f32; FEATURE_COUNT]) -> [i16; FEATURE_COUNT] {
        let scales = self.by_feature();
        core::array::from_fn(|c| nearest(f64::from(values[c]) / f64::from(scales[c])))
    }
}

/// The whole number nearest to `value`, half-way ones to even, within [`ValueScales::GREATEST`]; 0 for what is not a number.
pub fn nearest(value: f64) -> i16 {
    /// Adding it leaves no digits after the point.
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    let greatest = f64::from(ValueScales::GREATEST);
    let kept = value.clamp(-greatest, greatest);
    (kept + ROUNDER - ROUNDER) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_the_nearest_and_greatest_ones_are_kept() {
        assert_eq!([0.4, 0.5, 1.5, -2.5, -2.6].map(nearest), [0, 0, 2, -2, -3]);
        assert_eq!(
            [1e9, -1e9, f64::INFINITY, f64::NAN].map(nearest),
            [32_767, -32_767, 32_767, 0]
        );
        let value = [0.1, -0.2, 0.05, 1.0, -3.0, 0.0, 0.5, 2.0, -1.0];
        let scales = ValueScales::for_values(&[value, [0.0; FEATURE_COUNT]]);
        let whole = scales.round(&value);
        assert_eq!((whole[1], whole[4]), (-32_767, -32_767));
        for (c, (again, x)) in scales.widen(&whole).iter().zip(value).enumerate() {
            assert!((again - x).abs() <= 0.51 * scales.by_feature()[c], "{again} {x}");
        }
        // What stands for values exactly is found again.
        assert_eq!(scales.round(&scales.widen(&whole)), whole);
        assert_eq!(ValueScales::for_values(&[scales.widen(&whole)]), scales);
    }

    #[test]
    fn a_component_of_nothing_has_scales_all_the_same() {
        let scales = ValueScales::for_values(&[]);
        assert_eq!((scales.rotation, scales.stretch), (1.0, 1.0));
        assert_eq!(ValueScales::for_greatest(1e-44, 0.0).rotation, 1.0);
    }
}
