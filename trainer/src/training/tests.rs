//! The training loop on a tiny strip: it learns, resumes to the bit, does not depend on threads, and survives bad batches.

use std::fs;
use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_formats::package::FEATURE_COUNT;

use super::data::{BatchSource, FixedBatch};
use super::fit::{Engine, FitInput, FitOutcome, FitSettings, Flow, StopReason, TrainingError, fit};
use super::schedule::Schedule;
use crate::mesh::topology::{Topology, TopologyFindings};
use crate::network::weights::StackWeights;

/// More than one chunk of vertices, so that sums over chunks are really taken.
const VERTEX_COUNT: usize = 300;

fn strip() -> Topology {
    let last = VERTEX_COUNT as u32 - 1;
    let ring = (0..=last)
        .flat_map(|v| [v.checked_sub(1), (v < last).then_some(v + 1)])
        .flatten()
        .collect();
    let ring_offsets = (0..=last + 1)
        .map(|v| (2 * v).saturating_sub(1).min(2 * last))
        .collect();
    Topology {
        vertex_count: VERTEX_COUNT,
        faces: Vec::new(),
        ring_offsets,
        ring,
        piece_of: Vec::new(),
        bridges: Vec::new(),
        findings: TopologyFindings::default(),
    }
}

/// Smooth bumps whose sizes are drawn by the step.
struct Bumps;

impl BatchSource for Bumps {
    fn batch(&mut self, step: usize) -> Vec<f32> {
        let mut random = ChaCha8Rng::seed_from_u64(step as u64);
        let shape = |random: &mut ChaCha8Rng| {
            let sizes: [f32; 3] = core::array::from_fn(|_| random.random_range(-0.4..0.4));
            (0..VERTEX_COUNT * FEATURE_COUNT)
                .map(move |at| {
                    let (v, c) = ((at / FEATURE_COUNT) as f32 / VERTEX_COUNT as f32, at % FEATURE_COUNT);
                    let bump = |centre: f32| (-(v - centre).powi(2) / 0.01).exp();
                    sizes[c % 3] * bump(0.2 + 0.3 * (c % 3) as f32)
                })
                .collect::<Vec<f32>>()
        };
        (0..5).flat_map(|_| shape(&mut random)).collect()
    }
}

fn start() -> StackWeights {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut weights = StackWeights::zeros(VERTEX_COUNT, &[3, 2]);
    for block in weights.blocks_mut() {
        block
            .components
            .iter_mut()
            .for_each(|value| *value = random.random_range(-1.0..1.0));
        for convolution in [&mut block.encoder, &mut block.decoder] {
            (0..FEATURE_COUNT).for_each(|c| convolution.point[c][c] = 1.0);
        }
    }
    weights
}

fn settings(steps: usize) -> FitSettings {
    FitSettings {
        steps,
        validate_every: 2,
        patience: 0,
        checkpoint_every: 2,
        rate: Some(2e-3),
        ..FitSettings::default()
    }
}

fn train(
    settings: &FitSettings,
    batches: &mut dyn BatchSource,
    validate: &mut dyn FnMut(&StackWeights) -> f32,
    stop_at: Option<usize>,
    checkpoint: Option<&Path>,
) -> Result<FitOutcome, TrainingError> {
    let topology = strip();
    let mode: Vec<f32> = (0..VERTEX_COUNT * FEATURE_COUNT)
        .map(|at| if at % FEATURE_COUNT == 1 { 0.05 } else { 0.0 })
        .collect();
    let input = FitInput {
        topology: &topology,
        vertex_weights: &[1.0; VERTEX_COUNT],
        position_modes: &mode,
        kept_roots: 0..0,
        distances: &|centre| {
            (0..VERTEX_COUNT)
                .map(|v| v.abs_diff(centre) as f32 / VERTEX_COUNT as f32)
                .collect()
        },
    };
    let mut observer = |progress: &super::fit::FitProgress| {
        if Some(progress.step) == stop_at {
            Flow::Stop
        } else {
            Flow::Continue
        }
    };
    fit(&input, start(), settings, batches, validate, &mut observer, checkpoint)
}

/// A validation error that falls with every call, so that the last weights are the ones kept.
fn falling() -> impl FnMut(&StackWeights) -> f32 {
    let mut calls = 0.0;
    move |_| {
        calls += 1.0;
        -calls
    }
}

/// A validation error that is a function of the weights, as a real one is.
fn of_weights(weights: &StackWeights) -> f32 {
    weights.levels[0].blocks[0].components[1000].abs()
}

#[test]
fn training_lowers_the_loss() {
    let settings = FitSettings {
        rate: Some(5e-3),
        ..settings(150)
    };
    let outcome = train(&settings, &mut Bumps, &mut falling(), None, None).unwrap();
    let loss = |range: core::ops::Range<usize>| -> f32 { outcome.history[range].iter().map(|p| p.loss.total).sum() };
    assert_eq!((outcome.steps_run, outcome.stop_reason), (150, StopReason::Finished));
    assert!(
        loss(140..150) < 0.5 * loss(0..10),
        "from {} to {}",
        loss(0..10),
        loss(140..150)
    );
}

#[test]
fn levels_train_one_after_the_other_where_asked() {
    let settings = FitSettings {
        schedule: Schedule::LevelByLevel,
        keep_supports: false,
        ..settings(8)
    };
    let begun = {
        let mut start = start();
        start.normalize_rows();
        start
    };
    let half = train(&settings, &mut Bumps, &mut |_| f32::NAN, Some(4), None).unwrap();
    let whole = train(&settings, &mut Bumps, &mut |_| f32::NAN, None, None).unwrap();
    let change = |a: &StackWeights, b: &StackWeights, l: usize| -> f32 {
        let rows = |weights: &StackWeights| {
            weights.levels[l]
                .blocks
                .iter()
                .flat_map(|block| block.components.clone())
                .collect::<Vec<_>>()
        };
        rows(a)
            .iter()
            .zip(rows(b))
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max)
    };
    // A row of unit length is scaled to unit length again after every step.
    let still = 1e-6;
    assert!(change(&begun, &half.weights, 0) > 1e-5 && change(&begun, &half.weights, 1) < still);
    assert!(change(&half.weights, &whole.weights, 0) < still && change(&half.weights, &whole.weights, 1) > 1e-5);

    // Stopped within the second level and resumed, it is the same fit.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fit.checkpoint");
    for stop_at in [Some(4), Some(6), None] {
        let part = train(&settings, &mut Bumps, &mut |_| f32::NAN, stop_at, Some(&path)).unwrap();
        if stop_at.is_none() {
            assert_eq!(part.history, whole.history);
            assert_eq!(part.weights, whole.weights);
        }
    }
}

#[test]
fn a_stopped_and_resumed_fit_equals_an_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fit.checkpoint");
    let whole = train(&settings(8), &mut Bumps, &mut of_weights, None, None).unwrap();
    let first = train(&settings(8), &mut Bumps, &mut of_weights, Some(3), Some(&path)).unwrap();
    assert_eq!((first.steps_run, first.stop_reason), (3, StopReason::Stopped));
    let resumed = train(&settings(8), &mut Bumps, &mut of_weights, None, Some(&path)).unwrap();
    assert_eq!(resumed.weights, whole.weights);
    assert_eq!(resumed.history, whole.history);
    assert_eq!(
        (resumed.best_step, resumed.best_validation),
        (whole.best_step, whole.best_validation)
    );
    let again = train(&settings(8), &mut Bumps, &mut of_weights, None, Some(&path)).unwrap();
    assert_eq!(
        again.weights, whole.weights,
        "a finished fit is read back, not trained on"
    );
}

#[test]
fn the_number_of_threads_does_not_show() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| train(&settings(4), &mut Bumps, &mut falling(), None, None).unwrap())
    };
    let (one, two) = (with(1), with(2));
    assert_eq!(one.weights, two.weights);
    assert_eq!(one.history, two.history);
}

#[test]
fn a_checkpoint_that_is_damaged_or_of_another_fit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fit.checkpoint");
    train(&settings(2), &mut Bumps, &mut of_weights, None, Some(&path)).unwrap();
    let refusal = |settings: &FitSettings| {
        train(settings, &mut Bumps, &mut of_weights, None, Some(&path))
            .unwrap_err()
            .to_string()
    };
    assert!(refusal(&settings(3)).contains("other settings"));
    let sound = fs::read(&path).unwrap();
    for at in (0..32).chain([40, 100, sound.len() / 2, sound.len() - 1]) {
        let mut bytes = sound.clone();
        bytes[at] ^= 1;
        fs::write(&path, bytes).unwrap();
        assert!(refusal(&settings(2)).contains("checkpoint"), "byte {at}");
    }
    for len in [0, 7, 31, 32, 100, sound.len() - 1] {
        fs::write(&path, &sound[..len]).unwrap();
        assert!(refusal(&settings(2)).contains("not a usable checkpoint"), "{len} bytes");
    }
}

#[test]
fn the_best_weights_are_kept_and_patience_ends_the_fit() {
    let settings = FitSettings {
        patience: 2,
        ..settings(50)
    };
    let mut errors = [3.0, 1.0, 2.0, 2.0].into_iter();
    let outcome = train(&settings, &mut Bumps, &mut |_| errors.next().unwrap(), None, None).unwrap();
    assert_eq!((outcome.best_step, outcome.best_validation), (2, Some(1.0)));
    assert_eq!((outcome.steps_run, outcome.stop_reason), (6, StopReason::NoImprovement));
}

#[test]
fn a_spent_time_budget_ends_the_fit_between_steps() {
    let settings = FitSettings {
        time_budget_s: Some(1e-9),
        ..settings(50)
    };
    let outcome = train(&settings, &mut Bumps, &mut falling(), None, None).unwrap();
    assert_eq!((outcome.steps_run, outcome.stop_reason), (1, StopReason::OutOfTime));
}

/// Spoils the shapes of one step.
struct Spoilt(usize);

impl BatchSource for Spoilt {
    fn batch(&mut self, step: usize) -> Vec<f32> {
        let mut shapes = Bumps.batch(step);
        if step >= self.0 {
            shapes[17] = f32::NAN;
        }
        if step > self.0 + 20 {
            shapes.pop();
        }
        shapes
    }
}

#[test]
fn bad_batches_are_rolled_back_and_many_of_them_end_the_fit() {
    let once = train(&settings(3), &mut Spoilt(2), &mut falling(), None, None).unwrap();
    assert_eq!(once.rollbacks, 1);
    assert!(once.weights.is_finite());
    let error = train(&settings(40), &mut Spoilt(2), &mut falling(), None, None).unwrap_err();
    assert!(matches!(error, TrainingError::Diverged { step: 11, .. }), "{error}");
    let error = train(
        &settings(4),
        &mut FixedBatch::new(vec![0.0; 5]),
        &mut falling(),
        None,
        None,
    )
    .unwrap_err();
    assert!(
        matches!(error, TrainingError::Batch { step: 0, found: 5, .. }),
        "{error}"
    );
}

/// Adam divides by the gradient's size, so a rounding of a vanishing gradient becomes a step of a rate; few do.
const ENGINE_TOLERANCE: f32 = 1e-3;

#[test]
fn both_engines_walk_the_same_way() {
    let with = |engine| {
        train(
            &FitSettings { engine, ..settings(3) },
            &mut Bumps,
            &mut falling(),
            None,
            None,
        )
        .unwrap()
    };
    let (kernel, tensors) = (with(Engine::Kernel), with(Engine::Tensors));
    for (found, expected) in kernel.history.iter().zip(&tensors.history) {
        let (found, expected) = (found.loss.sum(), expected.loss.sum());
        assert!(
            (found - expected).abs() <= ENGINE_TOLERANCE * expected,
            "{found}, expected {expected}"
        );
    }
}
