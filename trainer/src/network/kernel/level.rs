//! What all shapes share at one level of the stack: components in lanes, and the sums of their gradients.

use rayon::prelude::*;
use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::lanes::{Features, LANE_COUNT, Narrow};
use super::layout::{chunks_of_blocks, components_from_lanes, components_into_lanes};
use super::{CHUNK, backward, forward};
use crate::network::ring::RingMean;
use crate::network::weights::{
    BlockWeights, CONVOLUTION_LEN, LevelWeights, convolution_from_flat, flatten_convolution,
};

/// One level's fields over components, `[blocks][V][width]` with width the groups of eight components.
#[derive(Default)]
pub(super) struct Level {
    block_count: usize,
    component_count: usize,
    /// C, lanes of k.
    pub(super) components: Vec<Features<Narrow>>,
    /// The decoder's convolution of C.
    pub(super) hat: Vec<Features<Narrow>>,
    /// dL/dhat.
    pub(super) hat_gradient: Vec<Features<Narrow>>,
    /// dL/dC.
    pub(super) component_gradient: Vec<Features<Narrow>>,
    /// Each component's share of its block's residual, empty on the last level. Shape: `[V][blocks][K]`.
    pub(super) masks: Vec<f32>,
    /// dL/dmask.
    pub(super) mask_gradient: Vec<f32>,
    pub(super) encoders: ConvolutionTotals,
    pub(super) decoders: ConvolutionTotals,
}

impl Level {
    /// Groups of eight components of a block.
    pub(super) fn width(&self) -> usize {
        self.component_count.div_ceil(LANE_COUNT)
    }

    /// Takes over the weights; where a floor is given, finds masks (equal ones where it is infinite).
    pub(super) fn forward(&mut self, level: &LevelWeights, order: &[u32], ring: &RingMean, mask_floor: Option<f32>) {
        let vertex_count = ring.vertex_count();
        (self.block_count, self.component_count) = (level.blocks.len(), level.component_count);
        components_into_lanes(&level.blocks, order, self.component_count, &mut self.components);
        let (width, k_count, components) = (self.width(), self.component_count, &self.components);
        self.hat.resize(components.len(), [[0.0; LANE_COUNT]; FEATURE_COUNT]);
        chunks_of_blocks(&mut self.hat, self.block_count, CHUNK * width)
            .into_par_iter()
            .enumerate()
            .for_each(|(chunk, mut hat)| {
                forward::convolve_components(chunk * CHUNK, components, width, ring, &level.blocks, &mut hat);
            });
        let mask_row_len = if mask_floor.is_some() {
            self.block_count * k_count
        } else {
            0
        };
        self.masks.resize(vertex_count * mask_row_len, 0.0);
        match mask_floor {
            None => {}
            Some(floor) if floor.is_infinite() => self.masks.fill(1.0 / k_count as f32),
            Some(floor) => self
                .masks
                .par_chunks_mut(CHUNK * mask_row_len)
                .enumerate()
                .for_each(|(chunk, masks)| {
                    forward::attend(chunk * CHUNK, components, vertex_count, width, k_count, floor, masks);
                }),
        }
    }

    /// Clears all sums of gradients but dL/dhat and dL/dC, which their first pass overwrites.
    pub(super) fn clear_gradient(&mut self) {
        for sums in [&mut self.hat_gradient, &mut self.component_gradient] {
            sums.resize(self.components.len(), [[0.0; LANE_COUNT]; FEATURE_COUNT]);
        }
        self.mask_gradient.clear();
        self.mask_gradient.resize(self.masks.len(), 0.0);
        self.encoders.clear(self.block_count);
        self.decoders.clear(self.block_count);
    }

    /// From dL/dhat and dL/dmask, once they are complete, to the decoders and, the first to write it, to dL/dC.
    pub(super) fn backward(&mut self, level: &LevelWeights, ring: &RingMean, floor: f32) {
        let (width, k_count, vertex_count) = (self.width(), self.component_count, ring.vertex_count());
        let (components, hat_gradient) = (&self.components, &self.hat_gradient);
        let parts: Vec<Vec<GraphConvRecord>> =
            chunks_of_blocks(&mut self.component_gradient, self.block_count, CHUNK * width)
                .into_par_iter()
                .enumerate()
                .map(|(chunk, mut sums)| {
                    let (start, blocks) = (chunk * CHUNK, &level.blocks);
                    backward::convolve_components_back(start, components, width, ring, blocks, hat_gradient, &mut sums)
                })
                .collect();
        self.decoders.add(&parts);
        if self.masks.is_empty() {
            return;
        }
        let mask_row_len = self.block_count * k_count;
        chunks_of_blocks(&mut self.component_gradient, self.block_count, CHUNK * width)
            .into_par_iter()
            .zip(self.masks.par_chunks(CHUNK * mask_row_len))
            .zip(self.mask_gradient.par_chunks(CHUNK * mask_row_len))
            .enumerate()
            .for_each(|(chunk, ((mut sums, masks), gradient))| {
                let start = chunk * CHUNK;
                backward::attend_back(
                    start,
                    components,
                    vertex_count,
                    width,
                    k_count,
                    floor,
                    masks,
                    gradient,
                    &mut sums,
                );
            });
    }

    /// Writes the complete gradient in the order of weights.
    pub(super) fn write_gradient(&self, order: &[u32], blocks: &mut [BlockWeights]) {
        components_from_lanes(&self.component_gradient, order, blocks);
        for (b, block) in blocks.iter_mut().enumerate() {
            block.encoder = self.encoders.convolution(b);
            block.decoder = self.decoders.convolution(b);
        }
    }
}

/// Gradients of each block's convolution, summed over chunks in their order.
#[derive(Default)]
pub(super) struct ConvolutionTotals(Vec<[f64; CONVOLUTION_LEN]>);

impl ConvolutionTotals {
    fn clear(&mut self, block_count: usize) {
        self.0.clear();
        self.0.resize(block_count, [0.0; CONVOLUTION_LEN]);
    }

    /// Shape of `parts`: `[chunks][blocks]`.
    pub(super) fn add(&mut self, parts: &[Vec<GraphConvRecord>]) {
        for part in parts {
            for (total, convolution) in self.0.iter_mut().zip(part) {
                let numbers = flatten_convolution(convolution);
                total
                    .iter_mut()
                    .zip(numbers)
                    .for_each(|(sum, value)| *sum += f64::from(value));
            }
        }
    }

    /// Shape of `parts`: `[chunks][blocks]`.
    pub(super) fn add_biases(&mut self, parts: &[Vec<[f32; FEATURE_COUNT]>]) {
        for part in parts {
            for (total, bias) in self.0.iter_mut().zip(part) {
                let sums = &mut total[CONVOLUTION_LEN - FEATURE_COUNT..];
                sums.iter_mut()
                    .zip(bias)
                    .for_each(|(sum, value)| *sum += f64::from(*value));
            }
        }
    }

    fn convolution(&self, b: usize) -> GraphConvRecord {
        convolution_from_flat(&self.0[b].map(|value| value as f32))
    }
}
