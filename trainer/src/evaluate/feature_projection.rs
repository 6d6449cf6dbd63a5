//! Weights by least squares in feature space, through the folded decoder's tanh (method section 3, number 2).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sinew_formats::package::{CompactView, FEATURE_COUNT};

use super::descent::{DescentSettings, LeastSquares, NormalEquations, descend};
use super::position_projection::gram_matrix;
use crate::components::fields::blends_of;
use crate::features::metric::{FeatureMetric, squared_length};
use crate::mesh::topology::Topology;

/// Converges in 3 to 6 steps from weights near the answer; the rest is for shapes far from training.
const DESCENT: DescentSettings = DescentSettings {
    step_limit: 12,
    ridge: 1e-6,
    least_gain: 1e-6,
};

/// The folded decoder, gathered by vertex: `Xhat_v = sum_b tanh(bias_b + sum_k z_k Chat_k,v) - tanh(bias_b)`.
#[derive(Debug, Clone)]
pub struct FeatureDecoder {
    component_count: usize,
    /// Compressed rows over `entries`, source order. Shape: `[V + 1]`.
    offsets: Vec<usize>,
    /// Ascending by component, hence by block, within a row.
    entries: Vec<Entry>,
    /// Decoder bias of each block, and its tanh. Shape: `[B]`.
    biases: Vec<[(f64, f64); FEATURE_COUNT]>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    component: u32,
    block: u32,
    value: [f32; FEATURE_COUNT],
}

impl FeatureDecoder {
    /// Folds and gathers a compact package by vertex, without the rounding of a baked one. `topology` is the package's.
    pub fn new(package: &CompactView<'_>, topology: &Topology) -> Self {
        let mut rows: Vec<Vec<Entry>> = vec![Vec::new(); package.vertex_count()];
        let blends = blends_of(package, topology);
        for (k, (component, blend)) in package.components().zip(blends).enumerate() {
            for (&v, value) in blend.vertices.iter().zip(&blend.sums) {
                rows[v as usize].push(Entry {
                    component: k as u32,
                    block: component.block,
                    value: value.map(|x| x as f32),
                });
            }
        }
        let mut offsets = vec![0];
        for row in &rows {
            offsets.push(offsets[offsets.len() - 1] + row.len());
        }
        let biases = package
            .blocks()
            .map(|block| block.decoder.bias.map(|b| (f64::from(b), f64::from(b).tanh())))
            .collect();
        Self {
            component_count: package.component_count(),
            offsets,
            entries: rows.concat(),
            biases,
        }
    }

    /// Features of one vertex at `weights`; hands `slope = 1 - tanh^2` of each entry's block to `visit`.
    fn decode(
        &self,
        v: usize,
        weights: &[f64],
        mut visit: impl FnMut(&Entry, [f64; FEATURE_COUNT]),
    ) -> [f64; FEATURE_COUNT] {
        let mut sum = [0.0; FEATURE_COUNT];
        for members in self.entries[self.offsets[v]..self.offsets[v + 1]].chunk_by(|a, b| a.block == b.block) {
            let bias = &self.biases[members[0].block as usize];
            let mut blend = bias.map(|(bias, _)| bias);
            for entry in members {
                for c in 0..FEATURE_COUNT {
                    blend[c] += weights[entry.component as usize] * f64::from(entry.value[c]);
                }
            }
            let activation = blend.map(f64::tanh);
            for c in 0..FEATURE_COUNT {
                sum[c] += activation[c] - bias[c].1;
            }
            let slope = activation.map(|t| 1.0 - t * t);
            for entry in members {
                visit(entry, slope);
            }
        }
        sum
    }

    /// All features at `weights`. Shape: `[V]`, source order, network units.
    pub fn decode_all(&self, weights: &[f64]) -> Vec<[f64; FEATURE_COUNT]> {
        (0..self.offsets.len() - 1)
            .map(|v| self.decode(v, weights, |_, _| ()))
            .collect()
    }

    /// `J^T force`, J the derivative of all features at weights of 0. Shapes: `force` `[V]`; the answer `[K]`.
    pub fn pull_at_rest(&self, force: &[[f64; FEATURE_COUNT]]) -> Vec<f64> {
        let rest = vec![0.0; self.component_count];
        let mut pull = rest.clone();
        for (v, force) in force.iter().enumerate() {
            self.decode(v, &rest, |entry, slope| {
                let derivative = core::array::from_fn(|c| slope[c] * f64::from(entry.value[c]));
                pull[entry.component as usize] += dot(&derivative, force);
            });
        }
        pull
    }

    /// K.
    pub fn component_count(&self) -> usize {
        self.component_count
    }

    /// Derivative of the features at `weights`, vertices without one left out. Shape: `[K]`, source order, network units.
    pub fn derivatives(&self, weights: &[f64]) -> Vec<Vec<(u32, [f64; FEATURE_COUNT])>> {
        let mut derivatives = vec![Vec::new(); self.component_count];
        for v in 0..self.offsets.len() - 1 {
            self.decode(v, weights, |entry, slope| {
                let derivative = core::array::from_fn(|c| slope[c] * f64::from(entry.value[c]));
                derivatives[entry.component as usize].push((v as u32, derivative));
            });
        }
        derivatives
    }

    /// `(G C)(G C)^T` at weights of 0, for [`FeatureProjection`]: what components do to positions, together.
    fn position_gram(&self, metric: &FeatureMetric<'_>) -> DMatrix<f64> {
        let vertex_count = self.offsets.len() - 1;
        let columns: Vec<Vec<[f32; 3]>> = self
            .derivatives(&vec![0.0; self.component_count])
            .into_par_iter()
            .map(|entries| {
                let mut change = vec![[0.0; FEATURE_COUNT]; vertex_count];
                for (v, x) in entries {
                    change[v as usize] = x;
                }
                let moved = metric.displacements(&change);
                moved.iter().map(|p| p.map(|x| x as f32)).collect()
            })
            .collect();
        gram_matrix(&columns)
    }
}

/// Finds weights of features by least squares, in the metric that counts positions.
pub struct FeatureProjection<'a> {
    decoder: &'a FeatureDecoder,
    metric: FeatureMetric<'a>,
    position_gram: DMatrix<f64>,
}

impl<'a> FeatureProjection<'a> {
    /// K solves.
    pub fn new(decoder: &'a FeatureDecoder, metric: FeatureMetric<'a>) -> Self {
        let position_gram = decoder.position_gram(&metric);
        Self {
            decoder,
            metric,
            position_gram,
        }
    }

    /// What it projects onto.
    pub fn decoder(&self) -> &'a FeatureDecoder {
        self.decoder
    }

    /// What it projects in.
    pub fn metric(&self) -> &FeatureMetric<'a> {
        &self.metric
    }

    /// `J^T M J` of the whole decoder at weights of 0, in the metric of this weight of positions. Shape: `[K][K]`.
    pub fn normal_matrix_at_rest(&self, position_weight: f64) -> DMatrix<f64> {
        let mut matrix = self.feature_matrix(&vec![0.0; self.decoder.component_count], |_, _, _| ());
        matrix += &self.position_gram * position_weight;
        matrix.fill_upper_triangle_with_lower_triangle();
        matrix
    }

    /// The part of features in `J^T M J` at `weights`, lower triangle; shows `visit` each vertex' components and their derivatives.
    /// Rows are short (a vertex sees a handful of components), so the Jacobian is used vertex by vertex.
    fn feature_matrix(
        &self,
        weights: &[f64],
        mut visit: impl FnMut(usize, usize, &[f64; FEATURE_COUNT]),
    ) -> DMatrix<f64> {
        let component_count = self.decoder.component_count;
        let mut matrix = DMatrix::zeros(component_count, component_count);
        let mut row: Vec<(usize, [f64; FEATURE_COUNT])> = Vec::new();
        for (v, area) in self.metric.areas().iter().enumerate() {
            row.clear();
            self.decoder.decode(v, weights, |entry, slope| {
                let derivative = core::array::from_fn(|c| slope[c] * f64::from(entry.value[c]));
                row.push((entry.component as usize, derivative));
            });
            for (n, (k, derivative)) in row.iter().enumerate() {
                visit(v, *k, derivative);
                for (l, other) in &row[..=n] {
                    matrix[(*k, *l)] += area * dot(derivative, other);
                }
            }
        }
        matrix
    }

    fn misfit(&self, features: &[[f32; FEATURE_COUNT]]) -> FeatureMisfit<'_> {
        let target: Vec<[f64; FEATURE_COUNT]> = features.iter().map(|x| x.map(f64::from)).collect();
        let position_weight = self.metric.position_weight(&target);
        FeatureMisfit {
            projection: self,
            target,
            position_weight,
        }
    }

    /// Weights that bring `|X - Xhat(z)|` of the metric down, from `start` (an encoder's, or any).
    /// Shapes: `features` `[V]`, source order; `start` `[K]`. Stretch counts as it stands in network units, already down-weighted.
    pub fn weights(&self, features: &[[f32; FEATURE_COUNT]], start: Vec<f64>) -> Vec<f64> {
        let mut misfit = self.misfit(features);
        let Ok(weights) = descend(&mut misfit, start, &DESCENT);
        weights
    }
}

/// Distance of decoded features from those of one shape.
struct FeatureMisfit<'p> {
    projection: &'p FeatureProjection<'p>,
    target: Vec<[f64; FEATURE_COUNT]>,
    position_weight: f64,
}

impl FeatureMisfit<'_> {
    fn residual(&self, weights: &[f64]) -> Vec<[f64; FEATURE_COUNT]> {
        let decoded = self.projection.decoder.decode_all(weights);
        let pairs = self.target.iter().zip(&decoded);
        pairs
            .map(|(target, decoded)| core::array::from_fn(|c| target[c] - decoded[c]))
            .collect()
    }
}

impl LeastSquares for FeatureMisfit<'_> {
    type Error = core::convert::Infallible;

    fn cost(&mut self, weights: &[f64]) -> Result<f64, Self::Error> {
        let metric = &self.projection.metric;
        let residual = self.residual(weights);
        Ok(metric.energy(&residual) + self.position_weight * squared_length(&metric.displacements(&residual)))
    }

    /// The gradient is exact; the matrix takes what components do to positions as it is at the reference, where the slopes
    /// of tanh are 1, so that no step needs K solves.
    fn linearise(&mut self, weights: &[f64]) -> Result<NormalEquations, Self::Error> {
        let metric = &self.projection.metric;
        let mut right_hand_side = DVector::zeros(weights.len());
        let residual = self.residual(weights);
        let pull = metric.displacements_adjoint(&metric.displacements(&residual));
        let mut matrix = self.projection.feature_matrix(weights, |v, k, derivative| {
            let force =
                core::array::from_fn(|c| metric.areas()[v] * residual[v][c] + self.position_weight * pull[v][c]);
            right_hand_side[k] += dot(derivative, &force);
        });
        matrix += &self.projection.position_gram * self.position_weight;
        Ok(NormalEquations {
            matrix,
            right_hand_side,
        })
    }
}

fn dot(a: &[f64; FEATURE_COUNT], b: &[f64; FEATURE_COUNT]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
