//! Turns a basis within its span until its rows are as local as they get: a span of leading modes explains the samples, but
//! each mode moves everything. Modes -> [`localise`] -> rows that each live somewhere.
//!
//! Varimax (Kaiser 1958) on the energies of vertices: of all orthogonal turns, the one with the greatest sum over rows and
//! vertices of `|C_kv|^4`, found by turning pairs.

use faer::{Mat, Side};

use super::embedding::combined;

/// Rounds over all pairs; most bases settle in half as many.
const SWEEPS: usize = 16;

/// The search ends when no pair turns by more than this, radians.
const SETTLED: f64 = 1e-3;

/// Vertices that the turns are found on; the surface is sampled evenly enough by every n-th.
const SAMPLED: usize = 2048;

/// Rows of the same span, orthonormal in the inner product of features by `areas`, each as local as it gets. Rows must be
/// independent. Shapes: `rows` `[K]`, each flat `[V][9]`; `areas` `[V]`.
pub fn localise(rows: &[Vec<f32>], areas: &[f64]) -> Vec<Vec<f32>> {
    let count = rows.len();
    if count < 2 {
        return rows.to_vec();
    }
    let flat = rows.concat();
    let whitening = whitening(rows, areas);
    let step = areas.len().div_ceil(SAMPLED).max(1);
    let sampled: Vec<usize> = (0..areas.len()).step_by(step).collect();
    let mut places: Vec<Vec<[f32; 9]>> = (0..count)
        .map(|k| {
            let place = |&v: &usize| {
                // Squared twice on the way to the sum, which is one over the surface.
                let root = areas[v].sqrt().sqrt();
                core::array::from_fn(|c| {
                    let value: f64 = (0..count)
                        .map(|j| whitening[(j, k)] * f64::from(rows[j][9 * v + c]))
                        .sum();
                    (root * value) as f32
                })
            };
            sampled.iter().map(place).collect()
        })
        .collect();
    let mut turn = Mat::<f64>::identity(count, count);
    for _ in 0..SWEEPS {
        let mut most = 0.0_f64;
        for i in 0..count {
            for j in i + 1..count {
                let (before, after) = places.split_at_mut(j);
                let angle = best_angle(&before[i], &after[0]);
                most = most.max(angle.abs());
                turn_pair(&mut before[i], &mut after[0], angle);
                let (sine, cosine) = angle.sin_cos();
                for q in 0..count {
                    let (a, b) = (turn[(q, i)], turn[(q, j)]);
                    turn[(q, i)] = cosine * a + sine * b;
                    turn[(q, j)] = cosine * b - sine * a;
                }
            }
        }
        if most < SETTLED {
            break;
        }
    }
    combined(&flat, (whitening * turn).as_ref())
}

/// Coefficients that make the rows orthonormal, `[old] x [new]`.
fn whitening(rows: &[Vec<f32>], areas: &[f64]) -> Mat<f64> {
    let count = rows.len();
    let product = |a: &[f32], b: &[f32]| -> f64 {
        let pairs = a.as_chunks::<9>().0.iter().zip(b.as_chunks::<9>().0).zip(areas);
        pairs
            .map(|((a, b), area)| area * (0..9).map(|c| f64::from(a[c] * b[c])).sum::<f64>())
            .sum()
    };
    let gram = Mat::from_fn(count, count, |i, j| product(&rows[i.min(j)], &rows[i.max(j)]));
    let Ok(eigen) = gram.self_adjoint_eigen(Side::Lower) else {
        return Mat::identity(count, count);
    };
    let (vectors, values) = (eigen.U(), eigen.S());
    let floor = values[count - 1] * 1e-12;
    Mat::from_fn(count, count, |i, k| {
        (0..count)
            .map(|q| vectors[(i, q)] * vectors[(k, q)] / values[q].max(floor).sqrt())
            .sum()
    })
}

/// The angle that makes the sum of squared energies greatest: with u = (|p|^2 - |q|^2) / 2 and c = p . q it is a quarter of
/// the direction of `sum (u + i c)^2`.
fn best_angle(p: &[[f32; 9]], q: &[[f32; 9]]) -> f64 {
    let (mut real, mut imaginary) = (0.0_f64, 0.0_f64);
    for (p, q) in p.iter().zip(q) {
        let (mut a, mut b, mut c) = (0.0_f32, 0.0_f32, 0.0_f32);
        for n in 0..9 {
            a += p[n] * p[n];
            b += q[n] * q[n];
            c += p[n] * q[n];
        }
        let (u, c) = (f64::from(a - b) * 0.5, f64::from(c));
        real += u * u - c * c;
        imaginary += 2.0 * u * c;
    }
    0.25 * imaginary.atan2(real)
}

fn turn_pair(p: &mut [[f32; 9]], q: &mut [[f32; 9]], angle: f64) {
    let (sine, cosine) = angle.sin_cos();
    let (sine, cosine) = (sine as f32, cosine as f32);
    for (p, q) in p.as_flattened_mut().iter_mut().zip(q.as_flattened_mut()) {
        let (a, b) = (*p, *q);
        *p = cosine * a + sine * b;
        *q = cosine * b - sine * a;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_were_blended_come_apart_again() {
        // Two fields that live at different places, blended evenly: no row of the blend is local.
        let vertex_count = 40;
        let field = |places: core::ops::Range<usize>, c: usize| -> Vec<f32> {
            (0..9 * vertex_count)
                .map(|i| {
                    if places.contains(&(i / 9)) && i % 9 == c {
                        1.0
                    } else {
                        0.0
                    }
                })
                .collect()
        };
        let (a, b) = (field(0..15, 0), field(20..40, 4));
        let blend = |sign: f32| -> Vec<f32> { a.iter().zip(&b).map(|(a, b)| a + sign * b).collect() };
        let areas: Vec<f64> = (0..vertex_count).map(|v| 1.0 + 0.01 * v as f64).collect();
        let local = localise(&[blend(1.0), blend(-1.0)], &areas);
        for row in &local {
            let energy = |places: core::ops::Range<usize>| -> f64 {
                places
                    .map(|v| areas[v] * (0..9).map(|c| f64::from(row[9 * v + c]).powi(2)).sum::<f64>())
                    .sum()
            };
            let (first, second) = (energy(0..15), energy(20..40));
            assert!((first + second - 1.0).abs() < 1e-5, "unit length: {first} {second}");
            assert!(first.min(second) < 1e-5, "at one of both places: {first} {second}");
        }
    }
}
