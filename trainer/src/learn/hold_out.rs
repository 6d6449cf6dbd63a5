//! The held-out part of the training shapes: what settings are chosen by, and when fitting stops. Errors are those of
//! positions, measured through the runtime.

use rayon::prelude::*;
use sinew_runtime::Basis;

use super::LearnError;
use super::package::{PackageError, draft, encode_linearly, with_players};
use super::prepare::Prepared;
use crate::bake::{Surface, bake};
use crate::components::extract::LearnedBasis;
use crate::config::{TrainConfig, ValidationSettings};
use crate::evaluate::{NormalisedPair, StackEncoder};
use crate::network::weights::StackWeights;
use crate::training::fit::HistoryPoint;

/// Numbers of the held-out shapes, among the M of [`Prepared`].
#[derive(Debug, Clone)]
pub struct HeldOut {
    shapes: Vec<usize>,
}

impl HeldOut {
    /// Nothing is held out.
    pub fn none() -> Self {
        Self { shapes: Vec::new() }
    }

    /// Shapes spread evenly over the training shapes; none where there are too few to spare any.
    pub fn choose(prepared: &Prepared, settings: &ValidationSettings) -> Self {
        let shape_count = prepared.network.len();
        if settings.share <= 0.0 || shape_count < settings.shapes_min.max(3) {
            return Self::none();
        }
        let wanted = ((shape_count as f64 * settings.share).round() as usize).clamp(1, settings.shapes_max.max(1));
        let count = wanted.min(shape_count - 2);
        Self {
            shapes: (0..count).map(|i| (2 * i + 1) * shape_count / (2 * count)).collect(),
        }
    }

    /// Whether there is no such shape.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// The shapes that are left to learn from.
    pub fn rest_of(&self, shape_count: usize) -> Vec<usize> {
        (0..shape_count).filter(|m| !self.shapes.contains(m)).collect()
    }

    /// E_rms of the held-out shapes through decode and solve. Components that will be refined serve whatever finds their weights
    /// by least squares, so the linear encoder judges them; others are judged by the network's own.
    pub fn error(&self, prepared: &Prepared, config: &TrainConfig, weights: &StackWeights) -> Result<f32, LearnError> {
        let basis = draft(prepared, config, weights, &self.rest_of(prepared.network.len()))?;
        let inputs: Vec<&[[f32; 9]]> = self.shapes.iter().map(|&m| &prepared.network[m]).collect();
        let truth = self.shapes.iter().map(|&m| prepared.aligned[m].to_vec()).collect();
        let judge = if config.refine.rounds > 0 {
            Judge::Linear
        } else {
            Judge::Network
        };
        Ok(encoder_error(&basis, prepared, config, judge, &inputs, Some(truth))?)
    }
}

/// The encoder that finds the weights an error is measured with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judge {
    /// The network's own.
    Network,
    /// The first step of the feature projection.
    Linear,
}

/// E_rms of `inputs` (network units) through encoder, decode and solve, against `truth`, or against the inputs' own
/// positions by the solve alone.
pub fn encoder_error(
    basis: &LearnedBasis,
    prepared: &Prepared,
    config: &TrainConfig,
    judge: Judge,
    inputs: &[&[[f32; 9]]],
    truth: Option<Vec<Vec<[f32; 3]>>>,
) -> Result<f32, PackageError> {
    let compact = basis.write_draft()?;
    let view = compact.view()?;
    let baked = bake(&view)?;
    let opened = Basis::open(&baked)?;
    let codes = match judge {
        Judge::Linear => encode_linearly(basis, prepared, inputs)?,
        Judge::Network => {
            let surface = Surface::of_package(&view);
            let encoder = StackEncoder::new(&view, &surface.topology, config.encoder());
            inputs.par_iter().map(|shape| encoder.encode(shape).weights).collect()
        }
    };
    let played = with_players(&opened, &codes, |player, code| Ok(player.play(code)?.to_vec()))?;
    let truth = match truth {
        Some(truth) => truth,
        None => with_players(&opened, inputs, |player, shape| Ok(player.reconstruct(shape)?.to_vec()))?,
    };
    Ok(NormalisedPair::new(&truth, &played)?.e_rms() as f32)
}

/// First and least validation error of a fit.
pub fn first_and_best(history: &[HistoryPoint]) -> Option<(f32, f32)> {
    let measured: Vec<f32> = history.iter().filter_map(|entry| entry.validation).collect();
    let first = *measured.first()?;
    Some((first, measured.iter().copied().fold(first, f32::min)))
}
