//! Right-hand side and solve: the scalar kernels against dense f64 twins, the others against the scalar ones, and all of
//! them against denormal numbers.

use std::vec;
use std::vec::Vec;

use crate::fixture::{DenseFactor, Grid, factorise};
use crate::simd::Kernels;
use crate::simd::lanes::Gradient;
use crate::simd::scalar::naive::{Noise, largest_difference};
use crate::simd::scalar::poisson::{BLOCK, Block, FLUSH_BELOW, Lane, Rings};
use crate::solve::{right_hand_side, substitute};

/// Roundings of a sum of a dozen products near one.
const SUM_TOLERANCE: f64 = 5e-6;
/// f32 substitution on a factor of condition about 1e2.
const SOLVE_TOLERANCE: f64 = 2e-5;

/// Grids of all remainders by four; the smallest have no tile at all.
const SIZES: [(u32, u32); 9] = [(2, 2), (3, 1), (3, 2), (5, 1), (7, 1), (3, 3), (5, 5), (7, 6), (9, 11)];

fn kernels_here() -> impl Iterator<Item = Kernels> {
    [Kernels::Scalar, Kernels::Avx2, Kernels::Avx512]
        .into_iter()
        .filter(|kernels| kernels.run_here())
}

fn gradients(noise: &mut Noise, count: usize) -> Vec<Gradient> {
    (0..count)
        .map(|_| core::array::from_fn(|_| with_zero(noise.point())))
        .collect()
}

fn with_zero([x, y, z]: [f32; 3]) -> Lane {
    [x, y, z, 0.0]
}

/// Noise on the nodes, zero after the last.
fn lanes(noise: &mut Noise, count: usize) -> Vec<Block> {
    let mut blocks = vec![[[0.0; 4]; BLOCK]; count.div_ceil(BLOCK)];
    let nodes = blocks.as_flattened_mut();
    nodes[..count]
        .iter_mut()
        .for_each(|lane| *lane = with_zero(noise.point()));
    blocks
}

fn widened(blocks: &[Block]) -> Vec<[f64; 4]> {
    blocks.as_flattened().iter().map(|lane| lane.map(f64::from)).collect()
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
        let mut expected = vec![[0.0_f64; 4]; grid.vertex_count()];
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
            let mut b = vec![[9.0; 4]; grid.vertex_count()];
            right_hand_side(kernels, &grid.rings(), &grid.rest, &d, &mut b);
            let expected = grid.in_solver_order(&expected);
            assert!(largest_difference(&b, &expected) < SUM_TOLERANCE, "{kernels:?}");
            assert!(b.iter().all(|lane| lane[3] == 0.0));
        }
    }
}

#[test]
fn substitution_solves_the_dense_system() {
    let mut noise = Noise::new(7);
    for (width, height) in SIZES {
        let (grid, matrix, factor) = system(width, height);
        let solution = lanes(&mut noise, grid.vertex_count());
        let expected = widened(&solution);
        let mut b = solution.clone();
        for (lane, row) in b.as_flattened_mut().iter_mut().zip(&matrix) {
            *lane = core::array::from_fn(|c| row.iter().zip(&expected).map(|(a, x)| a * x[c]).sum::<f64>() as f32);
        }
        for kernels in kernels_here() {
            let mut x = b.clone();
            substitute(kernels, &factor.view(), &mut x);
            let difference = largest_difference(x.as_flattened(), &expected);
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
    let mut expected = vec![[0.0; 4]; grid.vertex_count().next_multiple_of(BLOCK)];
    for (lane, r) in expected.iter_mut().zip(&grid.rest) {
        for row in 0..3 {
            lane[row] = (0..3).map(|c| f64::from(d[c][row]) * f64::from(r[c] - anchor[c])).sum();
        }
    }
    let in_solver_order = grid.in_solver_order(&expected[..grid.vertex_count()]);
    expected[..grid.vertex_count()].copy_from_slice(&in_solver_order);
    for kernels in kernels_here() {
        let mut b = lanes(&mut Noise::new(0), grid.vertex_count());
        let nodes = b.as_flattened_mut();
        right_hand_side(kernels, &grid.rings(), &grid.rest, &vec![d; grid.vertex_count()], nodes);
        substitute(kernels, &factor.view(), &mut b);
        assert!(
            largest_difference(b.as_flattened(), &expected) < SOLVE_TOLERANCE,
            "{kernels:?}"
        );
    }
}

#[test]
fn a_single_force_is_the_only_one_left() {
    // Most columns are zero on the way down, and are skipped.
    let (grid, matrix, factor) = system(9, 11);
    for node in [0, 50, 98] {
        let mut b = vec![[[0.0; 4]; BLOCK]; grid.vertex_count().div_ceil(BLOCK)];
        b.as_flattened_mut()[node] = [1.0, -2.0, 0.5, 0.0];
        for kernels in kernels_here() {
            let mut x = b.clone();
            substitute(kernels, &factor.view(), &mut x);
            let x = widened(&x);
            for (i, row) in matrix.iter().enumerate() {
                let force = row.iter().zip(&x).map(|(a, x)| a * x[1]).sum::<f64>();
                let expected = if i == node { -2.0 } else { 0.0 };
                assert!((force - expected).abs() < SOLVE_TOLERANCE, "{kernels:?} {node} {i}");
            }
        }
    }
}

/// Zero, or far enough from it.
fn is_sound(lane: &Lane) -> bool {
    lane.iter().all(|x| *x == 0.0 || x.abs() >= FLUSH_BELOW)
}

#[test]
fn no_denormal_enters_or_leaves_the_solve() {
    let (grid, _, factor) = system(9, 11);
    let mut noise = Noise::new(8);
    // From all of them normal to all of them denormal.
    for exponent in (-44..=0).map(|e| 10_f32.powi(e)) {
        let mut d = gradients(&mut noise, grid.vertex_count());
        d.as_flattened_mut()
            .as_flattened_mut()
            .iter_mut()
            .for_each(|x| *x *= exponent);
        for kernels in kernels_here() {
            let mut b = lanes(&mut Noise::new(0), grid.vertex_count());
            right_hand_side(kernels, &grid.rings(), &grid.rest, &d, b.as_flattened_mut());
            assert!(
                b.as_flattened()[..grid.vertex_count()].iter().all(is_sound),
                "{kernels:?} {exponent}"
            );
            // What no right-hand side lets through: the solve keeps it out all the same.
            let mut flood = lanes(&mut noise, grid.vertex_count());
            flood
                .as_flattened_mut()
                .as_flattened_mut()
                .iter_mut()
                .for_each(|x| *x *= exponent);
            for mut x in [b, flood] {
                substitute(kernels, &factor.view(), &mut x);
                assert!(x.as_flattened().iter().all(is_sound), "{kernels:?} {exponent}");
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
            let solver = grid.rings().solver_from_lane[7] as usize;
            let mut b = vec![[[0.0; 4]; BLOCK]; grid.vertex_count().div_ceil(BLOCK)];
            right_hand_side(kernels, &grid.rings(), &grid.rest, &d, b.as_flattened_mut());
            assert!(!b.as_flattened()[solver][2].is_finite(), "{kernels:?}");
            substitute(kernels, &factor.view(), &mut b);
            assert!(!b.as_flattened()[solver][2].is_finite(), "{kernels:?}");
        }
    }
}

#[test]
fn an_edgeless_mesh_has_no_force() {
    let rings = Rings {
        offsets: &[0, 0, 0],
        neighbours: &[],
        weights: &[],
        solver_from_lane: &[1, 0],
    };
    for kernels in kernels_here() {
        let mut b = [[9.0; 4]; 2];
        right_hand_side(kernels, &rings, &[[1.0; 3]; 2], &[[[1.0; 4]; 3]; 2], &mut b);
        assert_eq!(b, [[0.0; 4]; 2], "{kernels:?}");
    }
}
