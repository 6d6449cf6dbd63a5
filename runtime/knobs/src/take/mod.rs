//! Takes: a performance as it was played, from raw knob events to a file that survives a crash, and back. The format is in
//! `docs/take-format.md`.
//!
//! Path of data: source events, commands and frames -> [`TakeWriter`] -> bytes -> [`Take`] -> [`replay`] through a
//! [`ControlSurface`](crate::ControlSurface): the same weights to the bit, or [`TakeFrames`]: weights at other times.

mod error;
mod header;
mod read;
mod record;
mod replay;
mod wire;
mod write;

pub use error::TakeError;
pub use header::MissingControl;
pub use read::{Records, Take};
pub use record::{Record, Stamped};
pub use replay::{Replayed, TakeFrames, replay};
pub use write::{TakeWriter, WRITER_BYTES_MIN};

#[cfg(test)]
mod tests;
