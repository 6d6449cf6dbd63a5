//! The paper's ablations: what each choice of the method is worth. Every variant of a [`plan`] is trained on the same shapes
//! and measured on the same others through the runtime; finished rows are kept, so that a stopped ablation goes on.

mod kept;
pub mod page;
pub mod plan;

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use sinew_interchange::MeshSequence;

pub use kept::KeptError;
use kept::KeptRows;
use plan::{Group, variants};
use sinew_trainer::config::{Recipe, TrainConfig};
use sinew_trainer::evaluate::{EvaluationError, EvaluationInput, Scores, evaluate};
use sinew_trainer::learn::review::review;
use sinew_trainer::learn::{LearnError, Reporter, RunOptions, learn};

/// What is ablated, and on what.
#[derive(Debug, Clone, Copy)]
pub struct AblationInput<'a> {
    /// The shapes.
    pub sequence: &'a MeshSequence,
    /// Shapes to train on, ascending; shape 0 is the reference either way.
    pub train_shapes: &'a [usize],
    /// Shapes to measure, ascending; none is trained on.
    pub test_shapes: &'a [usize],
    /// How.
    pub settings: &'a AblationSettings,
}

/// Which variants, and how long.
#[derive(Debug, Clone, PartialEq)]
pub struct AblationSettings {
    /// What the variants are variants of.
    pub base: TrainConfig,
    /// The recipe that `base` follows.
    pub recipe: Recipe,
    /// Which questions.
    pub groups: Vec<Group>,
    /// Fewer and shorter trainings.
    pub quick: bool,
    /// Bounds each training.
    pub time_budget: Option<Duration>,
    /// Where finished rows and the checkpoints of the running one are kept; `None` keeps none.
    pub work_folder: Option<PathBuf>,
}

/// All rows, as `sinew-lab ablate --json` writes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ablation {
    /// Name of the sequence.
    pub sequence: String,
    /// V.
    pub vertices: usize,
    /// Shapes trained on, the reference included.
    pub train_shapes: usize,
    /// Shapes measured.
    pub test_shapes: usize,
    /// Seed of what is random.
    pub seed: u64,
    /// What the rows are variants of.
    pub recipe: Recipe,
    /// Whether trainings were cut short.
    pub quick: bool,
    /// In the order of the plan.
    pub rows: Vec<Row>,
}

/// One variant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The question it answers.
    pub group: Group,
    /// What is special about it.
    pub name: String,
    /// λ on its curve, `[d1, d2]` in the grid, empty elsewhere.
    pub place: Vec<f64>,
    /// Whether this is what all others are variants of.
    pub is_base: bool,
    /// What came of it.
    pub outcome: Outcome,
}

/// What came of a variant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It was trained and measured.
    Measured(Box<Figures>),
    /// It could not be; why.
    Failed(String),
}

/// The figures of a variant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Components asked for, all levels together.
    pub components_asked: usize,
    /// Components left when redundant ones were removed.
    pub components: usize,
    /// Weights by the encoder.
    pub encoder: Scores,
    /// Weights by least squares in features.
    pub feature_projection: Scores,
    /// Weights by Gauss-Newton on positions.
    pub position_projection: Scores,
    /// Max-percentage error: share of a shape's feature energy that the encoder's reconstruction misses; the worst training
    /// shape.
    pub missed_training: f64,
    /// The same for the measured shapes.
    pub missed_unseen: f64,
    /// Steps of the optimiser.
    pub steps: usize,
    /// Why training ended.
    pub stop_reason: String,
    /// Seconds of training, features included.
    pub training_seconds: f64,
    /// Size of the compact package.
    pub package_bytes: usize,
}

/// Why an ablation ends without a table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AblateError {
    /// The shapes cannot be trained on, or the reporter asked to stop.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// Rows cannot be kept.
    #[error(transparent)]
    Kept(#[from] KeptError),
    /// Nothing is left to measure.
    #[error("no shape is left to measure: train on fewer (--train-every)")]
    NothingToMeasure,
}

/// Trains and measures every variant. One that fails becomes a row that says why.
/// Errors: shapes that nothing can be learned from, the reporter's wish to stop (finished rows are kept), an unusable work
/// folder.
pub fn ablate(input: &AblationInput<'_>, reporter: &dyn Reporter) -> Result<Ablation, AblateError> {
    let settings = input.settings;
    if input.test_shapes.is_empty() {
        return Err(AblateError::NothingToMeasure);
    }
    review(input.sequence, input.train_shapes, settings.base.component_count())?;
    let base = plan::base(&settings.base, settings.quick);
    let plan = variants(&settings.groups, &base, settings.quick);
    let kept = KeptRows::open(settings.work_folder.as_deref(), input)?;
    let mut outcomes: BTreeMap<String, Outcome> = BTreeMap::new();
    for variant in &plan {
        let key = kept.key(&variant.config);
        if let Some(figures) = kept.read(&key) {
            outcomes.insert(key, Outcome::Measured(Box::new(figures)));
        }
    }
    let heard = Mutex::new(BTreeSet::new());
    let mut spent = Duration::ZERO;
    let mut trained = 0_u32;
    let mut rows = Vec::with_capacity(plan.len());
    for (i, variant) in plan.iter().enumerate() {
        let key = kept.key(&variant.config);
        let outcome = match outcomes.get(&key) {
            Some(outcome) => outcome.clone(),
            None => {
                let open: BTreeSet<String> = plan[i..]
                    .iter()
                    .map(|variant| kept.key(&variant.config))
                    .filter(|key| !outcomes.contains_key(key))
                    .collect();
                let left = (trained > 0).then(|| spent / trained * open.len() as u32);
                let of_row = RowReporter {
                    inner: reporter,
                    place: format!("{}/{}", i + 1, plan.len()),
                    note: match left {
                        Some(left) => format!("{} · all: about {} left", variant.name, minutes(left)),
                        None => variant.name.clone(),
                    },
                    heard: &heard,
                };
                let begun = Instant::now();
                let outcome = match measure(input, &variant.config, kept.run_folder(&key), &of_row) {
                    Ok(figures) => {
                        kept.keep(&key, &figures)?;
                        Outcome::Measured(Box::new(figures))
                    }
                    Err(RowError::Learn(LearnError::Stopped)) => return Err(LearnError::Stopped.into()),
                    Err(error) => Outcome::Failed(error.to_string()),
                };
                spent += begun.elapsed();
                trained += 1;
                outcomes.insert(key, outcome.clone());
                outcome
            }
        };
        rows.push(Row {
            group: variant.group,
            name: variant.name.clone(),
            place: variant.place.clone(),
            is_base: base == variant.config,
            outcome,
        });
    }
    Ok(Ablation {
        sequence: input.sequence.name.clone(),
        vertices: input.sequence.vertex_count(),
        train_shapes: input.train_shapes.len(),
        test_shapes: input.test_shapes.len(),
        seed: settings.base.seed,
        recipe: settings.recipe,
        quick: settings.quick,
        rows,
    })
}

#[derive(Debug, thiserror::Error)]
enum RowError {
    #[error(transparent)]
    Learn(#[from] LearnError),
    #[error("{0}")]
    Evaluate(#[from] EvaluationError),
}

fn measure(
    input: &AblationInput<'_>,
    config: &TrainConfig,
    work_folder: Option<PathBuf>,
    reporter: &dyn Reporter,
) -> Result<Figures, RowError> {
    let begun = Instant::now();
    let options = RunOptions {
        time_budget: input.settings.time_budget,
        work_folder,
    };
    let learned = learn(input.sequence, input.train_shapes, config, &options, reporter)?;
    let training_seconds = begun.elapsed().as_secs_f64();
    let trained: Vec<usize> = input.train_shapes.iter().copied().filter(|&m| m != 0).collect();
    reporter.stage("measuring", (input.test_shapes.len() + trained.len()) as u64);
    let input = EvaluationInput {
        package: &learned.package,
        sequence: input.sequence,
        test_shapes: input.test_shapes,
        trained_shapes: &trained,
        settings: config.features,
        encoder: config.encoder_settings(),
    };
    let (unseen, _) = evaluate(&input, &|done| reporter.advance(done as u64, ""))?;
    let missed = &unseen.max_percentage_error;
    let seen = unseen
        .trained_max_percentage_error
        .as_ref()
        .expect("a training has a shape besides the reference");
    Ok(Figures {
        components_asked: config.component_count(),
        components: learned.component_count,
        encoder: unseen.encoder,
        feature_projection: unseen.feature_projection,
        position_projection: unseen.position_projection,
        missed_training: seen.two_level,
        missed_unseen: missed.two_level,
        steps: learned.steps_run,
        stop_reason: learned.stop_reason,
        training_seconds,
        package_bytes: learned.package.len(),
    })
}

/// Says which row a stage belongs to, and every notice once.
struct RowReporter<'a> {
    inner: &'a dyn Reporter,
    place: String,
    note: String,
    heard: &'a Mutex<BTreeSet<String>>,
}

impl Reporter for RowReporter<'_> {
    fn stage(&self, name: &str, total: u64) {
        self.inner.stage(&format!("{} {name}", self.place), total);
        self.inner.advance(0, &self.note);
    }

    fn advance(&self, done: u64, note: &str) {
        match note {
            "" => self.inner.advance(done, &self.note),
            note => self.inner.advance(done, &format!("{} · {note}", self.note)),
        }
    }

    fn notice(&self, text: &str) {
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        if heard.insert(text.to_owned()) {
            self.inner.notice(text);
        }
    }

    fn stop_requested(&self) -> bool {
        self.inner.stop_requested()
    }
}

fn minutes(time: Duration) -> String {
    match time.as_secs() {
        seconds if seconds < 90 => format!("{seconds} s"),
        seconds => format!("{} min", seconds.div_ceil(60)),
    }
}
