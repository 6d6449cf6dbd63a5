//! Solve: deformation gradients to displacements, and those to positions in source order.

use crate::basis::{Basis, Tier};
use crate::error::FrameError;
use crate::simd::lanes::Gradient;
use crate::simd::scalar::poisson::{right_hand_side, substitute};
use crate::simd::scalar::surface::{Bounds, scatter};

/// Solves `L d = b(D)`. Shape: both `[N]`, solver order.
pub(crate) fn solve(tier: &Tier<'_>, gradients: &[Gradient], displacement: &mut [[f32; 3]]) {
    right_hand_side(&tier.rings(), tier.rest_positions(), gradients, displacement);
    substitute(&tier.factor(), displacement);
}

/// Writes rest shape plus displacement in source order and in lanes; gives the bounding box of what it wrote.
///
/// Errors: [`FrameError::NotFinite`], and then the output holds the rest shape.
pub(crate) fn emit(
    basis: &Basis<'_>,
    displacement: &[[f32; 3]],
    posed: &mut [[f32; 4]],
    positions: &mut [[f32; 3]],
) -> (Bounds, Result<(), FrameError>) {
    let (rest, places) = (basis.rest_positions(), basis.places());
    let vertex = match scatter(rest, displacement, places, posed, positions) {
        Ok(bounds) => return (bounds, Ok(())),
        Err(vertex) => vertex as usize,
    };
    let mut bounds = Bounds::EMPTY;
    let targets = places.vertex_from_solver.iter().zip(places.lane_from_solver);
    for (r, (&v, &lane)) in rest.iter().zip(targets) {
        positions[v as usize] = *r;
        posed[lane as usize] = [r[0], r[1], r[2], 0.0];
        bounds.include(r);
    }
    (bounds, Err(FrameError::NotFinite { vertex }))
}
