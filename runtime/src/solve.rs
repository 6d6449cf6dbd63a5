//! Solve: deformation gradients to displacements, and those to positions in source order.

use crate::basis::{Basis, Tier};
use crate::error::FrameError;
use crate::simd::scalar::poisson::{Block, Factor, Gradient, Lane, Rings};
use crate::simd::scalar::surface::scatter;
use crate::simd::{Kernels, scalar};
#[cfg(target_arch = "x86_64")]
use crate::simd::{avx2, avx512};

/// Solves `L d = b(D)`. Shape: `gradients` `[N]`, `displacement` `[4 T]`, zero after the last node; solver order.
pub(crate) fn solve(kernels: Kernels, tier: &Tier<'_>, gradients: &[Gradient], displacement: &mut [Lane]) {
    let rest = tier.rest_positions();
    displacement[rest.len()..].fill([0.0; 4]);
    right_hand_side(kernels, &tier.rings(), rest, gradients, displacement);
    substitute(kernels, &tier.factor(), displacement.as_chunks_mut().0);
}

/// See [`scalar::poisson::right_hand_side`].
pub(crate) fn right_hand_side(
    kernels: Kernels,
    rings: &Rings<'_>,
    rest: &[[f32; 3]],
    gradients: &[Gradient],
    b: &mut [Lane],
) {
    match kernels {
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx2 | Kernels::Avx512 => avx2::poisson::right_hand_side(rings, rest, gradients, b),
        _ => scalar::poisson::right_hand_side(rings, rest, gradients, b),
    }
}

/// See [`scalar::poisson::substitute`].
pub(crate) fn substitute(kernels: Kernels, factor: &Factor<'_>, x: &mut [Block]) {
    match kernels {
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx2 => avx2::poisson::substitute(factor, x),
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx512 => avx512::poisson::substitute(factor, x),
        _ => scalar::poisson::substitute(factor, x),
    }
}

/// Writes rest shape plus displacement in source order.
///
/// Errors: [`FrameError::NotFinite`], and then `positions` holds the rest shape.
pub(crate) fn emit(basis: &Basis<'_>, displacement: &[Lane], positions: &mut [[f32; 3]]) -> Result<(), FrameError> {
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
