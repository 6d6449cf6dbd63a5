//! Right-hand side and solve, four lanes: a row of a gradient, or of a quad. What they compute is said at the reference.

use core::ops::Range;

use sinew_formats::package::{Index, QUAD};
use wide::f32x4;

use super::lanes::load;
use crate::simd::generic::lanes::Gradient;
use crate::simd::generic::solve::{Factor, Quad, Rings, flushed, put};

/// See [`right_hand_side`](crate::simd::generic::solve::right_hand_side).
pub(crate) fn right_hand_side<I: Index>(
    rings: &Rings<'_, I>,
    rest: &[[f32; 3]],
    gradients: &[Gradient],
    slots: Range<usize>,
    b: &mut [Quad],
) {
    for i in slots {
        let solver = rings.solver_from_slot[i];
        let r = &rest[i];
        let mut sum = f32x4::ZERO;
        let mut total = [0.0_f32; 3];
        let ring = rings.offsets[i] as usize..rings.offsets[i + 1] as usize;
        for (&j, &weight) in rings.neighbours[ring.clone()].iter().zip(&rings.weights[ring]) {
            let rj = &rest[j.at()];
            let edge = [
                weight * (r[0] - rj[0]),
                weight * (r[1] - rj[1]),
                weight * (r[2] - rj[2]),
            ];
            sum += product(&gradients[j.at()], &edge);
            for c in 0..3 {
                total[c] += edge[c];
            }
        }
        sum += product(&gradients[i], &total);
        let [x, y, z, _] = (sum * f32x4::splat(0.5)).to_array();
        put(b, solver, [flushed(x), flushed(y), flushed(z)]);
    }
}

/// Columns times the edge's coordinates.
#[inline(always)]
fn product(gradient: &Gradient, edge: &[f32; 3]) -> f32x4 {
    let column = |c: usize| load(&gradient[c]) * f32x4::splat(edge[c]);
    column(0) + column(1) + column(2)
}

/// See [`substitute`](crate::simd::generic::solve::substitute).
pub(crate) fn substitute<I: Index>(factor: &Factor<'_, I>, x: &mut [Quad]) {
    for column in 0..x.len() {
        let own = x[column].map(|row| row.map(flushed));
        x[column] = own;
        if own == Quad::default() {
            continue;
        }
        for (row, tile) in factor.column(column) {
            let entries = columns(tile);
            for (target, own) in x[row][..3].iter_mut().zip(&own) {
                let mut sum = load(target);
                for n in 0..QUAD {
                    sum -= entries[n] * f32x4::splat(own[n]);
                }
                *target = sum.to_array();
            }
        }
    }
    for column in (0..x.len()).rev() {
        let inverse = columns(&factor.inverse_diagonals[column]);
        let mut sums = [[f32x4::ZERO; QUAD]; 3];
        for (row, tile) in factor.column(column).rev() {
            let entries = columns(tile);
            for (sums, place) in sums.iter_mut().zip(&x[row]) {
                let place = load(place);
                for n in 0..QUAD {
                    sums[n] += entries[n] * place;
                }
            }
        }
        for (sums, own) in sums.into_iter().zip(&mut x[column]) {
            let mut product = f32x4::ZERO;
            for n in 0..QUAD {
                product += inverse[n] * f32x4::splat(own[n]);
            }
            let [first, second, third, fourth] = f32x4::transpose(sums);
            let left = product - ((first + second) + (third + fourth));
            *own = left.to_array().map(flushed);
        }
    }
}

#[inline(always)]
fn columns(tile: &[f32; QUAD * QUAD]) -> [f32x4; QUAD] {
    [
        load(&tile[..4]),
        load(&tile[4..8]),
        load(&tile[8..12]),
        load(&tile[12..]),
    ]
}
