//! Weights to maps of the bones.

use sinew_formats::package::{BonesView, GROUP_NODES};

use crate::basis::Basis;
use crate::decode::Decoded;
use crate::simd::generic::bones::BoneLanes;
use crate::simd::generic::lanes::Gradient;
use crate::simd::generic::solve::Xyz0;
use crate::workspace::Workspace;

/// What a bone does to a rest position r: `D (r - c) + o` is added to it, with the place c that all bones share, [`centre`].
/// Three columns of D, then o; each filled up with a zero. Zero at rest, so rest is exact.
pub(crate) type Map = [Xyz0; 4];

/// What the maps act about: a mesh far from the origin then loses no digits.
pub(crate) fn centre(bones: &BonesView<'_>) -> [f32; 3] {
    bones.rest_places[0]
}

/// Brings the maps of the workspace, which is one of bones, to its weights.
pub(crate) fn update(basis: &Basis<'_>, bones: &BonesView<'_>, workspace: &mut Workspace<'_>) {
    let decoded = Decoded {
        shares: workspace.shares,
        blocks: workspace.blocks,
        touched: workspace.touched,
        gradients: workspace.gradients,
    };
    decoded.update(basis, bones.patches, workspace.kernels, workspace.weights, false);
    let gradients = &*workspace.gradients;
    workspace.kernels.turn(bones, gradients, workspace.turned);
    let displaced = &mut *workspace.displaced;
    workspace
        .kernels
        .displace(bones, gradients, workspace.weights, displaced);
    join(bones, workspace.turned, displaced, workspace.maps);
}

/// Gradients about the bones' own places and their displacements, to maps about one place. Shape: `turned` and `maps` `[B]`,
/// `displaced` `[H]`.
fn join(bones: &BonesView<'_>, turned: &[Gradient], displaced: &[BoneLanes], maps: &mut [Map]) {
    let centre = centre(bones);
    for (b, ((map, d), place)) in maps.iter_mut().zip(turned).zip(bones.rest_places).enumerate() {
        let moved = &displaced[b / GROUP_NODES];
        let arm: [f32; 3] = core::array::from_fn(|c| centre[c] - place[c]);
        let mut offset = [0.0; 4];
        for c in 0..3 {
            let turned = d[0][c] * arm[0] + d[1][c] * arm[1] + d[2][c] * arm[2];
            offset[c] = moved[c][b % GROUP_NODES] + turned;
        }
        *map = [d[0], d[1], d[2], offset];
    }
}

/// The first bone whose map is not made of numbers.
pub(crate) fn lost(maps: &[Map]) -> Option<usize> {
    // Stays zero while all are finite.
    let trace = maps
        .iter()
        .flatten()
        .flatten()
        .fold(0.0_f32, |trace, x| trace + 0.0 * x);
    if trace == 0.0 {
        return None;
    }
    maps.iter().position(|map| !map.iter().flatten().all(|x| x.is_finite()))
}
