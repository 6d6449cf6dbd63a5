//! The scalar kernels, in the order of the frame: blend, gradient, poisson, surface. Fixed summation order and every
//! transcendental function through `libm`, so one input gives the same bits on every machine.

pub(crate) mod poisson;
pub(crate) mod surface;

#[cfg(test)]
pub(crate) mod naive;
