//! The baked package, owned: what [`crate::bake_with`] gathers and writes; a test changes a field and writes.

use sinew_formats::package::{
    After, AlignedBytes, BakedBasis, BakedBlock, BakedComponent, BakedExact, CompactView, Fans, Indices, Prior,
    Surface, SurfaceView, write_baked,
};

use crate::BakeError;
use crate::bones::Bones;
use crate::fold::FoldedComponent;
use crate::tier::Tier;

/// A baked package before it is written. Names and the prior are the compact package's.
#[derive(Debug, Clone)]
pub struct Baked<'p> {
    /// Content id of the compact package.
    pub compact_id: [u8; 16],
    /// Network value to log-rotation, radians.
    pub rotation_scale: f32,
    /// Network value to stretch.
    pub stretch_scale: f32,
    /// Shape: `[B]`.
    pub blocks: Vec<BakedBlock>,
    /// Shape: `[K]`.
    pub components: Vec<BakedComponent<'p>>,
    /// Triangles by render vertices, or by slots where there are none. Shape: `[F]`.
    pub corners: Vec<[u32; 3]>,
    /// Slots of the render vertices, ascending. Shape: `[R]`.
    pub render_slots: Vec<u32>,
    /// Shape: `[R]`.
    pub uvs: Vec<[f32; 2]>,
    /// Slots.
    pub fans: Fans,
    /// The tier whose nodes are the vertices; its order is that of the package.
    pub exact: Tier,
    /// Whether the exact tier is written too.
    pub has_exact: bool,
    /// The bones.
    pub bones: Option<Bones>,
    /// The piece of each slot. Shape: `[V]`, or empty.
    pub piece_of: Vec<u16>,
    /// Modes by slots. Shape: `[V][R]`.
    pub modes: Vec<[i16; 3]>,
    /// Offsets, mix and scales of what is added, which know no order of vertices.
    pub after: After<'p>,
    /// What is known of the weights.
    pub prior: Prior<'p>,
}

impl<'p> Baked<'p> {
    /// Gathers what does not depend on a tier's numbers, in the slots of the exact one. Shape: `folded` `[K]`.
    pub fn new(package: &CompactView<'p>, surface: &crate::Surface, folded: &[FoldedComponent], exact: Tier) -> Self {
        let blocks = package.blocks().map(|block| BakedBlock {
            level: block.level,
            parent_component: block.parent_component,
            first_component: block.first_component,
            component_count: block.component_count,
            bias: block.decoder.bias,
        });
        let components = package.components().zip(folded);
        let components = components.map(|(component, folded)| BakedComponent {
            name: component.name,
            block: component.block,
            minimum: component.minimum,
            maximum: component.maximum,
            value_scales: folded.value_scales,
        });
        let (corners, render_slots, uvs) = drawn(&package.surface(), &exact.slot_from_node);
        let after = package.after();
        let vertices = || exact.node_from_slot.iter().map(|&v| v as usize);
        let pieces = vertices().filter_map(|v| after.piece_of.get(v).copied());
        let modes = after.mode_count();
        Self {
            compact_id: package.content_id(),
            rotation_scale: package.rotation_scale(),
            stretch_scale: package.stretch_scale(),
            blocks: blocks.collect(),
            components: components.collect(),
            corners,
            render_slots,
            uvs,
            fans: Fans::gather(&surface.topology.faces, &exact.slot_from_node),
            piece_of: pieces.collect(),
            modes: vertices()
                .flat_map(|v| &after.modes[v * modes..][..modes])
                .copied()
                .collect(),
            exact,
            has_exact: true,
            bones: None,
            after,
            prior: package.prior(),
        }
    }

    /// The package. Errors: [`BakeError::Refused`].
    pub fn write(&self) -> Result<AlignedBytes, BakeError> {
        write_baked(&self.record()).map_err(BakeError::Refused)
    }

    /// Borrowed, ready to be written.
    pub fn record(&self) -> BakedBasis<'_> {
        let vertex_count = self.exact.node_count();
        let surface = if self.render_slots.is_empty() {
            Surface::plain(vertex_count, &self.corners)
        } else {
            Surface::textured(vertex_count, &self.corners, &self.render_slots, &self.uvs)
        };
        BakedBasis {
            compact_id: self.compact_id,
            rotation_scale: self.rotation_scale,
            stretch_scale: self.stretch_scale,
            blocks: &self.blocks,
            components: &self.components,
            rest_positions: &self.exact.rest_positions,
            slot_from_vertex: Indices::of(vertex_count, &self.exact.slot_from_node),
            vertex_from_slot: Indices::of(vertex_count, &self.exact.node_from_slot),
            surface,
            fan_offsets: &self.fans.fan_offsets,
            fans: Indices::of(vertex_count, self.fans.fans.as_flattened()),
            exact: self.has_exact.then(|| BakedExact {
                patches: self.exact.patches.record(),
                solve: self.exact.solve(),
            }),
            bones: self.bones.as_ref().map(Bones::record),
            after: After {
                piece_of: &self.piece_of,
                modes: &self.modes,
                ..self.after
            },
            prior: self.prior,
        }
    }
}

/// Triangles, slots of render vertices and texture coordinates, render vertices in the order of their slots.
fn drawn(surface: &SurfaceView<'_>, slot_from_vertex: &[u32]) -> (Vec<[u32; 3]>, Vec<u32>, Vec<[f32; 2]>) {
    let slot = |point: u32| slot_from_vertex[point as usize];
    if !surface.has_texture() {
        let corners = surface.faces().iter().map(|face| face.map(slot));
        return (corners.collect(), Vec::new(), Vec::new());
    }
    let slots: Vec<u32> = surface.render_points.iter().map(slot).collect();
    let mut order: Vec<u32> = (0..slots.len() as u32).collect();
    order.sort_by_key(|&r| slots[r as usize]);
    let mut place = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        place[old as usize] = new as u32;
    }
    let corners = surface.drawn_faces();
    let corners = corners.iter().map(|corners| corners.map(|r| place[r as usize]));
    (
        corners.collect(),
        order.iter().map(|&r| slots[r as usize]).collect(),
        order.iter().map(|&r| surface.uvs[r as usize]).collect(),
    )
}
