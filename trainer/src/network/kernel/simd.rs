//! Wide registers behind one interface, so that a pass is written once.
//!
//! A value of [`Avx2`] or [`Avx512`] is proof that the processor has the instructions: only `detect` makes one. What the
//! compiler makes of plain loops over lanes changes with each neighbouring line; these calls are one instruction each.

use super::lanes::LANE_COUNT;

/// A group of lanes as it lies in memory.
pub(crate) trait Group: Copy + Send + Sync + PartialEq + AsRef<[f32]> + AsMut<[f32]> + 'static {
    const LEN: usize;
    const ZERO: Self;
    /// The widest instructions for such a group.
    type Widest: Simd<Self>;
    /// Those of the processors of the ten years before.
    type Wide: Simd<Self>;
    /// Those of any processor.
    type Plain: Simd<Self> + Default;
}

/// Arithmetic on groups in registers.
pub(crate) trait Simd<G>: Copy + Send + Sync {
    /// A group in registers.
    type V: Copy;
    /// The same instructions on a group of components.
    type Narrow: Simd<[f32; LANE_COUNT]>;
    /// Proof that the processor has wide registers, where it does.
    fn detect() -> Option<Self>;
    fn narrow(self) -> Self::Narrow;
    fn splat(self, value: f32) -> Self::V;
    fn load(self, group: &G) -> Self::V;
    fn store(self, x: Self::V) -> G;
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    fn div(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `c - a b`.
    fn mul_sub(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    fn min(self, a: Self::V, b: Self::V) -> Self::V;
    fn abs(self, x: Self::V) -> Self::V;
    /// The magnitude of `x` with the sign of `sign`; `x` must not be negative.
    fn copy_sign(self, x: Self::V, sign: Self::V) -> Self::V;
    /// `2^n` with n in the low bits of `x`.
    fn power_of_two(self, x: Self::V) -> Self::V;
}

/// Any processor. FUSED: whether `a * b + c` is one instruction.
#[derive(Clone, Copy, Default)]
pub(crate) struct Plain<const FUSED: bool>;

impl<const FUSED: bool, const L: usize> Simd<[f32; L]> for Plain<FUSED> {
    type V = [f32; L];
    type Narrow = Self;

    fn detect() -> Option<Self> {
        None
    }
    #[inline(always)]
    fn narrow(self) -> Self {
        self
    }
    #[inline(always)]
    fn splat(self, value: f32) -> [f32; L] {
        [value; L]
    }
    #[inline(always)]
    fn load(self, group: &[f32; L]) -> [f32; L] {
        *group
    }
    #[inline(always)]
    fn store(self, x: [f32; L]) -> [f32; L] {
        x
    }
    #[inline(always)]
    fn add(self, a: [f32; L], b: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| a[n] + b[n])
    }
    #[inline(always)]
    fn sub(self, a: [f32; L], b: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| a[n] - b[n])
    }
    #[inline(always)]
    fn mul(self, a: [f32; L], b: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| a[n] * b[n])
    }
    #[inline(always)]
    fn div(self, a: [f32; L], b: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| a[n] / b[n])
    }
    #[inline(always)]
    fn mul_add(self, a: [f32; L], b: [f32; L], c: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| {
            if FUSED {
                a[n].mul_add(b[n], c[n])
            } else {
                a[n] * b[n] + c[n]
            }
        })
    }
    #[inline(always)]
    fn mul_sub(self, a: [f32; L], b: [f32; L], c: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| {
            if FUSED {
                (-a[n]).mul_add(b[n], c[n])
            } else {
                c[n] - a[n] * b[n]
            }
        })
    }
    #[inline(always)]
    fn min(self, a: [f32; L], b: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| if a[n] < b[n] { a[n] } else { b[n] })
    }
    #[inline(always)]
    fn abs(self, x: [f32; L]) -> [f32; L] {
        x.map(f32::abs)
    }
    #[inline(always)]
    fn copy_sign(self, x: [f32; L], sign: [f32; L]) -> [f32; L] {
        core::array::from_fn(|n| x[n].copysign(sign[n]))
    }
    #[inline(always)]
    fn power_of_two(self, x: [f32; L]) -> [f32; L] {
        x.map(|x| f32::from_bits((x.to_bits() << 23).wrapping_add(ONE_BITS as u32)))
    }
}

/// The bits of 1.0.
const ONE_BITS: i32 = 0x3f80_0000;

#[cfg(not(target_arch = "x86_64"))]
mod widths {
    use super::{Group, Plain};

    const FUSED: bool = cfg!(target_arch = "aarch64");

    impl<const L: usize> Group for [f32; L]
    where
        [f32; L]: AsRef<[f32]> + AsMut<[f32]>,
    {
        const LEN: usize = L;
        const ZERO: Self = [0.0; L];
        type Widest = Plain<FUSED>;
        type Wide = Plain<FUSED>;
        type Plain = Plain<FUSED>;
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::Avx512;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use core::arch::x86_64::*;

    use super::{Group, ONE_BITS, Plain, Simd};

    /// Processors with AVX2 and FMA.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx2(());

    /// Processors with AVX-512: twice the lanes, and twice the registers for eight.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx512(());

    impl Avx2 {
        fn proof() -> Option<Self> {
            (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(()))
        }
    }

    impl Avx512 {
        fn proof() -> Option<Self> {
            let found = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl");
            (found && Avx2::proof().is_some()).then_some(Self(()))
        }
    }

    impl Group for [f32; 8] {
        const LEN: usize = 8;
        const ZERO: Self = [0.0; 8];
        type Widest = Avx512;
        type Wide = Avx2;
        type Plain = Plain<false>;
    }

    impl Group for [f32; 16] {
        const LEN: usize = 16;
        const ZERO: Self = [0.0; 16];
        type Widest = Avx512;
        // Without AVX-512 no shapes are put into groups of sixteen.
        type Wide = Plain<false>;
        type Plain = Plain<false>;
    }

    macro_rules! simd {
        (
            $token:ty, $len:literal, $vector:ty, $splat:ident, $load:ident, $store:ident, $add:ident, $sub:ident,
            $mul:ident, $div:ident, $mul_add:ident, $mul_sub:ident, $min:ident, $to_bits:ident, $from_bits:ident,
            $and:ident, $or:ident, $splat_bits:ident, $shift:ident, $add_bits:ident
        ) => {
            // SAFETY: of every call below, `self` proves that the processor has the instructions, and memory is read and
            // written through references to as many numbers as the instruction moves.
            impl Simd<[f32; $len]> for $token {
                type V = $vector;
                type Narrow = Self;

                fn detect() -> Option<Self> {
                    Self::proof()
                }
                #[inline(always)]
                fn narrow(self) -> Self {
                    self
                }
                #[inline(always)]
                fn splat(self, value: f32) -> $vector {
                    unsafe { $splat(value) }
                }
                #[inline(always)]
                fn load(self, group: &[f32; $len]) -> $vector {
                    unsafe { $load(group.as_ptr()) }
                }
                #[inline(always)]
                fn store(self, x: $vector) -> [f32; $len] {
                    let mut group = [0.0; $len];
                    unsafe { $store(group.as_mut_ptr(), x) };
                    group
                }
                #[inline(always)]
                fn add(self, a: $vector, b: $vector) -> $vector {
                    unsafe { $add(a, b) }
                }
                #[inline(always)]
                fn sub(self, a: $vector, b: $vector) -> $vector {
                    unsafe { $sub(a, b) }
                }
                #[inline(always)]
                fn mul(self, a: $vector, b: $vector) -> $vector {
                    unsafe { $mul(a, b) }
                }
                #[inline(always)]
                fn div(self, a: $vector, b: $vector) -> $vector {
                    unsafe { $div(a, b) }
                }
                #[inline(always)]
                fn mul_add(self, a: $vector, b: $vector, c: $vector) -> $vector {
                    unsafe { $mul_add(a, b, c) }
                }
                #[inline(always)]
                fn mul_sub(self, a: $vector, b: $vector, c: $vector) -> $vector {
                    unsafe { $mul_sub(a, b, c) }
                }
                #[inline(always)]
                fn min(self, a: $vector, b: $vector) -> $vector {
                    unsafe { $min(a, b) }
                }
                #[inline(always)]
                fn abs(self, x: $vector) -> $vector {
                    unsafe { $from_bits($and($to_bits(x), $splat_bits(i32::MAX))) }
                }
                #[inline(always)]
                fn copy_sign(self, x: $vector, sign: $vector) -> $vector {
                    unsafe { $from_bits($or($to_bits(x), $and($to_bits(sign), $splat_bits(i32::MIN)))) }
                }
                #[inline(always)]
                fn power_of_two(self, x: $vector) -> $vector {
                    unsafe { $from_bits($add_bits($shift::<23>($to_bits(x)), $splat_bits(ONE_BITS))) }
                }
            }
        };
    }

    macro_rules! eight {
        ($token:ty) => {
            simd!(
                $token,
                8,
                __m256,
                _mm256_set1_ps,
                _mm256_loadu_ps,
                _mm256_storeu_ps,
                _mm256_add_ps,
                _mm256_sub_ps,
                _mm256_mul_ps,
                _mm256_div_ps,
                _mm256_fmadd_ps,
                _mm256_fnmadd_ps,
                _mm256_min_ps,
                _mm256_castps_si256,
                _mm256_castsi256_ps,
                _mm256_and_si256,
                _mm256_or_si256,
                _mm256_set1_epi32,
                _mm256_slli_epi32,
                _mm256_add_epi32
            );
        };
    }
    eight!(Avx2);
    eight!(Avx512);
    simd!(
        Avx512,
        16,
        __m512,
        _mm512_set1_ps,
        _mm512_loadu_ps,
        _mm512_storeu_ps,
        _mm512_add_ps,
        _mm512_sub_ps,
        _mm512_mul_ps,
        _mm512_div_ps,
        _mm512_fmadd_ps,
        _mm512_fnmadd_ps,
        _mm512_min_ps,
        _mm512_castps_si512,
        _mm512_castsi512_ps,
        _mm512_and_si512,
        _mm512_or_si512,
        _mm512_set1_epi32,
        _mm512_slli_epi32,
        _mm512_add_epi32
    );
}
