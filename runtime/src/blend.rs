//! Blend: the pose's weights to features, block by block (method section 2, the decoder half).

use sinew_formats::package::{BakedBlock, FEATURE_COUNT};

use crate::basis::Tier;
use crate::simd::scalar::blend::{Features, accumulate, activate};

/// Weights nearer to zero are zero: their products would be denormal and slow, and nobody sees them.
const FLUSH_BELOW: f32 = 1e-6;

/// A weight as the blend uses it.
pub(crate) fn flushed(weight: f32) -> f32 {
    if weight.abs() < FLUSH_BELOW { 0.0 } else { weight }
}

/// Fills `features` with the sum of all blocks at `weights`; zero where nothing reaches.
///
/// Shape: `weights` `[K]`, flushed; `pre_activations` at least the largest support; `features` `[N]`, solver order.
pub(crate) fn blend(tier: &Tier<'_>, weights: &[f32], pre_activations: &mut [Features], features: &mut [Features]) {
    features.fill([0.0; FEATURE_COUNT]);
    for b in 0..tier.block_count() {
        let block = tier.block(b);
        let components = components(&block);
        // tanh(bias) - tanh(bias): a block at rest adds nothing.
        if weights[components].iter().all(|&w| w == 0.0) {
            continue;
        }
        let pre = blend_block(tier, b, weights, pre_activations);
        activate(&block.bias, tier.support(b), pre, features);
    }
}

/// Block `b`'s pre-activations without the bias: `u = sum_k z_k C_k` on the block's support.
pub(crate) fn blend_block<'p>(
    tier: &Tier<'_>,
    b: usize,
    weights: &[f32],
    pre_activations: &'p mut [Features],
) -> &'p [Features] {
    let pre = &mut pre_activations[..tier.support(b).len()];
    pre.fill([0.0; FEATURE_COUNT]);
    for k in components(&tier.block(b)) {
        if weights[k] != 0.0 {
            let entries = tier.entries(k);
            accumulate(entries.slots, entries.values, weights[k] * entries.scale, pre);
        }
    }
    pre
}

/// The block's components.
pub(crate) fn components(block: &BakedBlock) -> core::ops::Range<usize> {
    let first = block.first_component as usize;
    first..first + block.component_count as usize
}
