//! Eight shapes side by side: the arithmetic every pass of the kernel is made of.
//!
//! A vertex's features are nine [`Lane`]s. Loops over lanes are plain and fixed in length, so the compiler turns each
//! into one wide instruction; [`wide`] compiles a pass twice, with and without AVX2 and FMA, and picks at run time.

use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use crate::network::ring::RingMean;

/// Shapes (or components) worked on at once.
pub(crate) const LANE_COUNT: usize = 8;
/// One number for each of eight shapes.
pub(crate) type Lane = [f32; LANE_COUNT];
/// The nine features of one vertex for eight shapes.
pub(crate) type Features = [Lane; FEATURE_COUNT];

pub(crate) const ZERO_LANE: Lane = [0.0; LANE_COUNT];
pub(crate) const ZERO_FEATURES: Features = [ZERO_LANE; FEATURE_COUNT];

/// `a * b + c`, fused where the machine does so in one instruction.
#[inline(always)]
pub(crate) fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// `sum += scale * x`.
#[inline(always)]
pub(crate) fn add_scaled<const FUSED: bool>(sum: &mut Lane, scale: f32, x: &Lane) {
    for n in 0..LANE_COUNT {
        sum[n] = multiply_add::<FUSED>(scale, x[n], sum[n]);
    }
}

/// `sum += x * y`, lane by lane.
#[inline(always)]
pub(crate) fn add_product<const FUSED: bool>(sum: &mut Lane, x: &Lane, y: &Lane) {
    for n in 0..LANE_COUNT {
        sum[n] = multiply_add::<FUSED>(x[n], y[n], sum[n]);
    }
}

/// Sum of the lanes in a fixed order.
#[inline(always)]
pub(crate) fn sum_lanes(x: &Lane) -> f32 {
    ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]))
}

/// `sum += matrix x`.
#[inline(always)]
pub(crate) fn add_matrix<const FUSED: bool>(
    sum: &mut Features,
    matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT],
    x: &Features,
) {
    for i in 0..FEATURE_COUNT {
        for o in 0..FEATURE_COUNT {
            add_scaled::<FUSED>(&mut sum[o], matrix[o][i], &x[i]);
        }
    }
}

/// `sum += matrixᵀ x`.
#[inline(always)]
pub(crate) fn add_transposed<const FUSED: bool>(
    sum: &mut Features,
    matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT],
    x: &Features,
) {
    for o in 0..FEATURE_COUNT {
        for i in 0..FEATURE_COUNT {
            add_scaled::<FUSED>(&mut sum[i], matrix[o][i], &x[o]);
        }
    }
}

/// A field over the mesh: `[V][width]` groups of eight shapes or components, and which group is meant.
#[derive(Clone, Copy)]
pub(crate) struct Field<'a> {
    pub(crate) values: &'a [Features],
    pub(crate) width: usize,
    pub(crate) group: usize,
}

impl<'a> Field<'a> {
    #[inline(always)]
    pub(crate) fn at(self, v: usize) -> &'a Features {
        &self.values[v * self.width + self.group]
    }
}

/// Mean of `x` over the ring of `v`.
#[inline(always)]
pub(crate) fn ring_mean(ring: &RingMean, x: Field<'_>, v: usize) -> Features {
    let mut mean = ZERO_FEATURES;
    for &j in ring.ring(v) {
        let neighbour = x.at(j as usize);
        for c in 0..FEATURE_COUNT {
            for n in 0..LANE_COUNT {
                mean[c][n] += neighbour[c][n];
            }
        }
    }
    mean.as_flattened_mut()
        .iter_mut()
        .for_each(|value| *value *= ring.inverse_degree[v]);
    mean
}

/// `W_point x_v + W_neighbour mean_j x_j`, without bias.
#[inline(always)]
pub(crate) fn convolve<const FUSED: bool>(
    ring: &RingMean,
    convolution: &GraphConvRecord,
    x: Field<'_>,
    v: usize,
) -> Features {
    let mut sum = ZERO_FEATURES;
    add_matrix::<FUSED>(&mut sum, &convolution.point, x.at(v));
    add_matrix::<FUSED>(&mut sum, &convolution.neighbour, &ring_mean(ring, x, v));
    sum
}

/// Beyond this `tanh` rounds to one in single precision.
const TANH_SATURATION: f32 = 9.1;
/// Adding it rounds a small number to the nearest integer, which then stands in the low bits.
const ROUNDING: f32 = 12_582_912.0;
/// ln 2 split so that `n * LN2_HIGH` is exact for the few n that occur.
const LN2_HIGH: f32 = 0.693_359_4;
const LN2_LOW: f32 = -2.121_944_4e-4;

/// tanh with a relative error under 4e-7 everywhere: `t / (t + 2)` with `t = exp(2|x|) - 1`, the exponential reduced to
/// |r| <= ln 2 / 2 and its Taylor series, so that small arguments lose no digits. The C library's takes half of a step.
#[inline(always)]
pub(crate) fn tanh<const FUSED: bool>(x: f32) -> f32 {
    let double = 2.0 * x.abs().min(TANH_SATURATION);
    let shifted = multiply_add::<FUSED>(double, core::f32::consts::LOG2_E, ROUNDING);
    let n = shifted - ROUNDING;
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3f80_0000));
    let r = multiply_add::<FUSED>(n, -LN2_LOW, multiply_add::<FUSED>(n, -LN2_HIGH, double));
    let mut series = 1.0 / 5040.0;
    for coefficient in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0] {
        series = multiply_add::<FUSED>(series, r, coefficient);
    }
    let less_one = multiply_add::<FUSED>(power, series * r, power - 1.0);
    (less_one / (less_one + 2.0)).copysign(x)
}

/// tanh of nine features.
#[inline(always)]
pub(crate) fn tanh_features<const FUSED: bool>(x: &mut Features) {
    // One long loop: eight turns would be unrolled before they are vectorised, and a series of this depth then stays in
    // single instructions.
    for value in x.as_flattened_mut() {
        *value = tanh::<FUSED>(*value);
    }
}

/// Defines a pass that is compiled for the widest instructions at hand; `FUSED` is in scope inside its body.
///
/// Where: passes must not hand their work to closures that run elsewhere (rayon), or the wide code is lost; they take
/// one chunk of vertices and are called from such closures.
macro_rules! wide {
    ($(#[$attribute:meta])* fn $name:ident($($argument:ident: $kind:ty),* $(,)?) $(-> $result:ty)? $body:block) => {
        $(#[$attribute])*
        pub(crate) fn $name($($argument: $kind),*) $(-> $result)? {
            #[inline(always)]
            fn run<const FUSED: bool>($($argument: $kind),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn run_wide($($argument: $kind),*) $(-> $result)? {
                    run::<true>($($argument),*)
                }
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    // SAFETY: the processor was just found to have both features.
                    return unsafe { run_wide($($argument),*) };
                }
                run::<false>($($argument),*)
            }
            #[cfg(target_arch = "aarch64")]
            {
                run::<true>($($argument),*)
            }
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            {
                run::<false>($($argument),*)
            }
        }
    };
}
pub(crate) use wide;

wide! {
    /// `tanh(b)`, by the same series as everything else so that rest maps to rest to the last bit.
    fn tanh_bias(bias: &[f32; FEATURE_COUNT]) -> [f32; FEATURE_COUNT] {
        bias.map(tanh::<FUSED>)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The series' truncation (1.5e-8) and some roundings of half a unit in the last place (6e-8 each).
    const TANH_RELATIVE_ERROR: f64 = 4e-7;

    #[test]
    fn tanh_follows_the_true_one_everywhere() {
        for i in -4000..=4000 {
            for scale in [1e-6, 1e-3, 3e-3] {
                let x = i as f32 * scale;
                let truth = f64::from(x).tanh();
                for value in [tanh::<false>(x), tanh::<true>(x)] {
                    let error = (f64::from(value) - truth).abs();
                    assert!(
                        error <= TANH_RELATIVE_ERROR * truth.abs(),
                        "tanh({x}) = {value}, not {truth}"
                    );
                }
            }
        }
        assert_eq!(tanh::<false>(40.0), 1.0);
        assert_eq!(tanh::<true>(-40.0), -1.0);
    }
}
