//! The baked payload: everything the frame path reads, in the order it reads it. Written by the baker, opened by the
//! runtime without allocating.
//!
//! Vertices carry two numbers: the source order (`vertex`) and the elimination order of the factor (`solver`). Decode,
//! right-hand side and solve run in solver order; positions, normals and faces keep source order.

use rkyv::{Archive, Serialize, with::InlineAsBox};

use super::{FAN_VERTICES, FEATURE_COUNT, GROUP_NODES, RenderMesh};

/// The frame path's data: V vertices, F faces, B blocks, K components.
#[derive(Archive, Serialize, Debug)]
pub struct BakedBasis<'a> {
    /// Content id of the compact package this was baked from.
    pub compact_id: [u8; 16],
    /// Triangles in **source** order. Shape: `[F]`.
    #[rkyv(with = InlineAsBox)]
    pub faces: &'a [[u32; 3]],
    /// Where a vertex stands in the exact tier. Shape: `[V]`, a permutation.
    #[rkyv(with = InlineAsBox)]
    pub solver_from_vertex: &'a [u32],
    /// Shape: `[V]`, its inverse.
    #[rkyv(with = InlineAsBox)]
    pub vertex_from_solver: &'a [u32],
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
    /// A tier of fewer nodes.
    pub fast: Option<BakedTier<'a>>,
    /// What an engine draws.
    pub render: RenderMesh<'a>,
}

/// What a frame reads from blend to solve, for a set of N nodes: all vertices, or a graph that stands for them. Solver
/// indices number the nodes in the tier's own order of elimination.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedTier<'a> {
    /// Rest shape of the nodes, solver order. Shape: `[N]`.
    #[rkyv(with = InlineAsBox)]
    pub rest_positions: &'a [[f32; 3]],
    /// One-rings (with bridges) in solver order, compressed rows. Shape: `[N + 1]`, starts at 0, never falls.
    #[rkyv(with = InlineAsBox)]
    pub ring_offsets: &'a [u32],
    /// Solver indices, ascending within a row, never the row itself. Shape: `[2 * edges]`.
    #[rkyv(with = InlineAsBox)]
    pub ring: &'a [u32],
    /// Half the cotangent sum of each edge, non-negative, symmetric. Shape: that of `ring`.
    #[rkyv(with = InlineAsBox)]
    pub ring_weights: &'a [f32],
    /// Columns of the unit lower factor of `L + anchor = F D F^T`, below the diagonal. Shape: `[N + 1]`.
    #[rkyv(with = InlineAsBox)]
    pub factor_offsets: &'a [u32],
    /// Row (solver index) of each entry, ascending within a column, greater than the column.
    #[rkyv(with = InlineAsBox)]
    pub factor_rows: &'a [u32],
    /// Entries of F. Shape: that of `factor_rows`.
    #[rkyv(with = InlineAsBox)]
    pub factor_values: &'a [f32],
    /// `1 / D`, positive. Shape: `[N]`.
    #[rkyv(with = InlineAsBox)]
    pub inverse_pivots: &'a [f32],
    /// Solver index of each lane: the order in which a frame decodes, [`GROUP_NODES`] lanes a group, the last group
    /// perhaps short. Shape: `[N]`, a permutation.
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
