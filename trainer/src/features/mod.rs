//! From shapes to features: rigid alignment, deformation gradients, polar decomposition, consistent rotations, scaling
//! (method section 1).

pub mod acap;
pub mod align;
mod branches;
pub mod gradient;
pub mod metric;
pub mod polar;
pub mod reconstruct;
mod refine;
pub mod rigid;
pub mod scaler;

#[cfg(test)]
pub(crate) mod data;
