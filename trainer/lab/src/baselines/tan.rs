//! One-level mesh autoencoder: Tan, Gao, Lai, Yang, Xia, *Mesh-based Autoencoders for Localized Deformation Component
//! Analysis* (AAAI 2018). This project's own network with a single block and as many latents as components are asked for:
//! graph convolution, one fully connected layer shared by encoder and decoder, tanh; group sparsity away from each
//! component's centre; trained as published, from random weights, on the training shapes themselves.
//!
//! One difference: where the paper fades sparsity in between two distances (0.2 and 0.4 of the longest), the network here
//! knows one cut, set in their middle.
//!
//! Training goes on until its loss stays level, within a budget of epochs: [`Training`] says which of the two ended it.

use core::fmt;

use sinew_formats::package::{AlignedBytes, FEATURE_COUNT, Quality};

use sinew_trainer::components::random_start::random_start;
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::EncoderKind;
use sinew_trainer::features::gradient::Weighting;
use sinew_trainer::learn::package::package;
use sinew_trainer::learn::prepare::Prepared;
use sinew_trainer::learn::{LearnError, Reporter};
use sinew_trainer::network::activation::Activation;
use sinew_trainer::network::loss::LossSettings;
use sinew_trainer::training::data::FixedBatch;
use sinew_trainer::training::fit::{FitInput, FitProgress, FitSettings, Flow, fit};

/// Middle of the paper's two distances.
const SPARSITY_DISTANCE: f32 = 0.3;

/// Epochs whose mean loss is compared with that of as many before them.
const WINDOW: usize = 100;
/// The loss is level when a window lowers it by less than this share ...
const LEVEL: f64 = 0.001;
/// ... so many times in a row.
const LEVEL_WINDOWS: usize = 3;

/// How the training ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Training {
    /// Epochs run.
    pub epochs: usize,
    /// Epochs allowed.
    pub budget: usize,
    /// Whether the loss stayed level; else the budget ended it.
    pub level: bool,
    /// Share of the loss that the last hundred epochs took off; none in shorter trainings.
    pub last_gain: Option<f64>,
}

impl fmt::Display for Training {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { epochs, budget, .. } = self;
        if self.level {
            return write!(formatter, "loss level after {epochs} of at most {budget} epochs");
        }
        write!(formatter, "not converged: ended by its budget of {budget} epochs")?;
        match self.last_gain {
            Some(gain) => write!(
                formatter,
                ", the last {WINDOW} lowered the loss by {:.1} %",
                100.0 * gain
            ),
            None => Ok(()),
        }
    }
}

/// Watches the loss, window by window.
#[derive(Debug, Default)]
struct Plateau {
    sum: f64,
    epochs: usize,
    before: Option<f64>,
    last_gain: Option<f64>,
    level_windows: usize,
}

impl Plateau {
    /// Takes one epoch's loss; whether it has been level for long enough.
    fn is_level(&mut self, loss: f64) -> bool {
        self.sum += loss;
        self.epochs += 1;
        if self.epochs.is_multiple_of(WINDOW) {
            let mean = core::mem::take(&mut self.sum) / WINDOW as f64;
            self.last_gain = self.before.replace(mean).map(|before| (before - mean) / before);
            let level = self.last_gain.is_some_and(|gain| gain < LEVEL);
            self.level_windows = if level { self.level_windows + 1 } else { 0 };
        }
        self.level_windows >= LEVEL_WINDOWS
    }
}

/// How the autoencoder is trained.
#[derive(Debug, Clone, PartialEq)]
pub struct TanSettings {
    /// K.
    pub component_count: usize,
    /// Steps of Adam at most, each on all training shapes.
    pub epochs: usize,
    /// First learning rate; the paper's is 1e-3.
    pub rate: f32,
    /// Seed of the random weights.
    pub seed: u64,
}

impl TanSettings {
    /// The configuration that features and package take from these settings: plain cotangent features, both kinds of which
    /// fill the range of tanh, scaled apart; no mixes, nothing cut.
    pub fn config(&self, base: &TrainConfig) -> TrainConfig {
        let mut config = base.clone();
        config.seed = self.seed;
        config.components = vec![self.component_count];
        config.scaling.rotation_reach = 0.95;
        config.scaling.stretch_weight = 0.0;
        config.features.weighting = Weighting::Cotangent;
        config.mixes.per_step = 0;
        config.refine.rounds = 0;
        config.encoder = EncoderKind::Paper;
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
            // The weights of the last of these are kept.
            validate_every: WINDOW.min(self.epochs.max(1)),
            patience: 0,
            activation: Activation::Plain,
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
/// usual evaluation measures, and how the training ended.
/// Errors: a loss that keeps overflowing, the reporter's wish to stop.
pub fn train(
    prepared: &Prepared,
    config: &TrainConfig,
    settings: &TanSettings,
    sequence_name: &str,
    train_shapes: &[usize],
    shape_count: usize,
    reporter: &dyn Reporter,
) -> Result<(AlignedBytes, Training), LearnError> {
    let vertex_count = prepared.rest.len();
    let mut shapes = vec![0.0; vertex_count * FEATURE_COUNT];
    for shape in prepared.network.iter() {
        shapes.extend_from_slice(shape.as_flattened());
    }
    let distances = |v: usize| prepared.distances(v);
    let input = FitInput {
        topology: &prepared.topology,
        vertex_weights: &vec![1.0; vertex_count],
        position_modes: &[],
        kept_roots: 0..0,
        distances: &distances,
    };
    let (mut plateau, mut level, mut asked) = (Plateau::default(), false, false);
    let mut observe = |progress: &FitProgress| {
        reporter.advance(progress.step as u64, &format!("loss {:.3}", progress.loss.sum()));
        level = plateau.is_level(f64::from(progress.loss.sum()));
        asked = reporter.stop_requested();
        if level || asked { Flow::Stop } else { Flow::Continue }
    };
    let outcome = fit(
        &input,
        random_start(vertex_count, &[settings.component_count], settings.seed),
        &config.fit,
        &mut FixedBatch::new(shapes),
        // Nothing is held out: the last weights count.
        &mut |_| f32::NAN,
        &mut observe,
        None,
    )?;
    if asked {
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
    let training = Training {
        epochs: outcome.steps_run,
        budget: settings.epochs,
        level,
        last_gain: plateau.last_gain,
    };
    Ok((bytes, training))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sinew_trainer::evaluate::{Evaluation, EvaluationInput, evaluate};
    use sinew_trainer::learn::Silent;
    use sinew_trainer::synthesize::{Settings, Subject};

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
            let prepared = Prepared::new(&sequence, &train_shapes, &config, &[], &Silent).expect("a usable bar");
            let (bytes, training) = train(&prepared, &config, &tan, "bar", &train_shapes, 6, &Silent).expect("trains");
            assert_eq!((training.epochs, training.level), (epochs, false));
            let input = EvaluationInput {
                package: &bytes,
                sequence: &sequence,
                test_shapes: &train_shapes[1..],
                trained_shapes: &[],
                settings: config.features,
                encoder: config.encoder_settings(),
            };
            let (evaluation, _) = evaluate(&input, &|_| ()).expect("measures");
            (evaluation, bytes)
        })
    }

    #[test]
    fn a_loss_that_stays_level_ends_the_training() {
        let mut plateau = Plateau::default();
        let falling = (0..1000).position(|n| plateau.is_level(0.99_f64.powi(n)));
        assert_eq!(falling, None, "a percent an epoch is not level");
        let level = (0..1000).position(|_| plateau.is_level(1e-5));
        assert_eq!(level, Some(LEVEL_WINDOWS * WINDOW - 1 + WINDOW));
        let training = |level| Training {
            epochs: 400,
            budget: 500,
            level,
            last_gain: Some(0.25),
        };
        assert!(training(true).to_string().contains("level after 400 of at most 500"));
        assert!(
            training(false).to_string().contains("budget of 500") && training(false).to_string().contains("25.0 %")
        );
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
