//! The baked payload: everything the frame path reads, in the order it reads it. Written by the baker, opened by the
//! runtime without allocating.
//!
//! Vertices carry three numbers: their place in the source (`vertex`); their place in the order of decoding (`slot`), in which
//! what moves together stands together; and their place in the order of elimination (`solver`). Four solver places that follow
//! each other are a `quad`.

use rkyv::{
    Archive, ArchiveUnsized, Place, Serialize, SerializeUnsized,
    boxed::{ArchivedBox, BoxResolver},
    rancor::Fallible,
    ser::{Positional, Writer, WriterExt},
    with::{ArchiveWith, InlineAsBox, SerializeWith},
};

use super::{After, BakedBones, FEATURE_COUNT, GROUP_NODES, Indices, Prior, Surface, ValueScales};

/// Nodes of a quad, and rows and columns of a tile.
pub const QUAD: usize = 4;
/// Numbers of a tile.
pub const TILE_ENTRIES: usize = QUAD * QUAD;

/// Archives a slice as [`InlineAsBox`] does, but starts it at a multiple of 64 bytes from the start of the file: a tile
/// is a cache line where the package starts on one.
#[derive(Debug)]
pub struct OnCacheLines;

const CACHE_LINE_BYTES: usize = 64;

impl<T> ArchiveWith<&[T]> for OnCacheLines
where
    [T]: ArchiveUnsized,
{
    type Archived = ArchivedBox<<[T] as ArchiveUnsized>::Archived>;
    type Resolver = BoxResolver;

    fn resolve_with(field: &&[T], resolver: Self::Resolver, out: Place<Self::Archived>) {
        ArchivedBox::resolve_from_ref(*field, resolver, out);
    }
}

impl<T, S: Fallible + Writer + ?Sized> SerializeWith<&[T], S> for OnCacheLines
where
    [T]: SerializeUnsized<S>,
{
    fn serialize_with(field: &&[T], serializer: &mut S) -> Result<Self::Resolver, S::Error> {
        // In steps: rkyv pads by less than 32 bytes at once.
        serializer.align(CACHE_LINE_BYTES / 2)?;
        while !serializer.pos().is_multiple_of(CACHE_LINE_BYTES) {
            serializer.pad(CACHE_LINE_BYTES / 4)?;
        }
        ArchivedBox::serialize_from_ref(*field, serializer)
    }
}

/// The frame path's data: V vertices, F faces, B blocks, K components. At least one of the tiers is there.
#[derive(Archive, Serialize, Debug)]
pub struct BakedBasis<'a> {
    /// Content id of the compact package this was baked from.
    pub compact_id: [u8; 16],
    /// Network value to log-rotation, radians. Positive.
    pub rotation_scale: f32,
    /// Network value to stretch. Positive.
    pub stretch_scale: f32,
    /// Blocks, parents before children. Shape: `[B]`.
    #[rkyv(with = InlineAsBox)]
    pub blocks: &'a [BakedBlock],
    /// Components in block order. Shape: `[K]`.
    #[rkyv(with = InlineAsBox)]
    pub components: &'a [BakedComponent<'a>],
    /// Rest shape. Shape: `[V]`, slots.
    #[rkyv(with = InlineAsBox)]
    pub rest_positions: &'a [[f32; 3]],
    /// Slot of each vertex. Shape: `[V]`, a permutation.
    pub slot_from_vertex: Indices<'a>,
    /// Shape: `[V]`, its inverse.
    pub vertex_from_slot: Indices<'a>,
    /// Triangles in the order of the source, and render vertices in the order of their slots. Points are slots.
    pub surface: Surface<'a>,
    /// Compressed rows over `fans`, one for each [`super::FAN_VERTICES`] slots, the last perhaps short.
    /// Shape: `[ceil(V / FAN_VERTICES) + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub fan_offsets: &'a [u32],
    /// Slots. Each vertex's own column walks around it: two in succession and the vertex are a triangle, and the vertex
    /// itself parts fans and fills up. Shape: `[steps][FAN_VERTICES]`.
    pub fans: Indices<'a>,
    /// The tier whose nodes are the vertices: N = V.
    pub exact: Option<BakedExact<'a>>,
    /// A few affine maps, for GPUs, crowds and small devices.
    pub bones: Option<BakedBones<'a>>,
    /// What is added to the positions of the exact tier, and fitted by the bones. Points are slots.
    pub after: After<'a>,
    /// What is known of the weights.
    pub prior: Prior<'a>,
}

/// What a frame of the exact tier reads from decode to solve. Slots and solver places are those of the vertices.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedExact<'a> {
    /// The components at the vertices.
    pub patches: BakedPatches<'a>,
    /// Their system.
    pub solve: BakedSolve<'a>,
}

/// The components at a set of N nodes, in the order of decoding: [`GROUP_NODES`] slots a group, the last group perhaps short.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedPatches<'a> {
    /// Compressed rows over the patches, one a group; G = ceil(N / GROUP_NODES). Shape: `[G + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub offsets: &'a [u32],
    /// Component of each patch, ascending within a group, and the block it belongs to. Shape: `[patches]`.
    #[rkyv(with = InlineAsBox)]
    pub owners: &'a [[u16; 2]],
    /// Folded values `point C_k + neighbour mean C_k` as whole numbers, times the component's scales; zero where the
    /// component does not reach, and beyond the last node. Shape: `[patches]` of `[9][GROUP_NODES]`.
    #[rkyv(with = InlineAsBox)]
    pub values: &'a [[[i16; GROUP_NODES]; FEATURE_COUNT]],
}

/// The linear system of a set of N nodes: right-hand side and factor, T = ceil(N / 4) quads of solver places.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedSolve<'a> {
    /// One-rings (with bridges) of the slots, compressed rows. Shape: `[N + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub ring_offsets: &'a [u32],
    /// Slots, ascending within a row, never the row itself. Shape: `[2 * edges]`.
    pub ring: Indices<'a>,
    /// Half the cotangent sum of each edge, symmetric, non-negative. Shape: that of `ring`.
    #[rkyv(with = InlineAsBox)]
    pub ring_weights: &'a [f32],
    /// `L + anchor = F D F^T` in tiles of 4 x 4: F is block unit lower triangular, D block diagonal. Columns over
    /// `tile_rows`. Shape: `[T + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub tile_offsets: &'a [u32],
    /// Quad of rows of each tile, ascending within a column, greater than the column.
    pub tile_rows: Indices<'a>,
    /// Tiles of F below its diagonal, **column-major**. Shape: that of `tile_rows`. Starts at a multiple of 64 bytes in the
    /// file.
    #[rkyv(with = OnCacheLines)]
    pub tiles: &'a [[f32; TILE_ENTRIES]],
    /// `1 / D`: symmetric, zero where the last quad has no node. Shape: `[T]`. Starts as `tiles` does.
    #[rkyv(with = OnCacheLines)]
    pub inverse_diagonals: &'a [[f32; TILE_ENTRIES]],
    /// Solver place of each slot. Shape: `[N]`, a permutation.
    pub solver_from_slot: Indices<'a>,
}

/// One autoencoder block, folded: `x_v += tanh(bias + sum_k z_k C_k,v) - tanh(bias)` on its support.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct BakedBlock {
    /// 0 for the root block.
    pub level: u32,
    /// The component above this block; [`super::NONE`] for the root.
    pub parent_component: u32,
    /// First of this block's components.
    pub first_component: u32,
    /// How many components follow.
    pub component_count: u32,
    /// Bias of the decoder's convolution.
    pub bias: [f32; FEATURE_COUNT],
}

/// One component and its control.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct BakedComponent<'a> {
    /// Unique name of the control.
    #[rkyv(with = InlineAsBox)]
    pub name: &'a str,
    /// The block this component is a latent of.
    pub block: u32,
    /// Lower stop of the control; at most 0.
    pub minimum: f32,
    /// Upper stop of the control; at least 0.
    pub maximum: f32,
    /// Multiply the whole numbers of every tier.
    pub value_scales: ValueScales,
}
