//! Features to deformation gradients: `T = exp([r]x) S`, kept as `D = T - I` (method section 1).
//!
//! `D` instead of `T`: rest gives exactly zero, and the solve then works on displacements, which keeps f32 accurate.

use libm::{sinf, sqrtf};
use sinew_formats::package::FEATURE_COUNT;

use super::blend::Features;

/// Row-major 3x3.
type Matrix = [[f32; 3]; 3];

/// Below this squared angle the series of sine and cosine are exact to f32 in two terms.
const SMALL_ANGLE_SQUARED: f32 = 1e-4;
/// Below this squared angle [`left_jacobian`] uses a series: the closed form cancels.
const SERIES_ANGLE_SQUARED: f32 = 1.0;

/// What a network feature means: the two scales of the package.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeatureScales {
    /// Network value to radians.
    pub(crate) rotation: f32,
    /// Network value to stretch.
    pub(crate) stretch: f32,
}

impl FeatureScales {
    fn log_rotation(&self, x: &Features) -> [f32; 3] {
        [self.rotation * x[0], self.rotation * x[1], self.rotation * x[2]]
    }

    /// `S - I`.
    fn stretch_less_identity(&self, x: &Features) -> Matrix {
        let s: [f32; 6] = core::array::from_fn(|c| self.stretch * x[3 + c]);
        [[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]]
    }
}

/// Turns nine features a vertex into nine entries of `D = T - I`, row-major.
///
/// Shape: both `[V]`. Range: the log-rotation may exceed pi. `x = 0` gives `D = 0` to the bit.
pub(crate) fn gradients(scales: FeatureScales, features: &[Features], gradients: &mut [Features]) {
    for (x, d) in features.iter().zip(gradients) {
        *d = if *x == [0.0; FEATURE_COUNT] {
            [0.0; FEATURE_COUNT]
        } else {
            gradient(scales, x)
        };
    }
}

fn gradient(scales: FeatureScales, x: &Features) -> Features {
    let e = rotation_less_identity(&scales.log_rotation(x));
    let p = scales.stretch_less_identity(x);
    // (I + E)(I + P) - I = E + P + E P: no difference of near-equal numbers.
    let ep = product(&e, &p);
    core::array::from_fn(|n| e[n / 3][n % 3] + p[n / 3][n % 3] + ep[n / 3][n % 3])
}

/// Derivative of the gradient when the features move along `dx`: `[J_l(r) dr]x R S + R dS`, row-major.
pub(crate) fn gradient_tangent(scales: FeatureScales, x: &Features, dx: &Features) -> Features {
    let r = scales.log_rotation(x);
    let w = left_jacobian(&r, &scales.log_rotation(dx));
    let rotation = plus_identity(rotation_less_identity(&r));
    let turned = product(
        &cross_matrix(&w),
        &product(&rotation, &plus_identity(scales.stretch_less_identity(x))),
    );
    let stretched = product(&rotation, &scales.stretch_less_identity(dx));
    core::array::from_fn(|n| turned[n / 3][n % 3] + stretched[n / 3][n % 3])
}

/// `sin(t) / t` and `(1 - cos t) / t^2` for the squared angle `t^2`.
pub(super) fn rodrigues(angle_squared: f32) -> (f32, f32) {
    if angle_squared < SMALL_ANGLE_SQUARED {
        return (1.0 - angle_squared / 6.0, 0.5 - angle_squared / 24.0);
    }
    let angle = sqrtf(angle_squared);
    // The half angle: 1 - cos t would cancel.
    let half = sinf(0.5 * angle) / (0.5 * angle);
    (sinf(angle) / angle, 0.5 * half * half)
}

/// `exp([r]x) - I` by Rodrigues' formula, with `[r]x^2 = r r^T - |r|^2 I`.
fn rotation_less_identity(r: &[f32; 3]) -> Matrix {
    let angle_squared = dot(r, r);
    let (a, b) = rodrigues(angle_squared);
    let cross = cross_matrix(r);
    core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            let square = r[i] * r[j] - if i == j { angle_squared } else { 0.0 };
            a * cross[i][j] + b * square
        })
    })
}

/// `J_l(r) dr`: the angular velocity, in the deformed frame, of `exp([r + t dr]x)`.
///
/// `J_l = a I + b [r]x + c r r^T` with a, b of Rodrigues and `c = (t - sin t) / t^3`.
fn left_jacobian(r: &[f32; 3], dr: &[f32; 3]) -> [f32; 3] {
    let t = dot(r, r);
    let (a, b) = rodrigues(t);
    let c = if t < SERIES_ANGLE_SQUARED {
        1.0 / 6.0 - t * (1.0 / 120.0 - t * (1.0 / 5040.0 - t / 362_880.0))
    } else {
        (1.0 - a) / t
    };
    let along = c * dot(r, dr);
    let turn = cross(r, dr);
    core::array::from_fn(|i| a * dr[i] + b * turn[i] + along * r[i])
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn cross_matrix(r: &[f32; 3]) -> Matrix {
    [[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]]
}

fn plus_identity(mut a: Matrix) -> Matrix {
    for i in 0..3 {
        a[i][i] += 1.0;
    }
    a
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::scalar::naive::{Noise, deformation_gradient};

    /// Roundings of numbers up to about ten.
    const TOLERANCE: f64 = 1e-5;
    /// Largest rotation is about 5 radians at the first scale: past pi, as consistent features are.
    const SCALES: [FeatureScales; 3] = [
        FeatureScales {
            rotation: 3.0,
            stretch: 0.8,
        },
        FeatureScales {
            rotation: 0.02,
            stretch: 0.1,
        },
        FeatureScales {
            rotation: 1e-5,
            stretch: 1e-3,
        },
    ];

    #[test]
    fn gradient_equals_the_exponential_series() {
        let mut noise = Noise::new(4);
        for scales in SCALES {
            for _ in 0..200 {
                let x = noise.features();
                let t = deformation_gradient(scales.rotation, scales.stretch, &x.map(f64::from));
                let mut found = [[0.0; FEATURE_COUNT]];
                gradients(scales, &[x], &mut found);
                for n in 0..9 {
                    let expected = t[n / 3][n % 3] - f64::from(n / 3 == n % 3);
                    assert!(
                        (f64::from(found[0][n]) - expected).abs() < TOLERANCE,
                        "{scales:?} {x:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn rest_is_exact() {
        let mut found = [[1.0; FEATURE_COUNT]; 2];
        gradients(SCALES[0], &[[0.0; FEATURE_COUNT]; 2], &mut found);
        assert_eq!(found, [[0.0; FEATURE_COUNT]; 2]);
        assert_eq!(gradient(SCALES[0], &[0.0; FEATURE_COUNT]), [0.0; FEATURE_COUNT]);
    }

    #[test]
    fn tangent_equals_the_difference_quotient() {
        /// Central differences in f64: truncation near STEP^2.
        const STEP: f64 = 1e-5;
        let mut noise = Noise::new(5);
        for scales in SCALES {
            for _ in 0..200 {
                let (x, dx) = (noise.features(), noise.features());
                let at = |t: f64| {
                    let moved = core::array::from_fn(|c| f64::from(x[c]) + t * f64::from(dx[c]));
                    deformation_gradient(scales.rotation, scales.stretch, &moved)
                };
                let (ahead, behind) = (at(STEP), at(-STEP));
                let found = gradient_tangent(scales, &x, &dx);
                for n in 0..9 {
                    let expected = (ahead[n / 3][n % 3] - behind[n / 3][n % 3]) / (2.0 * STEP);
                    assert!(
                        (f64::from(found[n]) - expected).abs() < 3.0 * TOLERANCE,
                        "{scales:?} {x:?} {dx:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn tangent_at_rest_is_the_linear_part() {
        let dx = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
        let found = gradient_tangent(
            FeatureScales {
                rotation: 1.0,
                stretch: 1.0,
            },
            &[0.0; FEATURE_COUNT],
            &dx,
        );
        assert_eq!(
            found,
            [
                0.1,
                -3.0 + 0.2,
                2.0 + 0.3,
                3.0 + 0.2,
                0.4,
                -1.0 + 0.5,
                -2.0 + 0.3,
                1.0 + 0.5,
                0.6
            ]
        );
    }
}
