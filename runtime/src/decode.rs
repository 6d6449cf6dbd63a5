//! Decode: the pose's weights to features and deformation gradients, where a weight has changed.

use sinew_formats::package::PatchesView;

use crate::basis::Basis;
use crate::simd::Kernels;
use crate::simd::generic::decode::{BlockRest, Decoder, Share};
use crate::simd::generic::lanes::Gradient;

/// Weights nearer to zero are zero: their products would be denormal and slow, and nobody sees them.
const FLUSH_BELOW: f32 = 1e-6;
/// Scaled weights nearer to zero are zero: times the largest whole number they stay below what tanh rounds off, and times one
/// they leave tanh a square that is a normal number.
const FACTOR_START: f32 = 1e-14;
/// Scaled weights end here: times the largest whole number they are finite, so that a blend never is infinity less infinity.
const FACTOR_END: f32 = 5e33;

/// A weight as the blend uses it.
pub(crate) fn flushed(weight: f32) -> f32 {
    if weight.abs() < FLUSH_BELOW { 0.0 } else { weight }
}

/// Shares of a basis' components at rest. Shape: `[K]`.
pub(crate) fn shares_at_rest(basis: &Basis<'_>, shares: &mut [Share]) {
    for (k, share) in shares.iter_mut().enumerate() {
        *share = Share {
            factors: [0.0; 2],
            scales: basis.value_scales(k),
            changed: 0,
        };
    }
}

/// Brings the shares to `weights`, flushed, and marks those that are others now. Shape: both `[K]`.
pub(crate) fn set_shares(shares: &mut [Share], weights: &[f32]) {
    for (share, &weight) in shares.iter_mut().zip(weights) {
        let factors = share.scales.map(|scale| {
            let scaled = (weight * scale).clamp(-FACTOR_END, FACTOR_END);
            if scaled.abs() < FACTOR_START { 0.0 } else { scaled }
        });
        share.changed = u32::from(factors != share.factors);
        share.factors = factors;
    }
}

/// Buffers of a pose that decode keeps from frame to frame.
pub(crate) struct Decoded<'p> {
    /// Shape: `[K]`.
    pub(crate) shares: &'p mut [Share],
    /// Shape: `[B]`.
    pub(crate) blocks: &'p [BlockRest],
    /// Which groups have other gradients than in the pose before. Shape: `[G]`.
    pub(crate) touched: &'p mut [u8],
    /// Shape: `[N]`, slots.
    pub(crate) gradients: &'p mut [Gradient],
}

impl Decoded<'_> {
    /// Brings the gradients to `weights` `[K]`, flushed. `all` where the gradients are not those of the pose before.
    pub(crate) fn update(
        self,
        basis: &Basis<'_>,
        patches: PatchesView<'_>,
        kernels: Kernels,
        weights: &[f32],
        all: bool,
    ) {
        set_shares(self.shares, weights);
        let decoder = decoder(basis, patches, self.shares, self.blocks);
        if all {
            self.touched.fill(1);
        } else {
            decoder.mark_touched(self.touched);
        }
        kernels.decode(&decoder, self.touched, self.gradients);
    }
}

/// What the kernels read.
pub(crate) fn decoder<'a>(
    basis: &Basis<'a>,
    patches: PatchesView<'a>,
    shares: &'a [Share],
    blocks: &'a [BlockRest],
) -> Decoder<'a> {
    Decoder {
        patches,
        shares,
        blocks,
        scales: basis.scales(),
    }
}
