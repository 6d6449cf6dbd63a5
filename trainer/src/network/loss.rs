//! What the network is asked for (method section 2; `local` after this project's own experiments), and the two terms
//! that look at weights alone: where sparsity counts, and what it costs.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sinew_formats::package::FEATURE_COUNT;

use super::weights::{StackWeights, row_length};

/// Softens norms at zero, where they have no gradient. Entries of unit rows are near 0.01: a shift below their rounding.
pub(crate) const NORM_SOFTENING: f32 = 1e-6;

/// Weights of the loss terms. All norms are summed over vertices with the vertex weights, then averaged over the shapes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossSettings {
    /// λ1, in front of the three reconstruction terms.
    pub reconstruction_weight: f32,
    /// Whether norms weigh vertices by their area, mean one, or all alike as the paper's do.
    pub weigh_by_area: bool,
    /// Of the sum over blocks of `|x_b - y_b|²`, what each block sees less what it answers.
    pub block_weight: f32,
    /// Of `|e|²`, e = shapes less the sum of all blocks' answers.
    pub total_weight: f32,
    /// Of `Σ_i (g_i · e)²`, g_i the modes that move positions most. No effect where no modes are given.
    pub position_weight: f32,
    /// λ2, of the sparsity Ω(C).
    pub sparsity_weight: f32,
    /// Of V(Z), the penalty on latents that leave `[-range_threshold, range_threshold]`.
    pub range_weight: f32,
    /// θ.
    pub range_threshold: f32,
    /// Ω and the optimiser work on rows of C of unit length. Without it Ω can be lowered by scale alone (C → sC,
    /// decoder → decoder / s²).
    pub unit_rows: bool,
    /// d of each level: distance from a component's centre, as a share of the largest distance, from which Ω counts.
    /// The last one serves all deeper levels.
    pub sparsity_distances: Vec<f32>,
}

impl LossSettings {
    /// The paper's: every block for itself, λ1 = 10, λ2 = 1, θ = 5, d = 0.4 and 0.2.
    pub fn paper() -> Self {
        Self {
            reconstruction_weight: 10.0,
            weigh_by_area: false,
            block_weight: 1.0,
            total_weight: 0.0,
            position_weight: 0.0,
            sparsity_weight: 1.0,
            range_weight: 1.0,
            range_threshold: 5.0,
            unit_rows: false,
            sparsity_distances: vec![0.4, 0.2],
        }
    }

    /// Rewards what is finally seen, the total and its effect on positions: weights that generalise from few shapes.
    pub fn local() -> Self {
        Self {
            weigh_by_area: true,
            block_weight: 0.05,
            total_weight: 1.0,
            position_weight: 20.0,
            sparsity_weight: 0.02,
            unit_rows: true,
            ..Self::paper()
        }
    }

    /// d of level l; one, which nothing reaches, where none is given.
    pub fn sparsity_distance(&self, l: usize) -> f32 {
        self.sparsity_distances
            .get(l)
            .or(self.sparsity_distances.last())
            .copied()
            .unwrap_or(1.0)
    }
}

impl Default for LossSettings {
    fn default() -> Self {
        Self::local()
    }
}

/// What each term adds to the loss, weights included.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct LossTerms {
    /// Blocks, each for itself.
    pub block: f32,
    /// The sum of all blocks against the shapes.
    pub total: f32,
    /// The same, as far as it moves positions.
    pub position: f32,
    /// Ω.
    pub sparsity: f32,
    /// V.
    pub range: f32,
}

impl LossTerms {
    /// The loss that is minimised.
    pub fn sum(&self) -> f32 {
        self.block + self.total + self.position + self.sparsity + self.range
    }
}

/// Where Ω counts: vertices at least d away from the centre of their component (the paper's Λ).
pub struct SparsityRegions<'a> {
    distances: &'a (dyn Fn(usize) -> Vec<f32> + Sync),
    by_centre: BTreeMap<usize, Vec<f32>>,
}

impl<'a> SparsityRegions<'a> {
    /// `distances(centre)`: geodesic distances from one vertex as a share of the mesh's largest, shape `[V]`; asked for
    /// once a centre.
    pub fn new(distances: &'a (dyn Fn(usize) -> Vec<f32> + Sync)) -> Self {
        Self {
            distances,
            by_centre: BTreeMap::new(),
        }
    }

    /// Λ for the weights as they are: centres are where components are strongest. Shape: `[block][K][V]`, flat.
    pub fn outside(&mut self, weights: &StackWeights, settings: &LossSettings) -> Vec<Vec<bool>> {
        let row_len = weights.vertex_count * FEATURE_COUNT;
        let centres: Vec<Vec<usize>> = weights
            .blocks()
            .map(|block| {
                block
                    .components
                    .par_chunks_exact(row_len)
                    .map(strongest_vertex)
                    .collect()
            })
            .collect();
        let mut missing: Vec<usize> = centres.iter().flatten().copied().collect();
        missing.sort_unstable();
        missing.dedup();
        missing.retain(|centre| !self.by_centre.contains_key(centre));
        let fresh: Vec<_> = missing
            .into_par_iter()
            .map(|centre| (centre, (self.distances)(centre)))
            .collect();
        self.by_centre.extend(fresh);
        let levels = weights.levels.iter().enumerate();
        let reaches = levels.flat_map(|(l, level)| level.blocks.iter().map(move |_| settings.sparsity_distance(l)));
        let outside = centres.iter().zip(reaches).map(|(centres, reach)| {
            let mut outside = Vec::with_capacity(centres.len() * weights.vertex_count);
            for centre in centres {
                outside.extend(self.by_centre[centre].iter().map(|&d| d >= reach));
            }
            outside
        });
        outside.collect()
    }
}

/// The first vertex at which a row of C is longest.
fn strongest_vertex(row: &[f32]) -> usize {
    let mut strongest = (0, f32::NEG_INFINITY);
    for (v, values) in row.as_chunks::<FEATURE_COUNT>().0.iter().enumerate() {
        let energy = values.iter().map(|value| value * value).sum();
        if energy > strongest.1 {
            strongest = (v, energy);
        }
    }
    strongest.0
}

/// `λ2 Σ_blocks (1/K) Σ_k Σ_v Λ_kv |C_kv|`; adds its gradient to that of C. `outside` as from [`SparsityRegions`].
pub(crate) fn sparsity(
    weights: &StackWeights,
    outside: &[Vec<bool>],
    settings: &LossSettings,
    gradient: &mut StackWeights,
) -> f32 {
    if settings.sparsity_weight == 0.0 {
        return 0.0;
    }
    let row_len = weights.vertex_count * FEATURE_COUNT;
    let mut total = 0.0;
    for ((block, gradient), outside) in weights.blocks().zip(gradient.blocks_mut()).zip(outside) {
        let factor = settings.sparsity_weight / (block.components.len() / row_len) as f32;
        let rows = block
            .components
            .par_chunks_exact(row_len)
            .zip(gradient.components.par_chunks_exact_mut(row_len));
        let costs: Vec<f64> = rows
            .zip(outside.par_chunks_exact(weights.vertex_count))
            .map(|((row, gradient), outside)| row_sparsity(row, outside, factor, settings.unit_rows, gradient))
            .collect();
        total += costs.iter().sum::<f64>();
    }
    total as f32
}

/// One row's share of Ω; adds its gradient.
fn row_sparsity(row: &[f32], outside: &[bool], factor: f32, unit: bool, gradient: &mut [f32]) -> f64 {
    let length = if unit { row_length(row) } else { 1.0 };
    if length == 0.0 {
        return 0.0;
    }
    let scale = (1.0 / length) as f32;
    let (mut cost, mut along) = (0.0_f64, 0.0_f64);
    let vertices = row.as_chunks::<FEATURE_COUNT>().0.iter();
    let slopes = gradient.as_chunks_mut::<FEATURE_COUNT>().0.iter_mut();
    for ((values, slope), _) in vertices.zip(slopes).zip(outside).filter(|(_, outside)| **outside) {
        let energy = values.iter().map(|value| value * value).sum::<f32>() * scale * scale;
        let norm = (energy + NORM_SOFTENING * NORM_SOFTENING).sqrt();
        cost += f64::from(norm - NORM_SOFTENING);
        along += f64::from(energy / norm);
        let share = factor * scale * scale / norm;
        slope
            .iter_mut()
            .zip(values)
            .for_each(|(sum, value)| *sum += share * value);
    }
    if unit {
        // A row's length cannot change what it costs: take out the part of the gradient along the row.
        let along = along as f32 * factor * scale * scale;
        gradient
            .iter_mut()
            .zip(row)
            .for_each(|(sum, value)| *sum -= along * value);
    }
    f64::from(factor) * cost
}
