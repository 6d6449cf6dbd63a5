//! AVX-512: sixteen lanes.
// Intrinsics. A value of `Sixteen` exists only inside the functions here, which run where `Kernels::Avx512` does.
#![allow(unsafe_code)]

mod lanes;
pub(crate) mod solve;

use sinew_formats::package::BonesView;

use crate::simd::Kernels;
use crate::simd::generic::adjoint::{self, HeldSums, Pull};
use crate::simd::generic::bones::{self, BoneLanes};
use crate::simd::generic::decode::{self, BlockRest, Decoder, FeatureScales, Group};
use crate::simd::generic::lanes::Gradient;
use lanes::Sixteen;

/// Wraps a kernel written for any lanes: compiled for these instructions, called where they are present, which is looked
/// up in a word of memory.
macro_rules! kernel {
    ($module:ident :: $name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`", stringify!($module), "::", stringify!($name), "`].")]
        pub(crate) fn $name($($argument: $type),*) {
            #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl")]
            fn compiled($($argument: $type),*) {
                $module::$name::<Sixteen>($($argument),*);
            }
            assert!(Kernels::Avx512.run_here());
            // SAFETY: the instructions are present.
            unsafe { compiled($($argument),*) }
        }
    };
}

generic_kernels!(kernel);
