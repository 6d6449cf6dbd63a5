//! The mesh of a performance: basis, controls, workspace and positions, all allocated before the first frame.

use miette::{IntoDiagnostic, Report};
use sinew_runtime::{Basis, Controls, Frame, FrameError, FrameOutcome, Workspace, WorkspaceLayout};

/// Memory that a [`Scene`] borrows.
#[derive(Debug)]
pub struct SceneMemory {
    weights: Vec<f32>,
    workspace: Vec<u8>,
}

impl SceneMemory {
    /// As much as a basis needs.
    pub fn for_basis(basis: &Basis<'_>) -> Self {
        Self {
            weights: vec![0.0; basis.component_count()],
            workspace: vec![0; WorkspaceLayout::for_basis(basis).unaligned_bytes()],
        }
    }
}

/// A mesh that moves.
#[derive(Debug)]
pub struct Scene<'s> {
    /// The package.
    pub basis: &'s Basis<'s>,
    /// Its weights.
    pub controls: Controls<'s>,
    /// The mesh of the last frame. Shape: `[V]`, source order.
    pub positions: Vec<[f32; 3]>,
    workspace: Workspace<'s>,
}

impl<'s> Scene<'s> {
    /// At rest.
    ///
    /// # Errors
    /// None: memory made for the basis fits it.
    pub fn new(basis: &'s Basis<'s>, memory: &'s mut SceneMemory) -> Result<Self, Report> {
        Ok(Self {
            basis,
            controls: Controls::new(basis, &mut memory.weights).into_diagnostic()?,
            positions: vec![[0.0; 3]; basis.vertex_count()],
            workspace: Workspace::new(basis, &mut memory.workspace).into_diagnostic()?,
        })
    }

    /// The mesh of the weights. Allocates nothing.
    ///
    /// # Errors
    /// Weights so large that numbers overflow; the mesh is then the rest shape.
    pub fn solve(&mut self) -> Result<FrameOutcome, FrameError> {
        Frame {
            basis: self.basis,
            controls: &self.controls,
            positions: &mut self.positions,
            normals: None,
        }
        .run(&mut self.workspace)
    }
}
