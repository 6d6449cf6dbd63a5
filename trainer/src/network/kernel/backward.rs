//! The passes from the loss back to every weight, in the reverse order of `forward` and with its layout.

use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::forward::{Source, energies};
use super::lanes::{
    Features, LANE_COUNT, Narrow, Registers, add_blend, add_projection, add_scaled, add_transposed, at_rest, expand,
    load, scaled, store, sum_features, sum_lanes, wide, zero,
};
use super::simd::{Group, Simd};
use super::sums::ConvolutionSums;
use crate::network::ring::RingMean;
use crate::network::weights::BlockWeights;

wide! {
    /// Turns the error into dL/de in place: `2 factor w_v e + sum_i projection_i g_i` (projections already scaled).
    fn differentiate_error<G>(
        simd,
        start: usize,
        factor: f32,
        vertex_weights: &[f32],
        modes: &[f32],
        mode_count: usize,
        projections: &[G],
        group_count: usize,
        error: &mut [Features<G>],
    ) {
        for (i, error) in error.chunks_exact_mut(group_count).enumerate() {
            let v = start + i;
            for (p, e) in error.iter_mut().enumerate() {
                for c in 0..FEATURE_COUNT {
                    let mut gradient = simd.mul(simd.splat(factor * vertex_weights[v]), simd.load(&e[c]));
                    let mode = &modes[(v * FEATURE_COUNT + c) * mode_count..][..mode_count];
                    for (projection, &g) in projections[p * mode_count..(p + 1) * mode_count].iter().zip(mode) {
                        gradient = simd.mul_add(simd.splat(g), simd.load(projection), gradient);
                    }
                    e[c] = simd.store(gradient);
                }
            }
        }
    }
}

/// What goes back through a block's input to the masks and the residual of its parent. Mutable slices begin at the
/// chunk; both are empty where the block has no parent.
pub(crate) struct SourceGradient<'a, G> {
    /// dL/d(x - y) of the parents, less what other passes add. Shape: `[parents][V][groups]`.
    pub(crate) residuals: Vec<&'a mut [Features<G>]>,
    /// dL/dmask. Shape: `[V][blocks]`.
    pub(crate) masks: &'a mut [f32],
}

impl<G> SourceGradient<'_, G> {
    /// Adds `gradient`, dL/dx of block `b` at the chunk's vertex `i`, and to `product` its part in the mask's gradient.
    #[inline(always)]
    fn add<S: Simd<G>>(
        &mut self,
        simd: S,
        source: Source<'_, G>,
        start: usize,
        i: usize,
        b: usize,
        p: usize,
        gradient: &Registers<S, G>,
        product: &mut S::V,
    ) {
        let (v, parent) = (start + i, b / source.child_count);
        let sum = &mut self.residuals[parent][i * source.group_count + p];
        let residual = &source.residual(v, parent)[p];
        let mask = simd.splat(source.mask(v, b));
        for c in 0..FEATURE_COUNT {
            sum[c] = simd.store(simd.mul_add(mask, gradient[c], simd.load(&sum[c])));
            *product = simd.mul_add(gradient[c], simd.load(&residual[c]), *product);
        }
    }
}

wide! {
    /// Back through the decoder's tanh: adds to dL/dz and to dL/dhat; answers the bias's gradient of each block. What the
    /// block's own term asks of its input goes to `source_gradient`. `residual`: x - y of the blocks. `error_gradient`:
    /// dL/de, shape `[V][groups]`. `children`: dL/d(x - y) from the level below, or empty. `transposed`: latents,
    /// `[blocks][shapes][width]` lanes of k. `block_factor`: twice the factor of the reconstruction terms.
    fn decode_back<G>(
        simd,
        start: usize,
        source: Source<'_, G>,
        blocks: &[BlockWeights],
        rest_share: f32,
        residual: &[Features<G>],
        error_gradient: &[Features<G>],
        children: &[Features<G>],
        block_factor: f32,
        vertex_weights: &[f32],
        hat: &[Features<Narrow>],
        transposed: &[Narrow],
        hat_gradient: &mut [&mut [Features<Narrow>]],
        latent_gradient: &mut [G],
        source_gradient: &mut SourceGradient<'_, G>,
    ) -> Vec<[f32; FEATURE_COUNT]> {
        let (block_count, group_count) = (blocks.len(), source.group_count);
        let vertex_count = vertex_weights.len();
        let width = hat.len() / (vertex_count * block_count);
        let component_count = latent_gradient.len() / (block_count * group_count);
        let has_parent = !source_gradient.residuals.is_empty();
        let mut gradients = vec![[G::ZERO; FEATURE_COUNT]; group_count];
        let one = simd.splat(1.0);
        let mut biases = Vec::with_capacity(block_count);
        for (b, block) in blocks.iter().enumerate() {
            let parent = b / source.child_count;
            let (rest, slope_at_rest) = at_rest(simd, &block.decoder.bias, rest_share);
            let latents = &mut latent_gradient[b * group_count * component_count..][..group_count * component_count];
            let transposed = &transposed[b * transposed.len() / block_count..(b + 1) * transposed.len() / block_count];
            let mut bias = zero(simd);
            for (i, hat_gradient) in hat_gradient[b].chunks_exact_mut(width).enumerate() {
                let v = start + i;
                let hat = &hat[(b * vertex_count + v) * width..][..width];
                let factor = block_factor * vertex_weights[v];
                let mut product = simd.splat(0.0);
                for (p, z) in latents.chunks_exact_mut(component_count).enumerate() {
                    let at = (b * vertex_count + v) * group_count + p;
                    let x = scaled(simd, source.mask(v, b), &source.residual(v, parent)[p]);
                    let residual = &residual[at];
                    let mut own = scaled(simd, factor, residual);
                    if let Some(children) = children.get(at) {
                        for c in 0..FEATURE_COUNT {
                            own[c] = simd.add(own[c], simd.load(&children[c]));
                        }
                    }
                    let error = &error_gradient[v * group_count + p];
                    let mut gradient = zero(simd);
                    for c in 0..FEATURE_COUNT {
                        let t = simd.add(simd.sub(x[c], simd.load(&residual[c])), rest[c]);
                        let from_output = simd.add(simd.load(&error[c]), own[c]);
                        // t² - 1 and not its negative: dL/dy is -(dL/de + dL/d(x - y)).
                        gradient[c] = simd.mul(from_output, simd.sub(simd.mul(t, t), one));
                        bias[c] = simd.add(bias[c], simd.mul_add(from_output, slope_at_rest[c], gradient[c]));
                    }
                    add_projection(simd, z, hat, &gradient);
                    store(simd, &gradient, &mut gradients[p]);
                    if has_parent {
                        source_gradient.add(simd, source, start, i, b, p, &own, &mut product);
                    }
                }
                if has_parent {
                    source_gradient.masks[i * block_count + b] += sum_lanes(simd.store(product));
                }
                expand(simd.narrow(), &gradients, transposed, hat_gradient);
            }
            biases.push(sum_features(simd, &bias));
        }
        biases
    }
}

wide! {
    /// Back through the latents and the encoder's tanh: adds to dL/dC, turns `hidden` into the gradient of what the
    /// encoder's convolution answers; answers the bias's gradient of each block.
    fn encode_back<G>(
        simd,
        start: usize,
        group_count: usize,
        blocks: &[BlockWeights],
        rest_share: f32,
        components: &[Features<Narrow>],
        latent_gradient: &[G],
        transposed: &[Narrow],
        hidden: &mut [&mut [Features<G>]],
        component_gradient: &mut [&mut [Features<Narrow>]],
    ) -> Vec<[f32; FEATURE_COUNT]> {
        let block_count = blocks.len();
        let component_count = latent_gradient.len() / (block_count * group_count);
        let width = component_count.div_ceil(LANE_COUNT);
        let mut moved = vec![[G::ZERO; FEATURE_COUNT]; group_count];
        let one = simd.splat(1.0);
        let mut biases = Vec::with_capacity(block_count);
        for (b, block) in blocks.iter().enumerate() {
            let (rest, slope_at_rest) = at_rest(simd, &block.encoder.bias, rest_share);
            let latents = &latent_gradient[b * group_count * component_count..][..group_count * component_count];
            let transposed = &transposed[b * transposed.len() / block_count..(b + 1) * transposed.len() / block_count];
            let mut bias = zero(simd);
            let components = &components[b * components.len() / block_count..];
            let rows = hidden[b].chunks_exact_mut(group_count);
            let sums = component_gradient[b].chunks_exact_mut(width);
            for (i, (hidden, sums)) in rows.zip(sums).enumerate() {
                let rows = &components[(start + i) * width..][..width];
                for (p, z) in latents.chunks_exact(component_count).enumerate() {
                    let mut towards_hidden = zero(simd);
                    add_blend(simd, &mut towards_hidden, rows, z);
                    for c in 0..FEATURE_COUNT {
                        let t = simd.load(&hidden[p][c]);
                        let gradient = simd.mul(towards_hidden[c], simd.mul_sub(t, t, one));
                        moved[p][c] = simd.store(simd.sub(t, rest[c]));
                        let without_rest = simd.mul_sub(towards_hidden[c], slope_at_rest[c], gradient);
                        bias[c] = simd.add(bias[c], without_rest);
                        hidden[p][c] = simd.store(gradient);
                    }
                }
                expand(simd.narrow(), &moved, transposed, sums);
            }
            biases.push(sum_features(simd, &bias));
        }
        biases
    }
}

wide! {
    /// Back through the encoder's convolution, `gradient` being that of what it answers: its own gradient for each block,
    /// and dL/dx to `source_gradient`.
    fn convolve_back<G>(
        simd,
        start: usize,
        source: Source<'_, G>,
        ring: &RingMean,
        blocks: &[BlockWeights],
        gradient: &[Features<G>],
        chunk_len: usize,
        source_gradient: &mut SourceGradient<'_, G>,
    ) -> Vec<GraphConvRecord> {
        let (block_count, group_count) = (blocks.len(), source.group_count);
        let has_parent = !source_gradient.residuals.is_empty();
        let mut totals = Vec::with_capacity(block_count);
        for (b, block) in blocks.iter().enumerate() {
            let (convolution, parent) = (&block.encoder, b / source.child_count);
            let mut sums = ConvolutionSums::ZERO;
            let gradient = &gradient[b * gradient.len() / block_count..];
            for i in 0..chunk_len {
                let v = start + i;
                let mut product = simd.splat(0.0);
                for p in 0..group_count {
                    let at = |v: usize| &gradient[v * group_count + p];
                    let mut gathered = zero(simd);
                    for &j in ring.transposed_ring(v) {
                        add_scaled(simd, &mut gathered, ring.inverse_degree[j as usize], at(j as usize));
                    }
                    let x = scaled(simd, source.mask(v, b), &source.residual(v, parent)[p]);
                    sums.push(simd, &load(simd, at(v)), &gathered, &x);
                    if has_parent {
                        let mut towards_input = zero(simd);
                        add_transposed(simd, &mut towards_input, &convolution.point, &load(simd, at(v)));
                        add_transposed(simd, &mut towards_input, &convolution.neighbour, &gathered);
                        source_gradient.add(simd, source, start, i, b, p, &towards_input, &mut product);
                    }
                }
                if has_parent {
                    source_gradient.masks[i * block_count + b] += sum_lanes(simd.store(product));
                }
            }
            totals.push(sums.total(simd));
        }
        totals
    }
}

wide! {
    /// Back through `convolve_components`: writes dL/dC, answers the convolution's gradient of each block.
    fn convolve_components_back<G>(
        simd,
        start: usize,
        components: &[Features<G>],
        width: usize,
        ring: &RingMean,
        blocks: &[BlockWeights],
        hat_gradient: &[Features<G>],
        component_gradient: &mut [&mut [Features<G>]],
    ) -> Vec<GraphConvRecord> {
        let block_len = ring.vertex_count() * width;
        let fields = components.chunks_exact(block_len).zip(hat_gradient.chunks_exact(block_len));
        let mut totals = Vec::with_capacity(blocks.len());
        for ((block, (components, hat_gradient)), component_gradient) in blocks.iter().zip(fields).zip(component_gradient) {
            let mut sums = ConvolutionSums::ZERO;
            for (i, component_gradient) in component_gradient.iter_mut().enumerate() {
                let (v, q) = (start + i / width, i % width);
                let at = |v: usize| &hat_gradient[v * width + q];
                let mut gathered = zero(simd);
                for &j in ring.transposed_ring(v) {
                    add_scaled(simd, &mut gathered, ring.inverse_degree[j as usize], at(j as usize));
                }
                let g = load(simd, at(v));
                sums.push(simd, &g, &gathered, &load(simd, &components[v * width + q]));
                let mut own = zero(simd);
                add_transposed(simd, &mut own, &block.decoder.point, &g);
                add_transposed(simd, &mut own, &block.decoder.neighbour, &gathered);
                store(simd, &own, component_gradient);
            }
            totals.push(sums.total(simd));
        }
        totals
    }
}

wide! {
    /// Back through `attend`: adds the masks' part to dL/dC. `masks` and their gradient, `[V][blocks][K]`, begin at the
    /// chunk too.
    fn attend_back<G>(
        simd,
        start: usize,
        components: &[Features<G>],
        vertex_count: usize,
        width: usize,
        component_count: usize,
        floor: f32,
        masks: &[f32],
        mask_gradient: &[f32],
        component_gradient: &mut [&mut [Features<G>]],
    ) {
        let block_count = component_gradient.len();
        let mut own_energies = vec![0.0; component_count];
        let masks = masks.chunks_exact(component_count).zip(mask_gradient.chunks_exact(component_count));
        for (at, (masks, gradient)) in masks.enumerate() {
            let (i, b) = (at / block_count, at % block_count);
            let rows = &components[(b * vertex_count + start + i) * width..][..width];
            let sums = &mut component_gradient[b][i * width..(i + 1) * width];
            let total = energies(simd, rows, &mut own_energies) + component_count as f32 * floor;
            let mean: f32 = masks.iter().zip(gradient).map(|(mask, gradient)| mask * gradient).sum();
            for (k, gradient) in gradient.iter().enumerate() {
                let factor = 2.0 * (gradient - mean) / total;
                let (q, lane) = (k / G::LEN, k % G::LEN);
                for c in 0..FEATURE_COUNT {
                    sums[q][c].as_mut()[lane] += factor * rows[q][c].as_ref()[lane];
                }
            }
        }
    }
}
