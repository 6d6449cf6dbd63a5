//! AVX2 with fused multiply-add: eight lanes.

pub(crate) mod poisson;
