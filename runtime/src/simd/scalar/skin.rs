//! Skin: every vertex follows four nodes of the fast tier. Nodes' gradients and displacements -> affine maps -> positions.
//!
//! `p = r + sum over its nodes n of w_n (D_n (r - c) + o_n)` with `o_n = d_n - D_n (r_n - c)`. The maps act about the middle c
//! of the rest shape, so that a mesh far from the origin loses no digits, and are zero at rest, so that rest is exact.

use sinew_formats::package::{SKIN_NODES, SKIN_WEIGHT_SUM};

use super::poisson::{Gradient, Lane};

/// Three columns of a gradient less identity, then the offset; each filled up with a zero.
pub(crate) type Map = [Lane; 4];

/// A weight of one unit.
pub(crate) const UNIT: f32 = 1.0 / SKIN_WEIGHT_SUM as f32;

/// Which nodes the vertices follow. Shape: all `[V]`, source order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Skin<'a> {
    /// Rest shape.
    pub(crate) rest: &'a [[f32; 3]],
    /// What the maps act about.
    pub(crate) centre: [f32; 3],
    /// Solver indices of the nodes.
    pub(crate) nodes: &'a [[u16; SKIN_NODES]],
    /// Each row sums to [`SKIN_WEIGHT_SUM`].
    pub(crate) weights: &'a [[u16; SKIN_NODES]],
}

/// Maps of the nodes. Shape: all `[N]`, `displacement` at least; solver order.
pub(crate) fn maps(
    rest: &[[f32; 3]],
    centre: &[f32; 3],
    gradients: &[Gradient],
    displacement: &[Lane],
    maps: &mut [Map],
) {
    for (((map, d), offset), r) in maps.iter_mut().zip(gradients).zip(displacement).zip(rest) {
        let arm: [f32; 3] = core::array::from_fn(|c| r[c] - centre[c]);
        let turned = |c: usize| d[0][c] * arm[0] + d[1][c] * arm[1] + d[2][c] * arm[2];
        *map = [d[0], d[1], d[2], core::array::from_fn(|c| offset[c] - turned(c))];
    }
}

/// Positions of the vertices; whether all of them are finite. Shape: `maps` `[N]`, solver order; `positions` `[V]`, source order.
pub(crate) fn skin(skin: &Skin<'_>, maps: &[Map], positions: &mut [[f32; 3]]) -> bool {
    let mut finite = true;
    let rows = skin.nodes.iter().zip(skin.weights);
    for ((position, r), (nodes, weights)) in positions.iter_mut().zip(skin.rest).zip(rows) {
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
        *position = core::array::from_fn(|c| r[c] + (x[c] * arm[0] + y[c] * arm[1] + z[c] * arm[2] + offset[c]));
        finite &= position.iter().all(|x| x.is_finite());
    }
    finite
}
