//! The stages of a training run: choosing how to mix and where to start, and fits of the network.

use core::time::Duration;
use std::sync::Arc;
use std::time::Instant;

use super::hold_out::HeldOut;
use super::prepare::Prepared;
use super::run_folder::{Plan, RunFolder};
use super::trial::Trial;
use super::{LearnError, Reporter, package};
use crate::components::embedding::Embedding;
use crate::components::mix::{MixSettings, Mixer};
use crate::components::random_start::random_start;
use crate::components::start::{StartInput, closed_form_start};
use crate::config::{StartKind, TrainConfig};
use crate::network::activation::Activation;
use crate::network::weights::StackWeights;
use crate::training::data::{BatchSource, ShapesSource};
use crate::training::fit::{FitInput, FitOutcome, FitProgress, FitSettings, Flow, StopReason, fit};

/// One fit: what it learns from.
pub(super) struct Fit<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) config: &'a TrainConfig,
    pub(super) plan: &'a Plan,
    pub(super) shapes: &'a [usize],
    pub(super) modes: &'a [f32],
}

/// One fit: when it ends and what it is called.
pub(super) struct FitBounds {
    pub(super) steps: usize,
    pub(super) budget: Option<Duration>,
    pub(super) name: &'static str,
    pub(super) file: &'static str,
}

/// Numbers of the mixes that the start sees, far from those that batches see.
const START_MIXES: u64 = 1 << 40;

/// Number of the first mix that seeds are chosen by, and how many: a dozen leave the choice to chance.
const SEED_MIXES: (u64, usize) = (1 << 42, 48);

/// The start. The closed form's faint parts are cut, and of `seed_count` seeds it is the one that plays unseen mixes best.
fn start(
    prepared: &Prepared,
    config: &TrainConfig,
    shapes: &[usize],
    mixes: &MixSettings,
    seed_count: usize,
    reporter: &dyn Reporter,
) -> Result<StackWeights, LearnError> {
    if config.start.kind == StartKind::Random {
        return Ok(random_start(prepared.rest.len(), &config.components, config.seed));
    }
    let unseen = prepared
        .mixer(shapes, mixes, config.seed)
        .mixes(SEED_MIXES.0, SEED_MIXES.1);
    let unseen: Vec<&[[f32; 9]]> = unseen.as_chunks::<9>().0.chunks(prepared.rest.len()).collect();
    let mut best: Option<(f32, StackWeights)> = None;
    for i in 0..seed_count as u64 {
        if reporter.stop_requested() {
            return Err(LearnError::Stopped);
        }
        let weights = start_of_seed(prepared, config, shapes, mixes, config.seed.wrapping_add(i))?;
        if seed_count == 1 {
            return Ok(weights);
        }
        let basis = package::draft(prepared, config, &weights, shapes)?;
        let error = Trial::new(prepared, config, &basis)?.error(&unseen, None)?;
        if best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, weights));
        }
        reporter.advance(i + 1, "");
    }
    best.map(|(_, weights)| weights).ok_or(LearnError::Stopped)
}

fn start_of_seed(
    prepared: &Prepared,
    config: &TrainConfig,
    shapes: &[usize],
    mixes: &MixSettings,
    seed: u64,
) -> Result<StackWeights, LearnError> {
    let samples = prepared
        .mixer(shapes, mixes, seed)
        .mixes(START_MIXES, config.start.samples);
    let metric = prepared.metric();
    let embedding = Embedding::new(&metric, prepared.position_weight);
    let input = StartInput {
        embedding: &embedding,
        samples: &samples,
        claims: &prepared.claims,
        kept: &prepared.kept_rows,
        component_counts: &config.components,
        attention: config.fit.attention,
        entry_budget: config.prune.entry_budget(prepared.rest.len()),
        rounds: config.start.rounds,
    };
    let mut weights = closed_form_start(&input);
    if config.fit.loss.unit_rows {
        weights.normalize_rows();
    }
    // The supports that the fit keeps are those of the package.
    package::draft(prepared, config, &weights, shapes)?.put_rows_into(&mut weights);
    Ok(weights)
}

/// Chooses how to mix by the error on the held-out shapes.
pub(super) fn choose(
    prepared: &Prepared,
    config: &TrainConfig,
    held_out: &HeldOut,
    fit_shapes: &[usize],
    deadline: Option<Instant>,
    reporter: &dyn Reporter,
) -> Result<Plan, LearnError> {
    let mut best = Plan {
        mixes: config.mixes.clone(),
        held_out_error: None,
        first_fit: None,
    };
    // A random start says nothing of the mixes.
    if held_out.is_empty() || config.mixes.per_step == 0 || config.start.kind == StartKind::Random {
        return Ok(best);
    }
    let candidates = candidates(config);
    reporter.stage("choosing how to mix", candidates.len() as u64);
    let mut least = f32::INFINITY;
    for (i, mixes) in candidates.into_iter().enumerate() {
        let weights = start(prepared, config, fit_shapes, &mixes, 1, reporter)?;
        let error = held_out.error(prepared, config, &weights)?;
        if error < least {
            least = error;
            best = Plan {
                mixes,
                held_out_error: Some(error),
                first_fit: None,
            };
        }
        reporter.advance(i as u64 + 1, &format!("held-out E_rms {least:.2}"));
        if deadline.is_some_and(|deadline| Instant::now() > deadline) {
            break;
        }
    }
    Ok(best)
}

/// What there is to choose from. Regions that the user asks for are not up for choice.
fn candidates(config: &TrainConfig) -> Vec<MixSettings> {
    let (own, standard) = (&config.mixes, MixSettings::default());
    let regions = |mixes: &MixSettings| (mixes.reach, mixes.regions_min, mixes.regions_max);
    if regions(own) != regions(&standard) || config.validation.mix_candidates.is_empty() {
        return vec![own.clone()];
    }
    let candidates = config.validation.mix_candidates.iter();
    candidates
        .map(|&(reach, regions_min, regions_max)| MixSettings {
            reach,
            regions_min,
            regions_max,
            ..own.clone()
        })
        .collect()
}

/// The start from all shapes, where no step follows it.
pub(super) fn start_alone(
    prepared: &Prepared,
    config: &TrainConfig,
    plan: &Plan,
    reporter: &dyn Reporter,
) -> Result<FitOutcome, LearnError> {
    let seeds = config.validation.start_seeds;
    reporter.stage("starting", seeds as u64);
    let all: Vec<usize> = (0..prepared.network.len()).collect();
    Ok(FitOutcome {
        weights: start(prepared, config, &all, &plan.mixes, seeds, reporter)?,
        best_validation: plan.held_out_error,
        best_step: 0,
        steps_run: 0,
        history: Vec::new(),
        rollbacks: 0,
        stop_reason: StopReason::Finished,
    })
}

pub(super) fn run_fit(
    job: &Fit<'_>,
    held_out: &HeldOut,
    bounds: FitBounds,
    folder: &RunFolder,
    reporter: &dyn Reporter,
) -> Result<FitOutcome, LearnError> {
    let Fit {
        prepared,
        config,
        plan,
        shapes,
        modes,
    } = *job;
    reporter.stage("starting", config.validation.start_seeds as u64);
    let weights = start(
        prepared,
        config,
        shapes,
        &plan.mixes,
        config.validation.start_seeds,
        reporter,
    )?;
    let mut batches: Box<dyn BatchSource> = if config.mixes.per_step > 0 {
        let mixer = prepared.mixer(shapes, &plan.mixes, config.seed);
        Box::new(MixBatches {
            mixer,
            per_step: config.mixes.per_step,
        })
    } else {
        Box::new(shapes_source(prepared, config, shapes))
    };
    let distances = |v: usize| prepared.distances(v);
    let vertex_weights = if config.fit.loss.weigh_by_area {
        prepared.areas.clone()
    } else {
        vec![1.0; prepared.areas.len()]
    };
    let input = FitInput {
        topology: &prepared.topology,
        vertex_weights: &vertex_weights,
        position_modes: modes,
        kept_roots: prepared.kept_roots(),
        distances: &distances,
    };
    let settings = FitSettings {
        steps: planned_steps(prepared, config, shapes),
        time_budget_s: bounds.budget.map(|budget| budget.as_secs_f64()),
        ..config.fit.clone()
    };
    reporter.stage(bounds.name, bounds.steps as u64);
    let checkpoint = folder.file(bounds.file);
    let mut failure = None;
    let mut measured = checkpoint.as_ref().is_some_and(|path| path.exists());
    let mut validate = |weights: &StackWeights| {
        if held_out.is_empty() {
            return f32::NAN;
        }
        match held_out.error(prepared, config, weights) {
            Ok(error) => {
                measured = true;
                error
            }
            // Weights gone wild make no package; those before them did.
            Err(LearnError::Package(_)) if measured => f32::NAN,
            Err(error) => {
                failure = Some(error);
                f32::NAN
            }
        }
    };
    let mut rollbacks = 0;
    let mut observe = |progress: &FitProgress| {
        let mut note = format!("loss {:.4}", progress.loss.sum());
        if let Some(best) = progress.best {
            note += &format!(", held-out E_rms {best:.2}");
        }
        reporter.advance(progress.step as u64, &note);
        if progress.rollbacks > rollbacks {
            rollbacks = progress.rollbacks;
            reporter.notice(&format!(
                "step {}: the loss is no longer a number; back to the best weights so far, at half the learning rate",
                progress.step
            ));
        }
        if reporter.stop_requested() || progress.step >= bounds.steps {
            Flow::Stop
        } else {
            Flow::Continue
        }
    };
    let outcome = fit(
        &input,
        weights,
        &settings,
        &mut *batches,
        &mut validate,
        &mut observe,
        checkpoint.as_deref(),
    );
    if let Some(error) = failure {
        return Err(error);
    }
    let mut outcome = outcome?;
    if outcome.stop_reason == StopReason::Stopped {
        if outcome.steps_run < bounds.steps {
            return Err(LearnError::Stopped);
        }
        outcome.stop_reason = StopReason::Finished;
    }
    Ok(outcome)
}

/// The shapes themselves; with the reference, where nothing in the network gives it back for free.
fn shapes_source(prepared: &Prepared, config: &TrainConfig, shapes: &[usize]) -> ShapesSource {
    let with_reference = config.fit.activation == Activation::Plain;
    ShapesSource::new(Arc::clone(&prepared.network), shapes, with_reference, config.seed)
}

/// Steps of the optimiser: those of the settings, or as many as their passes over the shapes take.
pub(super) fn planned_steps(prepared: &Prepared, config: &TrainConfig, shapes: &[usize]) -> usize {
    let steps = config.fit.steps;
    if config.mixes.per_step > 0 {
        steps
    } else {
        steps.saturating_mul(shapes_source(prepared, config, shapes).steps_of_a_pass())
    }
}

/// Fresh mixes for every step.
struct MixBatches {
    mixer: Mixer,
    per_step: usize,
}

impl BatchSource for MixBatches {
    fn batch(&mut self, step: usize) -> Vec<f32> {
        self.mixer.mixes((step * self.per_step) as u64, self.per_step)
    }
}

/// Why a fit ended, for people.
pub(super) fn in_words(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Finished => "all steps done",
        StopReason::NoImprovement => "held-out error stopped improving",
        StopReason::OutOfTime => "time budget spent",
        StopReason::Stopped => "stopped",
    }
}
