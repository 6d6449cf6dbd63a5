//! The systems of the paper's table on one sequence: trained on the same shapes with the same budget of components, measured
//! on the same unseen shapes by the same figures.
//!
//! Path of data: sequence, split -> `Bench` (aligned shapes, features) -> [`crate::baselines`] and this
//! project's own training -> weights of unseen shapes, each method's own way (`fitting`, `feature_fit`) -> [`Comparison`].

mod bench;
mod control_points;
pub mod feature_fit;
mod fitting;
pub mod memory;
mod methods;
pub mod page;

use serde::{Deserialize, Serialize};
use sinew_interchange::MeshSequence;

use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{EvaluationError, HoldError, ScoreError, Scores};
use sinew_trainer::learn::LearnError;
use sinew_trainer::mesh::sparse_factor::FactorError;

pub use methods::compare;

/// Radius within which a component's energy counts as local, as a share of the longest distance along the surface.
pub const LOCAL_RADIUS: f32 = 0.2;

/// Numbers of control points that shapes are moved by.
pub const HANDLE_COUNTS: [usize; 6] = [2, 5, 10, 20, 35, 50];

/// What is compared, and on what.
#[derive(Debug, Clone, Copy)]
pub struct CompareInput<'a> {
    /// The shapes.
    pub sequence: &'a MeshSequence,
    /// Shapes to train on, ascending; shape 0 is the reference either way.
    pub train_shapes: &'a [usize],
    /// Compact packages trained on just these, to stand for this project's own training; none trains one.
    pub ours: &'a [OwnPackage<'a>],
    /// How.
    pub settings: &'a CompareSettings,
}

/// A package of this project.
#[derive(Debug, Clone, Copy)]
pub struct OwnPackage<'a> {
    /// For the tables.
    pub name: &'a str,
    /// A compact package.
    pub bytes: &'a [u8],
}

/// How methods are trained and fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareSettings {
    /// Components of every method, all levels together.
    pub component_count: usize,
    /// Epochs of the one-level autoencoder.
    pub epochs: usize,
    /// Leaves out what takes longest: peers fitted in positions, and control points.
    pub quick: bool,
    /// This project's configuration: features for all, training for its own.
    pub config: TrainConfig,
}

/// The figures of all methods, as `sinew-lab compare --json` writes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Name of the sequence.
    pub sequence: String,
    /// V.
    pub vertices: usize,
    /// Shapes trained on, the reference included.
    pub train_shapes: usize,
    /// Shapes measured.
    pub test_shapes: usize,
    /// The budget.
    pub components: usize,
    /// Seed of what is random.
    pub seed: u64,
    /// See [`HANDLE_COUNTS`]; empty where they were left out.
    pub control_points: Vec<usize>,
    /// Features alone, no components: what the features lose. Weights fitted in positions may win some of it back.
    pub round_trip: Scores,
    /// In the order of the table.
    pub methods: Vec<Method>,
}

/// One method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Method {
    /// Its name.
    pub name: String,
    /// Where it is described.
    pub source: String,
    /// Components that are not zero.
    pub components: usize,
    /// Seconds of training, features not counted but in this project's own; `None` where it was trained before.
    pub training_seconds: Option<f64>,
    /// Most bytes that training held at once, the sequence and its features not counted but in this project's own; `None`
    /// where it was trained before, or where no [`memory::CountingAllocator`] counts.
    pub peak_bytes: Option<usize>,
    /// What a reader should know about its training.
    pub note: Option<String>,
    /// Share of a component's energy within [`LOCAL_RADIUS`] of its centre, mean over components, in the values that the
    /// method factors.
    pub locality: f64,
    /// Numbers of the basis at four bytes, zeros left out where that is smaller.
    pub basis_bytes_f32: usize,
    /// The same at two bytes.
    pub basis_bytes_f16: usize,
    /// The whole compact package, mesh and all, where there is one.
    pub package_bytes: Option<usize>,
    /// The ways to find weights.
    pub projections: Vec<Projection>,
    /// E_rms of a few unseen shapes moved by [`Comparison::control_points`].
    pub control_point_e_rms: Vec<f64>,
}

/// One way to find the weights of an unseen shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Projection {
    /// Which.
    pub kind: ProjectionKind,
    /// E_rms and STED.
    #[serde(flatten)]
    pub scores: Scores,
    /// Share of a shape's energy, in the method's own features, that is missed; worst shape. Not for methods in positions.
    pub max_percentage_error: Option<f64>,
}

/// Where weights come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionKind {
    /// A network's own encoder.
    Encoder,
    /// One pass of least squares: the pseudo-inverse of the decoder at rest, in the metric of `Features`.
    LinearEncoder,
    /// Least squares in features and, to first order at the reference, in what they do to positions.
    Features,
    /// Least squares in positions.
    Positions,
}

impl ProjectionKind {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Encoder => "encoder",
            Self::LinearEncoder => "linear map",
            Self::Features => "features",
            Self::Positions => "positions",
        }
    }
}

/// The shapes behind the figures.
#[derive(Debug, Clone, Default)]
pub struct ComparedShapes {
    /// Indices of the measured shapes.
    pub shapes: Vec<usize>,
    /// Measured shapes aligned to the reference. Shape: `[N][V]`.
    pub truth: Vec<Vec<[f32; 3]>>,
    /// Shape: `[method][projection][N][V]`.
    pub reconstructions: Vec<Vec<Vec<Vec<[f32; 3]>>>>,
}

/// Why methods cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// Nothing is left to measure.
    #[error("all {0} shapes are trained on: none is left to measure (--train-every 10)")]
    NothingToMeasure(usize),
    /// The split is too small, the mesh cannot be used, or training fails.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A package cannot be measured.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A result cannot be scored.
    #[error("the result of {method} cannot be scored")]
    Score {
        /// Whose.
        method: String,
        /// Why.
        source: ScoreError,
    },
    /// A package's vertices cannot be dragged.
    #[error("{method} cannot be moved by control points")]
    Hold {
        /// Whose.
        method: String,
        /// Why.
        source: HoldError,
    },
    /// The faces cannot be solved on.
    #[error("the mesh cannot be solved on")]
    Factor(#[from] FactorError),
}

/// Two levels that together have as near to `budget` components as can be, about four fine ones under each coarse one.
pub fn two_levels(budget: usize) -> Vec<usize> {
    let candidates = (1..=12)
        .map(|fine| (budget / (1 + fine), fine))
        .filter(|(coarse, _)| *coarse > 0);
    let best = candidates.min_by_key(|&(coarse, fine)| (budget - coarse * (1 + fine), fine.abs_diff(4)));
    best.map_or_else(|| vec![budget.max(1)], |(coarse, fine)| vec![coarse, fine])
}

#[cfg(test)]
mod tests;
