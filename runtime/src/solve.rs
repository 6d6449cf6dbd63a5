//! Solve: deformation gradients to displacements, and those to positions in source order.

use crate::basis::{Basis, Tier};
use crate::error::FrameError;
use crate::simd::lanes::Gradient;
use crate::simd::scalar::poisson::{Block, Factor, Lane, Rings};
use crate::simd::scalar::surface::{Bounds, scatter};
use crate::simd::{Kernels, scalar};
#[cfg(target_arch = "x86_64")]
use crate::simd::{avx2, avx512};

/// Solves `L d = b(D)`. Shape: `gradients` `[N]`, lanes; `displacement` `[4 T]`, solver order, zero after the last node.
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

/// Writes rest shape plus displacement in source order and in lanes; gives the bounding box of what it wrote.
///
/// Errors: [`FrameError::NotFinite`], and then the output holds the rest shape.
pub(crate) fn emit(
    basis: &Basis<'_>,
    displacement: &[Lane],
    posed: &mut [[f32; 4]],
    positions: &mut [[f32; 3]],
) -> (Bounds, Result<(), FrameError>) {
    let (rest, orders) = (basis.rest_positions(), basis.orders());
    let vertex = match scatter(rest, displacement, orders, posed, positions) {
        Ok(bounds) => return (bounds, Ok(())),
        Err(vertex) => vertex as usize,
    };
    let mut bounds = Bounds::EMPTY;
    for ((r, posed), &v) in rest.iter().zip(posed).zip(orders.vertex_from_lane) {
        positions[v as usize] = *r;
        *posed = [r[0], r[1], r[2], 0.0];
        bounds.include(r);
    }
    (bounds, Err(FrameError::NotFinite { vertex }))
}
