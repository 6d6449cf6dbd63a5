//! What the runtime's benchmarks stand beside, and what they play. Nothing on the path of data uses it.
//!
//! Peers: [`morph`] (dense morph targets, three loops), [`skinning`] (linear blend skinning), [`solvers`] (faer's simplicial
//! solve, and CHOLMOD with the feature `cholmod`). Packages: [`subject`].

#[cfg(feature = "cholmod")]
pub mod cholmod;
pub mod lanes;
pub mod morph;
pub mod skinning;
pub mod solvers;
pub mod subject;
