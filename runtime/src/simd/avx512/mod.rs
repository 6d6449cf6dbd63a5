//! AVX-512: sixteen lanes.
// Intrinsics. A value of `Sixteen` exists only below the entry points here, which the frame path calls where
// `Kernels::Avx512` runs.
#![allow(unsafe_code)]

mod lanes;

use super::decode::{BlockRest, Decoder, Group};
use lanes::Sixteen;

/// See [`super::decode::decode`].
///
/// # Safety
/// `Kernels::Avx512.run_here()`.
#[target_feature(enable = "avx2,fma,f16c,avx512f,avx512bw,avx512dq,avx512vl")]
pub(crate) fn decode(decoder: &Decoder<'_>, features: &mut [Group<f32>], gradients: &mut [[f32; 4]]) {
    super::decode::decode::<Sixteen>(decoder, features, gradients);
}

/// See [`super::decode::rest_activations`].
#[target_feature(enable = "avx2,fma,f16c,avx512f,avx512bw,avx512dq,avx512vl")]
pub(crate) fn rest_activations(blocks: &mut [BlockRest]) {
    super::decode::rest_activations::<Sixteen>(blocks);
}
