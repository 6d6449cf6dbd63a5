//! The mesh as the trainer sees it: what the baker knows of it (connectivity, edge weights, nearest vertices), and distances
//! along the surface, sparse factors and what hangs on what, which only learning and comparing use.

pub mod geodesic;
pub mod hanging;
pub mod sparse_factor;
pub mod unfolding;

pub use sinew_bake::mesh::*;
