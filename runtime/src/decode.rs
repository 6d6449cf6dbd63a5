//! Decode: features to deformation gradients, at the scales of the package.

use crate::basis::Tier;
use crate::simd::scalar::blend::Features;
use crate::simd::scalar::gradient;

/// `D = T - I` of every node. Shape: both `[N]`.
pub(crate) fn decode(tier: &Tier<'_>, features: &[Features], gradients: &mut [Features]) {
    gradient::gradients(tier.scales(), features, gradients);
}
