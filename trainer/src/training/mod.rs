//! Fits the network: batches in, gradients from `network`, steps of Adam, validation, checkpoints; weights out.

pub mod checkpoint;
pub mod data;
pub mod fit;
mod optimizer;
pub mod schedule;
mod terms;
#[cfg(test)]
mod tests;
