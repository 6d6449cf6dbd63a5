//! Eight or sixteen shapes side by side: the arithmetic every pass of the kernel is made of.
//!
//! A vertex's features are nine groups of lanes. [`wide`] compiles a pass for AVX-512, for AVX2 with FMA and for any
//! processor, and picks at run time.

use sinew_formats::package::FEATURE_COUNT;

use super::simd::{Group, Simd};

/// Components, and shapes that fill no wide group, worked on at once.
pub(crate) const LANE_COUNT: usize = 8;
/// Shapes worked on at once where registers hold as many.
pub(crate) const WIDE_LANE_COUNT: usize = 16;
/// One number for each of eight components or shapes.
pub(crate) type Narrow = [f32; LANE_COUNT];
/// One number for each of sixteen shapes.
pub(crate) type Wide = [f32; WIDE_LANE_COUNT];
/// The nine features of one vertex for a group of shapes or components.
pub(crate) type Features<G> = [G; FEATURE_COUNT];
/// The same in registers.
pub(crate) type Registers<S, G> = [<S as Simd<G>>::V; FEATURE_COUNT];

/// Whether groups of [`WIDE_LANE_COUNT`] shapes pay.
pub(crate) fn has_wide_lanes() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        <super::simd::Avx512 as Simd<Wide>>::detect().is_some()
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// Sum of the lanes in a fixed order: by halves.
#[inline(always)]
pub(crate) fn sum_lanes<G: Group>(mut group: G) -> f32 {
    let values = group.as_mut();
    let mut len = values.len();
    while len > 1 {
        len /= 2;
        for n in 0..len {
            values[n] += values[n + len];
        }
    }
    values[0]
}

#[inline(always)]
pub(crate) fn zero<S: Simd<G>, G>(simd: S) -> Registers<S, G> {
    [simd.splat(0.0); FEATURE_COUNT]
}

// Registers are filled in loops: what a closure does (`map`, `from_fn`) may be compiled for any processor and then
// costs a call for each instruction.

#[inline(always)]
pub(crate) fn load<S: Simd<G>, G>(simd: S, x: &Features<G>) -> Registers<S, G> {
    let mut registers = zero(simd);
    for c in 0..FEATURE_COUNT {
        registers[c] = simd.load(&x[c]);
    }
    registers
}

#[inline(always)]
pub(crate) fn store<S: Simd<G>, G>(simd: S, x: &Registers<S, G>, to: &mut Features<G>) {
    for c in 0..FEATURE_COUNT {
        to[c] = simd.store(x[c]);
    }
}

/// Nine numbers, each in all lanes.
#[inline(always)]
pub(crate) fn splat<S: Simd<G>, G>(simd: S, x: &[f32; FEATURE_COUNT]) -> Registers<S, G> {
    let mut registers = zero(simd);
    for c in 0..FEATURE_COUNT {
        registers[c] = simd.splat(x[c]);
    }
    registers
}

/// `scale x`.
#[inline(always)]
pub(crate) fn scaled<S: Simd<G>, G>(simd: S, scale: f32, x: &Features<G>) -> Registers<S, G> {
    let scale = simd.splat(scale);
    let mut registers = load(simd, x);
    for c in 0..FEATURE_COUNT {
        registers[c] = simd.mul(scale, registers[c]);
    }
    registers
}

/// Sums of the lanes of nine features.
#[inline(always)]
pub(crate) fn sum_features<S: Simd<G>, G: Group>(simd: S, x: &Registers<S, G>) -> [f32; FEATURE_COUNT] {
    let mut sums = [0.0; FEATURE_COUNT];
    for c in 0..FEATURE_COUNT {
        sums[c] = sum_lanes(simd.store(x[c]));
    }
    sums
}

/// `sum += scale x`.
#[inline(always)]
pub(crate) fn add_scaled<S: Simd<G>, G>(simd: S, sum: &mut Registers<S, G>, scale: f32, x: &Features<G>) {
    let scale = simd.splat(scale);
    for c in 0..FEATURE_COUNT {
        sum[c] = simd.mul_add(scale, simd.load(&x[c]), sum[c]);
    }
}

/// `sum += matrix x`.
#[inline(always)]
pub(crate) fn add_matrix<S: Simd<G>, G>(
    simd: S,
    sum: &mut Registers<S, G>,
    matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT],
    x: &Registers<S, G>,
) {
    for i in 0..FEATURE_COUNT {
        for o in 0..FEATURE_COUNT {
            sum[o] = simd.mul_add(simd.splat(matrix[o][i]), x[i], sum[o]);
        }
    }
}

/// `sum += matrixᵀ x`.
#[inline(always)]
pub(crate) fn add_transposed<S: Simd<G>, G>(
    simd: S,
    sum: &mut Registers<S, G>,
    matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT],
    x: &Registers<S, G>,
) {
    for o in 0..FEATURE_COUNT {
        for i in 0..FEATURE_COUNT {
            sum[i] = simd.mul_add(simd.splat(matrix[o][i]), x[o], sum[i]);
        }
    }
}

/// `sum += sum_k row_k z_k` at one vertex: what latents make of components. `rows`: lanes of k.
#[inline(always)]
pub(crate) fn add_blend<S: Simd<G>, G>(simd: S, sum: &mut Registers<S, G>, rows: &[Features<Narrow>], z: &[G]) {
    for (row, z) in rows.iter().zip(z.chunks(LANE_COUNT)) {
        for (lane, z) in z.iter().enumerate() {
            let z = simd.load(z);
            for c in 0..FEATURE_COUNT {
                sum[c] = simd.mul_add(simd.splat(row[c][lane]), z, sum[c]);
            }
        }
    }
}

/// `z_k += row_k . x` at one vertex, the transpose of [`add_blend`].
#[inline(always)]
pub(crate) fn add_projection<S: Simd<G>, G>(simd: S, z: &mut [G], rows: &[Features<Narrow>], x: &Registers<S, G>) {
    for (row, z) in rows.iter().zip(z.chunks_mut(LANE_COUNT)) {
        for (lane, z) in z.iter_mut().enumerate() {
            let mut sum = simd.load(z);
            for c in 0..FEATURE_COUNT {
                sum = simd.mul_add(simd.splat(row[c][lane]), x[c], sum);
            }
            *z = simd.store(sum);
        }
    }
}

/// `sums += sum over shapes of field[shape] z[shape]`, the gradient of a product with the latents, lanes of k.
/// `transposed`: `[shapes][width]`, width being that of `sums`.
#[inline(always)]
pub(crate) fn expand<S: Simd<Narrow>, G: Group>(
    simd: S,
    field: &[Features<G>],
    transposed: &[Narrow],
    sums: &mut [Features<Narrow>],
) {
    let width = sums.len();
    for (q, sum) in sums.iter_mut().enumerate() {
        let mut own = load(simd, sum);
        for (values, rows) in field.iter().zip(transposed.chunks(G::LEN * width)) {
            for (n, row) in rows.chunks_exact(width).enumerate() {
                let z = simd.load(&row[q]);
                for c in 0..FEATURE_COUNT {
                    own[c] = simd.mul_add(simd.splat(values[c].as_ref()[n]), z, own[c]);
                }
            }
        }
        store(simd, &own, sum);
    }
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
pub(crate) fn tanh<S: Simd<G>, G>(simd: S, x: S::V) -> S::V {
    let (one, rounding) = (simd.splat(1.0), simd.splat(ROUNDING));
    let magnitude = simd.min(simd.abs(x), simd.splat(TANH_SATURATION));
    let double = simd.add(magnitude, magnitude);
    let shifted = simd.mul_add(double, simd.splat(core::f32::consts::LOG2_E), rounding);
    let n = simd.sub(shifted, rounding);
    let power = simd.power_of_two(shifted);
    let r = simd.mul_sub(n, simd.splat(LN2_LOW), simd.mul_sub(n, simd.splat(LN2_HIGH), double));
    let mut series = simd.splat(1.0 / 5040.0);
    for coefficient in &[1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0] {
        series = simd.mul_add(series, r, simd.splat(*coefficient));
    }
    let less_one = simd.mul_add(power, simd.mul(series, r), simd.sub(power, one));
    let quotient = simd.div(less_one, simd.add(less_one, simd.splat(2.0)));
    simd.copy_sign(quotient, x)
}

/// tanh of nine features.
#[inline(always)]
pub(crate) fn tanh_features<S: Simd<G>, G>(simd: S, x: &mut Registers<S, G>) {
    for c in 0..FEATURE_COUNT {
        x[c] = tanh(simd, x[c]);
    }
}

/// `tanh(b)` and its slope in all lanes, both times `share`: with the same series as everything else rest maps to rest to the
/// last bit where the share is one.
#[inline(always)]
pub(crate) fn at_rest<S: Simd<G>, G>(
    simd: S,
    bias: &[f32; FEATURE_COUNT],
    share: f32,
) -> (Registers<S, G>, Registers<S, G>) {
    let (one, share) = (simd.splat(1.0), simd.splat(share));
    let mut rest = splat(simd, bias);
    tanh_features(simd, &mut rest);
    let mut slope = rest;
    for c in 0..FEATURE_COUNT {
        slope[c] = simd.mul(share, simd.mul_sub(rest[c], rest[c], one));
        rest[c] = simd.mul(share, rest[c]);
    }
    (rest, slope)
}

/// Defines a pass over groups of `G`, compiled for the widest instructions at hand: `simd`, of type `S`, stands for them
/// inside its body.
///
/// Where: passes must not hand their work to closures that run elsewhere (rayon), or the wide code is lost; they take
/// one chunk of vertices and are called from such closures.
macro_rules! wide {
    (
        $(#[$attribute:meta])*
        fn $name:ident<$group:ident>($simd:ident, $($argument:ident: $kind:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        pub(crate) fn $name<$group: Group>($($argument: $kind),*) $(-> $result)? {
            #[inline(always)]
            fn run<S: Simd<$group>, $group: Group>($simd: S, $($argument: $kind),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx2,fma")]
                fn run_widest<$group: Group>(simd: $group::Widest, $($argument: $kind),*) $(-> $result)? {
                    run::<_, $group>(simd, $($argument),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn run_wide<$group: Group>(simd: $group::Wide, $($argument: $kind),*) $(-> $result)? {
                    run::<_, $group>(simd, $($argument),*)
                }
                if let Some(simd) = <$group::Widest as Simd<$group>>::detect() {
                    // SAFETY: the processor was just found to have these features.
                    return unsafe { run_widest::<$group>(simd, $($argument),*) };
                }
                if let Some(simd) = <$group::Wide as Simd<$group>>::detect() {
                    // SAFETY: the processor was just found to have these features.
                    return unsafe { run_wide::<$group>(simd, $($argument),*) };
                }
            }
            run::<_, $group>(<$group::Plain>::default(), $($argument),*)
        }
    };
}
pub(crate) use wide;

#[cfg(test)]
mod tests {
    use super::super::simd::Plain;
    use super::*;

    /// The series' truncation (1.5e-8) and some roundings of half a unit in the last place (6e-8 each).
    const TANH_RELATIVE_ERROR: f64 = 4e-7;

    fn check<S: Simd<G>, G: Group>(simd: S) {
        let at = |x: f32| simd.store(tanh(simd, simd.splat(x))).as_ref()[G::LEN - 1];
        for i in -4000..=4000 {
            for scale in [1e-6, 1e-3, 3e-3] {
                let x = i as f32 * scale;
                let truth = f64::from(x).tanh();
                let value = at(x);
                let error = (f64::from(value) - truth).abs();
                assert!(
                    error <= TANH_RELATIVE_ERROR * truth.abs(),
                    "tanh({x}) = {value}, not {truth}"
                );
            }
        }
        assert_eq!(at(40.0), 1.0);
        assert_eq!(at(-40.0), -1.0);
    }

    #[test]
    fn tanh_follows_the_true_one_everywhere() {
        check::<_, Narrow>(Plain::<false>);
        check::<_, Narrow>(Plain::<true>);
        if let Some(simd) = <<Narrow as Group>::Wide as Simd<Narrow>>::detect() {
            check::<_, Narrow>(simd);
        }
        if let Some(simd) = <<Narrow as Group>::Widest as Simd<Narrow>>::detect() {
            check::<_, Narrow>(simd);
        }
        if let Some(simd) = <<Wide as Group>::Widest as Simd<Wide>>::detect() {
            check::<_, Wide>(simd);
        }
    }
}
