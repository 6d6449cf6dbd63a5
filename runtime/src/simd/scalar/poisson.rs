//! Deformation gradients to displacements: right-hand side and solve of `L d = b(D)` (method section 1, reconstruction).
//!
//! Minimises `sum_i sum_j c_ij |(p_i - p_j) - T_i (r_i - r_j)|^2` over the positions p. With `p = r + d`, `T = I + D` and
//! symmetric c the normal equations are `sum_j c_ij (d_i - d_j) = 1/2 sum_j c_ij (D_i + D_j)(r_i - r_j)`. The factor
//! holds `L` and the penalty that keeps the anchor vertex at zero.

use crate::simd::lanes::Gradient;

/// Right-hand sides smaller than this are zero: products with them would be denormal, and denormals cost 22 times the
/// time of a solve.
const FLUSH_BELOW: f32 = 1e-20;

/// One-rings as compressed rows, with the cotangent weight of each edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rings<'a> {
    /// Shape: `[V + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Shape: `[2 * edges]`.
    pub(crate) neighbours: &'a [u32],
    /// Shape: `[2 * edges]`.
    pub(crate) weights: &'a [f32],
}

/// `F D F^T` with unit lower F by columns, diagonal left out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factor<'a> {
    /// Shape: `[V + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Greater than their column.
    pub(crate) rows: &'a [u32],
    /// Shape: that of `rows`.
    pub(crate) values: &'a [f32],
    /// Shape: `[V]`.
    pub(crate) inverse_pivots: &'a [f32],
}

/// `b_i = 1/2 sum_j c_ij (D_i + D_j)(r_i - r_j)`. Shape: all `[V]`, solver order.
pub(crate) fn right_hand_side(rings: &Rings<'_>, rest: &[[f32; 3]], gradients: &[Gradient], b: &mut [[f32; 3]]) {
    for (i, out) in b.iter_mut().enumerate() {
        let (r, d) = (&rest[i], &gradients[i]);
        let mut sum = [0.0_f32; 3];
        let ring = rings.offsets[i] as usize..rings.offsets[i + 1] as usize;
        for (&j, &weight) in rings.neighbours[ring.clone()].iter().zip(&rings.weights[ring]) {
            let (rj, dj) = (&rest[j as usize], &gradients[j as usize]);
            let edge = [r[0] - rj[0], r[1] - rj[1], r[2] - rj[2]];
            for c in 0..3 {
                let turned =
                    (d[0][c] + dj[0][c]) * edge[0] + (d[1][c] + dj[1][c]) * edge[1] + (d[2][c] + dj[2][c]) * edge[2];
                sum[c] += 0.5 * weight * turned;
            }
        }
        *out = sum.map(|x| if x.abs() < FLUSH_BELOW { 0.0 } else { x });
    }
}

/// Solves `F D F^T x = b` in place for x, y and z together. Shape: `b` `[V]`, solver order.
pub(crate) fn substitute(factor: &Factor<'_>, b: &mut [[f32; 3]]) {
    for j in 0..b.len() {
        let x = b[j];
        if x == [0.0; 3] {
            continue;
        }
        let column = factor.offsets[j] as usize..factor.offsets[j + 1] as usize;
        for (&i, &value) in factor.rows[column.clone()].iter().zip(&factor.values[column]) {
            let row = &mut b[i as usize];
            for c in 0..3 {
                row[c] -= value * x[c];
            }
        }
    }
    for j in (0..b.len()).rev() {
        let mut x = b[j].map(|x| x * factor.inverse_pivots[j]);
        let column = factor.offsets[j] as usize..factor.offsets[j + 1] as usize;
        for (&i, &value) in factor.rows[column.clone()].iter().zip(&factor.values[column]) {
            let row = &b[i as usize];
            for c in 0..3 {
                x[c] -= value * row[c];
            }
        }
        b[j] = x;
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::fixture::{Grid, factorise};
    use crate::simd::scalar::naive::{Noise, largest_difference};

    /// Roundings of a sum of six products near one.
    const SUM_TOLERANCE: f64 = 5e-6;
    /// f32 substitution on a factor of condition about 1e2.
    const SOLVE_TOLERANCE: f64 = 2e-5;

    /// Rows of nine to columns.
    fn columns(d: &[f32; 9]) -> Gradient {
        core::array::from_fn(|c| [d[c], d[3 + c], d[6 + c], 0.0])
    }

    #[test]
    fn right_hand_side_equals_the_naive_sum() {
        let grid = Grid::new(4, 3);
        let mut noise = Noise::new(6);
        let d: Vec<Gradient> = (0..grid.vertex_count()).map(|_| columns(&noise.features())).collect();
        let mut b = std::vec![[9.0; 3]; grid.vertex_count()];
        right_hand_side(&grid.rings(), &grid.rest, &d, &mut b);

        let mut expected = std::vec![[0.0_f64; 3]; grid.vertex_count()];
        for (i, j, weight) in grid.edges_both_ways() {
            for row in 0..3 {
                for c in 0..3 {
                    let mean = 0.5 * (f64::from(d[i][c][row]) + f64::from(d[j][c][row]));
                    let edge = f64::from(grid.rest[i][c]) - f64::from(grid.rest[j][c]);
                    expected[i][row] += f64::from(weight) * mean * edge;
                }
            }
        }
        assert!(largest_difference(&b, &expected) < SUM_TOLERANCE);
    }

    #[test]
    fn tiny_right_hand_sides_are_flushed() {
        let grid = Grid::new(2, 2);
        let mut b = std::vec![[9.0; 3]; 4];
        right_hand_side(&grid.rings(), &grid.rest, &[[[1e-30; 4]; 3]; 4], &mut b);
        assert_eq!(b, [[0.0; 3]; 4]);
    }

    #[test]
    fn substitution_solves_the_dense_system() {
        let grid = Grid::new(6, 5);
        let matrix = grid.laplacian();
        let factor = factorise(&matrix);
        let mut noise = Noise::new(7);
        let solution: Vec<[f64; 3]> = (0..grid.vertex_count()).map(|_| noise.point().map(f64::from)).collect();
        let mut b: Vec<[f32; 3]> = matrix
            .iter()
            .map(|row| core::array::from_fn(|c| row.iter().zip(&solution).map(|(a, x)| a * x[c]).sum::<f64>() as f32))
            .collect();
        substitute(&factor.view(), &mut b);
        assert!(largest_difference(&b, &solution) < SOLVE_TOLERANCE);
    }

    #[test]
    fn a_uniform_gradient_is_an_affine_map() {
        let grid = Grid::new(5, 5);
        let factor = factorise(&grid.laplacian());
        let d = [0.1, -0.2, 0.0, 0.3, 0.05, 0.1, 0.0, 0.2, -0.1];
        let mut b = std::vec![[0.0; 3]; grid.vertex_count()];
        right_hand_side(
            &grid.rings(),
            &grid.rest,
            &std::vec![columns(&d); grid.vertex_count()],
            &mut b,
        );
        substitute(&factor.view(), &mut b);
        let anchor = grid.rest[grid.anchor];
        let expected: Vec<[f64; 3]> = grid
            .rest
            .iter()
            .map(|r| {
                core::array::from_fn(|row| {
                    (0..3)
                        .map(|c| f64::from(d[3 * row + c]) * f64::from(r[c] - anchor[c]))
                        .sum::<f64>()
                })
            })
            .collect();
        assert!(largest_difference(&b, &expected) < SOLVE_TOLERANCE);
    }
}
