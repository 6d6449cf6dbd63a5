//! The baked payload as the runtime sees it: borrowed where it lies, proved whole by [`BakedView::open`].

use rkyv::{api::low::access, rancor::Failure};

use super::{
    ArchivedBakedBasis, ArchivedBakedFast, ArchivedBakedTier, BakedBlock, BakedComponent, FAN_VERTICES, FEATURE_COUNT,
    FastError, GROUP_NODES, Header, OpenError, PackageKind, RenderMesh, SKIN_NODES, TILE_ENTRIES, TILE_SIDE,
    open::{native, payload},
    render, rules,
};

/// An opened baked package; borrows its bytes. Fields mean what [`super::BakedBasis`] says.
#[derive(Clone, Copy)]
pub struct BakedView<'a> {
    header: Header,
    archived: &'a ArchivedBakedBasis<'static>,
}

/// One tier of an opened baked package: N nodes. Fields mean what [`super::BakedTier`] says.
#[derive(Clone, Copy)]
pub struct TierView<'a> {
    archived: &'a ArchivedBakedTier<'static>,
}

/// The fast tier of an opened baked package. Fields mean what [`super::BakedFast`] says.
#[derive(Clone, Copy)]
pub struct FastView<'a> {
    archived: &'a ArchivedBakedFast<'static>,
}

impl<'a> BakedView<'a> {
    /// Checks everything and borrows. `bytes` is a whole package, at a multiple of 16 bytes in memory.
    ///
    /// Errors: any [`OpenError`]; the first fault found is the one reported.
    pub fn open(bytes: &'a [u8]) -> Result<Self, OpenError> {
        let (header, payload) = payload(bytes, PackageKind::Baked)?;
        let archived = access::<ArchivedBakedBasis<'static>, Failure>(payload).map_err(|_| OpenError::Malformed)?;
        let view = Self { header, archived };
        rules::baked::check(&view)?;
        Ok(view)
    }

    /// The header in front of the payload.
    pub fn header(&self) -> Header {
        self.header
    }

    /// Names the content; equal exactly when the payloads are.
    pub fn content_id(&self) -> [u8; 16] {
        self.header.content_id
    }

    /// Content id of the compact package this was baked from.
    pub fn compact_id(&self) -> [u8; 16] {
        self.archived.compact_id
    }

    /// V, at least 3.
    pub fn vertex_count(&self) -> usize {
        self.archived.lane_from_vertex.len()
    }

    /// B, at least 1.
    pub fn block_count(&self) -> usize {
        self.archived.blocks.len()
    }

    /// K, at least 1.
    pub fn component_count(&self) -> usize {
        self.archived.components.len()
    }

    /// Source order. Shape: `[F]`, each index < V.
    pub fn faces(&self) -> &'a [[u32; 3]] {
        native(&self.archived.faces)
    }

    /// Shape: `[V]`, a permutation.
    pub fn lane_from_vertex(&self) -> &'a [u32] {
        native(&self.archived.lane_from_vertex)
    }

    /// Shape: `[V]`, its inverse.
    pub fn vertex_from_lane(&self) -> &'a [u32] {
        native(&self.archived.vertex_from_lane)
    }

    /// Network value to log-rotation, radians, positive.
    pub fn rotation_scale(&self) -> f32 {
        self.archived.rotation_scale.to_native()
    }

    /// Network value to stretch, positive.
    pub fn stretch_scale(&self) -> f32 {
        self.archived.stretch_scale.to_native()
    }

    /// Block `b` < B. Panics past the end, like a slice.
    pub fn block(&self, b: usize) -> BakedBlock {
        let block = &self.archived.blocks[b];
        BakedBlock {
            level: block.level.to_native(),
            parent_component: block.parent_component.to_native(),
            first_component: block.first_component.to_native(),
            component_count: block.component_count.to_native(),
            bias: bytemuck::cast(block.bias),
        }
    }

    /// All blocks, parents before children.
    pub fn blocks(&self) -> impl ExactSizeIterator<Item = BakedBlock> + use<'a> {
        let view = *self;
        (0..view.block_count()).map(move |b| view.block(b))
    }

    /// Component `k` < K. Panics past the end, like a slice.
    pub fn component(&self, k: usize) -> BakedComponent<'a> {
        let component = &self.archived.components[k];
        BakedComponent {
            name: component.name.get(),
            block: component.block.to_native(),
            minimum: component.minimum.to_native(),
            maximum: component.maximum.to_native(),
            value_scale: component.value_scale.to_native(),
        }
    }

    /// All components, in block order.
    pub fn components(&self) -> impl ExactSizeIterator<Item = BakedComponent<'a>> + use<'a> {
        let view = *self;
        (0..view.component_count()).map(move |k| view.component(k))
    }

    /// Shape: `[ceil(V / FAN_VERTICES) + 1]`, from 0 to `fans().len()`, never falls.
    pub fn fan_offsets(&self) -> &'a [u32] {
        native(&self.archived.fan_offsets)
    }

    /// Lanes of the exact tier, < V.
    pub fn fans(&self) -> &'a [[u32; FAN_VERTICES]] {
        native(&self.archived.fans)
    }

    /// The tier whose nodes are the vertices.
    pub fn exact(&self) -> TierView<'a> {
        TierView {
            archived: &self.archived.exact,
        }
    }

    /// The tier of fewer nodes, where the package has one.
    pub fn fast(&self) -> Option<FastView<'a>> {
        self.archived.fast.as_ref().map(|archived| FastView { archived })
    }

    /// What an engine draws; all empty where the source has no texture coordinates.
    pub fn render_mesh(&self) -> RenderMesh<'a> {
        render::view(&self.archived.render)
    }
}

impl<'a> FastView<'a> {
    /// The nodes and all that decode and solve read.
    pub fn nodes(&self) -> TierView<'a> {
        TierView {
            archived: &self.archived.nodes,
        }
    }

    /// What gradients act about.
    pub fn centre(&self) -> [f32; 3] {
        bytemuck::cast(self.archived.centre)
    }

    /// Lanes of the nodes, each < N. Shape: `[V]`, lanes of the exact tier.
    pub fn skin_nodes(&self) -> &'a [[u16; SKIN_NODES]] {
        native(&self.archived.skin_nodes)
    }

    /// Each row sums to [`SKIN_WEIGHT_SUM`](super::SKIN_WEIGHT_SUM). Shape: `[V]`, lanes of the exact tier.
    pub fn skin_weights(&self) -> &'a [[u16; SKIN_NODES]] {
        native(&self.archived.skin_weights)
    }

    /// How far the tier is from the exact one.
    pub fn error(&self) -> FastError {
        let error = &self.archived.error;
        FastError {
            mixed_rms: error.mixed_rms.to_native(),
            mixed_p99: error.mixed_p99.to_native(),
            mixed_max: error.mixed_max.to_native(),
            single_rms: error.single_rms.to_native(),
            single_max: error.single_max.to_native(),
            normal_rms: error.normal_rms.to_native(),
            mixed_poses: error.mixed_poses.to_native(),
        }
    }
}

impl<'a> TierView<'a> {
    /// N, at least 1; V in the exact tier.
    pub fn node_count(&self) -> usize {
        self.archived.rest_positions.len()
    }

    /// Lanes, finite. Shape: `[N]`.
    pub fn rest_positions(&self) -> &'a [[f32; 3]] {
        native(&self.archived.rest_positions)
    }

    /// Shape: `[N + 1]`, from 0 to `ring().len()`, never falls.
    pub fn ring_offsets(&self) -> &'a [u32] {
        native(&self.archived.ring_offsets)
    }

    /// Lanes < N, ascending within a row, never the row itself.
    pub fn ring(&self) -> &'a [u32] {
        native(&self.archived.ring)
    }

    /// Shape: that of `ring`; finite, symmetric, non-negative in the exact tier.
    pub fn ring_weights(&self) -> &'a [f32] {
        native(&self.archived.ring_weights)
    }

    /// T, the blocks of four nodes that the factor's tiles stand on; the last one may be short.
    pub fn tile_column_count(&self) -> usize {
        self.node_count().div_ceil(TILE_SIDE)
    }

    /// Shape: `[T + 1]`, from 0 to `tile_rows().len()`, never falls.
    pub fn tile_offsets(&self) -> &'a [u32] {
        native(&self.archived.tile_offsets)
    }

    /// Blocks < T, ascending within a column, greater than the column.
    pub fn tile_rows(&self) -> &'a [u32] {
        native(&self.archived.tile_rows)
    }

    /// Shape: that of `tile_rows`; finite.
    pub fn tiles(&self) -> &'a [[f32; TILE_ENTRIES]] {
        native(&self.archived.tiles)
    }

    /// Shape: `[T]`; finite, positive on the diagonal of every node.
    pub fn inverse_diagonals(&self) -> &'a [[f32; TILE_ENTRIES]] {
        native(&self.archived.inverse_diagonals)
    }

    /// Shape: `[N]`, a permutation.
    pub fn solver_from_lane(&self) -> &'a [u32] {
        native(&self.archived.solver_from_lane)
    }

    /// Shape: `[N]`, its inverse.
    pub fn lane_from_solver(&self) -> &'a [u32] {
        native(&self.archived.lane_from_solver)
    }

    /// Shape: `[ceil(N / GROUP_NODES) + 1]`, from 0 to `patch_owners().len()`, never falls.
    pub fn patch_offsets(&self) -> &'a [u32] {
        native(&self.archived.patch_offsets)
    }

    /// Component < K and its block, ascending within a group. Shape: `[T]`.
    pub fn patch_owners(&self) -> &'a [[u16; 2]] {
        native(&self.archived.patch_owners)
    }

    /// Half bits, finite. Shape: `[T]`.
    pub fn patch_values(&self) -> &'a [[[u16; GROUP_NODES]; FEATURE_COUNT]] {
        native(&self.archived.patch_values)
    }

    /// What the patches hold that is not zero, group by group.
    pub fn entries(&self) -> impl Iterator<Item = TierEntry> + use<'a> {
        /// Without the sign: both zeros are zero.
        const MAGNITUDE: u16 = 0x7fff;
        let tier = *self;
        let patches = tier.patch_offsets().windows(2).enumerate();
        let patches = patches.flat_map(|(g, row)| (row[0] as usize..row[1] as usize).map(move |p| (g, p)));
        let lanes = patches.flat_map(|(g, p)| (0..GROUP_NODES).map(move |n| (g * GROUP_NODES + n, p, n)));
        lanes.filter_map(move |(lane, p, n)| {
            let values = tier.patch_values()[p].map(|row| row[n]);
            let moves = lane < tier.node_count() && values.iter().any(|half| half & MAGNITUDE != 0);
            moves.then_some(TierEntry {
                component: usize::from(tier.patch_owners()[p][0]),
                lane,
                values,
            })
        })
    }
}

/// Where one component moves one node of a tier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TierEntry {
    /// k < K.
    pub component: usize,
    /// < N.
    pub lane: usize,
    /// Half bits; times the component's `value_scale`.
    pub values: [u16; FEATURE_COUNT],
}
