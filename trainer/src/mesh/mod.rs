//! The mesh as the trainer sees it: connectivity, edge weights, distances along the surface.

pub mod cotangent;
pub mod geodesic;
pub mod topology;
