//! Skin: every vertex follows four nodes of the fast tier. Nodes' gradients and displacements -> affine maps -> positions.
//!
//! `p = r + sum over its nodes n of w_n (D_n (r - c) + o_n)` with `o_n = d_n - D_n (r_n - c)`. The maps act about the middle c
//! of the rest shape, so that a mesh far from the origin loses no digits, and are zero at rest, so that rest is exact.

use sinew_formats::package::{SKIN_NODES, SKIN_WEIGHT_SUM};

use super::poisson::Lane;
use super::surface::Bounds;
use crate::simd::lanes::Gradient;

/// Three columns of a gradient less identity, then the offset; each filled up with a zero.
pub(crate) type Map = [Lane; 4];

/// A weight of one unit.
pub(crate) const UNIT: f32 = 1.0 / SKIN_WEIGHT_SUM as f32;

/// Which nodes the vertices follow. Shape: all `[V]`, lanes of the exact tier.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Skin<'a> {
    /// Rest shape.
    pub(crate) rest: &'a [[f32; 3]],
    /// What the maps act about.
    pub(crate) centre: [f32; 3],
    /// Lanes of the nodes.
    pub(crate) nodes: &'a [[u16; SKIN_NODES]],
    /// Each row sums to [`SKIN_WEIGHT_SUM`].
    pub(crate) weights: &'a [[u16; SKIN_NODES]],
    /// Where positions go; a permutation.
    pub(crate) vertex_from_lane: &'a [u32],
}

/// Where skinned vertices go: `positions` in source order, and `posed` in lanes, filled up with a zero. Shape: both `[V]`.
#[derive(Debug)]
pub(crate) struct Skinned<'p> {
    pub(crate) posed: &'p mut [Lane],
    pub(crate) positions: &'p mut [[f32; 3]],
}

/// Maps of the nodes. Shape: all `[N]`, `displacement` at least; `displacement` in solver order, the rest in lanes.
pub(crate) fn maps(
    rest: &[[f32; 3]],
    centre: &[f32; 3],
    gradients: &[Gradient],
    displacement: &[Lane],
    solver_from_lane: &[u32],
    maps: &mut [Map],
) {
    for (((map, d), r), &solver) in maps.iter_mut().zip(gradients).zip(rest).zip(solver_from_lane) {
        let arm: [f32; 3] = core::array::from_fn(|c| r[c] - centre[c]);
        let turned = |c: usize| d[0][c] * arm[0] + d[1][c] * arm[1] + d[2][c] * arm[2];
        let mut offset = displacement[solver as usize];
        for c in 0..3 {
            offset[c] -= turned(c);
        }
        *map = [d[0], d[1], d[2], offset];
    }
}

/// Skins the vertices and gives their bounding box; nothing where a position is not finite. Shape: `maps` `[N]`, lanes.
pub(crate) fn skin(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    let mut bounds = Bounds::EMPTY;
    // Stays zero while all are finite.
    let mut trace = [0.0_f32; 3];
    let rows = skin.nodes.iter().zip(skin.weights).zip(skin.rest);
    for ((((nodes, weights), r), posed), &v) in rows.zip(skinned.posed).zip(skin.vertex_from_lane) {
        let mut blended = Map::default();
        for (&node, &weight) in nodes.iter().zip(weights) {
            let weight = f32::from(weight) * UNIT;
            for (sum, column) in blended.iter_mut().zip(&maps[usize::from(node)]) {
                for c in 0..3 {
                    sum[c] += weight * column[c];
                }
            }
        }
        let [x, y, z, offset] = &blended;
        let arm: [f32; 3] = core::array::from_fn(|c| r[c] - skin.centre[c]);
        let p: [f32; 3] = core::array::from_fn(|c| r[c] + (x[c] * arm[0] + y[c] * arm[1] + z[c] * arm[2] + offset[c]));
        for c in 0..3 {
            trace[c] += 0.0 * p[c];
        }
        bounds.include(&p);
        skinned.positions[v as usize] = p;
        *posed = [p[0], p[1], p[2], 0.0];
    }
    (trace == [0.0; 3]).then_some(bounds)
}
