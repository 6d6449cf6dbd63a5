//! The steps of an exact frame, each alone, on the workspace of a pose: for benchmarks, which time them, and for nobody
//! else; hidden from the documentation and free to change. The pose of the workspace is spent by them.

use crate::basis::Basis;
use crate::decode::Decoded;
use crate::error::{Buffer, FrameError, check_length};
use crate::solve::{self, displace, substitute};
use crate::workspace::Workspace;

/// Blend, tanh and exponential map of all components of the pose.
///
/// # Errors
/// [`FrameError::ForeignWorkspace`], [`FrameError::NeedsExactTier`]; so for all steps.
pub fn decode(basis: &Basis<'_>, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
    let tier = workspace.validate_exact(basis)?;
    let decoded = Decoded {
        shares: workspace.shares,
        blocks: workspace.blocks,
        touched: workspace.touched,
        gradients: workspace.gradients,
    };
    decoded.update(basis, tier.patches, workspace.kernels, workspace.weights, true);
    Ok(())
}

/// The right-hand side of the pose's gradients, into the scratch of the solve.
///
/// # Errors
/// Those of [`decode`].
pub fn right_hand_side(basis: &Basis<'_>, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
    let tier = workspace.validate_exact(basis)?;
    solve::right_hand_side(workspace.kernels, &tier, workspace.gradients, workspace.solution);
    Ok(())
}

/// Solves with the factor for the three columns in the scratch, which it first sets to ones, as a solver is given new ones.
///
/// # Errors
/// Those of [`decode`].
pub fn solve(basis: &Basis<'_>, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
    let tier = workspace.validate_exact(basis)?;
    workspace.solution.fill([[1.0; 4], [1.0; 4], [1.0; 4], [0.0; 4]]);
    substitute(workspace.kernels, &tier, workspace.solution);
    Ok(())
}

/// Positions in source order and the bounding box. Shape: `positions` `[V]`.
///
/// # Errors
/// Those of [`decode`], and of a pose that left f32.
pub fn scatter(basis: &Basis<'_>, workspace: &mut Workspace<'_>, positions: &mut [[f32; 3]]) -> Result<(), FrameError> {
    let tier = workspace.validate_exact(basis)?;
    check_length(basis.vertex_count(), Buffer::Positions, positions.len())?;
    displace(&tier, workspace.displacement, workspace.posed);
    workspace.added.apply(&basis.after(), workspace.posed);
    crate::positions::scatter(basis, workspace.posed, positions).1
}
