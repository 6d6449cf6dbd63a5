//! The transcendental functions of decode, the same algorithm in every kernel and on every machine: no library's sine
//! or hyperbolic tangent has the same bits everywhere.
//!
//! Coefficients: minimax fits of relative error (tanh, rational, by weighted least squares) and Chebyshev fits (sine and
//! cosine) computed for this file in 30 digits.

use libm::{cosf, sinf};

use sinew_formats::package::GROUP_NODES;

use super::lanes::Lanes;

/// Arguments beyond have the value at this one, which differs from 1 by less than [`TANH_TOLERANCE`].
const TANH_END: f32 = 8.0;
/// `tanh x = x P(x^2) / Q(x^2)` to 7e-9 of its value up to [`TANH_END`], before rounding.
const TANH_P: [f32; 5] = [1.0, 0.134_444_56, 0.003_571_547, 2.189_378e-5, 1.522_907_4e-8];
/// See [`TANH_P`]; Q(0) = 1.
const TANH_Q: [f32; 5] = [1.0, 0.467_777_82, 0.026_164_252, 3.411_207e-4, 8.521_924_5e-7];

/// Greatest absolute error of [`tanh`].
#[cfg(test)]
pub(crate) const TANH_TOLERANCE: f64 = 4e-7;

/// Hyperbolic tangent: odd, between -1 and 1, zero at zero, never not a number for a number or an infinity. It rises, but
/// for roundings.
#[inline(always)]
pub(crate) fn tanh<L: Lanes>(x: L) -> L {
    let x = x.min(L::splat(TANH_END)).max(L::splat(-TANH_END));
    let square = x.mul(x);
    let [p, q] = [x.mul(polynomial(square, &TANH_P)), polynomial(square, &TANH_Q)];
    p.quotient(q)
}

/// Horner's rule, constant term first.
#[inline(always)]
fn polynomial<L: Lanes, const N: usize>(x: L, coefficients: &[f32; N]) -> L {
    let mut sum = L::splat(coefficients[N - 1]);
    for n in (0..N - 1).rev() {
        sum = sum.mul_add(x, L::splat(coefficients[n]));
    }
    sum
}

/// Half angles are reduced by multiples of pi, in three parts whose products with a small whole number are exact.
const PI: [f32; 3] = [3.140_625, 9.675_026e-4, 1.509_958e-7];
/// Angles up to this one are reduced here, greater ones by the library, which is slow and as good.
const REDUCED_ANGLE: f32 = 4096.0;
/// Adding and subtracting it rounds to a whole number.
const ROUNDER: f32 = 12_582_912.0;
/// `sin y / y` in y^2, |y| <= pi/2, to 5e-9.
const SINE: [f32; 5] = [1.0, -0.166_666_58, 0.008_333_05, -1.980_900_5e-4, 2.605_078_3e-6];
/// `cos y` in y^2, |y| <= pi/2, to 5e-8.
const COSINE: [f32; 5] = [
    0.999_999_95,
    -0.499_999_05,
    0.041_663_57,
    -0.001_385_361_6,
    2.315_209_7e-5,
];

/// For the angle t: `sin(t/2) / t` and `cos(t/2)`, both times one sign, which no product of two of them sees.
///
/// Range: t >= 0; what is not a number or infinite gives what is not a number.
#[inline(always)]
pub(crate) fn half_angle<L: Lanes>(t: L) -> [L; 2] {
    let half = t.mul(L::splat(0.5));
    let turns = half
        .mul(L::splat(core::f32::consts::FRAC_1_PI))
        .add(L::splat(ROUNDER))
        .sub(L::splat(ROUNDER));
    let y = PI.iter().fold(half, |y, &part| turns.neg_mul_add(L::splat(part), y));
    let square = y.mul(y);
    // Without a turn y is half of t, also where both are zero.
    let ratio = turns.select_below(L::splat(0.5), L::splat(0.5), y.div(t));
    let reduced = [polynomial(square, &SINE).mul(ratio), polynomial(square, &COSINE)];
    if t.all_at_most(REDUCED_ANGLE) {
        reduced
    } else {
        beyond_reduction(t, reduced)
    }
}

#[cold]
#[inline(never)]
fn beyond_reduction<L: Lanes>(t: L, reduced: [L; 2]) -> [L; 2] {
    let mut angles = [0.0; GROUP_NODES];
    t.store(&mut angles);
    let library: [fn(f32) -> f32; 2] = [|t| sinf(0.5 * t) / t, |t| cosf(0.5 * t)];
    core::array::from_fn(|n| {
        let mut lanes = [0.0; GROUP_NODES];
        reduced[n].store(&mut lanes);
        for (value, &t) in lanes.iter_mut().zip(&angles[..L::COUNT]) {
            // Not a number takes this way too.
            if t.is_nan() || t > REDUCED_ANGLE {
                *value = library[n](t);
            }
        }
        L::load(&lanes)
    })
}
