//! Sinew for C. The edge of the runtime: raw pointers come in, are checked, and become the borrowed slices of
//! `sinew-runtime`; results go out as status codes. All unsafe code of the frame path is in this crate.
//!
//! Path of data: package bytes -> [`sinew_basis_open`] -> handles for workspace and controls in the caller's memory ->
//! [`sinew_control_set`] -> [`sinew_frame`] -> positions and normals in the caller's buffers.
//!
//! `include/sinew.h` is written from these files by a test and is the manual; `README.md` says how to build and link.
//!
//! Three things hold for every function: it never unwinds into its caller, it allocates nothing, and where it refuses it
//! has changed nothing (the two exceptions say so: [`SinewStatus::FrameOverflow`] and [`SinewStatus::Internal`]).

mod basis;
mod classify;
mod controls;
mod details;
mod edge;
mod fault;
mod frame;
mod handle;
mod memory;
mod status;
mod structs;
mod version;
mod workspace;

pub use basis::*;
pub use controls::*;
pub use details::*;
pub use frame::*;
pub use memory::SinewLayout;
pub use status::*;
pub use version::*;
pub use workspace::*;
