//! Four lanes without fused operations: SSE2, NEON and WebAssembly's simd128, through one crate. Every kernel does the
//! operations of the reference in the reference's order, so it has the reference's bits on every machine.

mod lanes;
mod normals;
mod solve;

pub(crate) use normals::normals;
pub(crate) use solve::{right_hand_side, substitute};

use sinew_formats::package::BonesView;

use super::generic::adjoint::{self, HeldSums, Pull};
use super::generic::bones::{self, BoneLanes};
use super::generic::decode::{self, BlockRest, Decoder, FeatureScales, Group};
use super::generic::lanes::Gradient;
use lanes::Four;

/// A kernel written for any lanes, on four.
macro_rules! kernel {
    ($module:ident :: $name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`", stringify!($module), "::", stringify!($name), "`].")]
        pub(crate) fn $name($($argument: $type),*) {
            $module::$name::<Four>($($argument),*);
        }
    };
}

generic_kernels!(kernel);
