//! Sixteen lanes of AVX-512.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use crate::simd::generic::lanes::{Gradient, Lanes};

/// One register.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sixteen(pub(super) __m512);

// SAFETY, of every block here: the instructions are present, see the head of `avx512/mod.rs`; loads and stores are unaligned
// and stay inside a slice whose length was checked.
impl Lanes for Sixteen {
    const COUNT: usize = 16;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(value) })
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..Self::COUNT];
        Self(unsafe { _mm512_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..Self::COUNT];
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn load_whole(whole: &[i16]) -> Self {
        let whole = &whole[..Self::COUNT];
        Self(unsafe { _mm512_cvtepi32_ps(_mm512_cvtepi16_epi32(_mm256_loadu_si256(whole.as_ptr().cast()))) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(unsafe { _mm512_div_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm512_fnmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn select_below(self, limit: Self, yes: Self, no: Self) -> Self {
        unsafe {
            let below = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, limit.0);
            Self(_mm512_mask_blend_ps(below, no.0, yes.0))
        }
    }
    #[inline(always)]
    fn all_at_most(self, limit: f32) -> bool {
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, _mm512_set1_ps(limit)) == u16::MAX }
    }
    #[inline(always)]
    fn quotient(self, other: Self) -> Self {
        // Fourteen digits and one step of Newton's.
        unsafe {
            let guess = _mm512_rcp14_ps(other.0);
            let lack = _mm512_fnmadd_ps(other.0, guess, _mm512_set1_ps(1.0));
            Self(_mm512_mul_ps(self.0, _mm512_fmadd_ps(guess, lack, guess)))
        }
    }
    #[inline(always)]
    fn store_column(rows: [Self; 4], column: usize, target: &mut [Gradient]) {
        let [a, b, c, d] = rows.map(|row| row.0);
        // Four 4x4 transposes at once: lane 4 n + i is quarter n of quad i.
        let quads = unsafe {
            let [ab, cd] = [_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d)];
            let [ab_high, cd_high] = [_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d)];
            [
                _mm512_shuffle_ps::<0x44>(ab, cd),
                _mm512_shuffle_ps::<0xee>(ab, cd),
                _mm512_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm512_shuffle_ps::<0xee>(ab_high, cd_high),
            ]
        };
        let mut store = |lane: usize, quarter: __m128| {
            if let Some(gradient) = target.get_mut(lane) {
                unsafe { _mm_storeu_ps(gradient[column].as_mut_ptr(), quarter) }
            }
        };
        for (i, quad) in quads.into_iter().enumerate() {
            unsafe {
                store(i, _mm512_castps512_ps128(quad));
                store(4 + i, _mm512_extractf32x4_ps::<1>(quad));
                store(8 + i, _mm512_extractf32x4_ps::<2>(quad));
                store(12 + i, _mm512_extractf32x4_ps::<3>(quad));
            }
        }
    }
}
