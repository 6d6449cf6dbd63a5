//! Interchange with other programs: readers of mesh sequences and writers of results.
//!
//! Path of data: a file or folder -> by the table of [`FORMATS`] a scene (meshes, clips, positions at a moment) -> what a [`Choice`]
//! wants of it -> an [`OpenSequence`]: joined, welded along seams, triangulated, frame by frame checked -> [`MeshSequence`] -> the
//! trainer; and back: reconstructed shapes -> `write_*` -> files that other programs open.
//!
//! A format is one file or folder of its own and one row of the table: OBJ, PLY and OFF hold one shape a file, the others scenes.
//! Reading, choosing, welding, triangles and checks happen once, behind them all.
//!
//! Readers trust nothing: every count is held against the bytes that are really there before memory is taken for it.
//! PLY and npy are read by hand because the usual crates take memory for, or multiply, numbers that the header only
//! claims, and recurse over header text.

mod abc;
mod bytes;
mod cache;
mod choose;
mod error;
#[cfg(feature = "fbx")]
mod fbx;
#[cfg(not(feature = "fbx"))]
mod fbx_absent;
mod folder;
mod format;
mod gltf;
mod maya;
mod md2;
mod mdd;
mod mesh;
mod notice;
mod npy;
mod obj;
mod off;
mod open;
mod order;
mod pc2;
mod ply;
mod puppet;
mod read;
mod rig;
mod scene;
mod sequence;
mod skin;
mod still;
mod store;
mod surface;
mod text;
mod triangulate;
mod usd;
mod weld;
mod write;

pub use choose::{Choice, FrameRange, Pose};
pub use error::{Place, SequenceError};
pub use format::{FORMATS, Format, format_table};
pub use mesh::{CornerTexture, Dress, PolygonMesh, UNTEXTURED};
pub use notice::Notice;
pub use npy::{NpyArray, write_npy_f32, write_npy_matrix, write_npy_u32, write_npy_vertices, write_sequence_npy};
pub use obj::{write_obj, write_sequence_obj};
pub use open::{OpenSequence, read_contents};
pub use ply::write_ply;
pub use puppet::{JointPose, Keys, Puppet, PuppetClip, Track, skinned, write_puppet};
pub use read::{SequenceRead, read_sequence};
pub use scene::{ClipEntry, Contents, MeshEntry, Motion, Space, UpAxis};
pub use sequence::{MeshSequence, RenderSurface};
pub use skin::{Joint, Skin};
pub use store::{MAPPED_FROM_BYTES, ShapeStore};
pub use write::{DEFAULT_FPS, FrameWriter, OutputSurface, WriteError, create_writer, write_sequence};
