//! Interchange with other programs: readers of mesh sequences and writers of results.
//!
//! Path of data: files -> [`PolygonMesh`] or [`NpyArray`] -> checked, triangulated [`MeshSequence`] -> the trainer; and
//! back: reconstructed shapes -> `write_*` -> files that other programs open.
//!
//! Readers trust nothing: every count is held against the bytes that are really there before memory is taken for it.
//! PLY and npy are read by hand because the usual crates take memory for, or multiply, numbers that the header only
//! claims, and recurse over header text.

mod error;
mod folder;
mod mesh;
mod notice;
mod npy;
mod obj;
mod off;
mod order;
mod ply;
mod ply_header;
mod read;
mod sequence;
mod text;
mod texture;
mod triangulate;
mod write;

pub use error::{Place, SequenceError};
pub use mesh::{MeshKind, PolygonMesh};
pub use notice::Notice;
pub use npy::NpyArray;
pub use read::{SequenceRead, read_sequence};
pub use sequence::{MeshSequence, RenderSurface};
pub use write::{
    WriteError, write_npy_f32, write_npy_matrix, write_npy_u32, write_npy_vertices, write_obj, write_ply,
    write_sequence_npy, write_sequence_obj, write_textured_obj,
};
