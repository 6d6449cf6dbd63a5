//! The held-out part of the training shapes: what settings are chosen by, and when fitting stops. Errors are those of
//! positions, measured through the runtime.

use super::LearnError;
use super::package::draft;
use super::prepare::Prepared;
use super::trial::Trial;
use crate::config::{TrainConfig, ValidationSettings};
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

    /// E_rms of the held-out shapes through the package's encoder, decode and solve.
    pub fn error(&self, prepared: &Prepared, config: &TrainConfig, weights: &StackWeights) -> Result<f32, LearnError> {
        let basis = draft(prepared, config, weights, &self.rest_of(prepared.network.len()))?;
        let inputs: Vec<&[[f32; 9]]> = self.shapes.iter().map(|&m| &prepared.network[m]).collect();
        let truth = self.shapes.iter().map(|&m| prepared.aligned[m].to_vec()).collect();
        Ok(Trial::new(prepared, config, &basis)?.error(&inputs, Some(truth))?)
    }
}

/// First and least validation error of a fit.
pub fn first_and_best(history: &[HistoryPoint]) -> Option<(f32, f32)> {
    let measured: Vec<f32> = history.iter().filter_map(|entry| entry.validation).collect();
    let first = *measured.first()?;
    Some((first, measured.iter().copied().fold(first, f32::min)))
}
