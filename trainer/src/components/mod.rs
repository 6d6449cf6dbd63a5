//! Components: where they start (closed form, or random as published), what feeds their training (local mixes, position
//! modes), how they leave the trained network (extract, prune), and what is seen of them in a package (fields, mirror pairs,
//! labels, new names). Regions that the user paints stand in the configuration and steer the start.

pub mod alternate;
pub mod anatomy;
pub mod bends;
pub mod embedding;
pub mod extract;
pub mod fields;
pub mod grouping;
pub mod kept;
pub mod labels;
pub mod mix;
pub mod modes;
pub mod offsets;
pub mod painted;
pub mod position_modes;
pub mod prior;
pub mod random_start;
pub mod rename;
pub mod start;
pub mod symmetry;
pub mod varimax;
