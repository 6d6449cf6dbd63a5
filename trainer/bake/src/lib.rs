//! From a compact package to a baked one: the mesh's matrix is ordered and factored, the decoder's convolution folded
//! into the components, everything laid out in the order in which a frame reads it.
//!
//! Path of data: compact package -> [`Surface`] (rings, weights) -> [`factor`] (order, factor) and [`sparse`] -> [`fold`]
//! -> baked package, which the runtime opens without allocating.

pub mod factor;
pub mod fold;
pub mod groups;
pub mod mesh;
pub mod sparse;
mod surface;

use sinew_formats::package::{
    AlignedBytes, BakedBasis, BakedBlock, BakedComponent, BakedTier, CompactView, Fans, OpenError, WriteError,
    write_baked,
};

use factor::{AnchoredLaplacian, EliminationOrder, Factor};
use fold::{FoldFrame, FoldedComponent};
use groups::LaneOrder;
pub use surface::Surface;

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

/// Bakes the compact package in `bytes`; see [`bake`].
/// Errors: those of [`bake`], and [`BakeError::Unreadable`].
pub fn bake_bytes(bytes: &[u8]) -> Result<AlignedBytes, BakeError> {
    bake(&CompactView::open(bytes).map_err(BakeError::Unreadable)?)
}

/// Bakes a compact package; the same bytes give the same bytes, whatever the thread count.
/// Errors: a mesh that is not one connected graph, or a result that the format cannot hold.
/// Source: the frame path's design: fold, order (approximate minimum degree), factor in f64, store in f32.
pub fn bake(package: &CompactView<'_>) -> Result<AlignedBytes, BakeError> {
    let surface = Surface::of_package(package);
    let laplacian = surface.laplacian(package.anchor_vertex() as usize);
    let order = EliminationOrder::new(&laplacian)?;
    let factor = Factor::new(&laplacian, &order)?;
    let folded = fold_package(package, &surface, &order);
    let nearby = groups::nearby(package.rest_positions());
    let nearby: Vec<u32> = nearby.iter().map(|&v| order.solver_from_vertex[v as usize]).collect();
    let degree = |&v: &u32| surface.topology.ring_of(v as usize).len();
    let degrees: Vec<usize> = order.vertex_from_solver.iter().map(degree).collect();
    let lanes = LaneOrder::new(&folded, &nearby, &degrees);
    let through = |via: &[u32], then: &[u32]| -> Vec<u32> { via.iter().map(|&i| then[i as usize]).collect() };
    let vertex_from_lane = through(&lanes.solver_from_lane, &order.vertex_from_solver);
    let lane_from_vertex = through(&order.solver_from_vertex, &lanes.lane_from_solver);
    let rest = |&v: &u32| package.rest_positions()[v as usize];
    let rest_positions: Vec<[f32; 3]> = vertex_from_lane.iter().map(rest).collect();
    let rings = LaneRings::new(&laplacian, &vertex_from_lane, &lane_from_vertex);
    let block_of_component: Vec<u32> = package.components().map(|component| component.block).collect();
    let patches = lanes.patches(&folded, &block_of_component);
    let fans = Fans::gather(package.faces(), &lane_from_vertex);
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
    write_baked(&BakedBasis {
        compact_id: package.content_id(),
        faces: package.faces(),
        lane_from_vertex: &lane_from_vertex,
        vertex_from_lane: &vertex_from_lane,
        rotation_scale: package.rotation_scale(),
        stretch_scale: package.stretch_scale(),
        blocks: &blocks,
        components: &components,
        fan_offsets: &fans.fan_offsets,
        fans: &fans.fans,
        exact: BakedTier {
            rest_positions: &rest_positions,
            ring_offsets: &rings.offsets,
            ring: &rings.ring,
            ring_weights: &rings.weights,
            tile_offsets: &factor.offsets,
            tile_rows: &factor.rows,
            tiles: &factor.tiles,
            inverse_diagonals: &factor.inverse_diagonals,
            solver_from_lane: &lanes.solver_from_lane,
            lane_from_solver: &lanes.lane_from_solver,
            patch_offsets: &patches.patch_offsets,
            patch_owners: &patches.patch_owners,
            patch_values: &patches.patch_values,
        },
        fast: None,
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
        solver_from_vertex: &order.solver_from_vertex,
    };
    frame.fold(&sparse::unpack_components(package), &decoders, &value_scales)
}

/// One-rings and their weights in lanes, for the right-hand side.
struct LaneRings {
    offsets: Vec<u32>,
    ring: Vec<u32>,
    weights: Vec<f32>,
}

impl LaneRings {
    fn new(laplacian: &AnchoredLaplacian<'_>, vertex_from_lane: &[u32], lane_from_vertex: &[u32]) -> Self {
        let mut rings = Self {
            offsets: vec![0],
            ring: Vec::new(),
            weights: Vec::new(),
        };
        for &v in vertex_from_lane {
            let row = laplacian.ring_offsets[v as usize] as usize..laplacian.ring_offsets[v as usize + 1] as usize;
            let mut entries: Vec<(u32, f32)> = row
                .map(|e| {
                    (
                        lane_from_vertex[laplacian.ring[e] as usize],
                        laplacian.weights[e] as f32,
                    )
                })
                .collect();
            entries.sort_unstable_by_key(|&(lane, _)| lane);
            rings.ring.extend(entries.iter().map(|entry| entry.0));
            rings.weights.extend(entries.iter().map(|entry| entry.1));
            rings.offsets.push(rings.ring.len() as u32);
        }
        rings
    }
}

#[cfg(any(test, feature = "fixture"))]
pub mod fixture;
#[cfg(test)]
mod tests;
