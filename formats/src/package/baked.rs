//! The baked payload: everything the frame path reads, in the order it reads it. Written by the baker, opened by the
//! runtime without allocating.
//!
//! Vertices carry three numbers: the source order (`vertex`) of positions, normals and faces; the order of decode and
//! right-hand side (`lane`), in which what moves together stands together; and the elimination order of the factor
//! (`solver`), in which the solve runs.

use rkyv::{
    Archive, ArchiveUnsized, Place, Serialize, SerializeUnsized,
    boxed::{ArchivedBox, BoxResolver},
    rancor::Fallible,
    ser::{Positional, Writer, WriterExt},
    with::{ArchiveWith, InlineAsBox, SerializeWith},
};

use super::{FAN_VERTICES, FEATURE_COUNT, GROUP_NODES, RenderMesh};

/// Nodes of a block, and rows and columns of a tile.
pub const TILE_SIDE: usize = 4;
/// Numbers of a tile.
pub const TILE_ENTRIES: usize = TILE_SIDE * TILE_SIDE;

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

/// The frame path's data: V vertices, F faces, B blocks, K components.
#[derive(Archive, Serialize, Debug)]
pub struct BakedBasis<'a> {
    /// Content id of the compact package this was baked from.
    pub compact_id: [u8; 16],
    /// Triangles in **source** order. Shape: `[F]`.
    #[rkyv(with = InlineAsBox)]
    pub faces: &'a [[u32; 3]],
    /// Lane of each vertex in the exact tier. Shape: `[V]`, a permutation.
    #[rkyv(with = InlineAsBox)]
    pub lane_from_vertex: &'a [u32],
    /// Shape: `[V]`, its inverse.
    #[rkyv(with = InlineAsBox)]
    pub vertex_from_lane: &'a [u32],
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
    /// Compressed rows over `fans`, one for each [`FAN_VERTICES`] lanes of the exact tier, the last perhaps short.
    /// Shape: `[ceil(V / FAN_VERTICES) + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub fan_offsets: &'a [u32],
    /// Lanes of the exact tier. Each vertex's own column walks around it: two in succession and the vertex are a triangle,
    /// and the vertex itself parts fans and fills up.
    #[rkyv(with = InlineAsBox)]
    pub fans: &'a [[u32; FAN_VERTICES]],
    /// The tier whose nodes are the vertices: N = V.
    pub exact: BakedTier<'a>,
    /// A tier of fewer nodes, for crowds and small devices.
    pub fast: Option<BakedFast<'a>>,
    /// What an engine draws.
    pub render: RenderMesh<'a>,
}

/// The fast tier: a graph of N nodes stands for the mesh, and each vertex follows four of them. A vertex at rest position r
/// moves by `sum over its four nodes n of w_n (d_n + D_n (r - r_n))`, where d_n is the node's displacement, `D_n = T_n - I`
/// its deformation gradient less identity and r_n its rest position.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedFast<'a> {
    /// The nodes; ring weights may be negative here.
    pub nodes: BakedTier<'a>,
    /// Middle of the rest shape: gradients act about it, so that a mesh far from the origin loses no digits.
    pub centre: [f32; 3],
    /// The four nodes of each vertex, lanes of `nodes`. Shape: `[V]`, lanes of the exact tier.
    #[rkyv(with = InlineAsBox)]
    pub skin_nodes: &'a [[u16; SKIN_NODES]],
    /// Their weights, in units of 1 / 65535; each row sums to 65535. Shape: `[V]`, lanes of the exact
    /// tier.
    #[rkyv(with = InlineAsBox)]
    pub skin_weights: &'a [[u16; SKIN_NODES]],
    /// How far the tier is from the exact one.
    pub error: FastError,
}

/// Nodes that a vertex of the fast tier follows.
pub const SKIN_NODES: usize = 4;

/// What stands for 1 in [`BakedFast::skin_weights`].
pub const SKIN_WEIGHT_SUM: u32 = u16::MAX as u32;

/// How far the fast tier is from the exact one, measured when the package was baked. Distances are shares of the diagonal
/// of the rest shape's bounding box. In *mixed* poses every control moves in a quarter of them, and stands anywhere
/// between its stops, evenly; *single* ones put one control at one of its stops and leave the rest at zero.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct FastError {
    /// Root mean square distance, over all vertices of the mixed poses.
    pub mixed_rms: f32,
    /// 99 of 100 vertices of the mixed poses are nearer than this.
    pub mixed_p99: f32,
    /// Greatest distance in the mixed poses.
    pub mixed_max: f32,
    /// Root mean square distance, over all vertices of the single poses.
    pub single_rms: f32,
    /// Greatest distance in the single poses.
    pub single_max: f32,
    /// Root mean square angle between the normals of both tiers in the mixed poses, radians.
    pub normal_rms: f32,
    /// How many mixed poses there were.
    pub mixed_poses: u32,
}

/// What a frame reads from decode to solve, for a set of N nodes: all vertices, or a graph that stands for them. Lanes number
/// the nodes in the order of decoding, [`GROUP_NODES`] lanes a group, the last group perhaps short; solver indices in
/// the tier's own order of elimination.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedTier<'a> {
    /// Rest shape of the nodes. Shape: `[N]`, lanes.
    #[rkyv(with = InlineAsBox)]
    pub rest_positions: &'a [[f32; 3]],
    /// One-rings (with bridges) of the lanes, compressed rows. Shape: `[N + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub ring_offsets: &'a [u32],
    /// Lanes, ascending within a row, never the row itself. Shape: `[2 * edges]`.
    #[rkyv(with = InlineAsBox)]
    pub ring: &'a [u32],
    /// Half the cotangent sum of each edge, symmetric, non-negative in the exact tier. Shape: that of `ring`.
    #[rkyv(with = InlineAsBox)]
    pub ring_weights: &'a [f32],
    /// `L + anchor = F D F^T` in tiles of 4 x 4 over T = ceil(N / 4) blocks of solver indices: F is block unit lower
    /// triangular, D block diagonal. Columns over `tile_rows`. Shape: `[T + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub tile_offsets: &'a [u32],
    /// Block of rows of each tile, ascending within a column, greater than the column.
    #[rkyv(with = InlineAsBox)]
    pub tile_rows: &'a [u32],
    /// Tiles of F below its diagonal, row-major. Shape: that of `tile_rows`. Starts at a multiple of 64 bytes in the file.
    #[rkyv(with = OnCacheLines)]
    pub tiles: &'a [[f32; TILE_ENTRIES]],
    /// `1 / D`: symmetric, row-major, zero where the last block has no node. Shape: `[T]`. Starts as `tiles` does.
    #[rkyv(with = OnCacheLines)]
    pub inverse_diagonals: &'a [[f32; TILE_ENTRIES]],
    /// Solver index of each lane. Shape: `[N]`, a permutation.
    #[rkyv(with = InlineAsBox)]
    pub solver_from_lane: &'a [u32],
    /// Shape: `[N]`, its inverse.
    #[rkyv(with = InlineAsBox)]
    pub lane_from_solver: &'a [u32],
    /// Compressed rows over the patches, one a group; G = ceil(N / GROUP_NODES). Shape: `[G + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub patch_offsets: &'a [u32],
    /// Component of each patch, ascending within a group, and the block it belongs to. Shape: `[T]`.
    #[rkyv(with = InlineAsBox)]
    pub patch_owners: &'a [[u16; 2]],
    /// Folded values `point C_k + neighbour mean C_k` as IEEE half bits, times the component's `value_scale`; zero where the
    /// component does not reach, and beyond the last node. Shape: `[T]` of `[9][GROUP_NODES]`.
    #[rkyv(with = InlineAsBox)]
    pub patch_values: &'a [[[u16; GROUP_NODES]; FEATURE_COUNT]],
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
    /// Multiplies the half-precision values of every tier. Positive.
    pub value_scale: f32,
}
