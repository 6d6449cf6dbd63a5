//! The bytes of a package, which Sinew's trainer and runtime agree on: no_std, nothing allocated to read.
//!
//! Path of data: the trainer writes a compact [`package`] and bakes it into a baked one; the runtime opens that and plays
//! it. `FORMAT.md` says what every byte means.
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "alloc")]
extern crate alloc;

pub mod package;
