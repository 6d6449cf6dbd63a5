//! AVX2 with FMA: eight lanes.
// Intrinsics. A value of `Eight` exists only inside the functions here, which run where `Kernels::Avx2` does.
#![allow(unsafe_code)]

mod lanes;
mod normals;
pub(crate) mod solve;

pub(crate) use normals::normals;

use sinew_formats::package::BonesView;

use crate::simd::Kernels;
use crate::simd::generic::adjoint::{self, HeldSums, Pull};
use crate::simd::generic::bones::{self, BoneLanes};
use crate::simd::generic::decode::{self, BlockRest, Decoder, FeatureScales, Group};
use crate::simd::generic::lanes::Gradient;
use lanes::Eight;

/// Wraps a kernel written for any lanes: compiled for these instructions, called where they are present, which is looked
/// up in a word of memory.
macro_rules! kernel {
    ($module:ident :: $name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`", stringify!($module), "::", stringify!($name), "`].")]
        pub(crate) fn $name($($argument: $type),*) {
            #[target_feature(enable = "avx2,fma")]
            fn compiled($($argument: $type),*) {
                $module::$name::<Eight>($($argument),*);
            }
            assert!(Kernels::Avx2.run_here());
            // SAFETY: the instructions are present.
            unsafe { compiled($($argument),*) }
        }
    };
}

generic_kernels!(kernel);
