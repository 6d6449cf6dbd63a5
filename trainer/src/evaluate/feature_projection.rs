//! Weights by least squares in feature space, through the folded decoder's tanh (method section 3, number 2).

use half::f16;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sinew_formats::package::{BakedView, FEATURE_COUNT};

use super::descent::{DescentSettings, LeastSquares, NormalEquations, descend};
use super::feature_metric::{FeatureMetric, squared_length};
use super::position_projection::gram_matrix;

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
    /// Gathers a baked package by vertex.
    pub fn new(package: &BakedView<'_>) -> Self {
        let (exact, vertex_count) = (package.exact(), package.vertex_count());
        let mut rows: Vec<Vec<Entry>> = vec![Vec::new(); vertex_count];
        for entry in exact.entries() {
            let component = package.component(entry.component);
            let value = entry.values.map(|b| f16::from_bits(b).to_f32() * component.value_scale);
            rows[package.vertex_from_lane()[entry.lane] as usize].push(Entry {
                component: entry.component as u32,
                block: component.block,
                value,
            });
        }
        let mut offsets = vec![0];
        for row in &rows {
            offsets.push(offsets[offsets.len() - 1] + row.len());
        }
        let biases = package
            .blocks()
            .map(|block| block.bias.map(|b| (f64::from(b), f64::from(b).tanh())))
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

    /// Weights in one pass, without a search: least squares of the decoder made linear at the reference, in the metric of
    /// [`Self::weights`] (linear in the features but for how much this shape's positions count). Zeros where nothing can be
    /// solved. Shapes: `features` `[V]`, source order; the answer `[K]`.
    pub fn linear_weights(&self, features: &[[f32; FEATURE_COUNT]]) -> Vec<f64> {
        let mut misfit = self.misfit(features);
        let Ok(equations) = misfit.linearise(&vec![0.0; self.decoder.component_count]);
        match equations.step(DESCENT.ridge) {
            Some(weights) => weights.iter().copied().collect(),
            None => vec![0.0; self.decoder.component_count],
        }
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

    /// Weights that bring `|X - Xhat(z)|` of the metric down, from `start` ([`Self::linear_weights`], or any).
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
        let features: f64 = residual
            .iter()
            .zip(metric.areas())
            .map(|(x, area)| area * x.iter().map(|x| x * x).sum::<f64>())
            .sum();
        Ok(features + self.position_weight * squared_length(&metric.displacements(&residual)))
    }

    /// The gradient is exact; the matrix takes what components do to positions as it is at the reference, where the slopes
    /// of tanh are 1, so that no step needs K solves.
    fn linearise(&mut self, weights: &[f64]) -> Result<NormalEquations, Self::Error> {
        let FeatureProjection {
            decoder,
            metric,
            position_gram,
        } = self.projection;
        let component_count = decoder.component_count;
        let mut matrix = DMatrix::zeros(component_count, component_count);
        let mut right_hand_side = DVector::zeros(component_count);
        let residual = self.residual(weights);
        let pull = metric.displacements_adjoint(&metric.displacements(&residual));
        // Rows are short (a vertex sees a handful of components), so the Jacobian is used vertex by vertex.
        let mut row: Vec<(usize, [f64; FEATURE_COUNT])> = Vec::new();
        for (v, area) in metric.areas().iter().enumerate() {
            row.clear();
            decoder.decode(v, weights, |entry, slope| {
                let derivative = core::array::from_fn(|c| slope[c] * f64::from(entry.value[c]));
                row.push((entry.component as usize, derivative));
            });
            let force: [f64; FEATURE_COUNT] =
                core::array::from_fn(|c| area * residual[v][c] + self.position_weight * pull[v][c]);
            for (n, (k, derivative)) in row.iter().enumerate() {
                right_hand_side[*k] += dot(derivative, &force);
                for (l, other) in &row[..=n] {
                    matrix[(*k, *l)] += area * dot(derivative, other);
                }
            }
        }
        matrix += position_gram * self.position_weight;
        Ok(NormalEquations {
            matrix,
            right_hand_side,
        })
    }
}

fn dot(a: &[f64; FEATURE_COUNT], b: &[f64; FEATURE_COUNT]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
