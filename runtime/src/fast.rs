//! The fast tier's last steps: displacements of the nodes to their maps, and those to positions.

use crate::basis::Fast;
use crate::error::FrameError;
use crate::simd::lanes::Gradient;
use crate::simd::scalar::poisson::Lane;
use crate::simd::scalar::skin::{Map, Skin, Skinned};
use crate::simd::scalar::surface::Bounds;
use crate::simd::{Kernels, scalar};
#[cfg(target_arch = "x86_64")]
use crate::simd::{avx2, avx512};

/// Maps of the nodes. Shape: all `[N]`, `displacement` at least; `displacement` in solver order, the rest in lanes.
pub(crate) fn map_nodes(fast: &Fast<'_>, gradients: &[Gradient], displacement: &[Lane], maps: &mut [Map]) {
    let (nodes, centre) = (fast.nodes(), fast.skin().centre);
    let order = nodes.rings().solver_from_lane;
    scalar::skin::maps(nodes.rest_positions(), &centre, gradients, displacement, order, maps);
}

/// See [`scalar::skin::skin`].
pub(crate) fn skin(kernels: Kernels, skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    match kernels {
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx2 => avx2::skin::skin(skin, maps, skinned),
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx512 => avx512::skin::skin(skin, maps, skinned),
        _ => scalar::skin::skin(skin, maps, skinned),
    }
}

/// Writes the skinned vertices in source order and in lanes; gives the bounding box of what it wrote.
///
/// Errors: [`FrameError::NotFinite`], and then the output holds the rest shape.
pub(crate) fn emit_skinned(
    kernels: Kernels,
    fast: &Fast<'_>,
    maps: &[Map],
    posed: &mut [Lane],
    positions: &mut [[f32; 3]],
) -> (Bounds, Result<(), FrameError>) {
    let skinned = fast.skin();
    let output = Skinned {
        posed: &mut *posed,
        positions: &mut *positions,
    };
    if let Some(bounds) = skin(kernels, &skinned, maps, output) {
        return (bounds, Ok(()));
    }
    let lost = positions.iter().position(|p| !p.iter().all(|x| x.is_finite()));
    let mut bounds = Bounds::EMPTY;
    for ((r, posed), &v) in skinned.rest.iter().zip(posed).zip(skinned.vertex_from_lane) {
        positions[v as usize] = *r;
        *posed = [r[0], r[1], r[2], 0.0];
        bounds.include(r);
    }
    let vertex = lost.unwrap_or(0);
    (bounds, Err(FrameError::NotFinite { vertex }))
}
