//! The frame backwards, for one vertex that is held: how far it moves when a deformation gradient, a feature or a weight
//! does. Everything behind the decode is linear, so one solve made when the vertex is taken hold of serves for ever.
//!
//! `p_h = r_h + sum_v D_v g_v` with the *pull* `g_v = 1/2 sum_j c_vj (a_v - a_j)(r_v - r_j)`, where `a = L^-1 e_h` is the
//! vertex's row of the inverse: the right-hand side of [`super::poisson`], transposed.

use sinew_formats::package::FEATURE_COUNT;

use super::blend::Features;
use super::gradient::{FeatureScales, cross, rodrigues};
use super::poisson::Rings;

/// Derivative of the held vertex by the nine features of another: x, y and z. Shape: `[3][9]`, row-major.
pub(crate) type Adjoint = [f32; 3 * FEATURE_COUNT];

/// Values summed in f32 before they join an f64 total: keeps the sums of a large mesh good to six digits.
const CHUNK: usize = 256;

/// Below this squared angle `(1 - sin t / t) / t^2` cancels and is a series.
const SERIES_ANGLE_SQUARED: f32 = 1.0;

/// The pull of a vertex from its row of the inverse, which stands in the x of `row`. Shape: all `[V]`, solver order.
pub(crate) fn pull(rings: &Rings<'_>, rest: &[[f32; 3]], row: &[[f32; 3]], pull: &mut [[f32; 3]]) {
    for (i, out) in pull.iter_mut().enumerate() {
        let (r, a) = (&rest[i], row[i][0]);
        let mut sum = [0.0_f32; 3];
        let ring = rings.offsets[i] as usize..rings.offsets[i + 1] as usize;
        for (&j, &weight) in rings.neighbours[ring.clone()].iter().zip(&rings.weights[ring]) {
            let share = 0.5 * weight * (a - row[j as usize][0]);
            let rj = &rest[j as usize];
            for c in 0..3 {
                sum[c] += share * (r[c] - rj[c]);
            }
        }
        *out = sum;
    }
}

/// Displacement of the held vertex: `sum_v D_v g_v`. Shape: both `[V]`, solver order.
pub(crate) fn displacement(gradients: &[Features], pull: &[[f32; 3]]) -> [f64; 3] {
    let mut total = [0.0_f64; 3];
    for (gradients, pull) in gradients.chunks(CHUNK).zip(pull.chunks(CHUNK)) {
        let mut sums = [0.0_f32; FEATURE_COUNT];
        for (d, g) in gradients.iter().zip(pull) {
            for n in 0..FEATURE_COUNT {
                sums[n] += d[n] * g[n % 3];
            }
        }
        for c in 0..3 {
            total[c] += f64::from(sums[3 * c]) + f64::from(sums[3 * c + 1]) + f64::from(sums[3 * c + 2]);
        }
    }
    total
}

/// [`displacement`] differentiated by the features of every vertex. Shape: all `[V]`, solver order.
pub(crate) fn adjoints(scales: FeatureScales, features: &[Features], pull: &[[f32; 3]], adjoints: &mut [Adjoint]) {
    for ((x, g), out) in features.iter().zip(pull).zip(adjoints) {
        *out = adjoint(scales, x, g);
    }
}

/// With `y = R S g`: by the log-rotation `J_l(r)^T (y x e_c)`, by the stretch `R_c g^T`, both halves of the symmetric one.
fn adjoint(scales: FeatureScales, x: &Features, g: &[f32; 3]) -> Adjoint {
    let r: [f32; 3] = core::array::from_fn(|c| scales.rotation * x[c]);
    let s: [f32; 6] = core::array::from_fn(|c| scales.stretch * x[3 + c]);
    let t = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    let (a, b) = rodrigues(t);
    let l = if t < SERIES_ANGLE_SQUARED {
        1.0 / 6.0 - t * (1.0 / 120.0 - t * (1.0 / 5040.0 - t / 362_880.0))
    } else {
        (1.0 - a) / t
    };
    let turned = |u: &[f32; 3]| -> [f32; 3] {
        let (along, turn) = (b * (r[0] * u[0] + r[1] * u[1] + r[2] * u[2]), cross(&r, u));
        core::array::from_fn(|c| u[c] + a * turn[c] + along * r[c] - b * t * u[c])
    };
    let y = turned(&[
        g[0] + s[0] * g[0] + s[1] * g[1] + s[2] * g[2],
        g[1] + s[1] * g[0] + s[3] * g[1] + s[4] * g[2],
        g[2] + s[2] * g[0] + s[4] * g[1] + s[5] * g[2],
    ]);
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| turned(&e));
    let across = [[0.0, y[2], -y[1]], [-y[2], 0.0, y[0]], [y[1], -y[0], 0.0]];
    let mut out = [0.0; 3 * FEATURE_COUNT];
    for c in 0..3 {
        let z = &across[c];
        let (turn, along) = (cross(&r, z), l * (r[0] * z[0] + r[1] * z[1] + r[2] * z[2]));
        let row = &mut out[FEATURE_COUNT * c..][..FEATURE_COUNT];
        for i in 0..3 {
            row[i] = scales.rotation * (a * z[i] - b * turn[i] + along * r[i]);
        }
        let [p, q, w] = [columns[0][c], columns[1][c], columns[2][c]].map(|x| scales.stretch * x);
        row[3] = p * g[0];
        row[4] = p * g[1] + q * g[0];
        row[5] = p * g[2] + w * g[0];
        row[6] = q * g[1];
        row[7] = q * g[2] + w * g[1];
        row[8] = w * g[2];
    }
    out
}

/// Derivative of the held vertex by one component's weight: `sum_n adjoint_v . (slope * value)` over the component's entries,
/// `v = support[slots[n]]`, without the component's value scale.
///
/// Shape: `slots` and `values` `[entries]`; `support` and `slopes` those of the component's block; `adjoints` `[V]`.
pub(crate) fn derivative(
    slots: &[u32],
    values: &[[u16; FEATURE_COUNT]],
    support: &[u32],
    slopes: &[Features],
    adjoints: &[Adjoint],
) -> [f32; 3] {
    let mut sums = [0.0_f32; 3 * FEATURE_COUNT];
    for (&slot, value) in slots.iter().zip(values) {
        let (slope, adjoint) = (&slopes[slot as usize], &adjoints[support[slot as usize] as usize]);
        let dx: Features = core::array::from_fn(|c| slope[c] * finite_half(value[c]));
        for c in 0..3 {
            for i in 0..FEATURE_COUNT {
                sums[FEATURE_COUNT * c + i] += adjoint[FEATURE_COUNT * c + i] * dx[i];
            }
        }
    }
    core::array::from_fn(|c| sums[FEATURE_COUNT * c..][..FEATURE_COUNT].iter().sum())
}

/// A half that is finite, as all halves of a package are. Without a branch, so that a loop over it takes vector registers.
fn finite_half(bits: u16) -> f32 {
    /// What separates the two formats' exponents.
    const REBIAS: u32 = (127 - 15) << 23;
    /// The smallest normal half.
    const LEAST_NORMAL: f32 = 1.0 / 16384.0;
    let magnitude = (u32::from(bits) & 0x7fff) << 13;
    let normal = f32::from_bits(magnitude + REBIAS);
    // A subnormal has no leading one: give it one, and take it away as a number.
    let subnormal = f32::from_bits(magnitude + REBIAS + (1 << 23)) - LEAST_NORMAL;
    let value = if magnitude < 1 << 23 { subnormal } else { normal };
    f32::from_bits(value.to_bits() | (u32::from(bits) & 0x8000) << 16)
}
