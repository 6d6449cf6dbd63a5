//! One-level mesh autoencoder: Tan, Gao, Lai, Yang, Xia, *Mesh-based Autoencoders for Localized Deformation Component
//! Analysis* (AAAI 2018). This project's own network with a single block and as many latents as components are asked for:
//! graph convolution, one fully connected layer shared by encoder and decoder, tanh; group sparsity away from each
//! component's centre; trained as published, from random weights, on the training shapes themselves.
//!
//! One difference: where the paper fades sparsity in between two distances (0.2 and 0.4 of the longest), the network here
//! knows one cut, set in their middle.

use sinew_formats::package::{AlignedBytes, FEATURE_COUNT, Quality};

use crate::components::random_start::random_start;
use crate::config::TrainConfig;
use crate::learn::package::package;
use crate::learn::prepare::Prepared;
use crate::learn::{LearnError, Reporter};
use crate::network::loss::LossSettings;
use crate::training::data::ShapesSource;
use crate::training::fit::{FitInput, FitProgress, FitSettings, Flow, StopReason, fit};

/// Middle of the paper's two distances.
const SPARSITY_DISTANCE: f32 = 0.3;

/// How the autoencoder is trained.
#[derive(Debug, Clone, PartialEq)]
pub struct TanSettings {
    /// K.
    pub component_count: usize,
    /// Steps of Adam, each on all training shapes.
    pub epochs: usize,
    /// First learning rate; the paper's is 1e-3.
    pub rate: f32,
    /// Seed of the random weights.
    pub seed: u64,
}

impl TanSettings {
    /// The configuration that features and package take from these settings: both kinds of feature fill the range of tanh,
    /// no mixes, nothing cut.
    pub fn config(&self, base: &TrainConfig) -> TrainConfig {
        let mut config = base.clone();
        config.seed = self.seed;
        config.components = vec![self.component_count];
        config.scaling.rotation_reach = 0.95;
        config.scaling.stretch_weight = 1.0;
        config.mixes.per_step = 0;
        config.start.centres = 1;
        config.prune.least_strength = 0.0;
        config.prune.entries_per_vertex = self.component_count as f64 + 1.0;
        config.fit = FitSettings {
            steps: self.epochs,
            rate: Some(self.rate),
            component_rate_factor: 1.0,
            convolution_rate_factor: 1.0,
            final_share: 0.1,
            warm_up: 1,
            keep_supports: false,
            validate_every: self.epochs.max(1),
            patience: 0,
            checkpoint_every: self.epochs.max(1),
            loss: LossSettings {
                sparsity_distances: vec![SPARSITY_DISTANCE],
                ..LossSettings::paper()
            },
            ..FitSettings::default()
        };
        config
    }
}

/// Trains on the shapes of `prepared`, which was made with [`TanSettings::config`]. Returns a compact package, which the
/// usual evaluation measures.
/// Errors: a loss that keeps overflowing, the reporter's wish to stop.
pub fn train(
    prepared: &Prepared,
    config: &TrainConfig,
    settings: &TanSettings,
    sequence_name: &str,
    train_shapes: &[usize],
    shape_count: usize,
    reporter: &dyn Reporter,
) -> Result<AlignedBytes, LearnError> {
    let vertex_count = prepared.rest.len();
    let mut shapes = vec![0.0; vertex_count * FEATURE_COUNT];
    for shape in &prepared.network {
        shapes.extend_from_slice(shape.as_flattened());
    }
    let distances = |v: usize| prepared.distances(v);
    let input = FitInput {
        topology: &prepared.topology,
        vertex_weights: &vec![1.0; vertex_count],
        position_modes: &[],
        distances: &distances,
    };
    let mut observe = |progress: &FitProgress| {
        reporter.advance(progress.step as u64, &format!("loss {:.3}", progress.loss.sum()));
        if reporter.stop_requested() {
            Flow::Stop
        } else {
            Flow::Continue
        }
    };
    let outcome = fit(
        &input,
        random_start(vertex_count, &[settings.component_count], settings.seed),
        &config.fit,
        &mut ShapesSource::new(shapes),
        // Nothing is held out: the last weights count.
        &mut |_| f32::NAN,
        &mut observe,
        None,
    )?;
    if outcome.stop_reason == StopReason::Stopped {
        return Err(LearnError::Stopped);
    }
    let quality = Quality {
        validation_e_rms: -1.0,
        steps: outcome.steps_run as u32,
        steps_run: outcome.steps_run as u32,
    };
    let (bytes, _, _) = package(
        prepared,
        config,
        sequence_name,
        train_shapes,
        shape_count,
        &outcome.weights,
        quality,
    )?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{Evaluation, EvaluationInput, evaluate};
    use crate::learn::Silent;
    use crate::synthesize::{Settings, Subject};

    fn measured(epochs: usize, threads: usize) -> (Evaluation, AlignedBytes) {
        let settings = Settings {
            frames: 6,
            vertices: 120,
            seed: 3,
        };
        let sequence = Subject::Bar.synthesize(&settings).expect("a bar");
        let tan = TanSettings {
            component_count: 4,
            epochs,
            rate: 1e-2,
            seed: 7,
        };
        let config = tan.config(&TrainConfig::default());
        let train_shapes = [0, 1, 2, 3, 4, 5];
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| {
            let prepared = Prepared::new(&sequence, &train_shapes, &config, &Silent).expect("a usable bar");
            let bytes = train(&prepared, &config, &tan, "bar", &train_shapes, 6, &Silent).expect("trains");
            let input = EvaluationInput {
                package: &bytes,
                sequence: &sequence,
                test_shapes: &train_shapes[1..],
                settings: config.features,
                attention: config.fit.attention,
            };
            let (evaluation, _) = evaluate(&input, &|_| ()).expect("measures");
            (evaluation, bytes)
        })
    }

    #[test]
    fn training_brings_the_shapes_nearer_and_threads_change_nothing() {
        let (before, _) = measured(1, 1);
        let (after, bytes) = measured(150, 1);
        assert!(
            after.encoder.e_rms < 0.5 * before.encoder.e_rms,
            "{} then {}",
            before.encoder.e_rms,
            after.encoder.e_rms
        );
        let (_, again) = measured(150, 2);
        assert_eq!(bytes[..], again[..]);
    }
}
