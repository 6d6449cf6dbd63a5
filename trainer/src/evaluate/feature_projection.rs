//! Weights by least squares in feature space, through the folded decoder's tanh (method section 3, number 2).

use half::f16;
use nalgebra::{DMatrix, DVector};
use sinew_formats::package::{BakedView, FEATURE_COUNT};

use super::descent::{DescentSettings, LeastSquares, NormalEquations, descend};

/// Converges in 3 to 6 steps from the encoder's weights; the rest is for shapes far from training.
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

    /// Weights that minimise `sum_v areas_v |X_v - Xhat_v(z)|^2`, from `start` (the encoder's). Shapes: `features` and
    /// `areas` `[V]`, source order; `start` `[K]`. Stretch counts as it stands in network units, already down-weighted.
    pub fn project(&self, features: &[[f32; FEATURE_COUNT]], areas: &[f64], start: Vec<f64>) -> Vec<f64> {
        let Ok(weights) = descend(
            &mut FeatureMisfit {
                decoder: self,
                features,
                areas,
            },
            start,
            &DESCENT,
        );
        weights
    }
}

/// Area-weighted distance of decoded features from those of one shape.
struct FeatureMisfit<'p> {
    decoder: &'p FeatureDecoder,
    features: &'p [[f32; FEATURE_COUNT]],
    areas: &'p [f64],
}

impl LeastSquares for FeatureMisfit<'_> {
    type Error = core::convert::Infallible;

    fn cost(&mut self, weights: &[f64]) -> Result<f64, Self::Error> {
        let vertices = self.features.iter().zip(self.areas).enumerate();
        Ok(vertices
            .map(|(v, (target, area))| {
                let decoded = self.decoder.decode(v, weights, |_, _| ());
                area * (0..FEATURE_COUNT)
                    .map(|c| (f64::from(target[c]) - decoded[c]).powi(2))
                    .sum::<f64>()
            })
            .sum())
    }

    fn linearise(&mut self, weights: &[f64]) -> Result<NormalEquations, Self::Error> {
        let component_count = self.decoder.component_count;
        let mut matrix = DMatrix::zeros(component_count, component_count);
        let mut right_hand_side = DVector::zeros(component_count);
        // Rows are short (a vertex sees a handful of components), so the Jacobian is used vertex by vertex.
        let mut row: Vec<(usize, [f64; FEATURE_COUNT])> = Vec::new();
        for (v, (target, area)) in self.features.iter().zip(self.areas).enumerate() {
            row.clear();
            let decoded = self.decoder.decode(v, weights, |entry, slope| {
                let derivative = core::array::from_fn(|c| slope[c] * f64::from(entry.value[c]));
                row.push((entry.component as usize, derivative));
            });
            let residual: [f64; FEATURE_COUNT] = core::array::from_fn(|c| f64::from(target[c]) - decoded[c]);
            for (n, (k, derivative)) in row.iter().enumerate() {
                right_hand_side[*k] += area * dot(derivative, &residual);
                for (l, other) in &row[..=n] {
                    matrix[(*k, *l)] += area * dot(derivative, other);
                }
            }
        }
        Ok(NormalEquations {
            matrix,
            right_hand_side,
        })
    }
}

fn dot(a: &[f64; FEATURE_COUNT], b: &[f64; FEATURE_COUNT]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
