//! Sinew for C. The edge of the runtime: raw pointers come in, are checked, and become the borrowed slices of
//! `sinew-runtime`; results go out as status codes. All unsafe code of the frame path is in this crate.
//!
//! Path of data: package bytes -> [`sinew_basis_open`] -> handles for workspace and controls in the caller's memory ->
//! [`sinew_control_set`] -> [`sinew_frame`] -> positions and normals in the caller's buffers -> [`sinew_vertices_write`] ->
//! a vertex buffer. Around it: [`sinew_drag`] finds the weights for held vertices, [`sinew_batch_play`] plays many instances.
//!
//! Knobs: bytes of the caller's port -> [`sinew_decoder_feed`] -> [`sinew_surface_take`] -> [`sinew_surface_advance`] ->
//! controls.
//!
//! `include/sinew.h` is written from these files by a test and is the manual; `README.md` says how to build and link.
//!
//! Three things hold for every function: it never unwinds into its caller, it allocates nothing, and where it refuses it
//! has changed nothing (the two exceptions say so: [`SinewStatus::FrameOverflow`] and [`SinewStatus::Internal`]).

mod basis;
mod batch;
mod carve;
mod classify;
mod controls;
mod decoder;
mod details;
mod device;
mod drag;
mod edge;
mod fault;
mod frame;
mod handle;
mod memory;
mod output;
mod status;
mod status_texts;
mod structs;
mod surface;
mod surface_map;
mod surface_state;
mod text;
mod version;
mod workspace;

pub use basis::*;
pub use batch::*;
pub use controls::*;
pub use decoder::*;
pub use details::*;
pub use device::*;
pub use drag::*;
pub use frame::*;
pub use memory::SinewLayout;
pub use output::*;
pub use status::*;
pub use surface::*;
pub use surface_map::*;
pub use surface_state::*;
pub use version::*;
pub use workspace::*;
