//! The opened package and its tiers: checked views of the caller's bytes, nothing copied.

use core::fmt;

use sinew_formats::package::{
    After, BakedView, BonesView, FAN_VERTICES, Faces, Index, IndexSlice, NONE, OpenError, PatchesView, Prior,
    SolveView, SurfaceView,
};

use crate::bones::BonesInfo;
use crate::simd::generic::decode::FeatureScales;
use crate::simd::generic::normals::Around;
use crate::workspace::TierChoice;

/// Runs an expression with `$index` as the width of the indices of `$count` things.
macro_rules! with_index {
    ($count:expr, $index:ident => $body:expr) => {
        if $count <= sinew_formats::package::SHORT_COUNT {
            type $index = u16;
            $body
        } else {
            type $index = u32;
            $body
        }
    };
}
pub(crate) use with_index;

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
    /// Opens a baked package; all heavy checks are here, and nothing after it can fail because of the package. The bytes must
    /// start at a multiple of 16; at a multiple of 64 every tile of the factor is one cache line, and the solve is faster.
    ///
    /// # Errors
    /// Every rule of the format has its own [`OpenError`].
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
        self.view.surface().face_count()
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

    /// Triangles by source vertices, in the order of the source, counter-clockwise. Shape: `[F]`.
    pub fn faces(&self) -> Faces<'a> {
        self.view.faces()
    }

    /// What an engine draws: triangles by render vertices, and their texture coordinates. The points of this surface are
    /// slots. Without texture the render vertices are the slots.
    pub fn surface(&self) -> SurfaceView<'a> {
        self.view.surface()
    }

    /// R: vertices that an engine draws. V where the package has no texture coordinates.
    pub fn render_vertex_count(&self) -> usize {
        match self.surface().render_points.len() {
            0 => self.vertex_count(),
            count => count,
        }
    }

    /// The source vertex that each render vertex stands for. Shape: `[R]`.
    pub fn render_vertices(&self) -> impl ExactSizeIterator<Item = u32> + Clone + use<'a> {
        let (count, vertices, points) = (
            self.render_vertex_count(),
            self.view.vertex_from_slot(),
            self.surface().render_points,
        );
        (0..count).map(move |r| vertices.at(if points.is_empty() { r } else { points.at(r) as usize }))
    }

    /// Rest shape. Shape: `[V]`, in **slots**: the order in which the frame path runs; units of the source.
    pub fn rest_positions(&self) -> &'a [[f32; 3]] {
        self.view.rest_positions()
    }

    /// Slot of each source vertex. Shape: `[V]`.
    pub fn slot_from_vertex(&self) -> IndexSlice<'a> {
        self.view.slot_from_vertex()
    }

    /// Source vertex of each slot. Shape: `[V]`.
    pub fn vertex_from_slot(&self) -> IndexSlice<'a> {
        self.view.vertex_from_slot()
    }

    /// Radians a network unit of log-rotation.
    pub fn rotation_scale(&self) -> f32 {
        self.view.rotation_scale()
    }

    /// Stretch a network unit of stretch.
    pub fn stretch_scale(&self) -> f32 {
        self.view.stretch_scale()
    }

    /// Whether the package has a tier.
    pub fn has_tier(&self, tier: TierChoice) -> bool {
        match tier {
            TierChoice::Exact => self.view.exact().is_some(),
            TierChoice::Bones => self.view.bones().is_some(),
        }
    }

    /// The nearest tier that the package has: the exact one, where it was not left out.
    pub fn nearest_tier(&self) -> TierChoice {
        if self.has_tier(TierChoice::Exact) {
            TierChoice::Exact
        } else {
            TierChoice::Bones
        }
    }

    /// The bones, where the package has them.
    pub fn bones(&self) -> Option<BonesInfo<'a>> {
        self.view.bones().map(|bones| BonesInfo::new(*self, bones))
    }

    /// Says of another basis whether it is this one.
    pub(crate) fn identity(&self) -> Identity {
        let bones = self.bones_view();
        let [bones, nodes] = bones.map_or([0; 2], |bones| [bones.rest_places.len(), bones.node_count]);
        let counts = [
            self.vertex_count(),
            self.component_count(),
            self.block_count(),
            bones,
            nodes,
        ];
        Identity {
            content: self.id(),
            counts,
        }
    }

    /// What is added to positions after the solve, by slots.
    pub(crate) fn after(&self) -> After<'a> {
        self.view.after()
    }

    /// What is known of the weights.
    pub(crate) fn prior(&self) -> Prior<'a> {
        self.view.prior()
    }

    /// Scales of component `k`'s whole numbers: for log-rotation, for stretch.
    pub(crate) fn value_scales(&self, k: usize) -> [f32; 2] {
        let scales = self.view.component(k).value_scales;
        [scales.rotation, scales.stretch]
    }

    /// Bias of block `b`.
    pub(crate) fn bias(&self, b: usize) -> [f32; 9] {
        self.view.block(b).bias
    }

    /// What a network feature means.
    pub(crate) fn scales(&self) -> FeatureScales {
        FeatureScales {
            rotation: self.rotation_scale(),
            stretch: self.stretch_scale(),
        }
    }

    /// How the triangles lie around the vertices.
    pub(crate) fn around<I: Index>(&self) -> Around<'a, I> {
        Around {
            offsets: self.view.fan_offsets(),
            fans: I::of(self.view.fans()).as_chunks::<FAN_VERTICES>().0,
            vertex_from_slot: I::of(self.view.vertex_from_slot()),
        }
    }

    /// The tier whose nodes are the vertices, where the package has it.
    pub(crate) fn exact(&self) -> Option<Tier<'a>> {
        self.view.exact().map(|exact| Tier {
            rest: self.rest_positions(),
            patches: exact.patches,
            solve: exact.solve,
        })
    }

    /// What the frame path reads of the bones.
    pub(crate) fn bones_view(&self) -> Option<BonesView<'a>> {
        self.view.bones()
    }
}

/// What two bases that play the same have in common. The counts make sure that buffers fit even where somebody made two
/// packages of one id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    content: [u8; 16],
    counts: [usize; 5],
}

/// The exact tier of a basis: all that decode and solve read.
#[derive(Clone, Copy)]
pub(crate) struct Tier<'a> {
    /// Rest shape. Shape: `[V]`, slots.
    pub(crate) rest: &'a [[f32; 3]],
    pub(crate) patches: PatchesView<'a>,
    pub(crate) solve: SolveView<'a>,
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
