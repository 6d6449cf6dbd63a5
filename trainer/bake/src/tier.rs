//! One tier of a baked package, owned: order, factor, rings, rest shape and folded components of its nodes. Laplacian and
//! [`FoldedComponent`]s -> [`Tier`] -> [`BakedTier`], the record that is written.

use sinew_formats::package::{BakedTier, Patches};

use super::BakeError;
use super::factor::{AnchoredLaplacian, EliminationOrder, Factor};
use super::fold::FoldedComponent;
use super::groups::{self, LaneOrder};

/// What a frame reads from decode to solve, for N nodes: the vertices, or those that stand for them.
#[derive(Debug)]
pub struct Tier {
    /// Lane of each node. Shape: `[N]`, a permutation.
    pub lane_from_node: Vec<u32>,
    /// Its inverse.
    pub node_from_lane: Vec<u32>,
    /// Solver index of each node. Shape: `[N]`.
    pub solver_from_node: Vec<u32>,
    /// In lanes. Shape: `[N]`.
    pub rest_positions: Vec<[f32; 3]>,
    /// In lanes.
    pub rings: LaneRings,
    /// In solver order.
    pub factor: Factor,
    /// Lanes and solver indices.
    pub lanes: LaneOrder,
    /// The components in lanes.
    pub patches: Patches,
}

impl Tier {
    /// Factors the Laplacian in `order`, finds an order of decoding and lays everything out. Shape: `rest_positions` `[N]`, in
    /// node order; `components` `[K]`, in solver order; `block_of_component` `[K]`.
    /// Errors: those of [`Factor::new`].
    pub fn new(
        laplacian: &AnchoredLaplacian<'_>,
        order: EliminationOrder,
        rest_positions: &[[f32; 3]],
        components: &[FoldedComponent],
        block_of_component: &[u32],
    ) -> Result<Self, BakeError> {
        let factor = Factor::new(laplacian, &order)?;
        let through = |via: &[u32], then: &[u32]| -> Vec<u32> { via.iter().map(|&i| then[i as usize]).collect() };
        let nearby = through(&groups::nearby(rest_positions), &order.solver_from_vertex);
        let offsets = laplacian.ring_offsets;
        let degree = |&node: &u32| (offsets[node as usize + 1] - offsets[node as usize]) as usize;
        let degrees: Vec<usize> = order.vertex_from_solver.iter().map(degree).collect();
        let lanes = LaneOrder::new(components, &nearby, &degrees);
        let node_from_lane = through(&lanes.solver_from_lane, &order.vertex_from_solver);
        let lane_from_node = through(&order.solver_from_vertex, &lanes.lane_from_solver);
        Ok(Self {
            rest_positions: node_from_lane
                .iter()
                .map(|&node| rest_positions[node as usize])
                .collect(),
            rings: LaneRings::new(laplacian, &node_from_lane, &lane_from_node),
            factor,
            patches: lanes.patches(components, block_of_component),
            lanes,
            lane_from_node,
            node_from_lane,
            solver_from_node: order.solver_from_vertex,
        })
    }

    /// N.
    pub fn node_count(&self) -> usize {
        self.rest_positions.len()
    }

    /// Borrowed, ready to be written.
    pub fn record(&self) -> BakedTier<'_> {
        BakedTier {
            rest_positions: &self.rest_positions,
            ring_offsets: &self.rings.offsets,
            ring: &self.rings.ring,
            ring_weights: &self.rings.weights,
            tile_offsets: &self.factor.offsets,
            tile_rows: &self.factor.rows,
            tiles: &self.factor.tiles,
            inverse_diagonals: &self.factor.inverse_diagonals,
            solver_from_lane: &self.lanes.solver_from_lane,
            lane_from_solver: &self.lanes.lane_from_solver,
            patch_offsets: &self.patches.patch_offsets,
            patch_owners: &self.patches.patch_owners,
            patch_values: &self.patches.patch_values,
        }
    }
}

/// One-rings and their weights in lanes, for the right-hand side.
#[derive(Debug)]
pub struct LaneRings {
    /// Shape: `[N + 1]`.
    pub offsets: Vec<u32>,
    /// Lanes, ascending within a row.
    pub ring: Vec<u32>,
    /// Shape: that of `ring`.
    pub weights: Vec<f32>,
}

impl LaneRings {
    fn new(laplacian: &AnchoredLaplacian<'_>, node_from_lane: &[u32], lane_from_node: &[u32]) -> Self {
        let mut rings = Self {
            offsets: vec![0],
            ring: Vec::new(),
            weights: Vec::new(),
        };
        for &node in node_from_lane {
            let node = node as usize;
            let row = laplacian.ring_offsets[node] as usize..laplacian.ring_offsets[node + 1] as usize;
            let mut entries: Vec<(u32, f32)> = row
                .map(|e| (lane_from_node[laplacian.ring[e] as usize], laplacian.weights[e] as f32))
                .collect();
            entries.sort_unstable_by_key(|&(lane, _)| lane);
            rings.ring.extend(entries.iter().map(|entry| entry.0));
            rings.weights.extend(entries.iter().map(|entry| entry.1));
            rings.offsets.push(rings.ring.len() as u32);
        }
        rings
    }
}
