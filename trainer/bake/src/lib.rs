//! From a compact package to a baked one: the mesh's matrix is ordered and factored, the decoder's convolution folded
//! into the components, everything laid out in the order in which a frame reads it.
//!
//! Path of data: compact package -> [`Surface`] (rings, weights) -> [`factor`] (order, factor) and [`sparse`] -> [`fold`]
//! -> [`tier`], the exact one -> [`fast`], where wanted -> baked package, which the runtime opens without allocating.

pub mod factor;
pub mod fast;
pub mod fold;
pub mod groups;
pub mod mesh;
pub mod sparse;
mod surface;
pub mod tier;

use sinew_formats::package::{
    AlignedBytes, BakedBasis, BakedBlock, BakedComponent, CompactView, Fans, OpenError, WriteError, write_baked,
};

use factor::EliminationOrder;
use fast::{Fast, play::Network};
use fold::{FoldFrame, FoldedComponent};
pub use surface::Surface;
use tier::Tier;

/// Why a package cannot be baked.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// The factor's indices do not fit.
    #[error("the solver's factor of {vertex_count} vertices does not fit into memory: use a mesh with fewer vertices")]
    FactorTooLarge {
        /// V.
        vertex_count: usize,
    },
    /// The matrix is not positive definite.
    #[error("the Laplacian is singular at vertex {vertex}: the mesh is not connected through faces and bridges")]
    NotPositive {
        /// Source index.
        vertex: usize,
    },
    /// The result breaks a rule of the format, as magnitudes beyond f16 or f32 do.
    #[error("the baked package would be refused")]
    Refused(#[source] WriteError),
    /// The bytes are not a compact package.
    #[error("the package cannot be opened")]
    Unreadable(#[source] OpenError),
}

/// What to bake besides the exact tier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BakeOptions {
    /// Nodes of the fast tier.
    pub fast_nodes: FastNodes,
}

impl Default for BakeOptions {
    /// A fast tier with a node for every eight vertices.
    fn default() -> Self {
        Self {
            fast_nodes: FastNodes::OneIn(8),
        }
    }
}

/// How many nodes stand for the vertices in the fast tier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FastNodes {
    /// No fast tier.
    None,
    /// One for so many vertices; at least 1, and the format's limit caps the nodes.
    OneIn(u32),
}

/// A text that is not `none` and not `V/` with a whole number of at least 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("expected `none`, or `V/8` for a node to every eight vertices")]
pub struct FastNodesError;

impl core::str::FromStr for FastNodes {
    type Err = FastNodesError;

    fn from_str(text: &str) -> Result<Self, FastNodesError> {
        if text == "none" {
            return Ok(Self::None);
        }
        let vertices = text.strip_prefix("V/").and_then(|number| number.parse().ok());
        match vertices {
            Some(vertices) if vertices > 0 => Ok(Self::OneIn(vertices)),
            _ => Err(FastNodesError),
        }
    }
}

/// Bakes the compact package in `bytes`; see [`bake`].
/// Errors: those of [`bake`], and [`BakeError::Unreadable`].
pub fn bake_bytes(bytes: &[u8]) -> Result<AlignedBytes, BakeError> {
    bake(&CompactView::open(bytes).map_err(BakeError::Unreadable)?)
}

/// Bakes the compact package in `bytes`; see [`bake_with`].
/// Errors: those of [`bake_bytes`].
pub fn bake_bytes_with(bytes: &[u8], options: &BakeOptions) -> Result<AlignedBytes, BakeError> {
    bake_with(&CompactView::open(bytes).map_err(BakeError::Unreadable)?, options)
}

/// Bakes the exact tier alone: what a program needs that bakes and plays at once.
/// Errors: those of [`bake_with`].
pub fn bake(package: &CompactView<'_>) -> Result<AlignedBytes, BakeError> {
    let options = BakeOptions {
        fast_nodes: FastNodes::None,
    };
    bake_with(package, &options)
}

/// Bakes a compact package; the same bytes give the same bytes, whatever the thread count. A fast tier costs some hundred
/// poses of the exact one: it is fitted to them, and its error is measured on others.
/// Errors: a mesh that is not one connected graph, or a result that the format cannot hold.
/// Source: the frame path's design: fold, order (approximate minimum degree), factor in f64, store in f32.
pub fn bake_with(package: &CompactView<'_>, options: &BakeOptions) -> Result<AlignedBytes, BakeError> {
    let surface = Surface::of_package(package);
    let anchor_vertex = package.anchor_vertex() as usize;
    let laplacian = surface.laplacian(anchor_vertex);
    let order = EliminationOrder::new(&laplacian)?;
    let folded = fold_package(package, &surface, &order);
    let block_of_component: Vec<u32> = package.components().map(|component| component.block).collect();
    let exact = Tier::new(
        &laplacian,
        order,
        package.rest_positions(),
        &folded,
        &block_of_component,
    )?;
    let fans = Fans::gather(&surface.topology.faces, &exact.lane_from_node);
    let blocks: Vec<BakedBlock> = package
        .blocks()
        .map(|block| BakedBlock {
            level: block.level,
            parent_component: block.parent_component,
            first_component: block.first_component,
            component_count: block.component_count,
            bias: block.decoder.bias,
        })
        .collect();
    let components: Vec<BakedComponent<'_>> = package
        .components()
        .zip(&folded)
        .map(|(component, folded)| BakedComponent {
            name: component.name,
            block: component.block,
            minimum: component.minimum,
            maximum: component.maximum,
            value_scale: folded.value_scale,
        })
        .collect();
    let source = fast::Source {
        surface: &surface,
        anchor_vertex,
        rest_positions: package.rest_positions(),
        exact: &exact,
        components: &folded,
        network: Network {
            blocks: &blocks,
            components: &components,
            rotation_scale: package.rotation_scale(),
            stretch_scale: package.stretch_scale(),
        },
    };
    let fast = match options.fast_nodes {
        FastNodes::None => None,
        FastNodes::OneIn(vertices) => Some(Fast::new(&source, package.vertex_count() / vertices.max(1) as usize)?),
    };
    write_baked(&BakedBasis {
        compact_id: package.content_id(),
        faces: &surface.topology.faces,
        lane_from_vertex: &exact.lane_from_node,
        vertex_from_lane: &exact.node_from_lane,
        rotation_scale: package.rotation_scale(),
        stretch_scale: package.stretch_scale(),
        blocks: &blocks,
        components: &components,
        fan_offsets: &fans.fan_offsets,
        fans: &fans.fans,
        exact: exact.record(),
        fast: fast.as_ref().map(Fast::record),
        render: package.render_mesh(),
    })
    .map_err(BakeError::Refused)
}

fn fold_package(package: &CompactView<'_>, surface: &Surface, order: &EliminationOrder) -> Vec<FoldedComponent> {
    let blocks: Vec<_> = package.blocks().collect();
    let (decoders, value_scales): (Vec<_>, Vec<_>) = package
        .components()
        .map(|component| (&blocks[component.block as usize].decoder, component.value_scale))
        .unzip();
    let frame = FoldFrame {
        ring_offsets: &surface.topology.ring_offsets,
        ring: &surface.topology.ring,
        areas: &surface.gradient_areas(),
        rounding_order: &surface.towards(package.anchor_vertex() as usize),
        solver_from_vertex: &order.solver_from_vertex,
    };
    frame.fold(&sparse::unpack_components(package), &decoders, &value_scales)
}

#[cfg(any(test, feature = "fixture"))]
pub mod fixture;
#[cfg(test)]
mod tests;
