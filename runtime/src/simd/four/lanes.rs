//! Four lanes of f32.

use wide::{f32x4, i32x4};

use crate::simd::generic::lanes::{Gradient, Lanes};

/// One register. Products are rounded before they are added, as in the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Four(pub(super) f32x4);

/// The first four numbers of a slice that has them.
#[inline(always)]
pub(super) fn load(values: &[f32]) -> f32x4 {
    f32x4::new([values[0], values[1], values[2], values[3]])
}

impl Lanes for Four {
    const COUNT: usize = 4;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(f32x4::splat(value))
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        Self(load(&values[..Self::COUNT]))
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        values[..Self::COUNT].copy_from_slice(self.0.as_array());
    }
    #[inline(always)]
    fn load_whole(whole: &[i16]) -> Self {
        let whole = &whole[..Self::COUNT];
        let wide = i32x4::new([whole[0].into(), whole[1].into(), whole[2].into(), whole[3].into()]);
        Self(f32x4::from_i32x4(wide))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(self.0 * factor.0 + term.0)
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        Self(term.0 - self.0 * factor.0)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.fast_min(other.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.fast_max(other.0))
    }
    #[inline(always)]
    fn select_below(self, limit: Self, yes: Self, no: Self) -> Self {
        Self(self.0.simd_lt(limit.0).bitselect(yes.0, no.0))
    }
    #[inline(always)]
    fn all_at_most(self, limit: f32) -> bool {
        self.0.simd_le(f32x4::splat(limit)).all()
    }
    #[inline(always)]
    fn store_column(rows: [Self; 4], column: usize, target: &mut [Gradient]) {
        let lanes = f32x4::transpose([rows[0].0, rows[1].0, rows[2].0, rows[3].0]);
        for (gradient, lane) in target.iter_mut().zip(lanes) {
            gradient[column] = lane.to_array();
        }
    }
}
