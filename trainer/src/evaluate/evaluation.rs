//! Evaluates a package on shapes it was not trained on: four ways to find weights, each decoded and solved by the
//! runtime, scored against the truth (method sections 3 and 4).

use core::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sinew_formats::{
    interchange::MeshSequence,
    package::{BakedView, CompactView, FEATURE_COUNT, OpenError},
};
use sinew_runtime::{Basis, Workspace, WorkspaceError, WorkspaceLayout};

use super::{
    EncoderSettings, Encoding, FeatureDecoder, FeatureMetric, FeatureProjection, PlayError, Player, ScoreError, Scores,
    StackEncoder, project_positions, score,
};
use crate::{
    bake::{BakeError, Surface, bake},
    features::{
        acap::features_of_shape,
        align::{RigidMotion, widened},
        gradient::{FeatureSettings, GradientFit},
        reconstruct::PoissonSystem,
        scaler::FeatureScaler,
    },
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
    /// What the encoder takes from the training.
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
    /// Weights from the network's encoder: level by level, residuals shared out by attention.
    pub encoder: Scores,
    /// Weights from one pass of least squares: the pseudo-inverse of the whole decoder at rest, in the metric of
    /// [`FeatureMetric`].
    pub linear_encoder: Scores,
    /// Weights by least squares in feature space, in the metric of [`FeatureMetric`].
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
    /// The network's encoder, root block alone.
    pub one_level: f64,
    /// The network's encoder, all levels.
    pub two_level: f64,
    /// The linear encoder, all levels.
    pub linear: f64,
}

impl MaxPercentageError {
    fn of<'m>(missed: impl IntoIterator<Item = &'m Missed>) -> Self {
        let none = Self {
            one_level: 0.0,
            two_level: 0.0,
            linear: 0.0,
        };
        let moving = missed.into_iter().filter(|missed| missed.energy > 0.0);
        moving.fold(none, |worst, missed| Self {
            one_level: worst.one_level.max(missed.one_level / missed.energy),
            two_level: worst.two_level.max(missed.two_level / missed.energy),
            linear: worst.linear.max(missed.linear / missed.energy),
        })
    }
}

/// Feature energy of one shape, and what of it is missed.
struct Missed {
    energy: f64,
    one_level: f64,
    two_level: f64,
    linear: f64,
}

/// The measured shapes, for saving and for pictures. Shape of each: `[N][V]`, source order.
#[derive(Debug, Clone, Default)]
pub struct Reconstructions {
    /// As in the sequence.
    pub truth: Vec<Vec<[f32; 3]>>,
    /// Near the reference, like all that follow.
    pub encoder: Vec<Vec<[f32; 3]>>,
    /// Near the reference.
    pub linear_encoder: Vec<Vec<[f32; 3]>>,
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
    /// No memory for the runtime.
    #[error("the runtime's workspace cannot be made")]
    Workspace(#[from] WorkspaceError),
    /// The results cannot be scored.
    #[error("the reconstruction cannot be scored")]
    Score(#[from] ScoreError),
}

/// Everything found for one shape.
struct ShapeResult {
    missed: Missed,
    encoder: Vec<[f32; 3]>,
    linear_encoder: Vec<[f32; 3]>,
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
    let bench = Bench::new(&package, &baked)?;
    let surface = &bench.surface;
    let fit = GradientFit::new(&surface.topology, &surface.rest, &input.settings);
    let encoder = StackEncoder::new(&package, &surface.topology, input.encoder);
    let projection = bench.projection();
    let done = AtomicUsize::new(0);
    let results: Vec<ShapeResult> = input
        .test_shapes
        .par_iter()
        .map(|&m| {
            let result = bench.measure(&fit, &encoder, &projection, m, &input.sequence.shapes[m]);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            result
        })
        .collect::<Result<_, _>>()?;

    let faces = package.faces().to_vec();
    let truth: Vec<Vec<[f32; 3]>> = input
        .test_shapes
        .iter()
        .map(|&m| input.sequence.shapes[m].clone())
        .collect();
    let coarse = package
        .blocks()
        .filter(|b| b.level == 0)
        .map(|b| b.component_count as usize)
        .sum();
    let max_percentage_error = MaxPercentageError::of(results.iter().map(|result| &result.missed));
    let trained: Vec<Missed> = input
        .trained_shapes
        .par_iter()
        .map(|&m| {
            let features = bench.features(&fit, &input.sequence.shapes[m]);
            let linear_weights = projection.linear_weights(&features);
            bench.missed(&encoder.encode(&features), &linear_weights, &features)
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
        found.linear_encoder.push(result.linear_encoder);
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
        linear_encoder: score(&found.truth, &found.linear_encoder, &faces)?,
        feature_projection: score(&found.truth, &found.feature_projection, &faces)?,
        position_projection: score(&found.truth, &found.position_projection, &faces)?,
        round_trip: score(&found.truth, &round_trip, &faces)?,
        max_percentage_error,
        trained_max_percentage_error,
    };
    Ok((evaluation, found))
}

fn check(input: &EvaluationInput<'_>, package: &CompactView<'_>) -> Result<(), EvaluationError> {
    let (expected, actual) = (package.vertex_count(), input.sequence.vertex_count());
    if expected != actual {
        return Err(EvaluationError::VertexCount {
            package: expected,
            sequence: actual,
        });
    }
    let (faces, known) = (&input.sequence.faces, package.faces());
    if !known.iter().eq(faces.iter().copied()) {
        let face = faces.iter().zip(known.iter()).take_while(|(a, b)| **a == *b).count();
        return Err(EvaluationError::Faces { face });
    }
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

/// What all shapes share.
struct Bench<'b> {
    surface: Surface,
    areas: Vec<f64>,
    scaler: FeatureScaler,
    system: PoissonSystem,
    decoder: FeatureDecoder,
    basis: Basis<'b>,
    layout: WorkspaceLayout,
}

impl<'b> Bench<'b> {
    fn new(package: &CompactView<'_>, baked: &'b [u8]) -> Result<Self, EvaluationError> {
        let surface = Surface::of_package(package);
        let areas = surface.topology.vertex_areas(&surface.rest);
        let scaler = FeatureScaler {
            rotation_scale: package.rotation_scale(),
            stretch_scale: package.stretch_scale(),
        };
        let anchor = package.anchor_vertex() as usize;
        let system = PoissonSystem::new(&surface.topology, &surface.weights, &surface.rest, anchor)?;
        let decoder = FeatureDecoder::new(&BakedView::open(baked)?);
        let basis = Basis::open(baked)?;
        let layout = WorkspaceLayout::for_basis(&basis);
        Ok(Self {
            surface,
            areas,
            scaler,
            system,
            decoder,
            basis,
            layout,
        })
    }

    fn projection(&self) -> FeatureProjection<'_> {
        let metric = FeatureMetric::new(&self.system, self.scaler.scales(), &self.areas);
        FeatureProjection::new(&self.decoder, metric)
    }

    fn measure(
        &self,
        fit: &GradientFit<'_>,
        encoder: &StackEncoder<'_>,
        projection: &FeatureProjection<'_>,
        shape: usize,
        positions: &[[f32; 3]],
    ) -> Result<ShapeResult, EvaluationError> {
        let features = self.features(fit, positions);
        let mut memory = vec![0; self.layout.unaligned_bytes()];
        let mut player = Player::new(&self.basis, Workspace::new(&self.basis, &mut memory)?);
        let fail = |source| EvaluationError::Play { shape, source };
        let encoding = encoder.encode(&features);
        let linear_weights = projection.linear_weights(&features);
        let feature_weights = projection.weights(&features, linear_weights.clone());
        let position_weights = project_positions(&mut player, positions, feature_weights.clone()).map_err(fail)?;
        Ok(ShapeResult {
            encoder: player.play(&encoding.weights).map_err(fail)?.to_vec(),
            linear_encoder: player.play(&linear_weights).map_err(fail)?.to_vec(),
            feature_projection: player.play(&feature_weights).map_err(fail)?.to_vec(),
            position_projection: player.play(&position_weights).map_err(fail)?.to_vec(),
            round_trip: player.reconstruct(&features).map_err(fail)?.to_vec(),
            position_weights,
            missed: self.missed(&encoding, &linear_weights, &features),
        })
    }

    /// Features of a shape brought near the reference, network units. Shape: `[V]`.
    fn features(&self, fit: &GradientFit<'_>, positions: &[[f32; 3]]) -> Vec<[f32; FEATURE_COUNT]> {
        let wide = widened(positions);
        let motion = RigidMotion::onto(&self.surface.rest, &wide);
        let aligned: Vec<[f64; 3]> = wide.iter().map(|&p| motion.apply(p)).collect();
        self.scaler
            .to_network(&features_of_shape(&self.surface.topology, fit, &aligned))
    }

    fn missed(&self, encoding: &Encoding, linear_weights: &[f64], features: &[[f32; FEATURE_COUNT]]) -> Missed {
        let decoded = self.decoder.decode_all(linear_weights);
        let pairs = features.as_flattened().iter().zip(decoded.as_flattened());
        Missed {
            energy: encoding.energy,
            one_level: encoding.root_residual_energy,
            two_level: encoding.residual_energy,
            linear: pairs.map(|(&x, y)| (f64::from(x) - y).powi(2)).sum(),
        }
    }
}
