//! The mesh as baker and trainer see it: connectivity, edge weights, nearest vertices.

pub mod bridge;
pub mod cotangent;
pub mod nearest;
pub mod topology;
pub mod vector;

#[cfg(any(test, feature = "fixture"))]
pub mod shapes;

/// Positions as f64.
pub fn widened(shape: &[[f32; 3]]) -> Vec<[f64; 3]> {
    shape.iter().map(|p| p.map(f64::from)).collect()
}
