//! What a fit is given and what it answers: settings, the mesh, progress, outcome, errors.

use core::ops::Range;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::checkpoint::CheckpointError;
use super::schedule::Schedule;
use crate::mesh::topology::Topology;
use crate::network::activation::Activation;
use crate::network::attention::Attention;
use crate::network::loss::{LossSettings, LossTerms};
use crate::network::weights::StackWeights;

/// What computes loss and gradients; both answer the same numbers up to rounding.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Engine {
    /// The fused kernel on the CPU.
    #[default]
    Kernel,
    /// burn's tensors on the training device.
    Tensors,
}

/// How to train.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FitSettings {
    /// Steps of the optimiser; 0 leaves the start as it is. The rate's decay is planned over them. Where a training job learns from the shapes themselves
    /// and not from mixes, passes over all of them: each as many steps as batches hold the shapes.
    pub steps: usize,
    /// Learning rate at the first step; by the number of vertices (1.2e-2 / √V) where absent.
    pub rate: Option<f32>,
    /// Multiplies the rate for C.
    pub component_rate_factor: f32,
    /// Multiplies the rate for the convolutions.
    pub convolution_rate_factor: f32,
    /// The rate decays exponentially to this share at the last step, in (0, 1].
    pub final_share: f32,
    /// Steps over which the rate rises from nothing to its full size: Adam's first steps are as long as any, whatever the
    /// gradient, and would throw a good start away.
    pub warm_up: usize,
    /// Components stay zero at the vertices where they start at zero: what is far from a component cannot creep into it,
    /// and the package stays as small as its start.
    pub keep_supports: bool,
    /// Steps between two looks at the validation error.
    pub validate_every: usize,
    /// Validations without improvement after which the fit stops; 0 for never.
    pub patience: usize,
    /// Seconds after which the fit stops, resumed time included. A fit bounded by time is not reproducible to the bit.
    pub time_budget_s: Option<f64>,
    /// Steps between two checkpoints.
    pub checkpoint_every: usize,
    /// What computes loss and gradients.
    pub engine: Engine,
    /// Which levels train when.
    pub schedule: Schedule,
    /// How residuals are shared out among the blocks below.
    pub attention: Attention,
    /// What follows a convolution.
    pub activation: Activation,
    /// What to minimise.
    pub loss: LossSettings,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            steps: 0,
            rate: None,
            component_rate_factor: 1.0,
            convolution_rate_factor: 0.3,
            final_share: 0.01,
            warm_up: 20,
            keep_supports: true,
            validate_every: 20,
            patience: 5,
            time_budget_s: None,
            checkpoint_every: 50,
            engine: Engine::Kernel,
            schedule: Schedule::Joint,
            attention: Attention::Components,
            activation: Activation::FromRest,
            loss: LossSettings::local(),
        }
    }
}

/// The mesh as the fit needs it. V vertices.
pub struct FitInput<'a> {
    /// One-rings of the reference shape.
    pub topology: &'a Topology,
    /// Weight of each vertex in all norms: areas, mean one. Shape: `[V]`.
    pub vertex_weights: &'a [f32],
    /// The g_i of the position term; empty for none. Shape: `[I][V][9]`.
    pub position_modes: &'a [f32],
    /// Components of the root block that stay as the start has them.
    pub kept_roots: Range<usize>,
    /// Geodesic distances from a vertex as a share of the mesh's largest, shape `[V]`; asked for at most once a vertex.
    pub distances: &'a (dyn Fn(usize) -> Vec<f32> + Sync),
}

/// Whether to go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Take the next step.
    Continue,
    /// Write a checkpoint and return.
    Stop,
}

/// One point of the training curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HistoryPoint {
    /// Steps taken.
    pub step: usize,
    /// The loss on this step's shapes, before the step.
    pub loss: LossTerms,
    /// The validation error after the step, where it was measured and finite.
    pub validation: Option<f32>,
}

/// What an observer sees after every step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitProgress {
    /// Steps taken, from 1.
    pub step: usize,
    /// Steps planned.
    pub steps: usize,
    /// The loss on this step's shapes, before the step.
    pub loss: LossTerms,
    /// The validation error after the step, where it was measured and finite.
    pub validation: Option<f32>,
    /// The best validation error so far.
    pub best: Option<f32>,
    /// Seconds spent, resumed time included.
    pub seconds: f64,
    /// Times the loss stopped being a number and the fit went back to its best weights at half the rate.
    pub rollbacks: u32,
}

/// Why a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// All planned steps are done.
    Finished,
    /// The validation error stopped improving.
    NoImprovement,
    /// The time budget is spent.
    OutOfTime,
    /// The observer asked to stop.
    Stopped,
}

/// What a fit leaves.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The weights with the least validation error, the start included; the latest where none was ever finite.
    pub weights: StackWeights,
    /// Their validation error, where one was finite.
    pub best_validation: Option<f32>,
    /// Steps behind them.
    pub best_step: usize,
    /// Steps taken in all.
    pub steps_run: usize,
    /// The training curve.
    pub history: Vec<HistoryPoint>,
    /// Times the fit went back to its best weights.
    pub rollbacks: u32,
    /// Why it ended.
    pub stop_reason: StopReason,
}

/// Why a fit cannot go on.
#[derive(Debug, Error)]
pub enum TrainingError {
    /// The start is no complete stack, or not finite.
    #[error("the weights to start from are not a complete, finite stack of blocks")]
    Start,
    /// A part of the input does not fit the mesh.
    #[error("{what} has {found} numbers where the mesh of {vertex_count} vertices asks for {expected}")]
    Input {
        /// Which part.
        what: &'static str,
        /// Its length.
        found: usize,
        /// What was needed.
        expected: usize,
        /// V.
        vertex_count: usize,
    },
    /// A setting is outside its range.
    #[error("the training setting `{name}` is out of range: {rule}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// What it must be.
        rule: &'static str,
    },
    /// The batch source ended before the fit did.
    #[error("no shapes came for step {step}: their source stopped early")]
    NoBatch {
        /// The step that waited.
        step: usize,
    },
    /// A batch is empty or does not fit the mesh.
    #[error("the shapes of step {step} have {found} numbers, not a positive multiple of {shape_len}")]
    Batch {
        /// The step.
        step: usize,
        /// Length of the batch.
        found: usize,
        /// 9 V.
        shape_len: usize,
    },
    /// The loss keeps overflowing.
    #[error(
        "the loss stopped being a number {rollbacks} times, last at step {step}: lower the learning rate, or look for broken shapes"
    )]
    Diverged {
        /// The step at which the fit gave up.
        step: usize,
        /// Returns to the best weights.
        rollbacks: u32,
    },
    /// A checkpoint cannot be read or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}
