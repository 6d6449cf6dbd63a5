//! The kernels: free functions over plain slices, without a basis, a workspace or a check of lengths.
//!
//! [`scalar`] is the reference; whatever else stands here one day must equal it within a named tolerance.

pub(crate) mod scalar;
