//! What all methods share: the split, aligned shapes, features, distances.

use rayon::prelude::*;

use super::{CompareError, CompareInput, LOCAL_RADIUS};
use sinew_trainer::features::acap::features_of_shape;
use sinew_trainer::features::align::align_shapes;
use sinew_trainer::features::gradient::GradientFit;
use sinew_trainer::learn::Reporter;
use sinew_trainer::learn::prepare::Prepared;

/// One sequence, split.
pub(super) struct Bench<'a> {
    pub input: CompareInput<'a>,
    pub prepared: Prepared,
    /// Indices of the measured shapes.
    pub test_shapes: Vec<usize>,
    /// As in the sequence. Shape: `[N][V]`.
    pub truth: Vec<Vec<[f32; 3]>>,
    /// Training shapes aligned to the reference, which is the first. Shape: `[1 + M][V]`.
    pub train: Vec<Vec<[f64; 3]>>,
    /// Measured shapes aligned to the reference. Shape: `[N][V]`.
    pub test: Vec<Vec<[f64; 3]>>,
    /// Features of `train`, network units. Shape: `[1 + M][V x 9]`.
    pub train_features: Vec<Vec<f64>>,
    /// Features of `test`, network units. Shape: `[N][V x 9]`.
    pub test_features: Vec<Vec<f64>>,
    /// Vertex areas, mean 1.
    pub areas: Vec<f64>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(input: CompareInput<'a>, reporter: &dyn Reporter) -> Result<Self, CompareError> {
        let sequence = input.sequence;
        let mut config = input.settings.config.clone();
        // Only mixes need centres, and no peer mixes.
        config.start.centres = 1;
        let prepared = Prepared::new(sequence, input.train_shapes, &config, &[], reporter)?;
        let trained = |m: &usize| input.train_shapes.contains(m);
        let test_shapes: Vec<usize> = (1..sequence.shape_count()).filter(|m| !trained(m)).collect();
        if test_shapes.is_empty() {
            return Err(CompareError::NothingToMeasure(sequence.shape_count()));
        }
        let truth: Vec<Vec<[f32; 3]>> = test_shapes.iter().map(|&m| sequence.shapes[m].to_vec()).collect();
        let aligned = |shapes: &[Vec<[f32; 3]>]| -> Vec<Vec<[f64; 3]>> {
            let aligned = align_shapes(&prepared.rest, shapes).into_iter();
            aligned.map(|shape| shape.positions).collect()
        };
        let moving = input
            .train_shapes
            .iter()
            .filter(|&&m| m != 0 && m < sequence.shape_count());
        let moving: Vec<Vec<[f32; 3]>> = moving.map(|&m| sequence.shapes[m].to_vec()).collect();
        let mut train = vec![prepared.rest.clone()];
        train.extend(aligned(&moving));
        let test = aligned(&truth);

        let widened = |shape: &[[f32; 9]]| shape.as_flattened().iter().map(|&x| f64::from(x)).collect();
        let mut train_features: Vec<Vec<f64>> = vec![vec![0.0; 9 * prepared.rest.len()]];
        train_features.extend(prepared.network.iter().map(widened));
        let fit = GradientFit::new(&prepared.topology, &prepared.rest, &config.features);
        let test_features: Vec<Vec<f64>> = test
            .par_iter()
            .map(|shape| {
                let features = features_of_shape(&prepared.topology, &fit, shape);
                widened(&prepared.scaler.to_network(&features))
            })
            .collect();
        drop(fit);
        let areas = prepared.areas.iter().map(|&area| f64::from(area)).collect();
        Ok(Self {
            input,
            prepared,
            test_shapes,
            truth,
            train,
            test,
            train_features,
            test_features,
            areas,
        })
    }

    /// Share of each component's energy near its centre, mean over those that are not zero; 0 where all are.
    pub(super) fn locality(&self, energies: &[Vec<f64>]) -> f64 {
        let shares: Vec<f64> = energies
            .par_iter()
            .filter_map(|energy| {
                let total: f64 = energy.iter().sum();
                let centre = (0..energy.len())
                    .rev()
                    .max_by(|&a, &b| energy[a].total_cmp(&energy[b]))?;
                let distances = self.prepared.distances(centre);
                let near = energy.iter().zip(&distances).filter(|(_, d)| **d <= LOCAL_RADIUS);
                (total > 0.0).then(|| near.map(|(e, _)| e).sum::<f64>() / total)
            })
            .collect();
        shares.iter().sum::<f64>() / shares.len().max(1) as f64
    }

    /// Length of the reference's bounding box.
    pub(super) fn diagonal(&self) -> f64 {
        f64::from(sinew_trainer::learn::draft::bounding_diagonal(
            &self.prepared.rest_positions,
        ))
    }
}

/// Positions as packages and scores have them.
pub(super) fn narrowed(shape: &[[f64; 3]]) -> Vec<[f32; 3]> {
    shape.iter().map(|p| p.map(|x| x as f32)).collect()
}
