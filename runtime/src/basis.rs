//! The opened package and its tiers: checked views of the caller's bytes, nothing copied.

use core::fmt;

use sinew_formats::package::{BakedBlock, BakedView, FastError, FastView, NONE, OpenError, RenderMesh, TierView};

use crate::simd::decode::{FeatureScales, Patches};
use crate::simd::scalar::poisson::{Factor, Rings};
use crate::simd::scalar::skin::Skin;
use crate::simd::scalar::surface::{Around, Orders};

/// A baked package, checked. Borrows the bytes; cheap to copy; may be shared between threads, each with its own workspace.
#[derive(Clone, Copy)]
pub struct Basis<'a> {
    view: BakedView<'a>,
}

/// One component and its control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component<'a> {
    /// Unique name, for example `c03.f2`.
    pub name: &'a str,
    /// The block this component is a latent of.
    pub block: usize,
    /// Level of its block: 0 for the coarse ones.
    pub level: u32,
    /// The component above it, if any.
    pub parent: Option<usize>,
    /// Lower stop of the control; at most 0.
    pub minimum: f32,
    /// Upper stop of the control; at least 0.
    pub maximum: f32,
}

impl fmt::Debug for Basis<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (vertex_count, component_count) = (self.vertex_count(), self.component_count());
        write!(out, "Basis({vertex_count} vertices, {component_count} components)")
    }
}

impl<'a> Basis<'a> {
    /// Opens a baked package; all heavy checks are here, and nothing after it can fail because of the package.
    ///
    /// # Errors
    /// Every rule of the format has its own [`OpenError`]. The bytes must start at a multiple of 16.
    pub fn open(bytes: &'a [u8]) -> Result<Self, OpenError> {
        Ok(Self {
            view: BakedView::open(bytes)?,
        })
    }

    /// Identity of the package's content: two packages with the same id play the same.
    pub fn id(&self) -> [u8; 16] {
        self.view.content_id()
    }

    /// Identity of the compact package this one was baked from.
    pub fn compact_id(&self) -> [u8; 16] {
        self.view.compact_id()
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.view.vertex_count()
    }

    /// F.
    pub fn face_count(&self) -> usize {
        self.view.faces().len()
    }

    /// K, which is the number of controls.
    pub fn component_count(&self) -> usize {
        self.view.component_count()
    }

    /// Autoencoder blocks.
    pub fn block_count(&self) -> usize {
        self.view.block_count()
    }

    /// Component `k`. Panics if `k` is not less than [`Basis::component_count`], like a slice.
    pub fn component(&self, k: usize) -> Component<'a> {
        let record = self.view.component(k);
        let block = self.view.block(record.block as usize);
        Component {
            name: record.name,
            block: record.block as usize,
            level: block.level,
            parent: (block.parent_component != NONE).then_some(block.parent_component as usize),
            minimum: record.minimum,
            maximum: record.maximum,
        }
    }

    /// All components in block order: coarse ones first. Shape: `[K]`.
    pub fn components(&self) -> impl ExactSizeIterator<Item = Component<'a>> + use<'a> {
        let basis = *self;
        (0..self.component_count()).map(move |k| basis.component(k))
    }

    /// Index of the component of this name; O(K).
    pub fn component_named(&self, name: &str) -> Option<usize> {
        self.view.components().position(|record| record.name == name)
    }

    /// Triangles. Shape: `[F]`, source order, counter-clockwise.
    pub fn faces(&self) -> &'a [[u32; 3]] {
        self.view.faces()
    }

    /// What an engine draws: render vertices with texture coordinates; all empty where the package has none.
    pub fn render_mesh(&self) -> RenderMesh<'a> {
        self.view.render_mesh()
    }

    /// R: vertices that an engine draws. V where the package has no texture coordinates.
    pub fn render_vertex_count(&self) -> usize {
        match self.render_mesh().vertices.len() {
            0 => self.vertex_count(),
            count => count,
        }
    }

    /// Rest shape. Shape: `[V]`, in **lanes**: the order in which the frame path runs; units of the source.
    pub fn rest_positions(&self) -> &'a [[f32; 3]] {
        self.view.exact().rest_positions()
    }

    /// Lane of each source vertex. Shape: `[V]`.
    pub fn lane_from_vertex(&self) -> &'a [u32] {
        self.view.lane_from_vertex()
    }

    /// Source vertex of each lane. Shape: `[V]`.
    pub fn vertex_from_lane(&self) -> &'a [u32] {
        self.view.vertex_from_lane()
    }

    /// Radians a network unit of log-rotation.
    pub fn rotation_scale(&self) -> f32 {
        self.view.rotation_scale()
    }

    /// Stretch a network unit of stretch.
    pub fn stretch_scale(&self) -> f32 {
        self.view.stretch_scale()
    }

    /// How the triangles lie around the vertices.
    pub(crate) fn around(&self) -> Around<'a> {
        Around {
            offsets: self.view.fan_offsets(),
            fans: self.view.fans(),
            vertex_from_lane: self.view.vertex_from_lane(),
        }
    }

    /// The orders of the exact tier.
    pub(crate) fn orders(&self) -> Orders<'a> {
        Orders {
            solver_from_lane: self.view.exact().solver_from_lane(),
            vertex_from_lane: self.view.vertex_from_lane(),
        }
    }

    /// Nodes of the fast tier, where the package has one.
    pub fn fast_node_count(&self) -> Option<usize> {
        self.view.fast().map(|fast| fast.nodes().node_count())
    }

    /// How far the fast tier is from the exact one, measured when the package was baked.
    pub fn fast_error(&self) -> Option<FastError> {
        self.view.fast().map(|fast| fast.error())
    }

    /// The tier whose nodes are the vertices.
    pub(crate) fn exact(&self) -> Tier<'a> {
        Tier {
            basis: *self,
            nodes: self.view.exact(),
        }
    }

    /// The fast tier, where the package has one.
    pub(crate) fn fast(&self) -> Option<Fast<'a>> {
        self.view.fast().map(|view| Fast { basis: *self, view })
    }
}

/// The fast tier of a basis.
#[derive(Clone, Copy)]
pub(crate) struct Fast<'a> {
    basis: Basis<'a>,
    view: FastView<'a>,
}

impl<'a> Fast<'a> {
    /// What decode and solve read.
    pub(crate) fn nodes(&self) -> Tier<'a> {
        Tier {
            basis: self.basis,
            nodes: self.view.nodes(),
        }
    }

    /// How the vertices follow the nodes.
    pub(crate) fn skin(&self) -> Skin<'a> {
        Skin {
            rest: self.basis.rest_positions(),
            centre: self.view.centre(),
            nodes: self.view.skin_nodes(),
            weights: self.view.skin_weights(),
            vertex_from_lane: self.basis.vertex_from_lane(),
        }
    }
}

/// One tier of a basis, and what all tiers share: all that blend, decode and solve read. N nodes; N = V in the exact tier.
#[derive(Clone, Copy)]
pub(crate) struct Tier<'a> {
    basis: Basis<'a>,
    nodes: TierView<'a>,
}

impl<'a> Tier<'a> {
    pub(crate) fn block(&self, b: usize) -> BakedBlock {
        self.basis.view.block(b)
    }

    /// What a network feature means.
    pub(crate) fn scales(&self) -> FeatureScales {
        FeatureScales {
            rotation: self.basis.rotation_scale(),
            stretch: self.basis.stretch_scale(),
        }
    }

    /// Rest shape of the nodes. Shape: `[N]`, lanes.
    pub(crate) fn rest_positions(&self) -> &'a [[f32; 3]] {
        self.nodes.rest_positions()
    }

    /// Multiplies the halves of component `k`.
    pub(crate) fn value_scale(&self, k: usize) -> f32 {
        self.basis.view.component(k).value_scale
    }

    /// The components.
    pub(crate) fn patches(&self) -> Patches<'a> {
        Patches {
            offsets: self.nodes.patch_offsets(),
            owners: self.nodes.patch_owners(),
            values: self.nodes.patch_values(),
        }
    }

    pub(crate) fn rings(&self) -> Rings<'a> {
        Rings {
            offsets: self.nodes.ring_offsets(),
            neighbours: self.nodes.ring(),
            weights: self.nodes.ring_weights(),
            solver_from_lane: self.nodes.solver_from_lane(),
        }
    }

    pub(crate) fn factor(&self) -> Factor<'a> {
        Factor {
            offsets: self.nodes.tile_offsets(),
            rows: self.nodes.tile_rows(),
            tiles: self.nodes.tiles(),
            inverse_diagonals: self.nodes.inverse_diagonals(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Package, open};

    #[test]
    fn components_are_found_by_name_and_know_their_tree() {
        let package = Package::small(1);
        let basis = open(&package);
        assert_eq!(basis.component_count(), Package::COMPONENTS);
        for (k, component) in basis.components().enumerate() {
            assert_eq!(basis.component_named(component.name), Some(k));
            assert_eq!(component.level, u32::from(component.parent.is_some()));
            assert!(component.minimum <= 0.0 && component.maximum >= 0.0);
        }
        assert_eq!(basis.component(2).parent, Some(0));
        assert_eq!(basis.component(3).parent, Some(1));
        assert_eq!(basis.component(0).parent, None);
        assert_eq!(basis.component_named("no such"), None);
    }

    #[test]
    fn every_prefix_is_refused() {
        let package = Package::small(1);
        for end in 0..package.bytes.len() {
            assert!(Basis::open(&package.bytes[..end]).is_err());
        }
    }

    #[test]
    fn other_content_has_another_id() {
        let (one, two) = (Package::small(1), Package::small(2));
        assert_ne!(open(&one).id(), open(&two).id());
        assert_eq!(open(&one).id(), open(&Package::small(1)).id());
    }

    #[test]
    fn shared_between_threads() {
        fn shared<T: Send + Sync>() {}
        shared::<Basis<'static>>();
        shared::<crate::Workspace<'static>>();
        shared::<crate::Controls<'static>>();
    }
}
