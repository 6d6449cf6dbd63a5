//! The compact payload as trainer and baker see it: borrowed where it lies, proved whole by [`CompactView::open`]. What a view
//! hands out is proved: every index is in range, every number finite, every count agrees.

use rkyv::{api::low::access, rancor::Failure};

use super::{
    After, ArchivedBlockRecord, ArchivedCompactBasis, ArchivedGraphConvRecord, BlockRecord, ComponentRecord,
    FEATURE_COUNT, Faces, GraphConvRecord, Header, OpenError, PackageKind, Prior, Provenance, Quality, SurfaceView,
    ValueScales,
    archive::{native, payload},
    rules,
};

/// An opened compact package; borrows its bytes. Fields mean what [`super::CompactBasis`] says.
#[derive(Clone, Copy)]
pub struct CompactView<'a> {
    header: Header,
    // An archive owns no borrow: `'static` leaves the view covariant, so it may be lent for shorter.
    archived: &'a ArchivedCompactBasis<'static>,
}

impl<'a> CompactView<'a> {
    /// Checks everything and borrows. `bytes` is a whole package, at a multiple of 16 bytes in memory.
    ///
    /// Errors: any [`OpenError`]; the first fault found is the one reported.
    pub fn open(bytes: &'a [u8]) -> Result<Self, OpenError> {
        let (header, payload) = payload(bytes, PackageKind::Compact)?;
        let archived = access::<ArchivedCompactBasis<'static>, Failure>(payload).map_err(|_| OpenError::Malformed)?;
        let view = Self { header, archived };
        rules::compact::check(&view)?;
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

    /// Shape: `[V]`, finite.
    pub fn rest_positions(&self) -> &'a [[f32; 3]] {
        native(&self.archived.rest_positions)
    }

    /// Triangles and what an engine draws; points are vertices.
    pub fn surface(&self) -> SurfaceView<'a> {
        SurfaceView::new(&self.archived.surface)
    }

    /// Triangles by vertices. Shape: `[F]`, each corner < V.
    pub fn faces(&self) -> Faces<'a> {
        self.surface().faces()
    }

    /// Sorted, `from < to < V`.
    pub fn bridges(&self) -> &'a [[u32; 2]] {
        native(&self.archived.bridges)
    }

    /// The vertex that the solve holds, < V.
    pub fn anchor_vertex(&self) -> u32 {
        self.archived.anchor_vertex.to_native()
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
    pub fn block(&self, b: usize) -> BlockRecord {
        let block: &ArchivedBlockRecord = &self.archived.blocks[b];
        BlockRecord {
            level: block.level.to_native(),
            parent_component: block.parent_component.to_native(),
            first_component: block.first_component.to_native(),
            component_count: block.component_count.to_native(),
            encoder: graph_conv(&block.encoder),
            decoder: graph_conv(&block.decoder),
        }
    }

    /// All blocks, parents before children.
    pub fn blocks(&self) -> impl ExactSizeIterator<Item = BlockRecord> + use<'a> {
        let view = *self;
        (0..view.block_count()).map(move |b| view.block(b))
    }

    /// Component `k` < K. Panics past the end, like a slice.
    pub fn component(&self, k: usize) -> ComponentRecord<'a> {
        let component = &self.archived.components[k];
        ComponentRecord {
            name: component.name.get(),
            block: component.block.to_native(),
            centre_vertex: component.centre_vertex.to_native(),
            scale: component.scale.to_native(),
            strength: component.strength.to_native(),
            locality: component.locality.to_native(),
            minimum: component.minimum.to_native(),
            maximum: component.maximum.to_native(),
            value_scales: ValueScales {
                rotation: component.value_scales.rotation.to_native(),
                stretch: component.value_scales.stretch.to_native(),
            },
        }
    }

    /// All components, in block order.
    pub fn components(&self) -> impl ExactSizeIterator<Item = ComponentRecord<'a>> + use<'a> {
        let view = *self;
        (0..view.component_count()).map(move |k| view.component(k))
    }

    /// Shape: `[K][ceil(V / 32)]`.
    pub fn support_bits(&self) -> &'a [u32] {
        native(&self.archived.support_bits)
    }

    /// Whole numbers, times the component's scales. Shape: `[sum of popcounts]`.
    pub fn values(&self) -> &'a [[i16; FEATURE_COUNT]] {
        native(&self.archived.values)
    }

    /// The components' sparse entries: for each component in turn, its vertices in ascending order with their values.
    pub fn entries(&self) -> impl Iterator<Item = CompactEntry<'a>> + use<'a> {
        let words = self.vertex_count().div_ceil(32);
        let values = self.values();
        self.support_bits()
            .chunks_exact(words)
            .enumerate()
            .flat_map(|(k, bits)| set_bits(bits).map(move |vertex| (k, vertex)))
            .zip(values)
            .map(|((component, vertex), values)| CompactEntry {
                component,
                vertex,
                values,
            })
    }

    /// Where the package comes from.
    pub fn provenance(&self) -> Provenance<'a> {
        let provenance = &self.archived.provenance;
        Provenance {
            tool: provenance.tool.get(),
            sequence: provenance.sequence.get(),
            config: provenance.config.get(),
            seed: provenance.seed.to_native(),
            shape_count: provenance.shape_count.to_native(),
            train_shapes: native(&provenance.train_shapes),
        }
    }

    /// What the trainer measured.
    pub fn quality(&self) -> Quality {
        Quality {
            validation_e_rms: self.archived.quality.validation_e_rms.to_native(),
            steps: self.archived.quality.steps.to_native(),
            steps_run: self.archived.quality.steps_run.to_native(),
        }
    }

    /// What is added to positions after the solve; points are vertices.
    pub fn after(&self) -> After<'a> {
        After::view(&self.archived.after)
    }

    /// What is known of the weights.
    pub fn prior(&self) -> Prior<'a> {
        Prior::view(&self.archived.prior)
    }

    /// What the trainer keeps for reading weights off a shape; may be empty.
    pub fn encoder(&self) -> &'a [u8] {
        self.archived.encoder.get()
    }
}

/// Where one component touches one vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompactEntry<'a> {
    /// k < K.
    pub component: usize,
    /// v < V.
    pub vertex: usize,
    /// Times the component's scales.
    pub values: &'a [i16; FEATURE_COUNT],
}

/// Positions of the set bits, lowest first.
fn set_bits(words: &[u32]) -> impl Iterator<Item = usize> {
    words.iter().enumerate().flat_map(|(w, &word)| {
        (0..32)
            .filter(move |bit| word >> bit & 1 == 1)
            .map(move |bit| 32 * w + bit)
    })
}

fn graph_conv(conv: &ArchivedGraphConvRecord) -> GraphConvRecord {
    GraphConvRecord {
        point: bytemuck::cast(conv.point),
        neighbour: bytemuck::cast(conv.neighbour),
        bias: bytemuck::cast(conv.bias),
    }
}
