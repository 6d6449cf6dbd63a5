//! Sinew's runtime: weights of deformation components in, a deformed mesh out. `no_std`, no allocation, memory from the
//! caller; every check that costs more than O(controls) happens once, in [`Basis::open`].
//!
//! Path of data, a frame: [`Controls`] -> decode (sparse blend of folded components, tanh, deformation gradients) ->
//! solve (right-hand side, `L d = b`) -> positions -> [`Normals`]. [`Frame`] runs it; [`Tangent`] is its derivative along
//! one control; [`Reconstruct`] enters it behind the network, with features of one's own.
//!
//! A workspace of bones ([`TierChoice`]) decodes at a few nodes only and makes a few affine maps of them: [`BoneMaps`] writes them
//! for an engine's GPU to skin by, and stops.
//!
//! Around it: [`Handles`] and [`Drag`] find the weights that bring held vertices to where they are wanted; [`VertexOutput`]
//! writes a frame as an engine's vertex buffer; [`Batch`] plays many instances on threads that the caller lends.
//!
//! ```no_run
//! use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};
//! # fn play(bytes: &[u8], memory: &mut [u8], weights: &mut [f32], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]])
//! # -> Result<(), Box<dyn std::error::Error>> {
//! let basis = Basis::open(bytes)?; // once: all heavy checks
//! let layout = WorkspaceLayout::for_basis(&basis); // once: how much memory
//! # assert!(memory.len() >= layout.unaligned_bytes());
//! let mut workspace = Workspace::new(&basis, memory)?; // once: carves the caller's memory
//! let mut controls = Controls::new(&basis, weights)?; // once: all at rest
//! controls.set(0, 0.5)?;
//! Frame { basis: &basis, controls: &controls, positions, normals: Some(normals) }.run(&mut workspace)?; // each frame
//! # Ok(())
//! # }
//! ```
#![no_std]
// Only the kernels of one instruction set may allow it, each in a file of its own, and the batch's shared slice.
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

mod added;
mod basis;
mod bones;
// Threads need compare-and-swap.
#[cfg(target_has_atomic = "ptr")]
mod batch;
mod controls;
mod decode;
mod error;
mod frame;
mod handles;
mod linearize;
mod memory;
mod normals;
mod output;
mod positions;
mod reconstruct;
mod simd;
mod solve;
#[doc(hidden)]
pub mod steps;
mod workspace;

#[cfg(test)]
mod fixture;

pub use basis::{Basis, Component};
#[cfg(target_has_atomic = "ptr")]
pub use batch::{Batch, Instance};
pub use bones::{BoneMaps, BoneName, BoneOutput, BoneTransform, BonesInfo};
pub use controls::Controls;
pub use error::{Buffer, ControlError, FrameError, WorkspaceError};
pub use frame::{Frame, FrameOutcome};
pub use handles::{Drag, DragReport, HANDLES_MAX, HandleError, Handles, HandlesLayout};
pub use linearize::Tangent;
pub use normals::Normals;
pub use output::{Attribute, AttributeName, OutputError, UnitEncoding, VertexLayout, VertexOutput};
pub use positions::Bounds;
pub use reconstruct::Reconstruct;
pub use simd::Kernels;
pub use simd::generic::normals::FALLBACK_NORMAL;
pub use sinew_formats::package::{BonesError, FEATURE_COUNT, Faces, IndexSlice, OpenError, PoseError, SurfaceView};
pub use workspace::{TierChoice, Workspace, WorkspaceLayout};
