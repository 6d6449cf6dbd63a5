//! Solve: deformation gradients to displacements, and those to positions in source order.

use crate::basis::{Basis, Tier};
use crate::error::FrameError;
use crate::simd::scalar::blend::Features;
use crate::simd::scalar::poisson::{right_hand_side, substitute};
use crate::simd::scalar::surface::scatter;

/// Solves `L d = b(D)`. Shape: both `[N]`, solver order.
pub(crate) fn solve(tier: &Tier<'_>, gradients: &[Features], displacement: &mut [[f32; 3]]) {
    right_hand_side(&tier.rings(), tier.rest_positions(), gradients, displacement);
    substitute(&tier.factor(), displacement);
}

/// Writes rest shape plus displacement in source order.
///
/// Errors: [`FrameError::NotFinite`], and then `positions` holds the rest shape.
pub(crate) fn emit(basis: &Basis<'_>, displacement: &[[f32; 3]], positions: &mut [[f32; 3]]) -> Result<(), FrameError> {
    let (rest, order) = (basis.rest_positions(), basis.vertex_from_solver());
    let Err(vertex) = scatter(rest, displacement, order, positions) else {
        return Ok(());
    };
    for (r, &v) in rest.iter().zip(order) {
        positions[v as usize] = *r;
    }
    Err(FrameError::NotFinite {
        vertex: vertex as usize,
    })
}
