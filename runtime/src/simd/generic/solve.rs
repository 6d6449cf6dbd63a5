//! Deformation gradients to displacements: right-hand side and solve of `L d = b(D)` (method section 1, reconstruction). The
//! types of both steps, and the reference: plain Rust in the order of operations that every other kernel keeps.
//!
//! Minimises `sum_i sum_j c_ij |(p_i - p_j) - T_i (r_i - r_j)|^2` over the positions p. With `p = r + d`, `T = I + D` and
//! symmetric c the normal equations are `sum_j c_ij (d_i - d_j) = 1/2 sum_j c_ij (D_i + D_j)(r_i - r_j)`. The factor
//! holds `L` and the penalty that keeps the anchor vertex at zero.

use core::ops::Range;

use sinew_formats::package::{Index, QUAD, SolveView, TILE_ENTRIES};

use super::lanes::Gradient;

/// A row of four numbers: x, y, z, and a zero.
pub(crate) type Xyz0 = [f32; 4];

/// Four solver places: their x, their y, their z, and zeros, so that a tile's columns meet them without a permutation.
pub(crate) type Quad = [[f32; QUAD]; 4];

/// Numbers of the solve smaller than this are zero. With no entry of the factor nearer to zero than 1e-10 all products
/// are then normal numbers; denormal ones cost 22 times the time of a solve.
pub(crate) const FLUSH_BELOW: f32 = 1e-20;

/// One-rings as compressed rows, with the cotangent weight of each edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rings<'a, I> {
    /// Shape: `[N + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Shape: `[2 * edges]`.
    pub(crate) neighbours: &'a [I],
    /// Shape: `[2 * edges]`.
    pub(crate) weights: &'a [f32],
    /// Where each row's right-hand side goes. Shape: `[N]`, a permutation.
    pub(crate) solver_from_slot: &'a [I],
}

/// `F D F^T` in tiles: F block unit lower triangular, D block diagonal. T = ceil(N / 4) columns of tiles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factor<'a, I> {
    /// Columns over `rows`. Shape: `[T + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Which quad a tile stands on; greater than its column.
    pub(crate) rows: &'a [I],
    /// Column-major. Shape: that of `rows`.
    pub(crate) tiles: &'a [[f32; TILE_ENTRIES]],
    /// Symmetric; zero where the last quad has no node. Shape: `[T]`.
    pub(crate) inverse_diagonals: &'a [[f32; TILE_ENTRIES]],
}

impl<'a, I: Index> Rings<'a, I> {
    /// Of a package's system, whose indices are of this width.
    pub(crate) fn of(solve: &SolveView<'a>) -> Self {
        Self {
            offsets: solve.ring_offsets,
            neighbours: I::of(solve.ring),
            weights: solve.ring_weights,
            solver_from_slot: I::of(solve.solver_from_slot),
        }
    }
}

impl<'a, I: Index> Factor<'a, I> {
    /// Of a package's system, whose indices are of this width.
    pub(crate) fn of(solve: &SolveView<'a>) -> Self {
        Self {
            offsets: solve.tile_offsets,
            rows: I::of(solve.tile_rows),
            tiles: solve.tiles,
            inverse_diagonals: solve.inverse_diagonals,
        }
    }

    /// Rows and tiles of a column.
    #[inline(always)]
    pub(crate) fn column(
        &self,
        column: usize,
    ) -> impl DoubleEndedIterator<Item = (usize, &'a [f32; TILE_ENTRIES])> + use<'a, I> {
        let range = self.offsets[column] as usize..self.offsets[column + 1] as usize;
        let rows = self.rows[range.clone()].iter().map(|&row| row.at());
        rows.zip(&self.tiles[range])
    }
}

/// What stands at a solver place.
#[inline(always)]
pub(crate) fn place<I: Index>(quads: &[Quad], solver: I) -> [f32; 3] {
    let [x, y, z, _] = &quads[solver.at() / QUAD];
    let n = solver.at() % QUAD;
    [x[n], y[n], z[n]]
}

/// Puts a point at a solver place.
#[inline(always)]
pub(crate) fn put<I: Index>(quads: &mut [Quad], solver: I, [x, y, z]: [f32; 3]) {
    let quad = &mut quads[solver.at() / QUAD];
    let n = solver.at() % QUAD;
    (quad[0][n], quad[1][n], quad[2][n]) = (x, y, z);
}

/// `b_i = 1/2 (D_i g_i + sum_j D_j e_ij)` with `e_ij = c_ij (r_i - r_j)` and `g_i = sum_j e_ij`.
///
/// The rows of some slots; the others stay. Shape: `rest` and `gradients` `[N]`, slots; `b` `[T]`, solver order.
pub(crate) fn right_hand_side<I: Index>(
    rings: &Rings<'_, I>,
    rest: &[[f32; 3]],
    gradients: &[Gradient],
    slots: Range<usize>,
    b: &mut [Quad],
) {
    for i in slots {
        let solver = rings.solver_from_slot[i];
        let (r, d) = (&rest[i], &gradients[i]);
        let mut sum = [0.0_f32; 3];
        let mut total = [0.0_f32; 3];
        let ring = rings.offsets[i] as usize..rings.offsets[i + 1] as usize;
        for (&j, &weight) in rings.neighbours[ring.clone()].iter().zip(&rings.weights[ring]) {
            let (rj, dj) = (&rest[j.at()], &gradients[j.at()]);
            let edge: [f32; 3] = core::array::from_fn(|c| weight * (r[c] - rj[c]));
            add_product(&mut sum, dj, &edge);
            for c in 0..3 {
                total[c] += edge[c];
            }
        }
        add_product(&mut sum, d, &total);
        put(b, solver, sum.map(|x| flushed(0.5 * x)));
    }
}

fn add_product(sum: &mut [f32; 3], gradient: &Gradient, edge: &[f32; 3]) {
    for row in 0..3 {
        sum[row] += gradient[0][row] * edge[0] + gradient[1][row] * edge[1] + gradient[2][row] * edge[2];
    }
}

pub(crate) fn flushed(x: f32) -> f32 {
    // A number that is not one stays, so that the frame sees it.
    if x.abs() < FLUSH_BELOW { 0.0 } else { x }
}

/// Solves `F D F^T x = b` in place for x, y and z together. Shape: `[T]`, solver order; zero where there is no node.
///
/// Down, a column of a tile times one place is taken off four places at once; up, products stand in the places of their rows
/// until a column is done, and are then summed: first and second, third and fourth, both.
pub(crate) fn substitute<I: Index>(factor: &Factor<'_, I>, x: &mut [Quad]) {
    for column in 0..x.len() {
        let own = x[column].map(|row| row.map(flushed));
        x[column] = own;
        if own == Quad::default() {
            continue;
        }
        for (row, tile) in factor.column(column) {
            let target = &mut x[row];
            for (n, entries) in tile.as_chunks::<QUAD>().0.iter().enumerate() {
                for c in 0..3 {
                    for r in 0..QUAD {
                        target[c][r] -= entries[r] * own[c][n];
                    }
                }
            }
        }
    }
    for column in (0..x.len()).rev() {
        let mut own = Quad::default();
        let inverse = factor.inverse_diagonals[column].as_chunks::<QUAD>().0;
        for (n, entries) in inverse.iter().enumerate() {
            for c in 0..3 {
                for r in 0..QUAD {
                    own[c][r] += entries[r] * x[column][c][n];
                }
            }
        }
        let mut sums = [Quad::default(); QUAD];
        for (row, tile) in factor.column(column).rev() {
            for (sum, entries) in sums.iter_mut().zip(tile.as_chunks::<QUAD>().0) {
                for c in 0..3 {
                    for r in 0..QUAD {
                        sum[c][r] += entries[r] * x[row][c][r];
                    }
                }
            }
        }
        for (n, sum) in sums.iter().enumerate() {
            for c in 0..3 {
                let [first, second, third, fourth] = sum[c];
                own[c][n] -= (first + second) + (third + fourth);
            }
        }
        x[column] = own.map(|row| row.map(flushed));
    }
}
