//! Right-hand side and solve: the scalar kernels against dense f64 twins, the others against the scalar ones, and all of
//! them against denormal numbers.

use std::vec;
use std::vec::Vec;

use sinew_formats::package::QUAD;

use super::naive::{Noise, largest_difference};
use super::present as kernels_here;
use crate::fixture::{DenseFactor, Grid, factorise};
use crate::simd::generic::lanes::Gradient;
use crate::simd::generic::solve::{FLUSH_BELOW, Quad, Rings, Xyz0, place, put};

/// Roundings of a sum of a dozen products near one.
const SUM_TOLERANCE: f64 = 5e-6;
/// f32 substitution on a factor of condition about 1e2.
const SOLVE_TOLERANCE: f64 = 2e-5;

/// Grids of all remainders by four; the smallest have no tile at all.
const SIZES: [(u32, u32); 9] = [(2, 2), (3, 1), (3, 2), (5, 1), (7, 1), (3, 3), (5, 5), (7, 6), (9, 11)];

fn gradients(noise: &mut Noise, count: usize) -> Vec<Gradient> {
    (0..count)
        .map(|_| core::array::from_fn(|_| with_zero(noise.point())))
        .collect()
}

fn with_zero([x, y, z]: [f32; 3]) -> Xyz0 {
    [x, y, z, 0.0]
}

fn empty(count: usize) -> Vec<Quad> {
    vec![Quad::default(); count.div_ceil(QUAD)]
}

/// Noise on the nodes, zero after the last.
fn noisy(noise: &mut Noise, count: usize) -> Vec<Quad> {
    let mut quads = empty(count);
    (0..count as u32).for_each(|solver| put(&mut quads, solver, noise.point()));
    quads
}

/// Points in solver order, as far as there are places.
fn points(quads: &[Quad]) -> Vec<[f32; 3]> {
    assert!(quads.iter().all(|quad| quad[3] == [0.0; QUAD]), "zeros stay");
    (0..(quads.len() * QUAD) as u32)
        .map(|solver| place(quads, solver))
        .collect()
}

fn widened(quads: &[Quad]) -> Vec<[f64; 3]> {
    points(quads).iter().map(|p| p.map(f64::from)).collect()
}

/// A grid's Laplacian and its factor. An eighth on the diagonal: a line of vertices has no face, so each stands alone.
fn system(width: u32, height: u32) -> (Grid, Vec<Vec<f64>>, DenseFactor) {
    let grid = Grid::new(width, height);
    let mut matrix = grid.laplacian();
    matrix.iter_mut().enumerate().for_each(|(i, row)| row[i] += 0.125);
    let factor = factorise(&matrix);
    (grid, matrix, factor)
}

#[test]
fn right_hand_side_equals_the_naive_sum() {
    let mut noise = Noise::new(6);
    for (width, height) in SIZES {
        let grid = Grid::new(width, height);
        let d = gradients(&mut noise, grid.vertex_count());
        let mut expected = vec![[0.0_f64; 3]; grid.vertex_count()];
        for (i, j, weight) in grid.edges_both_ways() {
            for row in 0..3 {
                for c in 0..3 {
                    let mean = 0.5 * (f64::from(d[i][c][row]) + f64::from(d[j][c][row]));
                    let edge = f64::from(grid.rest[i][c]) - f64::from(grid.rest[j][c]);
                    expected[i][row] += f64::from(weight) * mean * edge;
                }
            }
        }
        for kernels in kernels_here() {
            let mut b = empty(grid.vertex_count());
            kernels.right_hand_side(&grid.rings(), &grid.rest, &d, 0..grid.vertex_count(), &mut b);
            let expected = grid.in_solver_order(&expected);
            let found = &points(&b)[..grid.vertex_count()];
            assert!(largest_difference(found, &expected) < SUM_TOLERANCE, "{kernels:?}");
        }
    }
}

#[test]
fn substitution_solves_the_dense_system() {
    let mut noise = Noise::new(7);
    for (width, height) in SIZES {
        let (grid, matrix, factor) = system(width, height);
        let expected = widened(&noisy(&mut noise, grid.vertex_count()));
        let mut b = empty(grid.vertex_count());
        for (solver, row) in matrix.iter().enumerate() {
            let sum = |c: usize| row.iter().zip(&expected).map(|(a, x)| a * x[c]).sum::<f64>() as f32;
            put(&mut b, solver as u32, [0, 1, 2].map(sum));
        }
        for kernels in kernels_here() {
            let mut x = b.clone();
            kernels.substitute(&factor.view(), &mut x);
            let difference = largest_difference(&points(&x), &expected);
            assert!(
                difference < SOLVE_TOLERANCE,
                "{kernels:?} {width} {height}: {difference}"
            );
        }
    }
}

#[test]
fn a_uniform_gradient_is_an_affine_map() {
    let grid = Grid::new(5, 5);
    let factor = factorise(&grid.laplacian());
    let d: Gradient = [[0.1, 0.3, 0.0, 0.0], [-0.2, 0.05, 0.2, 0.0], [0.0, 0.1, -0.1, 0.0]];
    let anchor = grid.rest[grid.anchor];
    let displaced = |r: &[f32; 3]| -> [f64; 3] {
        let arm = |c: usize| f64::from(r[c] - anchor[c]);
        core::array::from_fn(|row| (0..3).map(|c| f64::from(d[c][row]) * arm(c)).sum())
    };
    let expected: Vec<[f64; 3]> = grid.rest.iter().map(displaced).collect();
    let expected = grid.in_solver_order(&expected);
    for kernels in kernels_here() {
        let mut b = empty(grid.vertex_count());
        kernels.right_hand_side(
            &grid.rings(),
            &grid.rest,
            &vec![d; grid.vertex_count()],
            0..grid.vertex_count(),
            &mut b,
        );
        kernels.substitute(&factor.view(), &mut b);
        let found = &points(&b)[..grid.vertex_count()];
        assert!(largest_difference(found, &expected) < SOLVE_TOLERANCE, "{kernels:?}");
    }
}

#[test]
fn a_single_force_is_the_only_one_left() {
    // Most columns are zero on the way down, and are skipped.
    let (grid, matrix, factor) = system(9, 11);
    for node in [0_u32, 50, 98] {
        let mut b = empty(grid.vertex_count());
        put(&mut b, node, [1.0, -2.0, 0.5]);
        for kernels in kernels_here() {
            let mut x = b.clone();
            kernels.substitute(&factor.view(), &mut x);
            let x = widened(&x);
            for (i, row) in matrix.iter().enumerate() {
                let force = row.iter().zip(&x).map(|(a, x)| a * x[1]).sum::<f64>();
                let expected = if i == node as usize { -2.0 } else { 0.0 };
                assert!((force - expected).abs() < SOLVE_TOLERANCE, "{kernels:?} {node} {i}");
            }
        }
    }
}

/// Zero, or far enough from it.
fn are_sound(quads: &[Quad]) -> bool {
    let numbers = quads.as_flattened().as_flattened();
    numbers.iter().all(|x| *x == 0.0 || x.abs() >= FLUSH_BELOW)
}

#[test]
fn no_denormal_enters_or_leaves_the_solve() {
    let (grid, _, factor) = system(9, 11);
    let mut noise = Noise::new(8);
    // From all of them normal to all of them denormal.
    for exponent in (-44..=0).map(|e| 10_f32.powi(e)) {
        let shrink = |numbers: &mut [f32]| numbers.iter_mut().for_each(|x| *x *= exponent);
        let mut d = gradients(&mut noise, grid.vertex_count());
        shrink(d.as_flattened_mut().as_flattened_mut());
        for kernels in kernels_here() {
            let mut b = empty(grid.vertex_count());
            kernels.right_hand_side(&grid.rings(), &grid.rest, &d, 0..grid.vertex_count(), &mut b);
            assert!(are_sound(&b), "{kernels:?} {exponent}");
            // What no right-hand side lets through: the solve keeps it out all the same.
            let mut flood = noisy(&mut noise, grid.vertex_count());
            shrink(flood.as_flattened_mut().as_flattened_mut());
            for mut x in [b, flood] {
                kernels.substitute(&factor.view(), &mut x);
                assert!(are_sound(&x), "{kernels:?} {exponent}");
            }
        }
    }
}

#[test]
fn what_is_not_a_number_is_not_lost() {
    let (grid, _, factor) = system(5, 5);
    for bad in [f32::NAN, f32::INFINITY] {
        for kernels in kernels_here() {
            let mut d = gradients(&mut Noise::new(9), grid.vertex_count());
            d[7][1][2] = bad;
            let solver = grid.rings().solver_from_slot[7];
            let mut b = empty(grid.vertex_count());
            kernels.right_hand_side(&grid.rings(), &grid.rest, &d, 0..grid.vertex_count(), &mut b);
            assert!(!place(&b, solver)[2].is_finite(), "{kernels:?}");
            kernels.substitute(&factor.view(), &mut b);
            assert!(!place(&b, solver)[2].is_finite(), "{kernels:?}");
        }
    }
}

#[test]
fn an_edgeless_mesh_has_no_force() {
    let rings = Rings {
        offsets: &[0, 0, 0],
        neighbours: &[],
        weights: &[],
        solver_from_slot: &[1_u16, 0],
    };
    for kernels in kernels_here() {
        let mut b = [[[9.0; 4], [9.0; 4], [9.0; 4], [0.0; 4]]];
        kernels.right_hand_side(&rings, &[[1.0; 3]; 2], &[[[1.0; 4]; 3]; 2], 0..2, &mut b);
        assert_eq!([0_u16, 1].map(|solver| place(&b, solver)), [[0.0; 3]; 2], "{kernels:?}");
    }
}
