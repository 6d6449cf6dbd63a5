//! Eight lanes of AVX2.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use crate::simd::generic::lanes::{Gradient, Lanes};

/// One register.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eight(pub(super) __m256);

// SAFETY, of every block here: the instructions are present, see the head of `avx2/mod.rs`; loads and stores are unaligned
// and stay inside a slice whose length was checked.
impl Lanes for Eight {
    const COUNT: usize = 8;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..Self::COUNT];
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..Self::COUNT];
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn load_whole(whole: &[i16]) -> Self {
        let whole = &whole[..Self::COUNT];
        Self(unsafe { _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128(whole.as_ptr().cast()))) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(unsafe { _mm256_div_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm256_fnmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn select_below(self, limit: Self, yes: Self, no: Self) -> Self {
        unsafe {
            let below = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, limit.0);
            Self(_mm256_blendv_ps(no.0, yes.0, below))
        }
    }
    #[inline(always)]
    fn all_at_most(self, limit: f32) -> bool {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, _mm256_set1_ps(limit))) == 0xff }
    }
    #[inline(always)]
    fn store_column(rows: [Self; 4], column: usize, target: &mut [Gradient]) {
        let [a, b, c, d] = rows.map(|row| row.0);
        // Two 4x4 transposes at once: lane 4 n + i is half n of quad i.
        let quads = unsafe {
            let [ab, cd] = [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)];
            let [ab_high, cd_high] = [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)];
            [
                _mm256_shuffle_ps::<0x44>(ab, cd),
                _mm256_shuffle_ps::<0xee>(ab, cd),
                _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
            ]
        };
        let mut store = |lane: usize, half: __m128| {
            if let Some(gradient) = target.get_mut(lane) {
                unsafe { _mm_storeu_ps(gradient[column].as_mut_ptr(), half) }
            }
        };
        for (i, quad) in quads.into_iter().enumerate() {
            unsafe {
                store(i, _mm256_castps256_ps128(quad));
                store(4 + i, _mm256_extractf128_ps::<1>(quad));
            }
        }
    }
}
