//! Shapes in groups of L lanes, and their way through the levels: the passes strung together over chunks of vertices.

use rayon::prelude::*;
use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::backward::{self, SourceGradient};
use super::forward::{self, Source};
use super::lanes::{Features, LANE_COUNT};
use super::layout::{add_lanes, chunks_of_blocks, shapes_into_lanes, transpose_latents};
use super::level::Level;
use super::simd::Group;
use super::{CHUNK, Modes};
use crate::network::ring::RingMean;
use crate::network::weights::LevelWeights;

/// Fields over shapes: `[V][groups]`, or `[blocks][V][groups]` at a level.
pub(super) struct Band<G> {
    pub(super) shape_count: usize,
    group_count: usize,
    shapes: Vec<Features<G>>,
    /// Shapes less what all blocks answer; on the way back, dL/de.
    pub(super) error: Vec<Features<G>>,
    pub(super) levels: Vec<BandLevel<G>>,
}

/// A band's fields at one level.
pub(super) struct BandLevel<G> {
    /// tanh behind the encoder; on the way back, the gradient in front of that tanh.
    hidden: Vec<Features<G>>,
    /// x - y.
    residual: Vec<Features<G>>,
    /// dL/d(x - y) from the level below; empty on the last level.
    residual_gradient: Vec<Features<G>>,
    /// Z. Shape: `[blocks][groups][K]`.
    pub(super) latents: Vec<G>,
    /// dL/dZ.
    pub(super) latent_gradient: Vec<G>,
}

impl<G> Default for Band<G> {
    fn default() -> Self {
        Self {
            shape_count: 0,
            group_count: 0,
            shapes: Vec::new(),
            error: Vec::new(),
            levels: Vec::new(),
        }
    }
}

impl<G> Default for BandLevel<G> {
    fn default() -> Self {
        Self {
            hidden: Vec::new(),
            residual: Vec::new(),
            residual_gradient: Vec::new(),
            latents: Vec::new(),
            latent_gradient: Vec::new(),
        }
    }
}

/// One level's weights, what was made of them, and how the residual above is shared out.
#[derive(Clone, Copy)]
pub(super) struct LevelView<'a> {
    pub(super) weights: &'a LevelWeights,
    pub(super) ring: &'a RingMean,
    /// Shape: `[V]`.
    pub(super) vertex_weights: &'a [f32],
    /// Shape: `[V][blocks]`.
    pub(super) masks: &'a [f32],
    /// Blocks under each block above.
    pub(super) child_count: usize,
    /// Of the activation: how much of what a bias alone gives is subtracted.
    pub(super) rest_share: f32,
}

impl<G: Group> Band<G> {
    /// Takes shapes `[N][V][9]`.
    pub(super) fn take(&mut self, shapes: &[f32], order: &[u32], level_count: usize) {
        self.shape_count = shapes.len() / (order.len() * FEATURE_COUNT);
        self.group_count = self.shape_count.div_ceil(G::LEN);
        shapes_into_lanes(shapes, order, &mut self.shapes);
        self.error.clone_from(&self.shapes);
        self.levels.resize_with(level_count, BandLevel::default);
        if let Some(last) = self.levels.last_mut() {
            // A deeper stack may have been here before.
            last.residual_gradient.clear();
        }
    }

    /// The z of shape `m`, component `k` of block `b`.
    pub(super) fn latent(&self, l: usize, component_count: usize, b: usize, m: usize, k: usize) -> f32 {
        self.levels[l].latents[(b * self.group_count + m / G::LEN) * component_count + k].as_ref()[m % G::LEN]
    }

    /// dL/dz, to be changed.
    pub(super) fn latent_gradient(
        &mut self,
        l: usize,
        component_count: usize,
        b: usize,
        m: usize,
        k: usize,
    ) -> &mut f32 {
        let at = (b * self.group_count + m / G::LEN) * component_count + k;
        &mut self.levels[l].latent_gradient[at].as_mut()[m % G::LEN]
    }

    /// The first shape with the largest `|z|` of component `k` of block `b`, and that z; zero where there is no shape.
    pub(super) fn widest_latent(&self, l: usize, component_count: usize, b: usize, k: usize) -> (usize, f32) {
        let mut widest = (0, 0.0_f32);
        for m in 0..self.shape_count {
            let z = self.latent(l, component_count, b, m, k);
            if z.abs() > widest.1.abs() {
                widest = (m, z);
            }
        }
        widest
    }

    /// From inputs to latents and residuals; answers the weighted squared residuals of all blocks of the level.
    pub(super) fn forward(&mut self, l: usize, level: LevelView<'_>, own: &Level) -> f64 {
        if self.group_count == 0 {
            return 0.0;
        }
        let (group_count, blocks) = (self.group_count, level.weights.blocks.as_slice());
        let (above, rest) = self.levels.split_at_mut(l);
        let fields = &mut rest[0];
        let source = source(above, &self.shapes, level, group_count);
        let row_len = blocks.len() * group_count;
        let latent_count = row_len * level.weights.component_count;

        fields
            .hidden
            .resize(source.vertex_count() * row_len, [G::ZERO; FEATURE_COUNT]);
        let parts: Vec<Vec<G>> = chunks_of_blocks(&mut fields.hidden, blocks.len(), CHUNK * group_count)
            .into_par_iter()
            .enumerate()
            .map(|(chunk, mut hidden)| {
                let mut latents = vec![G::ZERO; latent_count];
                let start = chunk * CHUNK;
                forward::encode(
                    start,
                    source,
                    level.ring,
                    blocks,
                    level.rest_share,
                    &own.components,
                    &mut hidden,
                    &mut latents,
                );
                latents
            })
            .collect();
        fields.latents = add_lanes(&parts, latent_count);

        let latents = &fields.latents;
        let last_group = last_group(level.rest_share, self.shape_count);
        fields
            .residual
            .resize(source.vertex_count() * row_len, [G::ZERO; FEATURE_COUNT]);
        let losses: Vec<f32> = chunks_of_blocks(&mut fields.residual, blocks.len(), CHUNK * group_count)
            .into_par_iter()
            .zip(self.error.par_chunks_mut(CHUNK * group_count))
            .enumerate()
            .map(|(chunk, (mut residual, error))| {
                let start = chunk * CHUNK;
                let weights = level.vertex_weights;
                let share = level.rest_share;
                forward::decode(
                    start,
                    source,
                    blocks,
                    share,
                    &own.hat,
                    latents,
                    weights,
                    last_group.as_ref(),
                    &mut residual,
                    error,
                )
            })
            .collect();
        losses.iter().map(|&loss| f64::from(loss)).sum()
    }

    /// Weighted |e|² and Σ(g·e)²; then the error becomes dL/de for terms with these factors (twice the terms' own).
    pub(super) fn measure_error(
        &mut self,
        vertex_weights: &[f32],
        modes: &Modes,
        total_factor: f32,
        position_factor: f32,
    ) -> (f64, f64) {
        let group_count = self.group_count;
        if group_count == 0 {
            return (0.0, 0.0);
        }
        let projection_count = group_count * modes.count;
        let parts: Vec<(f32, Vec<G>)> = self
            .error
            .par_chunks(CHUNK * group_count)
            .enumerate()
            .map(|(chunk, error)| {
                let mut projections = vec![G::ZERO; projection_count];
                let (start, modes, count) = (chunk * CHUNK, modes.values.as_slice(), modes.count);
                let loss = forward::measure_error(
                    start,
                    error,
                    vertex_weights,
                    modes,
                    count,
                    group_count,
                    &mut projections,
                );
                (loss, projections)
            })
            .collect();
        let (losses, parts): (Vec<f32>, Vec<Vec<G>>) = parts.into_iter().unzip();
        let mut projections = add_lanes(&parts, projection_count);
        let mut position = 0.0;
        for value in projections.iter_mut().flat_map(|group| group.as_mut()) {
            position += f64::from(*value) * f64::from(*value);
            *value *= position_factor;
        }
        self.error
            .par_chunks_mut(CHUNK * group_count)
            .enumerate()
            .for_each(|(chunk, error)| {
                let (start, modes, count) = (chunk * CHUNK, modes.values.as_slice(), modes.count);
                let factor = total_factor;
                backward::differentiate_error(
                    start,
                    factor,
                    vertex_weights,
                    modes,
                    count,
                    &projections,
                    group_count,
                    error,
                );
            });
        (losses.iter().map(|&loss| f64::from(loss)).sum(), position)
    }

    /// From dL/de and dL/d(x - y) back to the latents and, in `own`, to dL/dhat and the decoders' biases. `mask_gradient`:
    /// of the level above, empty at the root. `is_first`: no other band was here, so dL/dhat begins at zero.
    pub(super) fn decode_back(
        &mut self,
        l: usize,
        level: LevelView<'_>,
        own: &mut Level,
        mask_gradient: &mut [f32],
        block_factor: f32,
        is_first: bool,
    ) {
        if self.group_count == 0 {
            return;
        }
        let (group_count, blocks) = (self.group_count, level.weights.blocks.as_slice());
        let (above, rest) = self.levels.split_at_mut(l);
        let fields = &mut rest[0];
        let mut towards_source =
            core::mem::take(above.last_mut().map_or(&mut Vec::new(), |x| &mut x.residual_gradient));
        let source = source(above, &self.shapes, level, group_count);
        if l > 0 {
            towards_source.resize(source.residuals.len(), [G::ZERO; FEATURE_COUNT]);
        }
        let block_count = blocks.len();
        let transposed = transpose_latents(&fields.latents, block_count, group_count, self.shape_count);
        let (residual, children, error, hat) = (&fields.residual, &fields.residual_gradient, &self.error, &own.hat);
        let latent_count = fields.latents.len();
        let chunk_len = CHUNK * own.width();
        let parts: Vec<(Vec<G>, Vec<[f32; FEATURE_COUNT]>)> =
            chunks_of_blocks(&mut own.hat_gradient, block_count, chunk_len)
                .into_par_iter()
                .zip(source_chunks(source, &mut towards_source, mask_gradient))
                .enumerate()
                .map(|(chunk, (mut hat_gradient, mut source_gradient))| {
                    let mut latent_gradient = vec![G::ZERO; latent_count];
                    if is_first {
                        for hat_gradient in &mut hat_gradient {
                            hat_gradient.fill([[0.0; LANE_COUNT]; FEATURE_COUNT]);
                        }
                    }
                    for residuals in &mut source_gradient.residuals {
                        residuals.fill([G::ZERO; FEATURE_COUNT]);
                    }
                    let biases = backward::decode_back(
                        chunk * CHUNK,
                        source,
                        blocks,
                        level.rest_share,
                        residual,
                        error,
                        children,
                        block_factor,
                        level.vertex_weights,
                        hat,
                        &transposed,
                        &mut hat_gradient,
                        &mut latent_gradient,
                        &mut source_gradient,
                    );
                    (latent_gradient, biases)
                })
                .collect();
        let (latents, biases): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        own.decoders.add_biases(&biases);
        fields.latent_gradient = add_lanes(&latents, latent_count);
        if let Some(above) = above.last_mut() {
            above.residual_gradient = towards_source;
        }
    }

    /// From dL/dz, once it is complete, back to the encoders, dL/dC and what the level above shared out.
    pub(super) fn encode_back(&mut self, l: usize, level: LevelView<'_>, own: &mut Level, mask_gradient: &mut [f32]) {
        if self.group_count == 0 {
            return;
        }
        let (group_count, blocks) = (self.group_count, level.weights.blocks.as_slice());
        let (above, rest) = self.levels.split_at_mut(l);
        let fields = &mut rest[0];
        let latent_gradient = &fields.latent_gradient;
        let transposed = transpose_latents(latent_gradient, blocks.len(), group_count, self.shape_count);
        let (chunk_len, components) = (CHUNK * own.width(), &own.components);
        let sums = chunks_of_blocks(&mut own.component_gradient, blocks.len(), chunk_len);
        let biases: Vec<Vec<[f32; FEATURE_COUNT]>> =
            chunks_of_blocks(&mut fields.hidden, blocks.len(), CHUNK * group_count)
                .into_par_iter()
                .zip(sums)
                .enumerate()
                .map(|(chunk, (mut hidden, mut sums))| {
                    let start = chunk * CHUNK;
                    let z = latent_gradient;
                    backward::encode_back(
                        start,
                        group_count,
                        blocks,
                        level.rest_share,
                        components,
                        z,
                        &transposed,
                        &mut hidden,
                        &mut sums,
                    )
                })
                .collect();
        own.encoders.add_biases(&biases);

        let mut towards_source =
            core::mem::take(above.last_mut().map_or(&mut Vec::new(), |x| &mut x.residual_gradient));
        let source = source(above, &self.shapes, level, group_count);
        let vertex_count = source.vertex_count();
        let hidden = &fields.hidden;
        let parts: Vec<Vec<GraphConvRecord>> = source_chunks(source, &mut towards_source, mask_gradient)
            .enumerate()
            .map(|(chunk, mut source_gradient)| {
                let start = chunk * CHUNK;
                let count = CHUNK.min(vertex_count - start);
                backward::convolve_back(start, source, level.ring, blocks, hidden, count, &mut source_gradient)
            })
            .collect();
        own.encoders.add(&parts);
        if let Some(above) = above.last_mut() {
            above.residual_gradient = towards_source;
        }
    }
}

/// Which lanes of the last group hold a shape, as ones, where a lane without one would answer more than zero.
fn last_group<G: Group>(rest_share: f32, shape_count: usize) -> Option<G> {
    let used = shape_count % G::LEN;
    (rest_share != 1.0 && used > 0).then(|| {
        let mut lanes = G::ZERO;
        lanes.as_mut()[..used].fill(1.0);
        lanes
    })
}

/// What the level below `above` sees.
fn source<'a, G: Group>(
    above: &'a [BandLevel<G>],
    shapes: &'a [Features<G>],
    level: LevelView<'a>,
    group_count: usize,
) -> Source<'a, G> {
    Source {
        residuals: above.last().map_or(shapes, |above| &above.residual),
        masks: level.masks,
        child_count: level.child_count,
        block_count: level.weights.blocks.len(),
        group_count,
    }
}

/// The gradients of a source, cut into chunks; empty ones where there is none.
fn source_chunks<'a, G: Group>(
    source: Source<'_, G>,
    residuals: &'a mut [Features<G>],
    masks: &'a mut [f32],
) -> impl IndexedParallelIterator<Item = SourceGradient<'a, G>> {
    let parent_count = source.block_count / source.child_count;
    let chunk_count = source.vertex_count().div_ceil(CHUNK);
    let mut residuals = chunks_of_blocks(residuals, parent_count, CHUNK * source.group_count).into_iter();
    let mut masks = masks.chunks_mut(CHUNK * source.block_count);
    let chunks: Vec<_> = (0..chunk_count)
        .map(|_| SourceGradient {
            residuals: residuals.next().unwrap_or_default(),
            masks: masks.next().unwrap_or_default(),
        })
        .collect();
    chunks.into_par_iter()
}
