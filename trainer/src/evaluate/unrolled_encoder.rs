//! The encoder of a package: a network of a few layers, each of which reads what the layers before it left of the shape's
//! features and adds to the weights. Feed-forward: no search, and the same arithmetic for every shape.
//!
//! A layer reads by one fixed matrix, the least squares of the whole decoder at rest in one fixed metric that counts
//! positions: `z <- z + (J^T M J)^-1 J^T M (x - decode(z))`. The first layer alone is linear in the features; those behind
//! it see what the decoder's tanh did to its answer. All of it follows from the package but the metric's weight, which the
//! package stores ([`EncoderRecord`]).

use nalgebra::{Cholesky, DVector, Dyn};
use sinew_formats::package::FEATURE_COUNT;

use super::feature_projection::FeatureProjection;
use crate::features::metric::squared_length;

/// Added to the diagonal of `J^T M J` as a share of its mean: components that repeat each other keep an answer.
const RIDGE: f64 = 1e-6;

/// Layers of a newly trained package. The second and third make good what bends cost the first; those behind them serve shapes that
/// bend by more than a quarter turn.
pub const LAYERS: u8 = 8;

/// Most layers that a package may ask for.
const LAYERS_MAX: u8 = 64;

/// First byte of a record.
const RECORD_VERSION: u8 = 1;

/// What a package keeps for its encoder. In the package: one byte that is 1, one with the number of layers, then `position_weight`
/// as eight bytes, little endian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderRecord {
    /// From 1 to 64.
    pub layers: u8,
    /// What positions count in the metric that layers read by: w of [`crate::features::metric::FeatureMetric`], at least 0.
    pub position_weight: f64,
}

impl EncoderRecord {
    /// As the package stores it.
    pub fn to_bytes(self) -> [u8; 10] {
        let mut bytes = [0; 10];
        bytes[0] = RECORD_VERSION;
        bytes[1] = self.layers;
        bytes[2..].copy_from_slice(&self.position_weight.to_le_bytes());
        bytes
    }

    /// The inverse; nothing where it is no such record.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (&version, rest) = bytes.split_first()?;
        let (&layers, rest) = rest.split_first()?;
        let position_weight = f64::from_le_bytes(rest.try_into().ok()?);
        let sound = version == RECORD_VERSION
            && (1..=LAYERS_MAX).contains(&layers)
            && position_weight.is_finite()
            && position_weight >= 0.0;
        sound.then_some(Self {
            layers,
            position_weight,
        })
    }
}

/// The encoder, ready for any number of shapes.
pub struct UnrolledEncoder<'p> {
    projection: &'p FeatureProjection<'p>,
    record: EncoderRecord,
    /// Of `J^T M J`; nothing where no component moves anything.
    factor: Option<Cholesky<f64, Dyn>>,
    /// Of the first components alone: what the root block can say without the others.
    roots: Option<Cholesky<f64, Dyn>>,
}

impl<'p> UnrolledEncoder<'p> {
    /// `root_count`: components of the root block, which come first.
    pub fn new(projection: &'p FeatureProjection<'p>, record: EncoderRecord, root_count: usize) -> Self {
        let matrix = projection.normal_matrix_at_rest(record.position_weight);
        let factored = |count: usize| {
            let mut part = matrix.view((0, 0), (count, count)).clone_owned();
            let mean = part.diagonal().sum() / count.max(1) as f64;
            for k in 0..count {
                part[(k, k)] += (RIDGE * mean).max(f64::MIN_POSITIVE);
            }
            Cholesky::new(part)
        };
        Self {
            projection,
            record,
            factor: factored(matrix.nrows()),
            roots: factored(root_count.min(matrix.nrows())),
        }
    }

    /// Weights of all components. Shapes: `features` `[V]`, source order, network units; the answer `[K]`.
    pub fn weights(&self, features: &[[f32; FEATURE_COUNT]]) -> Vec<f64> {
        self.run(features, self.factor.as_ref())
    }

    /// Weights that the root block would have if it were alone; those of the others are 0.
    pub fn root_weights(&self, features: &[[f32; FEATURE_COUNT]]) -> Vec<f64> {
        self.run(features, self.roots.as_ref())
    }

    /// `|x - decode(weights)|^2`.
    pub fn left_by(&self, weights: &[f64], features: &[[f32; FEATURE_COUNT]]) -> f64 {
        let decoded = self.projection.decoder().decode_all(weights);
        let pairs = features.as_flattened().iter().zip(decoded.as_flattened());
        pairs.map(|(&x, y)| (f64::from(x) - y).powi(2)).sum()
    }

    /// A layer that leaves more than the one before it, as can happen with shapes far beyond all that was learned, does not
    /// count, nor does any behind it.
    fn run(&self, features: &[[f32; FEATURE_COUNT]], factor: Option<&Cholesky<f64, Dyn>>) -> Vec<f64> {
        let (decoder, metric) = (self.projection.decoder(), self.projection.metric());
        let mut weights = vec![0.0; decoder.component_count()];
        let Some(factor) = factor else { return weights };
        let target: Vec<[f64; FEATURE_COUNT]> = features.iter().map(|x| x.map(f64::from)).collect();
        let mut left = target.clone();
        let mut moved = metric.displacements(&left);
        let mut energy = metric.energy(&left) + self.record.position_weight * squared_length(&moved);
        for _ in 0..self.record.layers {
            let pull = metric.displacements_adjoint(&moved);
            let mut force = left;
            for ((force, pull), area) in force.iter_mut().zip(&pull).zip(metric.areas()) {
                for c in 0..FEATURE_COUNT {
                    force[c] = area * force[c] + self.record.position_weight * pull[c];
                }
            }
            let mut step = DVector::from_vec(decoder.pull_at_rest(&force))
                .rows(0, factor.l_dirty().nrows())
                .clone_owned();
            factor.solve_mut(&mut step);
            let mut further = weights.clone();
            further.iter_mut().zip(&step).for_each(|(weight, step)| *weight += step);
            let decoded = decoder.decode_all(&further);
            left = target
                .iter()
                .zip(&decoded)
                .map(|(x, y)| core::array::from_fn(|c| x[c] - y[c]))
                .collect();
            moved = metric.displacements(&left);
            let now = metric.energy(&left) + self.record.position_weight * squared_length(&moved);
            if now.is_nan() || now >= energy {
                break;
            }
            (weights, energy) = (further, now);
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back_and_others_are_refused() {
        let record = EncoderRecord {
            layers: 4,
            position_weight: 12.5,
        };
        let bytes = record.to_bytes();
        assert_eq!(EncoderRecord::from_bytes(&bytes), Some(record));
        for length in 0..bytes.len() {
            assert_eq!(EncoderRecord::from_bytes(&bytes[..length]), None);
        }
        let changed = |at: usize, byte: u8| {
            let mut bytes = bytes;
            bytes[at] = byte;
            EncoderRecord::from_bytes(&bytes)
        };
        assert_eq!(changed(0, 2), None, "another version");
        assert_eq!(changed(1, 0), None, "no layer");
        assert_eq!(changed(1, 65), None, "more layers than any package has");
        assert_eq!(changed(9, 0xff), None, "a weight below zero");
    }
}
