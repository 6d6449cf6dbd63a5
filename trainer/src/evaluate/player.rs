//! The runtime as the evaluator uses it: every figure printed goes through this decode and this solve.

use sinew_formats::package::FEATURE_COUNT;
use sinew_runtime::{Basis, ControlError, Controls, Frame, FrameError, Reconstruct, Tangent, Workspace};

/// Why the runtime did not play.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlayError {
    /// The frame path refuses, or its numbers leave f32.
    #[error("the runtime cannot play the shape")]
    Frame(#[from] FrameError),
    /// A weight is not finite in f32.
    #[error("the runtime cannot take the weights")]
    Control(#[from] ControlError),
}

impl PlayError {
    /// Whether smaller weights would have played.
    pub fn is_overflow(&self) -> bool {
        matches!(
            self,
            Self::Frame(FrameError::NotFinite { .. }) | Self::Control(ControlError::NotFinite { .. })
        )
    }
}

/// Plays one pose at a time on a workspace of its own.
#[derive(Debug)]
pub struct Player<'p> {
    basis: &'p Basis<'p>,
    workspace: Workspace<'p>,
    weights: Vec<f32>,
    positions: Vec<[f32; 3]>,
}

impl<'p> Player<'p> {
    /// Wraps a workspace that was made for `basis`.
    pub fn new(basis: &'p Basis<'p>, workspace: Workspace<'p>) -> Self {
        let weights = vec![0.0; basis.component_count()];
        let positions = vec![[0.0; 3]; basis.vertex_count()];
        Self {
            basis,
            workspace,
            weights,
            positions,
        }
    }

    /// K.
    pub fn component_count(&self) -> usize {
        self.weights.len()
    }

    /// Positions at `weights`, unclamped. Shapes: `[K]` to `[V]`, source order.
    /// Errors: weights so large that they or the positions leave f32.
    pub fn play(&mut self, weights: &[f64]) -> Result<&[[f32; 3]], PlayError> {
        let mut controls = Controls::new(self.basis, &mut self.weights)?;
        for (k, &weight) in weights.iter().enumerate() {
            controls.set_unclamped(k, weight as f32)?;
        }
        let positions = &mut self.positions;
        Frame {
            basis: self.basis,
            controls: &controls,
            positions,
            normals: None,
        }
        .run(&mut self.workspace)?;
        Ok(&self.positions)
    }

    /// Decoded features of the positions last played, network units. Shape: `[V]`, source order.
    pub fn features(&self) -> Result<Vec<[f32; FEATURE_COUNT]>, PlayError> {
        let mut features = vec![[0.0; FEATURE_COUNT]; self.basis.vertex_count()];
        self.workspace.features(self.basis, &mut features)?;
        Ok(features)
    }

    /// Derivative of the positions last played with respect to the weight of `component`. Shape: `displacement` `[V]`.
    pub fn differentiate(&mut self, component: usize, displacement: &mut [[f32; 3]]) -> Result<(), PlayError> {
        Ok(Tangent {
            basis: self.basis,
            component,
            displacement,
        }
        .run(&mut self.workspace)?)
    }

    /// Positions of `features` (network units, source order), without components: decode and solve alone. Shape: `[V]`.
    pub fn reconstruct(&mut self, features: &[[f32; FEATURE_COUNT]]) -> Result<&[[f32; 3]], PlayError> {
        let positions = &mut self.positions;
        Reconstruct {
            basis: self.basis,
            features,
            positions,
        }
        .run(&mut self.workspace)?;
        Ok(&self.positions)
    }
}
