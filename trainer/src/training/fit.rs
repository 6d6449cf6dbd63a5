//! The training loop: every block of the stack jointly, or level by level; with validation, early stopping, rollback and exact resume.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crossbeam::channel::{Receiver, bounded};
use sinew_formats::package::FEATURE_COUNT;

use super::checkpoint;
use super::data::BatchSource;
use super::optimizer::Adam;
use super::schedule::Stage;
pub use super::terms::{
    Engine, FitInput, FitOutcome, FitProgress, FitSettings, Flow, HistoryPoint, StopReason, TrainingError,
};
use crate::network::kernel::Kernel;
use crate::network::loss::{LossSettings, LossTerms, SparsityRegions};
use crate::network::ring::RingMean;
use crate::network::stack::DifferentiableStack;
use crate::network::weights::StackWeights;

/// Learning rate times the root of V: 3e-4 at 1,500 vertices, 1.3e-4 at 8,400. Rows of C have unit length, so their
/// entries, and with them a sensible step, shrink with the root of V.
const RATE_TIMES_ROOT_V: f32 = 1.2e-2;
/// Returns to the best weights before the fit gives up.
const ROLLBACK_LIMIT: u32 = 8;

/// All that changes during a fit and that a checkpoint keeps, except the optimiser's moments.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FitState {
    pub(super) weights: StackWeights,
    pub(super) best: StackWeights,
    pub(super) best_validation: Option<f32>,
    pub(super) best_step: usize,
    pub(super) step: usize,
    /// Validations since the best.
    pub(super) stale: usize,
    pub(super) rate_scale: f32,
    pub(super) rollbacks: u32,
    pub(super) seconds: f64,
    pub(super) history: Vec<HistoryPoint>,
}

/// Trains `start`. Deterministic for the same input, settings and batches, whatever the number of threads, unless a time
/// budget or the observer ends it. With a checkpoint path, an existing file there is resumed (its caller removes it to
/// start over) and the state is written there now and then and at the end.
/// Errors: input that does not fit, a loss that keeps overflowing, a checkpoint of another fit or that cannot be written.
pub fn fit(
    input: &FitInput<'_>,
    start: StackWeights,
    settings: &FitSettings,
    batches: &mut dyn BatchSource,
    validate: &mut dyn FnMut(&StackWeights) -> f32,
    observer: &mut dyn FnMut(&FitProgress) -> Flow,
    checkpoints: Option<&Path>,
) -> Result<FitOutcome, TrainingError> {
    check(input, &start, settings)?;
    let supports = supports_of(&start);
    let row_len = start.vertex_count * FEATURE_COUNT;
    let kept_at = input.kept_roots.start * row_len..input.kept_roots.end * row_len;
    let kept = (kept_at.start, start.levels[0].blocks[0].components[kept_at].to_vec());
    let identity = checkpoint::identity(input, settings, &start);
    let resumed = match checkpoints {
        Some(path) if path.exists() => Some(checkpoint::read(path, identity, &start)?),
        _ => None,
    };
    let (state, optimizer) = resumed.unwrap_or_else(|| (first_state(start, settings, validate), Adam::default()));
    let supports = settings.keep_supports.then_some(supports);
    let first_step = state.step;
    let mut run = Run {
        network: Network::new(settings, input),
        regions: SparsityRegions::new(input.distances),
        supports,
        kept,
        settings,
        rate: settings
            .rate
            .unwrap_or(RATE_TIMES_ROOT_V / (input.topology.vertex_count as f32).sqrt()),
        state,
        optimizer,
        gradient: None,
        checkpoint: checkpoints.map(|path| (path.to_path_buf(), identity)),
        begun: Instant::now(),
    };
    let (sender, receiver) = bounded(1);
    let stop_reason = std::thread::scope(|scope| {
        scope.spawn(move || {
            // A closed channel means that the fit ended first.
            (first_step..settings.steps).try_for_each(|step| sender.send(batches.batch(step)))
        });
        run.steps(receiver, validate, observer)
    })?;
    let state = run.state;
    Ok(FitOutcome {
        weights: state.best,
        best_validation: state.best_validation,
        best_step: state.best_step,
        steps_run: state.step,
        history: state.history,
        rollbacks: state.rollbacks,
        stop_reason,
    })
}

fn first_state(
    mut start: StackWeights,
    settings: &FitSettings,
    validate: &mut dyn FnMut(&StackWeights) -> f32,
) -> FitState {
    if settings.loss.unit_rows {
        start.normalize_rows();
    }
    let best_validation = Some(validate(&start)).filter(|error| error.is_finite());
    FitState {
        best: start.clone(),
        weights: start,
        best_validation,
        best_step: 0,
        step: 0,
        stale: 0,
        rate_scale: 1.0,
        rollbacks: 0,
        seconds: 0.0,
        history: Vec::new(),
    }
}

/// Where the components are not zero, in the order of blocks, then `[K][V]`.
fn supports_of(weights: &StackWeights) -> Vec<bool> {
    let rows = weights
        .blocks()
        .flat_map(|block| block.components.as_chunks::<FEATURE_COUNT>().0);
    rows.map(|x| x.iter().any(|&x| x != 0.0)).collect()
}

fn clear_outside(weights: &mut StackWeights, supports: &[bool]) {
    let rows = weights
        .blocks_mut()
        .flat_map(|block| block.components.as_chunks_mut::<FEATURE_COUNT>().0);
    for (x, _) in rows.zip(supports).filter(|(_, inside)| !**inside) {
        *x = [0.0; FEATURE_COUNT];
    }
}

fn check(input: &FitInput<'_>, start: &StackWeights, settings: &FitSettings) -> Result<(), TrainingError> {
    let vertex_count = input.topology.vertex_count;
    let shape_len = vertex_count * FEATURE_COUNT;
    if !start.is_consistent() || !start.is_finite() {
        return Err(TrainingError::Start);
    }
    let lengths = [
        ("the start's C row", start.vertex_count * FEATURE_COUNT, shape_len),
        ("the list of vertex weights", input.vertex_weights.len(), vertex_count),
        (
            "the kept rows of the root block",
            input.kept_roots.end.min(start.levels[0].component_count),
            input.kept_roots.end,
        ),
        (
            "the list of position modes",
            input.position_modes.len(),
            input.position_modes.len() / shape_len * shape_len,
        ),
    ];
    for (what, found, expected) in lengths {
        if found != expected {
            return Err(TrainingError::Input {
                what,
                found,
                expected,
                vertex_count,
            });
        }
    }
    let positive = |value: f32| value.is_finite() && value > 0.0;
    let rules = [
        ("validate_every", settings.validate_every > 0, "it must be at least 1"),
        (
            "checkpoint_every",
            settings.checkpoint_every > 0,
            "it must be at least 1",
        ),
        ("rate", settings.rate.is_none_or(positive), "it must be positive"),
        (
            "final_share",
            positive(settings.final_share) && settings.final_share <= 1.0,
            "it must be in (0, 1]",
        ),
    ];
    match rules.into_iter().find(|(_, holds, _)| !holds) {
        Some((name, _, rule)) => Err(TrainingError::Setting { name, rule }),
        None => Ok(()),
    }
}

/// The network behind one of the engines.
enum Network {
    Kernel(Box<Kernel>),
    Tensors(Box<DifferentiableStack>),
}

impl Network {
    fn new(settings: &FitSettings, input: &FitInput<'_>) -> Self {
        let (attention, activation) = (settings.attention, settings.activation);
        let ring = RingMean::new(input.topology);
        let (vertex_weights, modes) = (input.vertex_weights, input.position_modes);
        match settings.engine {
            Engine::Kernel => Self::Kernel(Box::new(Kernel::new(
                ring,
                vertex_weights,
                modes,
                attention,
                activation,
            ))),
            Engine::Tensors => {
                let model = DifferentiableStack::new(&ring, vertex_weights, modes, attention, activation);
                Self::Tensors(Box::new(model))
            }
        }
    }

    /// Answers the loss and overwrites `gradient`, which has the shape of the weights.
    fn differentiate(
        &mut self,
        weights: &StackWeights,
        batch: &[f32],
        outside: &[Vec<bool>],
        settings: &LossSettings,
        gradient: &mut StackWeights,
    ) -> LossTerms {
        match self {
            Self::Kernel(kernel) => kernel.differentiate_into(weights, batch, outside, settings, gradient),
            Self::Tensors(model) => {
                let (loss, own) = model.differentiate(weights, batch, outside, settings);
                *gradient = own;
                loss
            }
        }
    }
}

struct Run<'a> {
    network: Network,
    regions: SparsityRegions<'a>,
    /// Where components may differ from zero, in the order of blocks, then `[K][V]`; everywhere where absent.
    supports: Option<Vec<bool>>,
    /// Where the rows that stay begin in the root block's C, and what they are.
    kept: (usize, Vec<f32>),
    settings: &'a FitSettings,
    rate: f32,
    state: FitState,
    optimizer: Adam,
    /// Of the last step, if that trained all levels: its memory serves the next.
    gradient: Option<StackWeights>,
    checkpoint: Option<(PathBuf, u64)>,
    begun: Instant,
}

impl Run<'_> {
    fn steps(
        &mut self,
        batches: Receiver<Vec<f32>>,
        validate: &mut dyn FnMut(&StackWeights) -> f32,
        observer: &mut dyn FnMut(&FitProgress) -> Flow,
    ) -> Result<StopReason, TrainingError> {
        let earlier_seconds = self.state.seconds;
        let patience = self.settings.patience;
        let stop_reason = loop {
            let stage = self.enter_stage();
            let last_level = stage.levels.end == self.state.weights.levels.len();
            if last_level && patience > 0 && self.state.stale >= patience {
                break StopReason::NoImprovement;
            }
            if self.state.step >= self.settings.steps {
                break StopReason::Finished;
            }
            if self
                .settings
                .time_budget_s
                .is_some_and(|budget| self.state.seconds >= budget)
            {
                break StopReason::OutOfTime;
            }
            let step = self.state.step;
            let batch = batches.recv().map_err(|_| TrainingError::NoBatch { step })?;
            let loss = self.step(&batch, &stage)?;
            let validation = self.validate(validate);
            self.state.seconds = earlier_seconds + self.begun.elapsed().as_secs_f64();
            self.state.history.push(HistoryPoint {
                step: self.state.step,
                loss,
                validation,
            });
            let flow = observer(&FitProgress {
                step: self.state.step,
                steps: self.settings.steps,
                loss,
                validation,
                best: self.state.best_validation,
                seconds: self.state.seconds,
                rollbacks: self.state.rollbacks,
            });
            if flow == Flow::Stop {
                break StopReason::Stopped;
            }
            if self.state.step.is_multiple_of(self.settings.checkpoint_every) {
                self.save()?;
            }
        };
        self.save()?;
        Ok(stop_reason)
    }

    /// The stage of the next step; the optimiser forgets what it knew of another stage.
    fn enter_stage(&mut self) -> Stage {
        let (step, step_count) = (self.state.step, self.settings.steps);
        let stage = self
            .settings
            .schedule
            .stage(step, step_count, self.state.weights.levels.len());
        if step == stage.steps.start && step > 0 {
            self.optimizer = Adam::default();
            self.state.stale = 0;
        }
        stage
    }

    /// One step, or a return to the best weights where the loss or its gradient is not finite.
    fn step(&mut self, batch: &[f32], stage: &Stage) -> Result<LossTerms, TrainingError> {
        let (settings, state) = (self.settings, &mut self.state);
        let shape_len = state.weights.vertex_count * FEATURE_COUNT;
        if batch.is_empty() || !batch.len().is_multiple_of(shape_len) {
            return Err(TrainingError::Batch {
                step: state.step,
                found: batch.len(),
                shape_len,
            });
        }
        let partial = (stage.levels.len() < state.weights.levels.len()).then(|| stage.network(&state.weights));
        let weights = partial.as_ref().unwrap_or(&state.weights);
        let outside = match settings.loss.sparsity_weight {
            0.0 => Vec::new(),
            _ => self.regions.outside(weights, &settings.loss),
        };
        let zeros = || StackWeights::zeros(weights.vertex_count, &weights.component_counts());
        let mut gradient = self.gradient.take().unwrap_or_else(zeros);
        let network = &mut self.network;
        let loss = network.differentiate(weights, batch, &outside, &settings.loss, &mut gradient);
        let is_partial = partial.is_some();
        if is_partial {
            gradient = stage.complete(gradient, &state.weights);
        }
        let done = state.step - stage.steps.start;
        let progress = done as f32 / stage.steps.len() as f32;
        let warmth = ((done + 1) as f32 / settings.warm_up.max(1) as f32).min(1.0);
        let rate = f64::from(self.rate * state.rate_scale * warmth * settings.final_share.powf(progress));
        let mut sound = loss.sum().is_finite() && gradient.is_finite();
        if sound {
            let component_rate = rate * f64::from(settings.component_rate_factor);
            let convolution_rate = rate * f64::from(settings.convolution_rate_factor);
            self.optimizer
                .step(&mut state.weights, &gradient, component_rate, convolution_rate);
            if let Some(supports) = &self.supports {
                clear_outside(&mut state.weights, supports);
            }
            if settings.loss.unit_rows {
                state.weights.normalize_rows();
            }
            let (at, kept) = &self.kept;
            state.weights.levels[0].blocks[0].components[*at..at + kept.len()].copy_from_slice(kept);
            sound = state.weights.is_finite();
        }
        self.gradient = Some(gradient).filter(|_| !is_partial);
        state.step += 1;
        if !sound {
            state.rollbacks += 1;
            if state.rollbacks > ROLLBACK_LIMIT {
                return Err(TrainingError::Diverged {
                    step: state.step,
                    rollbacks: state.rollbacks,
                });
            }
            state.rate_scale *= 0.5;
            state.weights.clone_from(&state.best);
            self.optimizer = Adam::default();
        }
        Ok(loss)
    }

    /// Measures the validation error where it is due, and keeps the best weights.
    fn validate(&mut self, validate: &mut dyn FnMut(&StackWeights) -> f32) -> Option<f32> {
        let state = &mut self.state;
        if !state.step.is_multiple_of(self.settings.validate_every) && state.step != self.settings.steps {
            return None;
        }
        let error = Some(validate(&state.weights)).filter(|error| error.is_finite());
        state.stale += 1;
        // Where nothing can be measured the latest weights are the best known.
        let unmeasured = error.is_none() && state.best_validation.is_none();
        if unmeasured || error.is_some_and(|error| state.best_validation.is_none_or(|best| error < best)) {
            state.best_validation = error;
            state.best_step = state.step;
            state.best.clone_from(&state.weights);
            state.stale = 0;
        }
        error
    }

    fn save(&self) -> Result<(), TrainingError> {
        if let Some((path, identity)) = &self.checkpoint {
            checkpoint::write(path, *identity, &self.state, &self.optimizer)?;
        }
        Ok(())
    }
}
