//! The mesh as the trainer sees it: connectivity, edge weights, distances along the surface.

mod bridge;
pub mod cotangent;
pub mod geodesic;
mod nearest;
pub mod sparse_factor;
pub mod topology;
pub mod unfolding;

#[cfg(test)]
pub(crate) mod shapes;
