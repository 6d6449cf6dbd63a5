//! Sinew's trainer: from a mesh sequence to a package of deformation components.
//!
//! Path of data: [`mesh`] (topology, weights, distances) -> [`features`] (as-consistent-as-possible deformation
//! gradients, scaled) -> `components::start` and [`training`] over [`network`] -> [`components`] (extract, prune) ->
//! compact package -> [`bake`] -> baked package -> [`evaluate`] through the runtime.
//!
//! Index letters everywhere: `v` vertex, `f` face, `k` component, `l` level, `m` shape, `c` coordinate.

pub mod components;
pub mod config;
pub mod evaluate;
pub mod features;
pub mod learn;
pub mod mesh;
pub mod network;
pub mod training;

pub use sinew_bake as bake;

pub use sinew_synthesize as synthesize;
