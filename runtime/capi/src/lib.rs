//! Sinew for C. The edge of the runtime: raw pointers come in, are checked, and become the borrowed slices of
//! `sinew-runtime`; results go out as status codes. All unsafe code of the frame path is in this crate.
//!
//! Path of data: package bytes -> [`sinew_player_open`], or [`sinew_basis_open`] and handles for workspace and controls, all in
//! the caller's memory -> [`sinew_control_set`] -> [`sinew_frame`] -> positions and normals in the caller's buffers ->
//! [`sinew_vertices_write`] -> a vertex buffer. Around it: [`sinew_pins_drag`] finds the weights for pinned vertices,
//! [`sinew_batch_play`] plays many instances, [`sinew_bones_pose`] stops at the bones that a GPU skins by, [`sinew_controls_carry`] takes the weights over into another package.
//!
//! Knobs: bytes of the caller's port -> [`sinew_decoder_feed`] -> [`sinew_surface_read`] -> [`sinew_surface_advance`] ->
//! controls.
//!
//! The headers in `include/` are written from these files by a test and are the manual; `README.md` says how to build and link.
//!
//! Three things hold for every function: it never unwinds into its caller, it allocates nothing, and where it refuses it
//! has changed nothing (the two exceptions say so: [`SinewStatus::FrameOverflow`] and [`SinewStatus::Internal`]).

mod basis;
mod batch;
mod bones;
mod carve;
mod classify;
mod controls;
mod decoder;
mod details;
mod device;
mod edge;
mod fault;
mod frame;
mod handle;
mod kind;
mod memory;
mod number;
mod pins;
mod player;
mod status;
mod structs;
mod surface;
mod surface_map;
mod surface_state;
mod text;
mod version;
mod vertices;
mod workspace;

pub use basis::*;
pub use batch::*;
pub use bones::*;
pub use controls::*;
pub use decoder::*;
pub use details::*;
pub use device::*;
pub use frame::*;
pub use memory::SinewLayout;
pub use pins::*;
pub use player::*;
pub use status::*;
pub use surface::*;
pub use surface_map::*;
pub use surface_state::*;
pub use version::*;
pub use vertices::*;
pub use workspace::*;
