//! Sinew's formats: the bytes that trainer and runtime agree on (`package`, no_std), and interchange with other programs
//! (`interchange`, feature `std`).
//!
//! Path of data: `interchange` reads a mesh sequence for the trainer; the trainer writes a compact `package`, bakes it
//! into a baked one; the runtime opens that and plays it. `FORMAT.md` says what every byte means.
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "alloc")]
extern crate alloc;

pub mod package;

#[cfg(feature = "std")]
pub mod interchange;
