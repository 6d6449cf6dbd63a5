//! Which feature errors show: the leading singular directions of the linearised map from features to positions. They
//! make the position term of the training loss, which needs no solve of its own.

use faer::{Mat, Par};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::mix::standard_normal;
use crate::features::reconstruct::PoissonSystem;
use crate::features::scaler::FeatureScaler;

/// Directions tried beyond the asked ones (Halko, Martinsson and Tropp 2011).
const OVERSAMPLING: usize = 8;
/// Power iterations; singular values of the map fall slowly enough for two.
const POWER_ROUNDS: usize = 2;

/// The `count` leading right singular vectors of `dp = L^-1 div([r]x + s)` at rest, in network units, each scaled by its
/// singular value over the largest. Rigid motions of the result are taken out first, for no measure counts them.
/// Shape: flat `[count][V][9]`.
pub fn position_modes(system: &PoissonSystem, scaler: &FeatureScaler, count: usize, seed: u64) -> Vec<f32> {
    let vertex_count = system.rest().len();
    let width = 9 * vertex_count;
    let tried = (count + OVERSAMPLING).min(3 * vertex_count);
    let rigid = rigid_motions(system.rest());
    let scale: [f64; 9] = core::array::from_fn(|c| {
        f64::from(if c < 3 {
            scaler.rotation_scale
        } else {
            scaler.stretch_scale
        })
    });

    let forward = |x: &[f64]| -> Vec<f64> {
        let changes: Vec<[f64; 9]> = x
            .chunks_exact(9)
            .map(|x| core::array::from_fn(|c| x[c] * scale[c]))
            .collect();
        let mut moved = system.linear_displacements(&changes).into_flattened();
        remove(&rigid, &mut moved);
        moved
    };
    let adjoint = |y: &[f64]| -> Vec<f64> {
        let mut y = y.to_vec();
        remove(&rigid, &mut y);
        let vectors: Vec<[f64; 3]> = y.chunks_exact(3).map(|y| [y[0], y[1], y[2]]).collect();
        let changes = system.linear_displacements_adjoint(&vectors);
        changes
            .into_iter()
            .flat_map(|x| (0..9).map(move |c| x[c] * scale[c]))
            .collect()
    };

    let mut directions: Vec<Vec<f64>> = (0..tried)
        .into_par_iter()
        .map(|i| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(i as u64);
            (0..width).map(|_| f64::from(standard_normal(&mut rng))).collect()
        })
        .collect();
    for _ in 0..POWER_ROUNDS {
        orthonormalise(&mut directions);
        directions = directions.par_iter().map(|x| adjoint(&forward(x))).collect();
    }
    orthonormalise(&mut directions);
    let images: Vec<Vec<f64>> = directions.par_iter().map(|x| forward(x)).collect();

    // Singular vectors inside the subspace that was found.
    let gram = gram(&images);
    let Ok(eigen) = gram.self_adjoint_eigen(faer::Side::Lower) else {
        return Vec::new();
    };
    let (u, s) = (eigen.U(), eigen.S());
    let strongest = s[tried - 1].max(0.0).sqrt();
    let mut modes = vec![0.0_f32; count.min(tried) * width];
    if strongest > 0.0 {
        modes.par_chunks_mut(width).enumerate().for_each(|(i, mode)| {
            let source = tried - 1 - i;
            let share = s[source].max(0.0).sqrt() / strongest;
            for (q, direction) in directions.iter().enumerate() {
                let weight = u[(q, source)] * share;
                mode.iter_mut()
                    .zip(direction)
                    .for_each(|(m, d)| *m += (weight * d) as f32);
            }
        });
    }
    modes
}

/// Orthonormal basis of the infinitesimal rigid motions of a shape. Shape: at most 6 rows of `[V * 3]`.
fn rigid_motions(rest: &[[f64; 3]]) -> Vec<Vec<f64>> {
    let mut motions: Vec<Vec<f64>> = Vec::with_capacity(6);
    let n = rest.len().max(1) as f64;
    let centre: [f64; 3] = core::array::from_fn(|c| rest.iter().map(|p| p[c]).sum::<f64>() / n);
    for c in 0..3 {
        motions.push(
            rest.iter()
                .flat_map(|_| (0..3).map(move |d| f64::from(u8::from(c == d))))
                .collect(),
        );
        motions.push(
            rest.iter()
                .flat_map(|p| {
                    let p: [f64; 3] = core::array::from_fn(|d| p[d] - centre[d]);
                    let (a, b) = ((c + 1) % 3, (c + 2) % 3);
                    let mut turn = [0.0; 3];
                    turn[b] = p[a];
                    turn[a] = -p[b];
                    turn
                })
                .collect(),
        );
    }
    orthonormalise(&mut motions);
    motions
}

/// Takes the span of orthonormal `basis` out of `vector`.
fn remove(basis: &[Vec<f64>], vector: &mut [f64]) {
    for row in basis {
        let share: f64 = row.iter().zip(vector.iter()).map(|(a, b)| a * b).sum();
        vector.iter_mut().zip(row).for_each(|(x, a)| *x -= share * a);
    }
}

fn gram(rows: &[Vec<f64>]) -> Mat<f64> {
    let count = rows.len();
    let products: Vec<f64> = (0..count * count)
        .into_par_iter()
        .map(|i| {
            if i % count <= i / count {
                rows[i / count].iter().zip(&rows[i % count]).map(|(a, b)| a * b).sum()
            } else {
                0.0
            }
        })
        .collect();
    Mat::from_fn(count, count, |i, j| products[i.max(j) * count + i.min(j)])
}

/// Orthonormal rows of the same span; rows that depend on others become zero. Twice, for accuracy.
fn orthonormalise(rows: &mut Vec<Vec<f64>>) {
    for _ in 0..2 {
        let Ok(eigen) = gram(rows).self_adjoint_eigen(faer::Side::Lower) else {
            return;
        };
        let (u, s) = (eigen.U(), eigen.S());
        let count = rows.len();
        let floor = 1e-14 * s[count - 1];
        *rows = (0..count)
            .into_par_iter()
            .map(|i| {
                let mut row = vec![0.0; rows[0].len()];
                if s[i] > floor {
                    for (q, source) in rows.iter().enumerate() {
                        let weight = u[(q, i)] / s[i].sqrt();
                        row.iter_mut().zip(source).for_each(|(r, x)| *r += weight * x);
                    }
                }
                row
            })
            .collect();
    }
}

/// faer's own threads would change the order of sums; the callers of this module run many small problems at once instead.
pub fn keep_linear_algebra_serial() {
    faer::set_global_parallelism(Par::Seq);
}
