//! The package: a 64-byte header, then one rkyv archive of either a [`CompactBasis`] (what the trainer learned) or a
//! [`BakedBasis`] (the same, ready for the frame path).

mod after;
mod archive;
mod baked;
mod baked_view;
mod bones;
mod compact;
mod compact_view;
mod error;
#[cfg(feature = "alloc")]
mod fans;
#[cfg(feature = "std")]
mod file;
#[cfg(any(all(test, feature = "alloc"), feature = "fixture"))]
pub mod fixture;
mod header;
mod indices;
#[cfg(test)]
mod layout_tests;
pub mod limits;
#[cfg(feature = "alloc")]
mod patches;
mod rules;
mod surface;
#[cfg(all(test, feature = "alloc"))]
mod tests;
mod values;
#[cfg(feature = "alloc")]
mod write;

pub use after::{After, ArchivedAfter, ArchivedPrior, NO_PIECE, Prior};
pub use baked::{
    ArchivedBakedBasis, ArchivedBakedBlock, ArchivedBakedComponent, ArchivedBakedExact, ArchivedBakedPatches,
    ArchivedBakedSolve, BakedBasis, BakedBlock, BakedComponent, BakedExact, BakedPatches, BakedSolve, OnCacheLines,
    QUAD, TILE_ENTRIES,
};
pub use baked_view::{BakedView, ExactView, PatchEntry, PatchesView, SolveView};
pub use bones::{
    ArchivedBakedBones, ArchivedBakedSkin, ArchivedBonesError, ArchivedPoseError, BakedBones, BakedSkin, BoneGroup,
    BonesError, BonesView, NORMAL_UNIT, PoseError, SKIN_WEIGHT_SUM, SkinView, TURN_NODES,
};
pub use compact::{
    ArchivedBlockRecord, ArchivedCompactBasis, ArchivedComponentRecord, ArchivedGraphConvRecord, ArchivedProvenance,
    ArchivedQuality, BlockRecord, CompactBasis, ComponentRecord, GraphConvRecord, Provenance, Quality,
};
pub use compact_view::{CompactEntry, CompactView};
pub use error::OpenError;
#[cfg(feature = "alloc")]
pub use fans::Fans;
#[cfg(feature = "std")]
pub use file::{ReadError, SaveError, read_package, save_package};
pub use header::{FIRST_VERSION, FORMAT_VERSION, HEADER_BYTES, Header, MAGIC, PAYLOAD_ALIGNMENT, PackageKind};
pub use indices::{ArchivedIndices, Index, IndexSlice, Indices, SHORT_COUNT};
#[cfg(feature = "alloc")]
pub use patches::{Patch, Patches};
pub use surface::{ArchivedSurface, Faces, Surface, SurfaceView};
pub use values::{ArchivedValueScales, ROTATION_FEATURES, ValueScales, nearest};
#[cfg(feature = "alloc")]
pub use write::{AlignedBytes, WriteError, write_baked, write_compact};

/// Features a vertex: axis-angle log-rotation xyz, then stretch xx xy xz yy yz zz.
pub const FEATURE_COUNT: usize = 9;
/// Nodes of a group: what the widest vector register holds, so that a frame decodes a group at a time.
pub const GROUP_NODES: usize = 16;
/// Vertices whose fans stand side by side: a quarter of a group.
pub const FAN_VERTICES: usize = 4;

/// Stands where an index is absent: the parent of a root block.
pub const NONE: u32 = u32::MAX;
