//! AVX2 with FMA and F16C: eight lanes.
// Intrinsics. A value of `Eight` exists only inside the functions here, which run where `Kernels::Avx2` does.
#![allow(unsafe_code)]

mod lanes;
pub(crate) mod poisson;
pub(crate) mod skin;
mod surface;

pub(crate) use surface::normals;

use super::adjoint::{HeldSums, Pull};
use super::decode::{BlockRest, Decoder, FeatureScales, Group};
use super::lanes::Gradient;
use super::{Kernels, decode as generic};
use lanes::Eight;

/// Wraps a kernel written for any lanes: compiled for these instructions, called where they are present, which is looked
/// up in a word of memory.
macro_rules! kernel {
    ($name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`generic::", stringify!($name), "`].")]
        pub(crate) fn $name($($argument: $type),*) {
            #[target_feature(enable = "avx2,fma,f16c")]
            fn compiled($($argument: $type),*) {
                generic::$name::<Eight>($($argument),*);
            }
            assert!(Kernels::Avx2.run_here());
            // SAFETY: the instructions are present.
            unsafe { compiled($($argument),*) }
        }
    };
}

generic_kernels!(kernel);
