//! What an error of features weighs when weights are sought in feature space (method section 3, number 2): as it stands,
//! and by what it does to positions, to first order at the reference. A slight turn that a whole limb shares is little to
//! features and much to the eye; local detail is the other way round.

use super::reconstruct::PoissonSystem;
use super::rigid::{remove_directions, rigid_directions};
use sinew_formats::package::FEATURE_COUNT;

/// Relative error of positions against relative error of features, both squared. On seven sequences of bodies, cloth and
/// bending things E_rms falls by a tenth to three quarters against 0, and STED hardly changes but where bends are very large.
pub const POSITION_WEIGHT: f64 = 10.0;

/// Measures features in network units: `|e|^2 = sum_v areas_v |e_v|^2 + w |G e|^2`, where G maps features to displacements,
/// rigid motions taken out, and w makes relative errors of both comparable.
pub struct FeatureMetric<'a> {
    system: &'a PoissonSystem,
    /// Units of a feature by the network's. Shape: `[9]`.
    scales: [f64; FEATURE_COUNT],
    /// Shape: `[V]`.
    areas: &'a [f64],
    rigid: Vec<Vec<[f64; 3]>>,
}

impl<'a> FeatureMetric<'a> {
    /// Shapes: `scales` as [`FeatureScaler::scales`](super::scaler::FeatureScaler::scales) gives them, `areas` `[V]`.
    pub fn new(system: &'a PoissonSystem, scales: [f64; FEATURE_COUNT], areas: &'a [f64]) -> Self {
        Self {
            system,
            scales,
            areas,
            rigid: rigid_directions(system.rest()),
        }
    }

    /// Shape: `[V]`.
    pub fn areas(&self) -> &'a [f64] {
        self.areas
    }

    /// `G e`: displacements that small `features` make at the reference, less their rigid part. Shape: `[V]`.
    pub fn displacements(&self, features: &[[f64; FEATURE_COUNT]]) -> Vec<[f64; 3]> {
        let scaled: Vec<[f64; FEATURE_COUNT]> = features
            .iter()
            .map(|x| core::array::from_fn(|c| x[c] * self.scales[c]))
            .collect();
        let mut moved = self.system.linear_displacements(&scaled);
        remove_directions(&self.rigid, &mut moved, |x| x);
        moved
    }

    /// `G^T y` of displacements y without a rigid part. Shape: `[V]`.
    pub fn displacements_adjoint(&self, displacements: &[[f64; 3]]) -> Vec<[f64; FEATURE_COUNT]> {
        let mut back = self.system.linear_displacements_adjoint(displacements);
        for x in &mut back {
            (0..FEATURE_COUNT).for_each(|c| x[c] *= self.scales[c]);
        }
        back
    }

    /// `w` for many shapes together: [`POSITION_WEIGHT`] times their energy as features over that as displacements; of some of
    /// them, spread evenly, where they are many. 0 where nothing moves. Shape: `[M]`, each `[V]`.
    pub fn common_position_weight<'s>(&self, shapes: impl ExactSizeIterator<Item = &'s [[f32; FEATURE_COUNT]]>) -> f64 {
        let step = shapes.len().div_ceil(SHAPES_WEIGHED).max(1);
        let (mut features, mut displacements) = (0.0, 0.0);
        for shape in shapes.step_by(step) {
            let wide: Vec<[f64; FEATURE_COUNT]> = shape.iter().map(|x| x.map(f64::from)).collect();
            features += self.energy(&wide);
            displacements += squared_length(&self.displacements(&wide));
        }
        ratio(features, displacements)
    }

    /// `sum_v areas_v |x_v|^2`.
    pub fn energy(&self, features: &[[f64; FEATURE_COUNT]]) -> f64 {
        let places = features.iter().zip(self.areas);
        places
            .map(|(x, area)| area * x.iter().map(|x| x * x).sum::<f64>())
            .sum()
    }

    /// `w` for approaching `target`: [`POSITION_WEIGHT`] times its energy as features over its energy as displacements.
    /// 0 where it moves nothing.
    pub fn position_weight(&self, target: &[[f64; FEATURE_COUNT]]) -> f64 {
        ratio(self.energy(target), squared_length(&self.displacements(target)))
    }
}

/// Most shapes that [`FeatureMetric::common_position_weight`] looks at.
const SHAPES_WEIGHED: usize = 64;

fn ratio(features: f64, displacements: f64) -> f64 {
    if displacements > features * f64::MIN_POSITIVE {
        POSITION_WEIGHT * features / displacements
    } else {
        0.0
    }
}

/// `|y|^2` of displacements.
pub fn squared_length(displacements: &[[f64; 3]]) -> f64 {
    displacements.as_flattened().iter().map(|x| x * x).sum()
}
