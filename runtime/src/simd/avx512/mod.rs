//! AVX-512: sixteen lanes.
// Intrinsics. A value of `Sixteen` exists only inside the functions here, which run where `Kernels::Avx512` does.
#![allow(unsafe_code)]

mod lanes;
pub(crate) mod poisson;
pub(crate) mod skin;

use super::adjoint::{HeldSums, Pull};
use super::decode::{BlockRest, Decoder, FeatureScales, Group};
use super::lanes::Gradient;
use super::{Kernels, decode as generic};
use lanes::Sixteen;

/// Wraps a kernel written for any lanes: compiled for these instructions, called where they are present, which is looked
/// up in a word of memory.
macro_rules! kernel {
    ($name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`generic::", stringify!($name), "`].")]
        pub(crate) fn $name($($argument: $type),*) {
            #[target_feature(enable = "avx2,fma,f16c,avx512f,avx512bw,avx512dq,avx512vl")]
            fn compiled($($argument: $type),*) {
                generic::$name::<Sixteen>($($argument),*);
            }
            assert!(Kernels::Avx512.run_here());
            // SAFETY: the instructions are present.
            unsafe { compiled($($argument),*) }
        }
    };
}

generic_kernels!(kernel);
