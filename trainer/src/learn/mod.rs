//! The whole training job: from a sequence to a compact package. Everything the command does between reading files and
//! writing one is here, so that tests and other programs can do it too.
//!
//! Path of data: what the user keeps of older packages, [`mod@review`] (which shapes are of use) -> [`prepare`] (topology,
//! features, distances) -> choose how to mix, by held-out shapes ([`hold_out`]) -> the closed-form start, and steps of the optimiser
//! where they are asked for -> [`mod@refine`] -> [`package`] (extract, prune, measure).

pub mod draft;
pub mod hold_out;
pub mod package;
mod pieces;
pub mod prepare;
mod prior;
pub mod refine;
pub mod review;
pub mod run_folder;
mod stages;
pub mod trial;

use core::time::Duration;
use std::path::PathBuf;
use std::time::Instant;

use sinew_formats::package::{AlignedBytes, CompactView, Quality, WriteError};
use sinew_interchange::MeshSequence;

use crate::bake::BakeError;
use crate::components::kept::{self, KeepError, row_behind};
use crate::components::painted::{PaintError, painted_labels};
use crate::components::position_modes::{keep_linear_algebra_serial, position_modes};
use crate::config::{StartKind, TrainConfig};
use crate::evaluate::PlayError;
use crate::mesh::sparse_factor::FactorError;
use crate::network::weights::StackWeights;
use crate::training::fit::{FitOutcome, HistoryPoint, TrainingError};
use draft::PackageError;
use hold_out::HeldOut;
use prepare::Prepared;
use review::review;
use run_folder::{Plan, RunFolder, RunFolderError};
use stages::{Fit, FitBounds, choose, in_words, run_fit};

/// Share of a time budget that choosing a start may take.
const CHOOSING_SHARE: f64 = 0.25;

/// Hears how the job goes, from any thread, and may ask it to stop.
pub trait Reporter: Sync {
    /// A stage of `total` parts begins.
    fn stage(&self, name: &str, total: u64);
    /// `done` of its parts are done; `note` says what a user may want to see beside the bar.
    fn advance(&self, done: u64, note: &str);
    /// Something that the user should know and can keep.
    fn notice(&self, text: &str);
    /// Whether to stop at the next chance.
    fn stop_requested(&self) -> bool;
}

/// Hears nothing, never stops.
pub struct Silent;

impl Reporter for Silent {
    fn stage(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64, _: &str) {}
    fn notice(&self, _: &str) {}
    fn stop_requested(&self) -> bool {
        false
    }
}

/// What decides how a run goes, but not what an unbounded one learns.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// Bounds choosing and fitting; `None` runs all steps.
    pub time_budget: Option<Duration>,
    /// Where checkpoints are kept, and looked for; `None` keeps none.
    pub work_folder: Option<PathBuf>,
}

/// What a run gives.
#[derive(Debug)]
pub struct Learned {
    /// The compact package.
    pub package: AlignedBytes,
    /// K, after redundant ones went.
    pub component_count: usize,
    /// Redundant components that were removed.
    pub removed_count: usize,
    /// The configuration with what was chosen filled in.
    pub config: TrainConfig,
    /// Loss and validation by step, of the fit whose weights were kept.
    pub history: Vec<HistoryPoint>,
    /// Optimiser steps run in all.
    pub steps_run: usize,
    /// Why fitting ended, in words.
    pub stop_reason: String,
    /// Held-out E_rms at the start and at its best; `None` where nothing was held out.
    pub validation: Option<(f32, f32)>,
}

/// Why a run fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// The reporter asked for it; checkpoints are kept.
    #[error("the run was stopped")]
    Stopped,
    /// Too little to learn from.
    #[error(
        "{found} training shapes besides the reference: at least {needed} are needed; choose more shapes (--train-every, --train-list)"
    )]
    TooFewShapes {
        /// Shapes other than the reference.
        found: usize,
        /// What is needed.
        needed: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of {shape} is at no finite place: mend the shape, or leave it out with --train-list")]
    NotFinite {
        /// Number and name of the shape.
        shape: String,
        /// Its first such vertex.
        vertex: usize,
    },
    /// All training shapes equal the reference.
    #[error("no vertex moves in any of the {shapes} training shapes: there is nothing to learn")]
    NothingMoves {
        /// N.
        shapes: usize,
    },
    /// A painted region does not fit the mesh or the components.
    #[error(transparent)]
    Paint(#[from] PaintError),
    /// A component of an older package cannot be kept.
    #[error(transparent)]
    Keep(#[from] KeepError),
    /// Features go to a file where they are many, and there is no room for it.
    #[error(
        "the features of the training shapes cannot be kept in {}: {source}; make room there, or name another folder in TMPDIR",
        std::env::temp_dir().display()
    )]
    Store {
        /// As it says.
        source: std::io::Error,
    },
    /// The mesh's matrix cannot be factored.
    #[error("the mesh cannot be solved on: {0}")]
    Factor(#[from] FactorError),
    /// The optimiser fails, or its checkpoint does not fit.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The run's folder cannot be used.
    #[error(transparent)]
    RunFolder(#[from] RunFolderError),
    /// The learned basis cannot be written or measured.
    #[error(transparent)]
    Package(#[from] PackageError),
}

impl From<BakeError> for LearnError {
    fn from(error: BakeError) -> Self {
        Self::Package(error.into())
    }
}

impl From<WriteError> for LearnError {
    fn from(error: WriteError) -> Self {
        Self::Package(error.into())
    }
}

impl From<PlayError> for LearnError {
    fn from(error: PlayError) -> Self {
        Self::Package(error.into())
    }
}

/// Learns a package from the shapes of `sequence` that `train_shapes` lists (ascending; shape 0 is the reference either way).
/// The same input, configuration and seed give the same bytes unless `time_budget` cuts the run short.
pub fn learn(
    sequence: &MeshSequence,
    train_shapes: &[usize],
    config: &TrainConfig,
    options: &RunOptions,
    reporter: &dyn Reporter,
) -> Result<Learned, LearnError> {
    keep_linear_algebra_serial();
    let started = Instant::now();
    painted_labels(&config.start.painted, sequence.vertex_count(), config.components[0])?;
    if config.start.kind == StartKind::Random && !config.start.painted.is_empty() {
        return Err(PaintError::RandomStart.into());
    }
    if config.start.kind == StartKind::Random && !config.start.kept.is_empty() {
        return Err(KeepError::RandomStart.into());
    }
    let kept = kept::read(
        &config.start.kept,
        &config.start.painted,
        config.components[0],
        sequence,
    )?;
    let reviewed = review(sequence, train_shapes, config.component_count())?;
    reviewed.notices.iter().for_each(|notice| reporter.notice(notice));
    let prepared = Prepared::new(sequence, &reviewed.shapes, config, &kept, reporter)?;
    let mut folder = RunFolder::open(options.work_folder.as_deref(), &prepared.fingerprint(config))?;
    let held_out = HeldOut::choose(&prepared, &config.validation);
    let fit_shapes = held_out.rest_of(prepared.network.len());

    let plan = match folder.plan() {
        Some(plan) => plan,
        None => {
            let deadline = options
                .time_budget
                .map(|budget| started + budget.mul_f64(CHOOSING_SHARE));
            let plan = choose(&prepared, config, &held_out, &fit_shapes, deadline, reporter)?;
            folder.keep_plan(&plan)?;
            plan
        }
    };
    let mut config = config.clone();
    config.mixes = plan.mixes.clone();

    if config.fit.steps == 0 {
        let outcome = stages::start_alone(&prepared, &config, &plan, reporter)?;
        let mut learned = finish(&prepared, &config, sequence, train_shapes, outcome, 0, reporter)?;
        learned.stop_reason = "the closed form, refined".to_owned();
        return Ok(learned);
    }
    reporter.stage("position modes", 1);
    let modes = position_modes(
        &prepared.system,
        &prepared.scaler,
        config.start.position_modes,
        config.seed,
    );
    let left = |started: Instant| {
        options
            .time_budget
            .map(|budget| budget.saturating_sub(started.elapsed()))
    };
    let refits = !held_out.is_empty() && prepared.network.len() <= config.validation.refit_shapes_max;

    // First fit: with validation where there is some.
    let first = match plan.first_fit.clone() {
        Some(first) => first,
        None => {
            let budget = left(started).map(|left| if refits { left.mul_f64(0.5) } else { left });
            let outcome = run_fit(
                &Fit {
                    prepared: &prepared,
                    config: &config,
                    plan: &plan,
                    shapes: &fit_shapes,
                    modes: &modes,
                },
                &held_out,
                FitBounds {
                    steps: stages::planned_steps(&prepared, &config, &fit_shapes),
                    budget,
                    name: "training",
                    file: "first.checkpoint",
                },
                &folder,
                reporter,
            )?;
            if !refits {
                return finish(&prepared, &config, sequence, train_shapes, outcome, 0, reporter);
            }
            let first = run_folder::FirstFit {
                best_step: outcome.best_step,
                steps_run: outcome.steps_run,
                validation: hold_out::first_and_best(&outcome.history),
                stop_reason: in_words(outcome.stop_reason).to_owned(),
            };
            folder.keep_plan(&Plan {
                first_fit: Some(first.clone()),
                ..plan.clone()
            })?;
            first
        }
    };
    // Second fit: all shapes, as many steps as the first found best.
    let mut outcome = run_fit(
        &Fit {
            prepared: &prepared,
            config: &config,
            plan: &plan,
            shapes: &(0..prepared.network.len()).collect::<Vec<_>>(),
            modes: &modes,
        },
        &HeldOut::none(),
        FitBounds {
            steps: first.best_step,
            budget: left(started),
            name: "training on all shapes",
            file: "second.checkpoint",
        },
        &folder,
        reporter,
    )?;
    outcome.best_validation = first.validation.map(|(_, best)| best);
    let mut learned = finish(
        &prepared,
        &config,
        sequence,
        train_shapes,
        outcome,
        first.steps_run,
        reporter,
    )?;
    learned.validation = first.validation;
    learned.stop_reason = first.stop_reason;
    Ok(learned)
}

fn finish(
    prepared: &Prepared,
    config: &TrainConfig,
    sequence: &MeshSequence,
    train_shapes: &[usize],
    outcome: FitOutcome,
    earlier_steps: usize,
    reporter: &dyn Reporter,
) -> Result<Learned, LearnError> {
    let all: Vec<usize> = (0..prepared.network.len()).collect();
    let mut weights = outcome.weights;
    restore_kept(prepared, config, &mut weights);
    let weights = refine::refine(prepared, config, &all, weights, reporter)?;
    reporter.stage("packaging", 1);
    let quality = Quality {
        validation_e_rms: outcome.best_validation.filter(|e| e.is_finite()).unwrap_or(-1.0),
        steps: outcome.best_step as u32,
        steps_run: (outcome.steps_run + earlier_steps) as u32,
    };
    let (package, component_count, removed_count) = package::package(
        prepared,
        config,
        &sequence.name,
        train_shapes,
        sequence.shape_count(),
        &weights,
        quality,
    )?;
    reporter.advance(1, "");
    let view = CompactView::open(&package).map_err(PackageError::from)?;
    for region in &config.start.painted {
        if !view.components().any(|component| component.name == region.name) {
            reporter.notice(&format!(
                "no component is called `{}`: too little moves on that painted region to be worth one",
                region.name
            ));
        }
    }
    Ok(Learned {
        package,
        component_count,
        removed_count,
        config: config.clone(),
        validation: hold_out::first_and_best(&outcome.history).or(outcome.best_validation.map(|error| (error, error))),
        history: outcome.history,
        steps_run: quality.steps_run as usize,
        stop_reason: in_words(outcome.stop_reason).to_owned(),
    })
}

/// What was kept decodes again to what it was, but for the unit of its weight: during the fit its row stayed, but not the convolution
/// behind it. Refinement leaves both alone.
fn restore_kept(prepared: &Prepared, config: &TrainConfig, weights: &mut StackWeights) {
    if prepared.kept_rows.is_empty() {
        return;
    }
    let root = &mut weights.levels[0].blocks[0];
    for (k, wanted) in prepared.kept_roots().zip(&prepared.kept_rows) {
        if let Some(row) = row_behind(wanted, &root.decoder, &prepared.topology) {
            root.components[k * row.len()..(k + 1) * row.len()].copy_from_slice(&row);
        }
    }
    if config.fit.loss.unit_rows {
        weights.normalize_rows();
    }
}
