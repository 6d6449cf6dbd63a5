//! Evaluates a package on shapes it was not trained on: three ways to find weights, each decoded and solved by the
//! runtime, scored against the truth (method sections 3 and 4).

use core::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sinew_formats::package::{CompactView, OpenError};
use sinew_interchange::MeshSequence;
use sinew_runtime::{Basis, Workspace, WorkspaceError, WorkspaceLayout};

use super::{
    Encoder, EncoderSettings, Encoding, FeatureProjection, PlayError, Player, ScoreError, Scores, UnknownEncoder,
    project_positions, score, shape_reader::ShapeReader,
};
use crate::{
    bake::{BakeError, bake},
    features::gradient::{FeatureSettings, GradientFit},
    mesh::sparse_factor::FactorError,
};

/// What is measured, and on what.
#[derive(Debug, Clone, Copy)]
pub struct EvaluationInput<'a> {
    /// A compact package.
    pub package: &'a [u8],
    /// The sequence; its connectivity is the package's.
    pub sequence: &'a MeshSequence,
    /// Indices of the shapes to measure, in temporal order.
    pub test_shapes: &'a [usize],
    /// Shapes that were trained on, of which only [`Evaluation::trained_max_percentage_error`] is found; may be none.
    pub trained_shapes: &'a [usize],
    /// Settings of the features, those of the training.
    pub settings: FeatureSettings,
    /// What the paper's encoder takes from the training.
    pub encoder: EncoderSettings,
}

/// The figures, as `sinew evaluate --json` prints them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Shapes measured.
    pub shapes: usize,
    /// V.
    pub vertices: usize,
    /// Components of the package.
    pub components: ComponentCounts,
    /// Weights from the package's encoder, in one pass.
    pub encoder: Scores,
    /// Weights by least squares in feature space, in the metric of [`crate::features::metric::FeatureMetric`].
    pub feature_projection: Scores,
    /// Weights by Gauss-Newton on positions.
    pub position_projection: Scores,
    /// No components at all: features, solve, positions. The floor.
    pub round_trip: Scores,
    /// Share of a shape's feature energy that a reconstruction in one pass misses, worst shape.
    pub max_percentage_error: MaxPercentageError,
    /// The same of the shapes that were trained on.
    pub trained_max_percentage_error: Option<MaxPercentageError>,
}

/// Components by scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ComponentCounts {
    /// Of the root block.
    pub coarse: usize,
    /// Of all blocks below.
    pub fine: usize,
}

/// `max_m |X_m - Xhat_m|^2 / |X_m|^2`, network units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MaxPercentageError {
    /// The encoder, root block alone.
    pub one_level: f64,
    /// The encoder, all levels.
    pub two_level: f64,
}

impl MaxPercentageError {
    fn of<'m>(encodings: impl IntoIterator<Item = &'m Encoding>) -> Self {
        let none = Self {
            one_level: 0.0,
            two_level: 0.0,
        };
        let moving = encodings.into_iter().filter(|encoding| encoding.energy > 0.0);
        moving.fold(none, |worst, encoding| Self {
            one_level: worst.one_level.max(encoding.root_residual_energy / encoding.energy),
            two_level: worst.two_level.max(encoding.residual_energy / encoding.energy),
        })
    }
}

/// The measured shapes, for saving and for pictures. Shape of each: `[N][V]`, source order.
#[derive(Debug, Clone, Default)]
pub struct Reconstructions {
    /// As in the sequence.
    pub truth: Vec<Vec<[f32; 3]>>,
    /// Near the reference, like all that follow.
    pub encoder: Vec<Vec<[f32; 3]>>,
    /// Near the reference.
    pub feature_projection: Vec<Vec<[f32; 3]>>,
    /// Near the reference.
    pub position_projection: Vec<Vec<[f32; 3]>>,
    /// Weights of the position projection. Shape: `[N][K]`.
    pub position_weights: Vec<Vec<f64>>,
}

/// Why a package cannot be evaluated on a sequence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// Not a package, or a damaged one.
    #[error("the package cannot be opened")]
    Open(#[from] OpenError),
    /// Not bakeable.
    #[error("the package cannot be baked")]
    Bake(#[from] BakeError),
    /// Another mesh.
    #[error(
        "the package has {package} vertices and the sequence {sequence}: evaluate on the sequence it was trained on"
    )]
    VertexCount {
        /// V of the package.
        package: usize,
        /// V of the sequence.
        sequence: usize,
    },
    /// Another connectivity.
    #[error("face {face} of the sequence is not that of the package: evaluate on the sequence it was trained on")]
    Faces {
        /// First face that differs.
        face: usize,
    },
    /// No such shape.
    #[error("there is no shape {shape}: the sequence has {shape_count}")]
    NoSuchShape {
        /// The index asked for.
        shape: usize,
        /// N.
        shape_count: usize,
    },
    /// The runtime gives up on a shape.
    #[error("shape {shape} cannot be played")]
    Play {
        /// Index in the sequence.
        shape: usize,
        /// Why.
        source: PlayError,
    },
    /// The mesh's matrix cannot be factored.
    #[error("the mesh cannot be solved on")]
    Factor(#[from] FactorError),
    /// Its encoder cannot be used.
    #[error(transparent)]
    Encoder(#[from] UnknownEncoder),
    /// No memory for the runtime.
    #[error("the runtime's workspace cannot be made")]
    Workspace(#[from] WorkspaceError),
    /// The results cannot be scored.
    #[error("the reconstruction cannot be scored")]
    Score(#[from] ScoreError),
}

/// Everything found for one shape.
struct ShapeResult {
    encoding: Encoding,
    encoder: Vec<[f32; 3]>,
    feature_projection: Vec<[f32; 3]>,
    position_projection: Vec<[f32; 3]>,
    position_weights: Vec<f64>,
    round_trip: Vec<[f32; 3]>,
}

/// Measures. Shapes run in parallel, each on a workspace of its own; the result does not depend on the thread count.
/// `progress` is called with the number of shapes done, from any thread.
/// Errors: a damaged package, a sequence of another mesh, a shape index out of range.
pub fn evaluate(
    input: &EvaluationInput<'_>,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<(Evaluation, Reconstructions), EvaluationError> {
    let package = CompactView::open(input.package)?;
    check(input, &package)?;
    let baked = bake(&package)?;
    let reader = ShapeReader::new(&package)?;
    let basis = Basis::open(&baked)?;
    let projection = reader.projection();
    let bench = Bench {
        fit: reader.gradients(&input.settings),
        encoder: reader.encoder(&projection, input.encoder)?,
        projection: &projection,
        layout: WorkspaceLayout::for_basis(&basis),
        basis: &basis,
        reader: &reader,
    };
    let done = AtomicUsize::new(0);
    let results: Vec<ShapeResult> = input
        .test_shapes
        .par_iter()
        .map(|&m| {
            let result = bench.measure(m, &input.sequence.shapes[m]);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            result
        })
        .collect::<Result<_, _>>()?;

    let faces = package.faces().to_vec();
    let truth: Vec<Vec<[f32; 3]>> = input
        .test_shapes
        .iter()
        .map(|&m| input.sequence.shapes[m].to_vec())
        .collect();
    let coarse = package
        .blocks()
        .filter(|b| b.level == 0)
        .map(|b| b.component_count as usize)
        .sum();
    let max_percentage_error = MaxPercentageError::of(results.iter().map(|result| &result.encoding));
    let trained: Vec<Encoding> = input
        .trained_shapes
        .par_iter()
        .map(|&m| {
            let features = reader.features(&bench.fit, &input.sequence.shapes[m]);
            bench.encoder.encode(&features)
        })
        .collect();
    let trained_max_percentage_error = (!trained.is_empty()).then(|| MaxPercentageError::of(&trained));
    let mut round_trip = Vec::with_capacity(results.len());
    let mut found = Reconstructions {
        truth,
        ..Reconstructions::default()
    };
    for result in results {
        found.encoder.push(result.encoder);
        found.feature_projection.push(result.feature_projection);
        found.position_projection.push(result.position_projection);
        found.position_weights.push(result.position_weights);
        round_trip.push(result.round_trip);
    }
    let evaluation = Evaluation {
        shapes: found.truth.len(),
        vertices: package.vertex_count(),
        components: ComponentCounts {
            coarse,
            fine: package.component_count() - coarse,
        },
        encoder: score(&found.truth, &found.encoder, &faces)?,
        feature_projection: score(&found.truth, &found.feature_projection, &faces)?,
        position_projection: score(&found.truth, &found.position_projection, &faces)?,
        round_trip: score(&found.truth, &round_trip, &faces)?,
        max_percentage_error,
        trained_max_percentage_error,
    };
    Ok((evaluation, found))
}

fn check(input: &EvaluationInput<'_>, package: &CompactView<'_>) -> Result<(), EvaluationError> {
    same_mesh(package, input.sequence)?;
    let shape_count = input.sequence.shape_count();
    match input
        .test_shapes
        .iter()
        .chain(input.trained_shapes)
        .find(|&&shape| shape >= shape_count)
    {
        Some(&shape) => Err(EvaluationError::NoSuchShape { shape, shape_count }),
        None if input.test_shapes.is_empty() => Err(ScoreError::Nothing.into()),
        None => Ok(()),
    }
}

/// Errors: a sequence of another mesh than the package's.
pub(super) fn same_mesh(package: &CompactView<'_>, sequence: &MeshSequence) -> Result<(), EvaluationError> {
    let (expected, actual) = (package.vertex_count(), sequence.vertex_count());
    if expected != actual {
        return Err(EvaluationError::VertexCount {
            package: expected,
            sequence: actual,
        });
    }
    let (faces, known) = (&sequence.faces, package.faces());
    if !known.iter().eq(faces.iter().copied()) {
        let face = faces.iter().zip(known.iter()).take_while(|(a, b)| **a == *b).count();
        return Err(EvaluationError::Faces { face });
    }
    Ok(())
}

/// What all shapes share.
struct Bench<'b> {
    reader: &'b ShapeReader<'b>,
    fit: GradientFit<'b>,
    encoder: Encoder<'b>,
    projection: &'b FeatureProjection<'b>,
    basis: &'b Basis<'b>,
    layout: WorkspaceLayout,
}

impl Bench<'_> {
    fn measure(&self, shape: usize, positions: &[[f32; 3]]) -> Result<ShapeResult, EvaluationError> {
        let features = self.reader.features(&self.fit, positions);
        let mut memory = vec![0; self.layout.unaligned_bytes()];
        let mut player = Player::new(self.basis, Workspace::new(self.basis, &mut memory)?);
        let fail = |source| EvaluationError::Play { shape, source };
        let encoding = self.encoder.encode(&features);
        let start = self.encoder.start_of_projection(&encoding.weights);
        let feature_weights = self.projection.weights(&features, start);
        let position_weights = project_positions(&mut player, positions, feature_weights.clone()).map_err(fail)?;
        Ok(ShapeResult {
            encoder: player.play(&encoding.weights).map_err(fail)?.to_vec(),
            feature_projection: player.play(&feature_weights).map_err(fail)?.to_vec(),
            position_projection: player.play(&position_weights).map_err(fail)?.to_vec(),
            round_trip: player.reconstruct(&features).map_err(fail)?.to_vec(),
            position_weights,
            encoding,
        })
    }
}
