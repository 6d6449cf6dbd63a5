//! Kernels written once: those of decode for any number of lanes, the others as their plain reference, with the types that
//! each step reads and writes.

pub(crate) mod adjoint;
pub(crate) mod bones;
pub(crate) mod decode;
mod functions;
pub(crate) mod lanes;
pub(crate) mod normals;
pub(crate) mod solve;

#[cfg(test)]
pub(crate) use functions::{TANH_TOLERANCE, tanh};
