//! The passes from shapes to residuals, one chunk of vertices each (method section 2).
//!
//! Layout: fields over shapes are `[blocks of the level][V][groups]`, fields over components `[blocks][V][width]` with
//! width the groups of eight components: what neighbours hold of a block lies close together. A chunk's first vertex is
//! `start`; its mutable slices begin there, one for each block where the field has blocks; its shared slices begin at
//! vertex 0. `rest` is tanh of the bias, subtracted so that rest maps to rest; nothing under the paper's activation.

use sinew_formats::package::FEATURE_COUNT;

use super::lanes::{
    Features, Narrow, add_blend, add_matrix, add_projection, add_scaled, at_rest, load, scaled, splat, store,
    sum_lanes, tanh_features, wide, zero,
};
use super::simd::{Group, Simd};
use crate::network::ring::RingMean;
use crate::network::weights::BlockWeights;

/// What the blocks of a level see: the residuals of the blocks above, shared out by masks. Inputs are never stored.
pub(crate) struct Source<'a, G> {
    /// Residuals of the level above; above the root, the shapes. Shape: `[parents][V][groups]`.
    pub(crate) residuals: &'a [Features<G>],
    /// Each block's share of its parent's residual. Shape: `[V][blocks]`.
    pub(crate) masks: &'a [f32],
    /// Blocks under each parent.
    pub(crate) child_count: usize,
    pub(crate) block_count: usize,
    pub(crate) group_count: usize,
}

impl<G> Clone for Source<'_, G> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<G> Copy for Source<'_, G> {}

impl<'a, G> Source<'a, G> {
    #[inline(always)]
    pub(crate) fn mask(self, v: usize, b: usize) -> f32 {
        self.masks[v * self.block_count + b]
    }

    pub(crate) fn vertex_count(self) -> usize {
        self.masks.len() / self.block_count
    }

    /// The parent's residual. Shape: `[groups]`.
    #[inline(always)]
    pub(crate) fn residual(self, v: usize, parent: usize) -> &'a [Features<G>] {
        &self.residuals[(parent * self.vertex_count() + v) * self.group_count..][..self.group_count]
    }
}

wide! {
    /// Encoder convolution and its share of the latents: `hidden = tanh(conv(x))`, `z[b][p][k] += C_k . (hidden - rest)`.
    fn encode<G>(
        simd,
        start: usize,
        source: Source<'_, G>,
        ring: &RingMean,
        blocks: &[BlockWeights],
        rest_share: f32,
        components: &[Features<Narrow>],
        hidden: &mut [&mut [Features<G>]],
        latents: &mut [G],
    ) {
        let (block_count, group_count) = (blocks.len(), source.group_count);
        let vertex_count = ring.vertex_count();
        let width = components.len() / (vertex_count * block_count);
        let component_count = latents.len() / (block_count * group_count);
        for (b, block) in blocks.iter().enumerate() {
            let (convolution, parent) = (&block.encoder, b / source.child_count);
            let (rest, _) = at_rest(simd, &convolution.bias, rest_share);
            let latents = &mut latents[b * group_count * component_count..][..group_count * component_count];
            for (i, hidden) in hidden[b].chunks_exact_mut(group_count).enumerate() {
                let v = start + i;
                let rows = &components[(b * vertex_count + v) * width..][..width];
                for (p, z) in latents.chunks_exact_mut(component_count).enumerate() {
                    let mut mean = zero(simd);
                    for &j in ring.ring(v) {
                        let share = ring.inverse_degree[v] * source.mask(j as usize, b);
                        add_scaled(simd, &mut mean, share, &source.residual(j as usize, parent)[p]);
                    }
                    let x = scaled(simd, source.mask(v, b), &source.residual(v, parent)[p]);
                    let mut t = splat(simd, &convolution.bias);
                    add_matrix(simd, &mut t, &convolution.point, &x);
                    add_matrix(simd, &mut t, &convolution.neighbour, &mean);
                    tanh_features(simd, &mut t);
                    store(simd, &t, &mut hidden[p]);
                    for c in 0..FEATURE_COUNT {
                        t[c] = simd.sub(t[c], rest[c]);
                    }
                    add_projection(simd, z, rows, &t);
                }
            }
        }
    }
}

wide! {
    /// The decoder's convolution of the components instead of the shapes: `hat = W_point C + W_neighbour mean C`.
    fn convolve_components<G>(
        simd,
        start: usize,
        components: &[Features<G>],
        width: usize,
        ring: &RingMean,
        blocks: &[BlockWeights],
        hat: &mut [&mut [Features<G>]],
    ) {
        let block_len = ring.vertex_count() * width;
        for ((block, hat), components) in blocks.iter().zip(hat).zip(components.chunks_exact(block_len)) {
            for (i, hat) in hat.chunks_exact_mut(width).enumerate() {
                let v = start + i;
                for (q, hat) in hat.iter_mut().enumerate() {
                    let at = |v: usize| &components[v * width + q];
                    let mut mean = zero(simd);
                    for &j in ring.ring(v) {
                        add_scaled(simd, &mut mean, ring.inverse_degree[v], at(j as usize));
                    }
                    let mut sum = zero(simd);
                    add_matrix(simd, &mut sum, &block.decoder.point, &load(simd, at(v)));
                    add_matrix(simd, &mut sum, &block.decoder.neighbour, &mean);
                    store(simd, &sum, hat);
                }
            }
        }
    }
}

wide! {
    /// `y = tanh(sum_k z_k hat_k + bias) - rest`, `residual = x - y`, `error -= y`; answers the chunk's share of the
    /// weighted `|x - y|^2`. `last_group`: 1 in the lanes of the last group that hold a shape and 0 in the others, where
    /// those would not stay zero by themselves.
    fn decode<G>(
        simd,
        start: usize,
        source: Source<'_, G>,
        blocks: &[BlockWeights],
        rest_share: f32,
        hat: &[Features<Narrow>],
        latents: &[G],
        vertex_weights: &[f32],
        last_group: Option<&G>,
        residual: &mut [&mut [Features<G>]],
        error: &mut [Features<G>],
    ) -> f32 {
        let (block_count, group_count) = (blocks.len(), source.group_count);
        let vertex_count = vertex_weights.len();
        let width = hat.len() / (vertex_count * block_count);
        let component_count = latents.len() / (block_count * group_count);
        let mut loss = simd.splat(0.0);
        for (b, block) in blocks.iter().enumerate() {
            let parent = b / source.child_count;
            let (rest, _) = at_rest(simd, &block.decoder.bias, rest_share);
            let latents = &latents[b * group_count * component_count..][..group_count * component_count];
            let rows = residual[b].chunks_exact_mut(group_count);
            for (i, (residual, error)) in rows.zip(error.chunks_exact_mut(group_count)).enumerate() {
                let v = start + i;
                let hat = &hat[(b * vertex_count + v) * width..][..width];
                for (p, z) in latents.chunks_exact(component_count).enumerate() {
                    let mut y = splat(simd, &block.decoder.bias);
                    add_blend(simd, &mut y, hat, z);
                    let x = scaled(simd, source.mask(v, b), &source.residual(v, parent)[p]);
                    let mut squares = simd.splat(0.0);
                    tanh_features(simd, &mut y);
                    if let Some(shapes) = last_group.filter(|_| p + 1 == group_count) {
                        for c in 0..FEATURE_COUNT {
                            y[c] = simd.mul(y[c], simd.load(shapes));
                        }
                    }
                    for c in 0..FEATURE_COUNT {
                        let y = simd.sub(y[c], rest[c]);
                        let difference = simd.sub(x[c], y);
                        squares = simd.mul_add(difference, difference, squares);
                        residual[p][c] = simd.store(difference);
                        error[p][c] = simd.store(simd.sub(simd.load(&error[p][c]), y));
                    }
                    loss = simd.mul_add(simd.splat(vertex_weights[v]), squares, loss);
                }
            }
        }
        sum_lanes(simd.store(loss))
    }
}

wide! {
    /// Attention masks: `(am_k + floor) / (sum_k am_k + K floor)` with `am_k = |C_k,v|^2`. Shape of `masks`:
    /// `[V][blocks][K]`.
    fn attend<G>(
        simd,
        start: usize,
        components: &[Features<G>],
        vertex_count: usize,
        width: usize,
        component_count: usize,
        floor: f32,
        masks: &mut [f32],
    ) {
        let block_count = components.len() / (vertex_count * width);
        for (at, masks) in masks.chunks_exact_mut(component_count).enumerate() {
            let (v, b) = (start + at / block_count, at % block_count);
            let rows = &components[(b * vertex_count + v) * width..][..width];
            let total = energies(simd, rows, masks) + component_count as f32 * floor;
            masks.iter_mut().for_each(|value| *value = (*value + floor) / total);
        }
    }
}

/// Writes `|C_k,v|^2` of one vertex and block into `energies`, answers their sum.
#[inline(always)]
pub(super) fn energies<S: Simd<G>, G: Group>(simd: S, rows: &[Features<G>], energies: &mut [f32]) -> f32 {
    let mut total = 0.0;
    for (row, energies) in rows.iter().zip(energies.chunks_mut(G::LEN)) {
        let mut squares = simd.splat(0.0);
        for x in row {
            let x = simd.load(x);
            squares = simd.mul_add(x, x, squares);
        }
        let squares = simd.store(squares);
        total += sum_lanes(squares);
        energies.copy_from_slice(&squares.as_ref()[..energies.len()]);
    }
    total
}

wide! {
    /// The chunk's share of the weighted `|e|^2` and, added to `projections[p][i]`, of `g_i . e`.
    fn measure_error<G>(
        simd,
        start: usize,
        error: &[Features<G>],
        vertex_weights: &[f32],
        modes: &[f32],
        mode_count: usize,
        group_count: usize,
        projections: &mut [G],
    ) -> f32 {
        let mut loss = simd.splat(0.0);
        for (i, error) in error.chunks_exact(group_count).enumerate() {
            let v = start + i;
            for (p, e) in error.iter().enumerate() {
                let mut squares = simd.splat(0.0);
                for c in 0..FEATURE_COUNT {
                    let e = simd.load(&e[c]);
                    squares = simd.mul_add(e, e, squares);
                    let mode = &modes[(v * FEATURE_COUNT + c) * mode_count..][..mode_count];
                    for (sum, &g) in projections[p * mode_count..(p + 1) * mode_count].iter_mut().zip(mode) {
                        *sum = simd.store(simd.mul_add(simd.splat(g), e, simd.load(sum)));
                    }
                }
                loss = simd.mul_add(simd.splat(vertex_weights[v]), squares, loss);
            }
        }
        sum_lanes(simd.store(loss))
    }
}
