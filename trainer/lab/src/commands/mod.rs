//! The subcommands, one file each.

pub mod ablate;
pub mod compare;
