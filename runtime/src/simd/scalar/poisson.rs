//! Deformation gradients to displacements: right-hand side and solve of `L d = b(D)` (method section 1, reconstruction).
//!
//! Minimises `sum_i sum_j c_ij |(p_i - p_j) - T_i (r_i - r_j)|^2` over the positions p. With `p = r + d`, `T = I + D` and
//! symmetric c the normal equations are `sum_j c_ij (d_i - d_j) = 1/2 sum_j c_ij (D_i + D_j)(r_i - r_j)`. The factor
//! holds `L` and the penalty that keeps the anchor vertex at zero.

use crate::simd::lanes::Gradient;

/// What one node has in a right-hand side or a solution: x, y, z, and a zero.
pub(crate) type Lane = [f32; 4];

/// Four nodes of a vector: the rows that one tile of the factor multiplies.
pub(crate) type Block = [Lane; BLOCK];

/// Nodes of a block, and rows and columns of a tile.
pub(crate) const BLOCK: usize = 4;

/// Numbers of the solve smaller than this are zero. With no entry of the factor nearer to zero than 1e-10 all products
/// are then normal numbers; denormal ones cost 22 times the time of a solve.
pub(crate) const FLUSH_BELOW: f32 = 1e-20;

/// One-rings as compressed rows, with the cotangent weight of each edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rings<'a> {
    /// Shape: `[N + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Shape: `[2 * edges]`.
    pub(crate) neighbours: &'a [u32],
    /// Shape: `[2 * edges]`.
    pub(crate) weights: &'a [f32],
    /// Where each row's right-hand side goes. Shape: `[V]`, a permutation.
    pub(crate) solver_from_lane: &'a [u32],
}

/// `F D F^T` in tiles: F block unit lower triangular, D block diagonal. T = ceil(N / 4) columns of tiles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factor<'a> {
    /// Columns over `rows`. Shape: `[T + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Which block a tile stands on; greater than its column.
    pub(crate) rows: &'a [u32],
    /// Row-major. Shape: that of `rows`.
    pub(crate) tiles: &'a [[f32; 16]],
    /// Symmetric; zero where the last block has no node. Shape: `[T]`.
    pub(crate) inverse_diagonals: &'a [[f32; 16]],
}

impl<'a> Factor<'a> {
    /// Rows and tiles of a column.
    pub(crate) fn column(&self, column: usize) -> impl DoubleEndedIterator<Item = (usize, &'a [f32; 16])> + use<'a> {
        let range = self.offsets[column] as usize..self.offsets[column + 1] as usize;
        let rows = self.rows[range.clone()].iter().map(|&row| row as usize);
        rows.zip(&self.tiles[range])
    }
}

/// `b_i = 1/2 (D_i g_i + sum_j D_j e_ij)` with `e_ij = c_ij (r_i - r_j)` and `g_i = sum_j e_ij`.
///
/// Shape: `rest` and `gradients` `[N]`, lanes; `b` at least `[N]`, solver order.
pub(crate) fn right_hand_side(rings: &Rings<'_>, rest: &[[f32; 3]], gradients: &[Gradient], b: &mut [Lane]) {
    for (i, &solver) in rings.solver_from_lane.iter().enumerate() {
        let (r, d) = (&rest[i], &gradients[i]);
        let mut sum = [0.0_f32; 3];
        let mut total = [0.0_f32; 3];
        let ring = rings.offsets[i] as usize..rings.offsets[i + 1] as usize;
        for (&j, &weight) in rings.neighbours[ring.clone()].iter().zip(&rings.weights[ring]) {
            let (rj, dj) = (&rest[j as usize], &gradients[j as usize]);
            let edge: [f32; 3] = core::array::from_fn(|c| weight * (r[c] - rj[c]));
            add_product(&mut sum, dj, &edge);
            for c in 0..3 {
                total[c] += edge[c];
            }
        }
        add_product(&mut sum, d, &total);
        let [x, y, z] = sum.map(|x| flushed(0.5 * x));
        b[solver as usize] = [x, y, z, 0.0];
    }
}

fn add_product(sum: &mut [f32; 3], gradient: &Gradient, edge: &[f32; 3]) {
    for row in 0..3 {
        sum[row] += gradient[0][row] * edge[0] + gradient[1][row] * edge[1] + gradient[2][row] * edge[2];
    }
}

fn flushed(x: f32) -> f32 {
    // A number that is not one stays, so that the frame sees it.
    if x.abs() < FLUSH_BELOW { 0.0 } else { x }
}

/// Solves `F D F^T x = b` in place for x, y and z together. Shape: `[T]`, solver order; zero where there is no node.
pub(crate) fn substitute(factor: &Factor<'_>, x: &mut [Block]) {
    for column in 0..x.len() {
        let own = x[column].map(|lane| lane.map(flushed));
        x[column] = own;
        if own == [[0.0; 4]; BLOCK] {
            continue;
        }
        for (row, tile) in factor.column(column) {
            for (lane, entries) in x[row].iter_mut().zip(tile.as_chunks::<BLOCK>().0) {
                for (value, other) in entries.iter().zip(&own) {
                    for c in 0..4 {
                        lane[c] -= value * other[c];
                    }
                }
            }
        }
    }
    for column in (0..x.len()).rev() {
        let mut own = [[0.0; 4]; BLOCK];
        for (entries, other) in factor.inverse_diagonals[column]
            .as_chunks::<BLOCK>()
            .0
            .iter()
            .zip(&x[column])
        {
            add_scaled(&mut own, entries, other, 1.0);
        }
        for (row, tile) in factor.column(column) {
            for (entries, other) in tile.as_chunks::<BLOCK>().0.iter().zip(&x[row]) {
                add_scaled(&mut own, entries, other, -1.0);
            }
        }
        x[column] = own.map(|lane| lane.map(flushed));
    }
}

/// `block_c += sign * entries_c * other`.
fn add_scaled(block: &mut Block, entries: &[f32; BLOCK], other: &Lane, sign: f32) {
    for (lane, value) in block.iter_mut().zip(entries) {
        for c in 0..4 {
            lane[c] += sign * value * other[c];
        }
    }
}
