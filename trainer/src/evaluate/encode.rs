//! Weights of shapes of a package's mesh, for whatever goes on with them: `sinew encode`.

use core::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use sinew_formats::package::CompactView;
use sinew_interchange::MeshSequence;
use sinew_runtime::{Basis, Workspace, WorkspaceLayout};

use super::evaluation::{EvaluationError, same_mesh};
use super::player::Player;
use super::position_projection::project_positions;
use super::shape_reader::ShapeReader;
use super::stack_encoder::EncoderSettings;
use crate::bake::bake;
use crate::features::gradient::FeatureSettings;

/// How weights are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum WeightFit {
    /// By the package's encoder, in one pass.
    #[default]
    Encoder,
    /// By least squares of features, from the encoder's.
    Features,
    /// By least squares of positions through the runtime, from there.
    Positions,
}

/// Whose weights are wanted.
#[derive(Debug, Clone, Copy)]
pub struct EncodeInput<'a> {
    /// A compact package.
    pub package: &'a [u8],
    /// Shapes of the package's mesh.
    pub sequence: &'a MeshSequence,
    /// How weights are found.
    pub fit: WeightFit,
    /// Settings of the features, those of the training.
    pub settings: FeatureSettings,
    /// What the paper's encoder takes from the training.
    pub encoder: EncoderSettings,
}

/// Weights of every shape of the sequence, not clamped. Shapes run in parallel; the answer does not depend on the thread count.
/// `progress` is called with the number of shapes done, from any thread. Shape: `[N][K]`.
/// Errors: a damaged package, a sequence of another mesh, a shape that cannot be played.
pub fn encode(input: &EncodeInput<'_>, progress: &(dyn Fn(usize) + Sync)) -> Result<Vec<Vec<f64>>, EvaluationError> {
    let package = CompactView::open(input.package)?;
    same_mesh(&package, input.sequence)?;
    let reader = ShapeReader::new(&package)?;
    let projection = reader.projection();
    let encoder = reader.encoder(&projection, input.encoder)?;
    let fit = reader.gradients(&input.settings);
    let baked = match input.fit {
        WeightFit::Positions => Some(bake(&package)?),
        WeightFit::Encoder | WeightFit::Features => None,
    };
    let basis = baked.as_deref().map(Basis::open).transpose()?;
    let done = AtomicUsize::new(0);
    (0..input.sequence.shape_count())
        .into_par_iter()
        .map(|shape| {
            let positions = &input.sequence.shapes[shape];
            let features = reader.features(&fit, positions);
            let mut weights = encoder.weights(&features);
            if input.fit != WeightFit::Encoder {
                weights = projection.weights(&features, encoder.start_of_projection(&weights));
            }
            if let Some(basis) = &basis {
                let mut memory = vec![0; WorkspaceLayout::for_basis(basis).unaligned_bytes()];
                let mut player = Player::new(basis, Workspace::new(basis, &mut memory)?);
                weights = project_positions(&mut player, positions, weights)
                    .map_err(|source| EvaluationError::Play { shape, source })?;
            }
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(weights)
        })
        .collect()
}
