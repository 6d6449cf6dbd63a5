//! The laboratory: Sinew beside the systems of the literature, and what each choice of its method is worth. Nothing here is
//! part of the product, and no product depends on it.
//!
//! Path of data: sequence, split -> [`baselines`] and the trainer itself -> [`compare`] (one table of methods) or [`ablate`]
//! (one table for every choice) -> a page each.

pub mod ablate;
pub mod baselines;
pub mod compare;
