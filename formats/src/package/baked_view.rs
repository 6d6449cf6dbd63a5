//! The baked payload as the runtime sees it: borrowed where it lies, proved whole by [`BakedView::open`].

use rkyv::{api::low::access, rancor::Failure};

use super::{
    After, ArchivedBakedBasis, ArchivedBakedPatches, ArchivedBakedSolve, BakedBlock, BakedComponent, BonesView,
    FEATURE_COUNT, Faces, GROUP_NODES, Header, IndexSlice, OpenError, PackageKind, Prior, SurfaceView, TILE_ENTRIES,
    ValueScales,
    archive::{native, payload},
    indices::slice,
    rules,
};

/// An opened baked package; borrows its bytes. Fields mean what [`super::BakedBasis`] says.
#[derive(Clone, Copy)]
pub struct BakedView<'a> {
    header: Header,
    archived: &'a ArchivedBakedBasis<'static>,
}

/// The exact tier of an opened baked package. Fields mean what [`super::BakedExact`] says.
#[derive(Clone, Copy)]
pub struct ExactView<'a> {
    /// The components at the vertices.
    pub patches: PatchesView<'a>,
    /// Their system.
    pub solve: SolveView<'a>,
}

/// The components at N nodes. Fields mean what [`super::BakedPatches`] says, and keep its promises.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "fields are those of BakedPatches")]
pub struct PatchesView<'a> {
    pub offsets: &'a [u32],
    pub owners: &'a [[u16; 2]],
    pub values: &'a [[[i16; GROUP_NODES]; FEATURE_COUNT]],
}

/// The linear system of N nodes. Fields mean what [`super::BakedSolve`] says, and keep its promises.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "fields are those of BakedSolve")]
pub struct SolveView<'a> {
    pub ring_offsets: &'a [u32],
    pub ring: IndexSlice<'a>,
    pub ring_weights: &'a [f32],
    pub tile_offsets: &'a [u32],
    pub tile_rows: IndexSlice<'a>,
    pub tiles: &'a [[f32; TILE_ENTRIES]],
    pub inverse_diagonals: &'a [[f32; TILE_ENTRIES]],
    pub solver_from_slot: IndexSlice<'a>,
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
        self.archived.rest_positions.len()
    }

    /// B, at least 1.
    pub fn block_count(&self) -> usize {
        self.archived.blocks.len()
    }

    /// K, at least 1.
    pub fn component_count(&self) -> usize {
        self.archived.components.len()
    }

    /// Slots, finite. Shape: `[V]`.
    pub fn rest_positions(&self) -> &'a [[f32; 3]] {
        native(&self.archived.rest_positions)
    }

    /// Shape: `[V]`, a permutation.
    pub fn slot_from_vertex(&self) -> IndexSlice<'a> {
        slice(&self.archived.slot_from_vertex)
    }

    /// Shape: `[V]`, its inverse.
    pub fn vertex_from_slot(&self) -> IndexSlice<'a> {
        slice(&self.archived.vertex_from_slot)
    }

    /// Triangles and what an engine draws; points are slots.
    pub fn surface(&self) -> SurfaceView<'a> {
        SurfaceView::new(&self.archived.surface)
    }

    /// Triangles by vertices, source order. Shape: `[F]`, each corner < V.
    pub fn faces(&self) -> Faces<'a> {
        self.surface().faces().renamed(self.vertex_from_slot())
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
            value_scales: ValueScales {
                rotation: component.value_scales.rotation.to_native(),
                stretch: component.value_scales.stretch.to_native(),
            },
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

    /// Slots, < V. Shape: `[steps][FAN_VERTICES]`.
    pub fn fans(&self) -> IndexSlice<'a> {
        slice(&self.archived.fans)
    }

    /// The tier whose nodes are the vertices, where the package has it.
    pub fn exact(&self) -> Option<ExactView<'a>> {
        self.archived.exact.as_ref().map(|exact| ExactView {
            patches: PatchesView::new(&exact.patches),
            solve: SolveView::new(&exact.solve),
        })
    }

    /// The bones, where the package has them.
    pub fn bones(&self) -> Option<BonesView<'a>> {
        self.archived.bones.as_ref().map(BonesView::new)
    }

    /// What is added to the positions of the exact tier; points are slots.
    pub fn after(&self) -> After<'a> {
        After::view(&self.archived.after)
    }

    /// What is known of the weights.
    pub fn prior(&self) -> Prior<'a> {
        Prior::view(&self.archived.prior)
    }
}

impl<'a> SolveView<'a> {
    fn new(archived: &'a ArchivedBakedSolve<'static>) -> Self {
        Self {
            ring_offsets: native(&archived.ring_offsets),
            ring: slice(&archived.ring),
            ring_weights: native(&archived.ring_weights),
            tile_offsets: native(&archived.tile_offsets),
            tile_rows: slice(&archived.tile_rows),
            tiles: native(&archived.tiles),
            inverse_diagonals: native(&archived.inverse_diagonals),
            solver_from_slot: slice(&archived.solver_from_slot),
        }
    }
}

impl<'a> PatchesView<'a> {
    pub(super) fn new(archived: &'a ArchivedBakedPatches<'static>) -> Self {
        Self {
            offsets: native(&archived.offsets),
            owners: native(&archived.owners),
            values: native(&archived.values),
        }
    }

    /// What the patches hold that is not zero, group by group.
    pub fn entries(&self) -> impl Iterator<Item = PatchEntry> + use<'a> {
        let patches = *self;
        let rows = patches.offsets.windows(2).enumerate();
        let places = rows.flat_map(|(g, row)| (row[0] as usize..row[1] as usize).map(move |p| (g, p)));
        let places = places.flat_map(|(g, p)| (0..GROUP_NODES).map(move |n| (g * GROUP_NODES + n, p, n)));
        places.filter_map(move |(slot, p, n)| {
            let values = patches.values[p].map(|row| row[n]);
            (values != [0; FEATURE_COUNT]).then_some(PatchEntry {
                component: usize::from(patches.owners[p][0]),
                slot,
                values,
            })
        })
    }
}

/// Where one component moves one node of a tier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PatchEntry {
    /// k < K.
    pub component: usize,
    /// < N.
    pub slot: usize,
    /// Times the component's scales.
    pub values: [i16; FEATURE_COUNT],
}
