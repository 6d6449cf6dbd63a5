//! Decode: features to deformation gradients, at the scales of the package.

use crate::basis::Basis;
use crate::simd::scalar::blend::Features;
use crate::simd::scalar::gradient::{self, FeatureScales};

/// The package's feature scales.
pub(crate) fn scales(basis: &Basis<'_>) -> FeatureScales {
    FeatureScales {
        rotation: basis.rotation_scale(),
        stretch: basis.stretch_scale(),
    }
}

/// `D = T - I` of every vertex. Shape: both `[V]`.
pub(crate) fn decode(basis: &Basis<'_>, features: &[Features], gradients: &mut [Features]) {
    gradient::gradients(scales(basis), features, gradients);
}
