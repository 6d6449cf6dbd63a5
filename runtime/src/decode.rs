//! Decode: the pose's weights to features and deformation gradients, where a weight has changed.

use crate::basis::Tier;
use crate::simd::Kernels;
use crate::simd::decode::{BlockRest, Decoder, Share};
use crate::simd::lanes::Gradient;

/// Weights nearer to zero are zero: their products would be denormal and slow, and nobody sees them.
const FLUSH_BELOW: f32 = 1e-6;
/// Scaled weights nearer to zero are zero: times the largest half that the baker writes they stay below what tanh rounds
/// off, and times the smallest they leave tanh a square that is a normal number.
const FACTOR_START: f32 = 1.7e-11;
/// Scaled weights end here: times the largest half they are finite, so that a blend never is infinity less infinity.
const FACTOR_END: f32 = 5e33;

/// A weight as the blend uses it.
pub(crate) fn flushed(weight: f32) -> f32 {
    if weight.abs() < FLUSH_BELOW { 0.0 } else { weight }
}

/// What component `k` counts at a weight.
pub(crate) fn factor(tier: &Tier<'_>, k: usize, weight: f32) -> f32 {
    let scaled = (weight * tier.value_scale(k)).clamp(-FACTOR_END, FACTOR_END);
    if scaled.abs() < FACTOR_START { 0.0 } else { scaled }
}

/// Buffers of a pose that decode keeps from frame to frame.
pub(crate) struct Decoded<'p> {
    /// Shape: `[K]`.
    pub(crate) shares: &'p mut [Share],
    /// Shape: `[B]`.
    pub(crate) blocks: &'p [BlockRest],
    /// Shape: `[N]`, lanes.
    pub(crate) gradients: &'p mut [Gradient],
}

impl Decoded<'_> {
    /// Brings the gradients to `weights` `[K]`, flushed. `all` where the gradients are not those of the pose before.
    pub(crate) fn update(self, tier: &Tier<'_>, kernels: Kernels, weights: &[f32], all: bool) {
        for (k, (share, &weight)) in self.shares.iter_mut().zip(weights).enumerate() {
            let factor = factor(tier, k, weight);
            let changed = u32::from(factor != share.factor);
            *share = Share { factor, changed };
        }
        let decoder = decoder(tier, self.shares, self.blocks, all);
        kernels.decode(&decoder, self.gradients);
    }
}

/// What the kernels read.
pub(crate) fn decoder<'a>(tier: &Tier<'a>, shares: &'a [Share], blocks: &'a [BlockRest], all: bool) -> Decoder<'a> {
    Decoder {
        patches: tier.patches(),
        shares,
        blocks,
        scales: tier.scales(),
        all,
    }
}
