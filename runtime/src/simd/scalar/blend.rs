//! Weights to features: the sparse blend of a block's folded components and its tanh (method section 2).
//!
//! The decoder's convolution is folded into the components by the baker, because blend and convolution are both linear:
//! only `tanh(bias + sum_k z_k C_k)` is left for the frame.

use half::f16;
use libm::tanhf;
use sinew_formats::package::FEATURE_COUNT;

/// Nine numbers a vertex.
pub(crate) type Features = [f32; FEATURE_COUNT];

/// Adds one component to a block's pre-activations: `u[slots[n]] += weight * values[n]`.
///
/// Shape: `slots` and `values` `[entries]`; every slot < `pre_activations.len()`. `weight` already holds the
/// component's value scale.
pub(crate) fn accumulate(
    slots: &[u32],
    values: &[[u16; FEATURE_COUNT]],
    weight: f32,
    pre_activations: &mut [Features],
) {
    for (&slot, value) in slots.iter().zip(values) {
        let row = &mut pre_activations[slot as usize];
        for c in 0..FEATURE_COUNT {
            row[c] += weight * f16::from_bits(value[c]).to_f32();
        }
    }
}

/// Adds a block's output to the features: `x[support[n]] += tanh(bias + u[n]) - tanh(bias)`.
///
/// The rest term makes an untouched vertex exactly zero: both tanh see the same bits. Shape: `support` and
/// `pre_activations` `[support_count]`; every vertex of `support` < `features.len()`.
pub(crate) fn activate(bias: &Features, support: &[u32], pre_activations: &[Features], features: &mut [Features]) {
    let rest = bias.map(tanhf);
    for (&v, row) in support.iter().zip(pre_activations) {
        let feature = &mut features[v as usize];
        for c in 0..FEATURE_COUNT {
            feature[c] += tanhf(bias[c] + row[c]) - rest[c];
        }
    }
}

/// Derivative of [`activate`] along one component: `dx = (1 - tanh(bias + u)^2) * scale * value`, at one entry.
pub(crate) fn activate_tangent(
    bias: &Features,
    pre_activation: &Features,
    value: &[u16; FEATURE_COUNT],
    scale: f32,
) -> Features {
    core::array::from_fn(|c| {
        let y = tanhf(bias[c] + pre_activation[c]);
        (1.0 - y * y) * scale * f16::from_bits(value[c]).to_f32()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::scalar::naive::{Noise, largest_difference};

    /// A few f32 roundings of numbers near one.
    const TOLERANCE: f64 = 2e-6;

    fn entries(noise: &mut Noise, count: usize) -> std::vec::Vec<[u16; FEATURE_COUNT]> {
        (0..count)
            .map(|_| noise.features().map(|x| f16::from_f32(x).to_bits()))
            .collect()
    }

    #[test]
    fn blend_equals_the_naive_sum() {
        let mut noise = Noise::new(1);
        let support = [2_u32, 3, 5, 8];
        let slots: [&[u32]; 2] = [&[0, 2, 3], &[1, 2]];
        let values = [entries(&mut noise, 3), entries(&mut noise, 2)];
        let weights = [0.7_f32, -1.3];
        let bias = noise.features();

        let mut pre = [[0.0; FEATURE_COUNT]; 4];
        let mut features = [[0.25; FEATURE_COUNT]; 9];
        for k in 0..2 {
            accumulate(slots[k], &values[k], weights[k], &mut pre);
        }
        activate(&bias, &support, &pre, &mut features);

        let mut expected = [[0.25_f64; FEATURE_COUNT]; 9];
        for (n, &v) in support.iter().enumerate() {
            for c in 0..FEATURE_COUNT {
                let mut u = f64::from(bias[c]);
                for k in 0..2 {
                    if let Some(e) = slots[k].iter().position(|&s| s as usize == n) {
                        u += f64::from(weights[k]) * f16::from_bits(values[k][e][c]).to_f64();
                    }
                }
                expected[v as usize][c] += u.tanh() - f64::from(bias[c]).tanh();
            }
        }
        assert!(largest_difference(&features, &expected) < TOLERANCE);
    }

    #[test]
    fn nothing_in_gives_exactly_nothing_out() {
        let mut features = [[0.0; FEATURE_COUNT]; 3];
        activate(
            &Noise::new(2).features(),
            &[0, 2],
            &[[0.0; FEATURE_COUNT]; 2],
            &mut features,
        );
        assert_eq!(features, [[0.0; FEATURE_COUNT]; 3]);
    }

    #[test]
    fn tangent_equals_the_difference_quotient() {
        /// Central differences in f64 of a function with third derivative near one.
        const STEP: f64 = 1e-4;
        let mut noise = Noise::new(3);
        let (bias, pre) = (noise.features(), noise.features());
        let value = entries(&mut noise, 1)[0];
        let tangent = activate_tangent(&bias, &pre, &value, 0.5);
        for c in 0..FEATURE_COUNT {
            let direction = 0.5 * f16::from_bits(value[c]).to_f64();
            let y = |t: f64| (f64::from(bias[c]) + f64::from(pre[c]) + t * direction).tanh();
            let expected = (y(STEP) - y(-STEP)) / (2.0 * STEP);
            assert!((f64::from(tangent[c]) - expected).abs() < TOLERANCE);
        }
    }
}
