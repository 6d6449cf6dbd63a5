//! The fast tier's last steps: displacements of the nodes to their maps, and those to positions.

use crate::basis::Fast;
use crate::error::FrameError;
use crate::simd::scalar::poisson::{Gradient, Lane};
use crate::simd::scalar::skin::{Map, Skin};
use crate::simd::{Kernels, scalar};
#[cfg(target_arch = "x86_64")]
use crate::simd::{avx2, avx512};

/// Maps of the nodes. Shape: all `[N]`, `displacement` at least; solver order of the nodes.
pub(crate) fn map_nodes(fast: &Fast<'_>, gradients: &[Gradient], displacement: &[Lane], maps: &mut [Map]) {
    let rest = fast.nodes().rest_positions();
    scalar::skin::maps(rest, &fast.skin().centre, gradients, displacement, maps);
}

/// See [`scalar::skin::skin`].
pub(crate) fn skin(kernels: Kernels, skin: &Skin<'_>, maps: &[Map], positions: &mut [[f32; 3]]) -> bool {
    match kernels {
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx2 => avx2::skin::skin(skin, maps, positions),
        #[cfg(target_arch = "x86_64")]
        Kernels::Avx512 => avx512::skin::skin(skin, maps, positions),
        _ => scalar::skin::skin(skin, maps, positions),
    }
}

/// Writes the skinned vertices.
///
/// Errors: [`FrameError::NotFinite`], and then `positions` holds the rest shape.
pub(crate) fn emit_skinned(
    kernels: Kernels,
    fast: &Fast<'_>,
    maps: &[Map],
    positions: &mut [[f32; 3]],
) -> Result<(), FrameError> {
    let skinned = fast.skin();
    if skin(kernels, &skinned, maps, positions) {
        return Ok(());
    }
    let lost = positions.iter().position(|p| !p.iter().all(|x| x.is_finite()));
    positions.copy_from_slice(skinned.rest);
    Err(FrameError::NotFinite {
        vertex: lost.unwrap_or(0),
    })
}
