//! Components: where they start (closed form, or random as published), what feeds their training (local mixes, position modes), and how they
//! leave the trained network (extract, prune).

pub mod extract;
pub mod mix;
pub mod modes;
pub mod position_modes;
pub mod random_start;
pub mod regions;
pub mod start;
