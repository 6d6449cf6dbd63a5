//! The reference of the kernels written for any lanes: one lane of plain Rust, no fused operation, the same bits on every
//! machine.

use libm::sqrtf;
use sinew_formats::package::BonesView;

use super::generic::adjoint::{self, HeldSums, Pull};
use super::generic::bones::{self, BoneLanes};
use super::generic::decode::{self, BlockRest, Decoder, FeatureScales, Group};
use super::generic::lanes::{Gradient, Lanes};
pub(crate) use super::generic::normals::normals;
pub(crate) use super::generic::solve::{right_hand_side, substitute};

/// A kernel written for any lanes, on one.
macro_rules! kernel {
    ($module:ident :: $name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`", stringify!($module), "::", stringify!($name), "`].")]
        pub(crate) fn $name($($argument: $type),*) {
            $module::$name::<One>($($argument),*);
        }
    };
}

generic_kernels!(kernel);

/// One lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct One(pub(crate) f32);

impl Lanes for One {
    const COUNT: usize = 1;

    fn splat(value: f32) -> Self {
        Self(value)
    }
    fn load(values: &[f32]) -> Self {
        Self(values[0])
    }
    fn store(self, values: &mut [f32]) {
        values[0] = self.0;
    }
    fn load_whole(whole: &[i16]) -> Self {
        Self(f32::from(whole[0]))
    }
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
    fn sqrt(self) -> Self {
        Self(sqrtf(self.0))
    }
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(self.0 * factor.0 + term.0)
    }
    fn neg_mul_add(self, factor: Self, term: Self) -> Self {
        Self(term.0 - self.0 * factor.0)
    }
    fn min(self, other: Self) -> Self {
        Self(if self.0 < other.0 { self.0 } else { other.0 })
    }
    fn max(self, other: Self) -> Self {
        Self(if self.0 > other.0 { self.0 } else { other.0 })
    }
    fn select_below(self, limit: Self, yes: Self, no: Self) -> Self {
        if self.0 < limit.0 { yes } else { no }
    }
    fn all_at_most(self, limit: f32) -> bool {
        self.0 <= limit
    }
    fn store_column(rows: [Self; 4], column: usize, target: &mut [Gradient]) {
        target[0][column] = rows.map(|row| row.0);
    }
}
