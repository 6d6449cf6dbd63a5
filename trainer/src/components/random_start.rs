//! The published start of the network: random weights, for training as the papers do.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use crate::network::weights::StackWeights;

/// Random weights of Xavier's variance, biases zero: `component_counts[l]` components in every block of level l.
pub fn random_start(vertex_count: usize, component_counts: &[usize], seed: u64) -> StackWeights {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = |inputs: usize, outputs: usize| {
        let bound = (6.0 / (inputs + outputs) as f32).sqrt();
        random.random_range(-bound..bound)
    };
    let mut weights = StackWeights::zeros(vertex_count, component_counts);
    let row_len = vertex_count * FEATURE_COUNT;
    for block in weights.blocks_mut() {
        let component_count = block.components.len() / row_len;
        for value in &mut block.components {
            *value = uniform(row_len, component_count);
        }
        for convolution in [&mut block.encoder, &mut block.decoder] {
            let GraphConvRecord { point, neighbour, .. } = convolution;
            for value in point.as_flattened_mut().iter_mut().chain(neighbour.as_flattened_mut()) {
                *value = uniform(FEATURE_COUNT, FEATURE_COUNT);
            }
        }
    }
    weights
}
