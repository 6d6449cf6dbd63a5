//! Loss and gradients of the whole stack on the CPU, by hand: an order of magnitude faster than the differentiable model
//! in `stack`, which is its reference in tests.
//!
//! Why so fast: shapes lie eight or sixteen to a wide register; the decoder's convolution is applied to C instead of to
//! shapes; what a block sees is the residual above times a mask and never stored; every pass goes through all blocks of a
//! level while a chunk of vertices is in the cache. Chunks have a fixed size and sums over chunks are taken in order, so
//! the bits do not depend on the number of threads.

mod backward;
mod band;
mod forward;
mod lanes;
mod layout;
mod level;
mod simd;
mod sums;
#[cfg(test)]
mod tests;

use sinew_formats::package::FEATURE_COUNT;

use self::band::{Band, LevelView};
use self::lanes::{Narrow, WIDE_LANE_COUNT, Wide, has_wide_lanes};
use self::layout::shapes_from_lanes;
use self::level::Level;
use super::activation::Activation;
use super::attention::Attention;
use super::loss::{LossSettings, LossTerms, sparsity};
use super::ring::RingMean;
use super::weights::StackWeights;

/// Vertices of one piece of work; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 128;

/// Guards the masks' division where no component of a block is present; over V (method section 2).
pub const MASK_FLOOR: f32 = 1e-6;

/// The g_i of the position term, transposed.
struct Modes {
    count: usize,
    /// In the order of rows. Shape: `[V][9][count]`.
    values: Vec<f32>,
}

/// The network bound to a mesh, with its buffers. V vertices.
pub struct Kernel {
    /// The mesh's vertex at each row of the fields here, neighbours close together.
    order: Vec<u32>,
    /// In the order of rows.
    ring: RingMean,
    /// In the order of rows. Shape: `[V]`.
    vertex_weights: Vec<f32>,
    attention: Attention,
    activation: Activation,
    modes: Modes,
    /// The root's masks: it sees all. Shape: `[V]`.
    ones: Vec<f32>,
    levels: Vec<Level>,
    /// As many shapes as fill wide groups, where the machine has them; the first ones.
    wide: Band<Wide>,
    /// All others.
    narrow: Band<Narrow>,
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
    pub fn new(
        ring: RingMean,
        vertex_weights: &[f32],
        modes: &[f32],
        attention: Attention,
        activation: Activation,
    ) -> Self {
        let order = ring.breadth_first_order();
        let len = ring.vertex_count() * FEATURE_COUNT;
        let mode_count = modes.len() / len;
        let mut transposed = Vec::with_capacity(modes.len());
        for &v in &order {
            for at in v as usize * FEATURE_COUNT..(v as usize + 1) * FEATURE_COUNT {
                transposed.extend(modes.chunks_exact(len).map(|mode| mode[at]));
            }
        }
        Self {
            ring: ring.reordered(&order),
            vertex_weights: order.iter().map(|&v| vertex_weights[v as usize]).collect(),
            attention,
            activation,
            modes: Modes {
                count: mode_count,
                values: transposed,
            },
            ones: vec![1.0; vertex_weights.len()],
            levels: Vec::new(),
            wide: Band::default(),
            narrow: Band::default(),
            order,
        }
    }

    /// Latents and reconstruction of shapes `[N][V][9]`.
    pub fn reconstruct(&mut self, weights: &StackWeights, shapes: &[f32]) -> StackOutput {
        self.forward(weights, shapes);
        let mut errors = vec![0.0; shapes.len()];
        let wide_len = self.wide.shape_count * weights.vertex_count * FEATURE_COUNT;
        shapes_from_lanes(&self.wide.error, &self.order, &mut errors[..wide_len]);
        shapes_from_lanes(&self.narrow.error, &self.order, &mut errors[wide_len..]);
        let shape_count = self.wide.shape_count + self.narrow.shape_count;
        let latents = weights.levels.iter().enumerate().map(|(l, level)| {
            let k_count = level.component_count;
            let of_block = |b: usize| {
                let all = (0..shape_count).flat_map(|m| (0..k_count).map(move |k| (m, k)));
                all.map(|(m, k)| self.latent(l, k_count, b, m, k)).collect()
            };
            (0..level.blocks.len()).map(of_block).collect()
        });
        StackOutput {
            latents: latents.collect(),
            shapes: shapes.iter().zip(errors).map(|(shape, error)| shape - error).collect(),
        }
    }

    fn latent(&self, l: usize, component_count: usize, b: usize, m: usize, k: usize) -> f32 {
        match m.checked_sub(self.wide.shape_count) {
            None => self.wide.latent(l, component_count, b, m, k),
            Some(m) => self.narrow.latent(l, component_count, b, m, k),
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
        let mut gradient = StackWeights::zeros(weights.vertex_count, &weights.component_counts());
        let terms = self.differentiate_into(weights, shapes, outside, settings, &mut gradient);
        (terms, gradient)
    }

    /// The same, into a gradient that may be used again and again; its numbers do not matter, its shape must be that of
    /// the weights.
    pub fn differentiate_into(
        &mut self,
        weights: &StackWeights,
        shapes: &[f32],
        outside: &[Vec<bool>],
        settings: &LossSettings,
        gradient: &mut StackWeights,
    ) -> LossTerms {
        let shape_count = shapes.len() / (weights.vertex_count * FEATURE_COUNT);
        let per_shape = settings.reconstruction_weight / shape_count as f32;
        let block_error = self.forward(weights, shapes);
        let total_factor = 2.0 * per_shape * settings.total_weight;
        let position_factor = 2.0 * per_shape * settings.position_weight;
        let (vertex_weights, modes) = (&self.vertex_weights, &self.modes);
        let wide = self
            .wide
            .measure_error(vertex_weights, modes, total_factor, position_factor);
        let narrow = self
            .narrow
            .measure_error(vertex_weights, modes, total_factor, position_factor);
        let (total, position) = (wide.0 + narrow.0, wide.1 + narrow.1);
        let block_factor = 2.0 * per_shape * settings.block_weight;
        let range = self.backward(weights, settings, block_factor, gradient);
        LossTerms {
            block: per_shape * settings.block_weight * block_error as f32,
            total: per_shape * settings.total_weight * total as f32,
            position: per_shape * settings.position_weight * position as f32,
            sparsity: sparsity(weights, outside, settings, gradient),
            range,
        }
    }

    /// Fills every level and the total error; answers the sum over blocks of the weighted squared residuals.
    fn forward(&mut self, weights: &StackWeights, shapes: &[f32]) -> f64 {
        let (vertex_count, level_count) = (weights.vertex_count, weights.levels.len());
        let shape_len = vertex_count * FEATURE_COUNT;
        let group_count = if has_wide_lanes() {
            shapes.len() / shape_len / WIDE_LANE_COUNT
        } else {
            0
        };
        let (wide, narrow) = shapes.split_at(group_count * WIDE_LANE_COUNT * shape_len);
        self.wide.take(wide, &self.order, level_count);
        self.narrow.take(narrow, &self.order, level_count);
        self.levels.resize_with(level_count, Level::default);
        let floor = self.attention.floor(vertex_count);
        let mut loss = 0.0;
        for (l, level) in weights.levels.iter().enumerate() {
            let (above, rest) = self.levels.split_at_mut(l);
            rest[0].forward(level, &self.order, &self.ring, (l + 1 < level_count).then_some(floor));
            let view = LevelView {
                weights: level,
                ring: &self.ring,
                vertex_weights: &self.vertex_weights,
                masks: above.last().map_or(&self.ones, |above| &above.masks),
                child_count: child_count(weights, l),
                rest_share: self.activation.rest_share(),
            };
            loss += self.wide.forward(l, view, &rest[0]);
            loss += self.narrow.forward(l, view, &rest[0]);
        }
        loss
    }

    /// From dL/de back through all blocks, deepest level first; answers the range term.
    fn backward(
        &mut self,
        weights: &StackWeights,
        settings: &LossSettings,
        block_factor: f32,
        gradient: &mut StackWeights,
    ) -> f32 {
        let floor = self.attention.floor(weights.vertex_count);
        self.levels.iter_mut().for_each(Level::clear_gradient);
        let mut range = 0.0;
        for (l, level) in weights.levels.iter().enumerate().rev() {
            let (above, rest) = self.levels.split_at_mut(l);
            let own = &mut rest[0];
            let (masks, mask_gradient) = match above.last_mut() {
                None => (self.ones.as_slice(), &mut [][..]),
                Some(above) => (above.masks.as_slice(), above.mask_gradient.as_mut_slice()),
            };
            let view = LevelView {
                weights: level,
                ring: &self.ring,
                vertex_weights: &self.vertex_weights,
                masks,
                child_count: child_count(weights, l),
                rest_share: self.activation.rest_share(),
            };
            let is_first = self.wide.shape_count == 0;
            self.wide.decode_back(l, view, own, mask_gradient, block_factor, true);
            self.narrow
                .decode_back(l, view, own, mask_gradient, block_factor, is_first);
            own.backward(level, &self.ring, floor);
            for b in 0..level.blocks.len() {
                range += penalize_range(&mut self.wide, &mut self.narrow, l, level.component_count, b, settings);
            }
            self.wide.encode_back(l, view, own, mask_gradient);
            self.narrow.encode_back(l, view, own, mask_gradient);
            own.write_gradient(&self.order, &mut gradient.levels[l].blocks);
        }
        range
    }
}

/// Blocks of level `l` under each block above.
fn child_count(weights: &StackWeights, l: usize) -> usize {
    l.checked_sub(1)
        .map_or(1, |above| weights.levels[above].component_count)
}

/// `V(Z) = (1/K) Σ_k max(max_m |Z_mk| - θ, 0)` of one block; adds its gradient.
fn penalize_range(
    wide: &mut Band<Wide>,
    narrow: &mut Band<Narrow>,
    l: usize,
    component_count: usize,
    b: usize,
    settings: &LossSettings,
) -> f32 {
    let factor = settings.range_weight / component_count as f32;
    let mut total = 0.0;
    for k in 0..component_count {
        let (m, z) = wide.widest_latent(l, component_count, b, k);
        let (other_m, other_z) = narrow.widest_latent(l, component_count, b, k);
        let excess = z.abs().max(other_z.abs()) - settings.range_threshold;
        if excess > 0.0 {
            total += factor * excess;
            if other_z.abs() > z.abs() {
                *narrow.latent_gradient(l, component_count, b, other_m, k) += factor * other_z.signum();
            } else {
                *wide.latent_gradient(l, component_count, b, m, k) += factor * z.signum();
            }
        }
    }
    total
}
