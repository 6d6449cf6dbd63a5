//! Unseen shapes by a few held vertices, as a user would pull them: through the runtime's own drag. Compact package, vertices and
//! where they are to go -> weights -> positions.

use rayon::prelude::*;
use sinew_runtime::{
    Basis, Controls, Drag, Frame, HandleError, Handles, HandlesLayout, Workspace, WorkspaceError, WorkspaceLayout,
};

use super::player::PlayError;
use crate::bake::{BakeError, bake_bytes};
use sinew_formats::package::OpenError;

/// Updates of a drag at most: a user's hand takes as many in two seconds.
const UPDATES: usize = 120;

/// Updates without a step after which a drag has arrived.
const IDLE_UPDATES: usize = 5;

/// Why vertices cannot be dragged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HoldError {
    /// Not a compact package, or one that cannot be baked.
    #[error("the package cannot be baked")]
    Bake(#[from] BakeError),
    /// What was baked does not open.
    #[error("the baked package cannot be opened")]
    Open(#[from] OpenError),
    /// No memory suffices.
    #[error("the runtime has no workspace for the package")]
    Workspace(#[from] WorkspaceError),
    /// A vertex cannot be held, or a target not be aimed at.
    #[error("the vertices cannot be held")]
    Hold(#[from] HandleError),
    /// The runtime does not play.
    #[error(transparent)]
    Play(#[from] PlayError),
}

/// Drags `held` (at most [`sinew_runtime::HANDLES_MAX`] vertices) of the rest shape to each of `targets`, up to a translation of all
/// of them, and gives the whole mesh. Shapes: each of `targets` that of `held`, units of the source; the answer `[N][V]`.
pub fn drag_to(package: &[u8], held: &[usize], targets: &[Vec<[f32; 3]>]) -> Result<Vec<Vec<[f32; 3]>>, HoldError> {
    let baked = bake_bytes(package)?;
    let basis = Basis::open(&baked)?;
    targets
        .par_iter()
        .map(|targets| drag_one(&basis, held, targets))
        .collect()
}

fn drag_one(basis: &Basis<'_>, held: &[usize], targets: &[[f32; 3]]) -> Result<Vec<[f32; 3]>, HoldError> {
    let mut memory = vec![0_u8; WorkspaceLayout::for_basis(basis).unaligned_bytes()];
    let mut workspace = Workspace::new(basis, &mut memory)?;
    let mut own = vec![0_u8; HandlesLayout::for_basis(basis, held.len()).unaligned_bytes()];
    let mut handles = Handles::new(basis, held.len(), &mut own)?;
    for &vertex in held {
        handles.add(basis, &mut workspace, vertex)?;
    }
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(basis, &mut weights).map_err(PlayError::from)?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut idle = 0;
    for update in 0..=UPDATES {
        Frame {
            basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        }
        .run(&mut workspace)
        .map_err(PlayError::from)?;
        if update == UPDATES {
            break;
        }
        // The translation under which the targets are nearest to where the vertices are now.
        let mut shift = [0.0_f32; 3];
        for (&vertex, target) in held.iter().zip(targets) {
            for c in 0..3 {
                shift[c] += (positions[vertex][c] - target[c]) / held.len() as f32;
            }
        }
        for (&vertex, target) in held.iter().zip(targets) {
            handles.set_target(vertex, core::array::from_fn(|c| target[c] + shift[c]))?;
        }
        let report = Drag {
            basis,
            handles: &mut handles,
            controls: &mut controls,
        }
        .run(&mut workspace)?;
        // Each update that takes no step makes the next more careful.
        idle = if report.step_count == 0 { idle + 1 } else { 0 };
        if idle == IDLE_UPDATES {
            break;
        }
    }
    Ok(positions)
}
