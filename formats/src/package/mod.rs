//! The package: a 64-byte header, then one rkyv archive of either a [`CompactBasis`] (what the trainer learned) or a
//! [`BakedBasis`] (the same, ready for the frame path).

mod baked;
mod basis;

pub use baked::{
    ArchivedBakedBasis, ArchivedBakedBlock, ArchivedBakedComponent, BakedBasis, BakedBlock, BakedComponent,
};
pub use basis::{
    ArchivedBlockRecord, ArchivedCompactBasis, ArchivedComponentRecord, ArchivedGraphConvRecord, ArchivedProvenance,
    ArchivedQuality, BlockRecord, CompactBasis, ComponentRecord, GraphConvRecord, Provenance, Quality,
};

/// Features a vertex: axis-angle log-rotation xyz, then stretch xx xy xz yy yz zz.
pub const FEATURE_COUNT: usize = 9;

/// Stands where an index is absent: the parent of a root block.
pub const NONE: u32 = u32::MAX;
