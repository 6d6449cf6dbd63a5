//! The mesh as baker and trainer see it: connectivity, edge weights, distances along the surface.

mod bridge;
pub mod cotangent;
pub mod geodesic;
pub mod nearest;
pub mod sparse_factor;
pub mod topology;
pub mod unfolding;

#[cfg(any(test, feature = "fixture"))]
pub mod shapes;

/// Positions as f64.
pub fn widened(shape: &[[f32; 3]]) -> Vec<[f64; 3]> {
    shape.iter().map(|p| p.map(f64::from)).collect()
}
