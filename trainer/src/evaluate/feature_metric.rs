//! What an error of features weighs when weights are sought in feature space (method section 3, number 2): as it stands,
//! and by what it does to positions, to first order at the reference. A slight turn that a whole limb shares is little to
//! features and much to the eye; local detail is the other way round.

use super::position_projection::{remove_directions, rigid_directions};
use crate::features::reconstruct::PoissonSystem;
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
    /// Shapes: `scales` as [`FeatureScaler::scales`](crate::features::scaler::FeatureScaler::scales) gives them, `areas` `[V]`.
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

    /// `w` for approaching `target`: [`POSITION_WEIGHT`] times its energy as features over its energy as displacements.
    /// 0 where it moves nothing.
    pub fn position_weight(&self, target: &[[f64; FEATURE_COUNT]]) -> f64 {
        let features: f64 = target
            .iter()
            .zip(self.areas)
            .map(|(x, area)| area * x.iter().map(|x| x * x).sum::<f64>())
            .sum();
        let displacements = squared_length(&self.displacements(target));
        if displacements > features * f64::MIN_POSITIVE {
            POSITION_WEIGHT * features / displacements
        } else {
            0.0
        }
    }
}

/// `|y|^2` of displacements.
pub(crate) fn squared_length(displacements: &[[f64; 3]]) -> f64 {
    displacements.as_flattened().iter().map(|x| x * x).sum()
}
