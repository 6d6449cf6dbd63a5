//! One block's fields between the passes, and the passes strung together over chunks of vertices.

use rayon::prelude::*;
use sinew_formats::package::FEATURE_COUNT;

use super::lanes::tanh_bias;
use super::{
    CHUNK, ConvolutionSums, Features, LANE_COUNT, Lane, ResidualGradient, ZERO_FEATURES, ZERO_LANE, backward, forward,
};
use crate::network::loss::LossSettings;
use crate::network::ring::RingMean;
use crate::network::weights::BlockWeights;

/// Fields of one block: `[V][groups of eight shapes]` or `[V][groups of eight components]`.
#[derive(Default)]
pub(super) struct BlockState {
    /// x_b.
    pub(super) input: Vec<Features>,
    /// tanh behind the encoder; on the way back, what its neighbours' gradient is gathered from.
    hidden: Vec<Features>,
    /// y_b; on the way back, dL/dx_b.
    pub(super) output: Vec<Features>,
    /// C, lanes of k.
    components: Vec<Features>,
    /// The decoder's convolution of C; on the way back, its gradient.
    hat: Vec<Features>,
    /// dL/dC, lanes of k.
    component_gradient: Vec<Features>,
    /// Attention masks, lanes of k; empty on the last level.
    masks: Vec<Lane>,
    /// Z. Shape: `[groups of eight shapes][K]`.
    pub(super) latents: Vec<Lane>,
    /// dL/d(x_b - y_b) from the children; empty on the last level.
    pub(super) residual_gradient: Vec<Features>,
}

impl BlockState {
    /// Sets the input to what component `k` of the parent attends to.
    pub(super) fn attend_to(&mut self, parent: &Self, parent_count: usize, k: usize, group_count: usize) {
        let width = parent_count.div_ceil(LANE_COUNT);
        self.input.resize(parent.input.len(), ZERO_FEATURES);
        self.input
            .par_chunks_mut(CHUNK * group_count)
            .enumerate()
            .for_each(|(chunk, input)| {
                let start = chunk * CHUNK;
                forward::attend_residual(
                    start,
                    &parent.input,
                    &parent.output,
                    &parent.masks,
                    width,
                    k,
                    group_count,
                    input,
                );
            });
    }

    /// Everything from the input to latents, output and, where a floor is given, masks (equal ones where it is infinite);
    /// answers the weighted squared residual.
    pub(super) fn forward(
        &mut self,
        block: &BlockWeights,
        component_count: usize,
        group_count: usize,
        ring: &RingMean,
        vertex_weights: &[f32],
        mask_floor: Option<f32>,
    ) -> f64 {
        let vertex_count = ring.vertex_count();
        let width = component_count.div_ceil(LANE_COUNT);
        components_into_lanes(&block.components, vertex_count, component_count, &mut self.components);
        let (input, components) = (&self.input, &self.components);

        let rest = tanh_bias(&block.encoder.bias);
        self.hidden.resize(input.len(), ZERO_FEATURES);
        let parts: Vec<Vec<Lane>> = self
            .hidden
            .par_chunks_mut(CHUNK * group_count)
            .enumerate()
            .map(|(chunk, hidden)| {
                let mut latents = vec![ZERO_LANE; group_count * component_count];
                let start = chunk * CHUNK;
                forward::encode(
                    start,
                    input,
                    ring,
                    &block.encoder,
                    &rest,
                    components,
                    component_count,
                    group_count,
                    hidden,
                    &mut latents,
                );
                latents
            })
            .collect();
        self.latents = add_lanes(parts.iter().map(Vec::as_slice), group_count * component_count);

        self.hat.resize(components.len(), ZERO_FEATURES);
        self.hat
            .par_chunks_mut(CHUNK * width)
            .enumerate()
            .for_each(|(chunk, hat)| {
                forward::convolve_components(chunk * CHUNK, components, width, ring, &block.decoder, hat);
            });

        let rest = tanh_bias(&block.decoder.bias);
        let (hat, latents) = (&self.hat, &self.latents);
        self.output.resize(input.len(), ZERO_FEATURES);
        let losses: Vec<f32> = self
            .output
            .par_chunks_mut(CHUNK * group_count)
            .enumerate()
            .map(|(chunk, output)| {
                let (start, bias) = (chunk * CHUNK, &block.decoder.bias);
                forward::decode(
                    start,
                    input,
                    hat,
                    component_count,
                    latents,
                    bias,
                    &rest,
                    vertex_weights,
                    group_count,
                    output,
                )
            })
            .collect();

        if let Some(floor) = mask_floor {
            self.masks.resize(components.len(), ZERO_LANE);
            if floor.is_infinite() {
                self.masks.fill([1.0 / component_count as f32; LANE_COUNT]);
                return losses.iter().map(|&loss| f64::from(loss)).sum();
            }
            self.masks
                .par_chunks_mut(CHUNK * width)
                .enumerate()
                .for_each(|(chunk, masks)| {
                    forward::attend(chunk * CHUNK, components, component_count, floor, masks);
                });
        }
        losses.iter().map(|&loss| f64::from(loss)).sum()
    }

    /// Clears dL/dC. `row_count`: K times V.
    pub(super) fn prepare_gradient(&mut self, row_count: usize, component_count: usize) {
        let vertex_count = row_count / component_count;
        self.component_gradient.clear();
        self.component_gradient
            .resize(vertex_count * component_count.div_ceil(LANE_COUNT), ZERO_FEATURES);
        self.residual_gradient.clear();
    }

    /// Collects the children's gradients through the masks.
    pub(super) fn attend_back(&mut self, children: &[Self], component_count: usize, floor: f32, group_count: usize) {
        let width = component_count.div_ceil(LANE_COUNT);
        let children: Vec<&[Features]> = children.iter().map(|child| child.output.as_slice()).collect();
        let (input, output, masks, components) = (&self.input, &self.output, &self.masks, &self.components);
        self.residual_gradient.resize(input.len(), ZERO_FEATURES);
        self.residual_gradient
            .par_chunks_mut(CHUNK * group_count)
            .zip(self.component_gradient.par_chunks_mut(CHUNK * width))
            .enumerate()
            .for_each(|(chunk, (residual, component_gradient))| {
                backward::attend_back(
                    chunk * CHUNK,
                    input,
                    output,
                    masks,
                    components,
                    component_count,
                    floor,
                    &children,
                    group_count,
                    residual,
                    component_gradient,
                );
            });
    }

    /// Everything from dL/de back to the block's weights and, where it has a parent, its input; answers its range term.
    pub(super) fn backward(
        &mut self,
        block: &BlockWeights,
        component_count: usize,
        group_count: usize,
        ring: &RingMean,
        residual: ResidualGradient<'_>,
        has_parent: bool,
        settings: &LossSettings,
        gradient: &mut BlockWeights,
    ) -> f32 {
        let width = component_count.div_ceil(LANE_COUNT);
        let (input, components) = (&self.input, &self.components);

        let rest = tanh_bias(&block.decoder.bias);
        let transposed = transpose_latents(&self.latents, component_count, group_count);
        let output = &self.output;
        let parts: Vec<(Vec<Lane>, ConvolutionSums)> = self
            .hat
            .par_chunks_mut(CHUNK * width)
            .enumerate()
            .map(|(chunk, hat)| {
                let mut latent_gradient = vec![ZERO_LANE; group_count * component_count];
                let mut sums = ConvolutionSums::ZERO;
                backward::decode_back(
                    chunk * CHUNK,
                    input,
                    output,
                    residual,
                    component_count,
                    &transposed,
                    &rest,
                    group_count,
                    hat,
                    &mut latent_gradient,
                    &mut sums,
                );
                (latent_gradient, sums)
            })
            .collect();
        let bias = ConvolutionSums::total(parts.iter().map(|part| &part.1)).bias;
        let mut latent_gradient = add_lanes(
            parts.iter().map(|part| part.0.as_slice()),
            group_count * component_count,
        );
        let range = penalize_range(&self.latents, component_count, settings, &mut latent_gradient);

        let parts: Vec<ConvolutionSums> = self
            .hat
            .par_chunks_mut(CHUNK * width)
            .zip(self.component_gradient.par_chunks_mut(CHUNK * width))
            .enumerate()
            .map(|(chunk, (hat, component_gradient))| {
                let mut sums = ConvolutionSums::ZERO;
                let start = chunk * CHUNK;
                let decoder = &block.decoder;
                backward::convolve_components_back(
                    start,
                    components,
                    width,
                    ring,
                    decoder,
                    hat,
                    component_gradient,
                    &mut sums,
                );
                sums
            })
            .collect();
        gradient.decoder = ConvolutionSums::total(parts.iter());
        gradient.decoder.bias = bias;
        spread(&self.hat, width, ring, &mut self.component_gradient);

        let rest = tanh_bias(&block.encoder.bias);
        let transposed = transpose_latents(&latent_gradient, component_count, group_count);
        let parts: Vec<ConvolutionSums> = self
            .hidden
            .par_chunks_mut(CHUNK * group_count)
            .zip(self.output.par_chunks_mut(CHUNK * group_count))
            .zip(self.component_gradient.par_chunks_mut(CHUNK * width))
            .enumerate()
            .map(|(chunk, ((hidden, output), component_gradient))| {
                let mut sums = ConvolutionSums::ZERO;
                backward::encode_back(
                    chunk * CHUNK,
                    input,
                    ring,
                    &block.encoder,
                    &rest,
                    components,
                    component_count,
                    &latent_gradient,
                    &transposed,
                    residual,
                    group_count,
                    has_parent,
                    hidden,
                    output,
                    component_gradient,
                    &mut sums,
                );
                sums
            })
            .collect();
        gradient.encoder = ConvolutionSums::total(parts.iter());
        if has_parent {
            spread(&self.hidden, group_count, ring, &mut self.output);
        }
        components_from_lanes(&self.component_gradient, component_count, &mut gradient.components);
        range
    }
}

/// The neighbours' part of a convolution's gradient, added to `sum`.
fn spread(values: &[Features], width: usize, ring: &RingMean, sum: &mut [Features]) {
    sum.par_chunks_mut(CHUNK * width).enumerate().for_each(|(chunk, sum)| {
        backward::gather(chunk * CHUNK, values, width, ring, sum);
    });
}

/// `V(Z) = (1/K) Σ_k max(max_m |Z_mk| - θ, 0)`; adds its gradient.
fn penalize_range(latents: &[Lane], component_count: usize, settings: &LossSettings, gradient: &mut [Lane]) -> f32 {
    let factor = settings.range_weight / component_count as f32;
    let mut total = 0.0;
    for k in 0..component_count {
        let mut widest = (0, 0, 0.0_f32);
        for (p, lanes) in latents.chunks_exact(component_count).enumerate() {
            for (n, z) in lanes[k].iter().enumerate() {
                if z.abs() > widest.2.abs() {
                    widest = (p, n, *z);
                }
            }
        }
        let (p, n, z) = widest;
        if z.abs() > settings.range_threshold {
            total += factor * (z.abs() - settings.range_threshold);
            gradient[p * component_count + k][n] += factor * z.signum();
        }
    }
    total
}

/// Adds up chunks in order, in double precision.
pub(super) fn add_lanes<'a>(chunks: impl Iterator<Item = &'a [Lane]>, len: usize) -> Vec<Lane> {
    let mut sums = vec![[0.0_f64; LANE_COUNT]; len];
    for chunk in chunks {
        for (sum, value) in sums.as_flattened_mut().iter_mut().zip(chunk.as_flattened()) {
            *sum += f64::from(*value);
        }
    }
    sums.into_iter().map(|lane| lane.map(|value| value as f32)).collect()
}

/// `[groups of eight shapes][K]` to `[shape][groups of eight components]`.
pub(super) fn transpose_latents(latents: &[Lane], component_count: usize, group_count: usize) -> Vec<Lane> {
    let width = component_count.div_ceil(LANE_COUNT);
    let mut transposed = vec![ZERO_LANE; group_count * LANE_COUNT * width];
    for (at, lane) in latents.iter().enumerate() {
        let (p, k) = (at / component_count, at % component_count);
        for (n, &value) in lane.iter().enumerate() {
            transposed[(p * LANE_COUNT + n) * width + k / LANE_COUNT][k % LANE_COUNT] = value;
        }
    }
    transposed
}

/// `[N][V][9]` to `[V][groups]`; lanes without a shape are zero, and stay without effect since zero maps to zero.
pub(super) fn shapes_into_lanes(shapes: &[f32], vertex_count: usize, group_count: usize, lanes: &mut Vec<Features>) {
    lanes.clear();
    lanes.resize(vertex_count * group_count, ZERO_FEATURES);
    lanes
        .par_chunks_mut(CHUNK * group_count)
        .enumerate()
        .for_each(|(chunk, rows)| {
            for (i, row) in rows.iter_mut().enumerate() {
                let (v, p) = (chunk * CHUNK + i / group_count, i % group_count);
                for (n, shape) in shapes
                    .chunks_exact(vertex_count * FEATURE_COUNT)
                    .skip(p * LANE_COUNT)
                    .take(LANE_COUNT)
                    .enumerate()
                {
                    for (c, value) in shape[v * FEATURE_COUNT..(v + 1) * FEATURE_COUNT].iter().enumerate() {
                        row[c][n] = *value;
                    }
                }
            }
        });
}

/// The inverse of [`shapes_into_lanes`].
pub(super) fn shapes_from_lanes(lanes: &[Features], shape_count: usize, vertex_count: usize) -> Vec<f32> {
    let group_count = lanes.len() / vertex_count;
    let mut shapes = vec![0.0; shape_count * vertex_count * FEATURE_COUNT];
    shapes
        .par_chunks_mut(vertex_count * FEATURE_COUNT)
        .enumerate()
        .for_each(|(m, shape)| {
            for (at, value) in shape.iter_mut().enumerate() {
                let row = &lanes[at / FEATURE_COUNT * group_count + m / LANE_COUNT];
                *value = row[at % FEATURE_COUNT][m % LANE_COUNT];
            }
        });
    shapes
}

/// `[K][V][9]` to `[V][groups of eight components]`.
fn components_into_lanes(components: &[f32], vertex_count: usize, component_count: usize, lanes: &mut Vec<Features>) {
    shapes_into_lanes(components, vertex_count, component_count.div_ceil(LANE_COUNT), lanes);
}

/// The inverse of [`components_into_lanes`].
fn components_from_lanes(lanes: &[Features], component_count: usize, components: &mut Vec<f32>) {
    let vertex_count = components.len() / (component_count * FEATURE_COUNT);
    *components = shapes_from_lanes(lanes, component_count, vertex_count);
}
