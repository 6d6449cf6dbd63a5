//! The package: a 64-byte header, then one rkyv archive of either a [`CompactBasis`] (what the trainer learned) or a
//! [`BakedBasis`] (the same, ready for the frame path).

mod baked;
mod baked_view;
mod basis;
mod error;
mod faces;
#[cfg(feature = "alloc")]
mod fans;
#[cfg(feature = "std")]
mod file;
#[cfg(any(all(test, feature = "alloc"), feature = "fixture"))]
pub mod fixture;
mod header;
pub mod limits;
mod open;
#[cfg(feature = "alloc")]
mod patches;
mod render;
mod rules;
#[cfg(all(test, feature = "alloc"))]
mod tests;
#[cfg(feature = "alloc")]
mod write;

pub use baked::{
    ArchivedBakedBasis, ArchivedBakedBlock, ArchivedBakedComponent, ArchivedBakedFast, ArchivedBakedTier,
    ArchivedFastError, BakedBasis, BakedBlock, BakedComponent, BakedFast, BakedTier, FastError, OnCacheLines,
    SKIN_NODES, SKIN_WEIGHT_SUM, TILE_ENTRIES, TILE_SIDE,
};
pub use baked_view::{BakedView, FastView, TierEntry, TierView};
pub use basis::{
    ArchivedBlockRecord, ArchivedCompactBasis, ArchivedComponentRecord, ArchivedGraphConvRecord, ArchivedProvenance,
    ArchivedQuality, BlockRecord, CompactBasis, ComponentRecord, GraphConvRecord, Provenance, Quality,
};
pub use error::OpenError;
pub use faces::{AsShortAsFit, Faces};
#[cfg(feature = "alloc")]
pub use fans::Fans;
#[cfg(feature = "std")]
pub use file::{ReadError, SaveError, read_package, save_package};
pub use header::{FIRST_VERSION, FORMAT_VERSION, HEADER_BYTES, Header, MAGIC, PAYLOAD_ALIGNMENT, PackageKind};
pub use open::{CompactEntry, CompactView};
#[cfg(feature = "alloc")]
pub use patches::{Patch, Patches};
pub use render::{ArchivedRenderMesh, RenderMesh};
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
