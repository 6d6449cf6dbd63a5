//! Loss and gradients of the whole stack on the CPU, by hand: an order of magnitude faster than the differentiable model
//! in `stack`, which is its reference in tests.
//!
//! Why so fast: shapes lie eight to a wide register; the decoder's convolution is applied to C instead of to shapes; every
//! pass reads its fields once; work is split into chunks of vertices of fixed size, and sums over chunks are taken in
//! order, so the bits do not depend on the number of threads.

mod backward;
mod forward;
mod lanes;
mod state;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use sinew_formats::package::FEATURE_COUNT;

use self::backward::{ConvolutionSums, ResidualGradient};
use self::lanes::{Features, LANE_COUNT, Lane, ZERO_FEATURES, ZERO_LANE};
use self::state::{BlockState, shapes_from_lanes, shapes_into_lanes};
use super::attention::Attention;
use super::loss::{LossSettings, LossTerms, sparsity};
use super::ring::RingMean;
use super::weights::StackWeights;

/// Vertices of one piece of work; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 128;

/// Guards the masks' division where no component of a block is present; over V (method section 2).
pub const MASK_FLOOR: f32 = 1e-6;

/// The network bound to a mesh, with its buffers. V vertices.
pub struct Kernel {
    ring: RingMean,
    vertex_weights: Vec<f32>,
    attention: Attention,
    /// Modes transposed. Shape: `[V][9][I]`.
    modes: Vec<f32>,
    mode_count: usize,
    levels: Vec<Vec<BlockState>>,
    error: Vec<Features>,
}

/// What the stack makes of some shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct StackOutput {
    /// Z. Shape: `[level][block][N][K]`, the last two flat.
    pub latents: Vec<Vec<Vec<f32>>>,
    /// Sum of all blocks' answers. Shape: `[N][V][9]`.
    pub shapes: Vec<f32>,
}

impl Kernel {
    /// `vertex_weights`: shape `[V]`, areas with mean one. `modes`: the g_i of the position term, shape `[I][V][9]`, or
    /// empty. Both must fit the ring's V.
    pub fn new(ring: RingMean, vertex_weights: &[f32], modes: &[f32], attention: Attention) -> Self {
        let len = ring.vertex_count() * FEATURE_COUNT;
        let mode_count = modes.len() / len;
        let mut transposed = vec![0.0; mode_count * len];
        for (i, mode) in modes.chunks_exact(len).enumerate() {
            mode.iter()
                .enumerate()
                .for_each(|(at, &value)| transposed[at * mode_count + i] = value);
        }
        Self {
            ring,
            vertex_weights: vertex_weights.to_vec(),
            attention,
            modes: transposed,
            mode_count,
            levels: Vec::new(),
            error: Vec::new(),
        }
    }

    /// Latents and reconstruction of shapes `[N][V][9]`.
    pub fn reconstruct(&mut self, weights: &StackWeights, shapes: &[f32]) -> StackOutput {
        let shape_len = weights.vertex_count * FEATURE_COUNT;
        let shape_count = shapes.len() / shape_len;
        self.forward(weights, shapes);
        let mut output = shapes.to_vec();
        let error = shapes_from_lanes(&self.error, shape_count, weights.vertex_count);
        output.iter_mut().zip(error).for_each(|(value, error)| *value -= error);
        let latents = weights.levels.iter().zip(&self.levels).map(|(level, states)| {
            let of_block = |state: &BlockState| {
                let k_count = level.component_count;
                let at = |m: usize, k: usize| state.latents[m / LANE_COUNT * k_count + k][m % LANE_COUNT];
                (0..shape_count)
                    .flat_map(|m| (0..k_count).map(move |k| (m, k)))
                    .map(|(m, k)| at(m, k))
                    .collect()
            };
            states.iter().map(of_block).collect()
        });
        StackOutput {
            latents: latents.collect(),
            shapes: output,
        }
    }

    /// Loss on shapes `[N][V][9]` and its gradient; `outside` is Λ as from [`super::loss::SparsityRegions`].
    pub fn differentiate(
        &mut self,
        weights: &StackWeights,
        shapes: &[f32],
        outside: &[Vec<bool>],
        settings: &LossSettings,
    ) -> (LossTerms, StackWeights) {
        let shape_count = shapes.len() / (weights.vertex_count * FEATURE_COUNT);
        let per_shape = settings.reconstruction_weight / shape_count as f32;
        let block_error = self.forward(weights, shapes);
        let (total, position) = self.measure_error(
            2.0 * per_shape * settings.total_weight,
            2.0 * per_shape * settings.position_weight,
            self.error.len() / weights.vertex_count,
        );
        let mut gradient = StackWeights::zeros(weights.vertex_count, &weights.component_counts());
        let range = self.backward(
            weights,
            settings,
            2.0 * per_shape * settings.block_weight,
            &mut gradient,
        );
        let terms = LossTerms {
            block: per_shape * settings.block_weight * block_error as f32,
            total: per_shape * settings.total_weight * total as f32,
            position: per_shape * settings.position_weight * position as f32,
            sparsity: sparsity(weights, outside, settings, &mut gradient),
            range,
        };
        (terms, gradient)
    }

    /// Fills every block's state and the total error; answers the sum over blocks of the weighted squared residuals.
    fn forward(&mut self, weights: &StackWeights, shapes: &[f32]) -> f64 {
        let vertex_count = weights.vertex_count;
        let group_count = (shapes.len() / (vertex_count * FEATURE_COUNT)).div_ceil(LANE_COUNT);
        self.levels.resize_with(weights.levels.len(), Vec::new);
        shapes_into_lanes(shapes, vertex_count, group_count, &mut self.error);
        let floor = self.attention.floor(vertex_count);
        let last = weights.levels.len() - 1;
        let mut loss = 0.0;
        for (l, level) in weights.levels.iter().enumerate() {
            let (done, rest) = self.levels.split_at_mut(l);
            let states = &mut rest[0];
            states.resize_with(level.blocks.len(), BlockState::default);
            let (ring, vertex_weights, root_input) = (&self.ring, &self.vertex_weights, &self.error);
            let errors: Vec<f64> = states
                .par_iter_mut()
                .zip(&level.blocks)
                .enumerate()
                .map(|(b, (state, block))| {
                    match l.checked_sub(1) {
                        None => state.input.clone_from(root_input),
                        Some(above) => {
                            let parent_count = weights.levels[above].component_count;
                            let parent = &done[above][b / parent_count];
                            state.attend_to(parent, parent_count, b % parent_count, group_count);
                        }
                    }
                    state.forward(
                        block,
                        level.component_count,
                        group_count,
                        ring,
                        vertex_weights,
                        (l < last).then_some(floor),
                    )
                })
                .collect();
            loss += errors.iter().sum::<f64>();
        }
        let levels = &self.levels;
        self.error
            .par_chunks_mut(CHUNK * group_count)
            .enumerate()
            .for_each(|(chunk, error)| {
                for state in levels.iter().flatten() {
                    forward::subtract(chunk * CHUNK, &state.output, group_count, error);
                }
            });
        loss
    }

    /// Weighted |e|² and Σ(g·e)²; then the error becomes dL/de for terms with these factors (twice the terms' own).
    fn measure_error(&mut self, total_factor: f32, position_factor: f32, group_count: usize) -> (f64, f64) {
        let (modes, mode_count, vertex_weights) = (&self.modes, self.mode_count, &self.vertex_weights);
        let parts: Vec<(f32, Vec<Lane>)> = self
            .error
            .par_chunks(CHUNK * group_count)
            .enumerate()
            .map(|(chunk, error)| {
                let mut projections = vec![ZERO_LANE; group_count * mode_count];
                let start = chunk * CHUNK;
                let loss = forward::measure_error(
                    start,
                    error,
                    vertex_weights,
                    modes,
                    mode_count,
                    group_count,
                    &mut projections,
                );
                (loss, projections)
            })
            .collect();
        let total = parts.iter().map(|part| f64::from(part.0)).sum();
        let mut projections = state::add_lanes(parts.iter().map(|part| part.1.as_slice()), group_count * mode_count);
        let position = projections
            .as_flattened()
            .iter()
            .map(|&g| f64::from(g) * f64::from(g))
            .sum();
        projections
            .as_flattened_mut()
            .iter_mut()
            .for_each(|value| *value *= position_factor);
        self.error
            .par_chunks_mut(CHUNK * group_count)
            .enumerate()
            .for_each(|(chunk, error)| {
                let start = chunk * CHUNK;
                backward::differentiate_error(
                    start,
                    total_factor,
                    vertex_weights,
                    modes,
                    mode_count,
                    &projections,
                    group_count,
                    error,
                );
            });
        (total, position)
    }

    /// From dL/de back through all blocks, deepest level first; answers the range term.
    fn backward(
        &mut self,
        weights: &StackWeights,
        settings: &LossSettings,
        block_factor: f32,
        gradient: &mut StackWeights,
    ) -> f32 {
        let group_count = self.error.len() / weights.vertex_count;
        let floor = self.attention.floor(weights.vertex_count);
        let mut range = 0.0;
        for l in (0..weights.levels.len()).rev() {
            let level = &weights.levels[l];
            let k_count = level.component_count;
            let (rest, below) = self.levels.split_at_mut(l + 1);
            let below = below.first();
            let (ring, vertex_weights, error) = (&self.ring, &self.vertex_weights, &self.error);
            let ranges: Vec<f32> = rest[l]
                .par_iter_mut()
                .zip(&level.blocks)
                .zip(&mut gradient.levels[l].blocks)
                .enumerate()
                .map(|(b, ((state, block), gradient))| {
                    state.prepare_gradient(block.components.len() / FEATURE_COUNT, k_count);
                    if let Some(below) = below {
                        state.attend_back(&below[b * k_count..(b + 1) * k_count], k_count, floor, group_count);
                    }
                    let children = core::mem::take(&mut state.residual_gradient);
                    let residual = ResidualGradient {
                        error,
                        children: &children,
                        block_factor,
                        vertex_weights,
                    };
                    let cost = state.backward(block, k_count, group_count, ring, residual, l > 0, settings, gradient);
                    state.residual_gradient = children;
                    cost
                })
                .collect();
            range += ranges.iter().sum::<f32>();
        }
        range
    }
}
