//! AVX-512: sixteen lanes.

pub(crate) mod poisson;
