//! One tier of a baked package, owned: order, factor, rings, rest shape and folded components of its nodes. Laplacian and
//! [`FoldedComponent`]s -> [`Tier`] -> [`BakedSolve`] and patches, the records that are written.

use sinew_formats::package::{BakedSolve, Indices, Patches};

use super::BakeError;
use super::factor::{AnchoredLaplacian, EliminationOrder, Factor};
use super::fold::FoldedComponent;
use super::slots::{SlotOrder, nearby};

/// What a frame reads from decode to solve, for N nodes: the vertices, or those that stand for them.
#[derive(Debug, Clone)]
pub struct Tier {
    /// Slot of each node. Shape: `[N]`, a permutation.
    pub slot_from_node: Vec<u32>,
    /// Its inverse.
    pub node_from_slot: Vec<u32>,
    /// Solver place of each node. Shape: `[N]`.
    pub solver_from_node: Vec<u32>,
    /// In slots. Shape: `[N]`.
    pub rest_positions: Vec<[f32; 3]>,
    /// In slots.
    pub rings: SlotRings,
    /// In solver order.
    pub factor: Factor,
    /// Slots and solver places.
    pub order: SlotOrder,
    /// The components in slots.
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
        let nearby = through(&nearby(rest_positions), &order.solver_from_vertex);
        let offsets = laplacian.ring_offsets;
        let degree = |&node: &u32| (offsets[node as usize + 1] - offsets[node as usize]) as usize;
        let degrees: Vec<usize> = order.vertex_from_solver.iter().map(degree).collect();
        let slots = SlotOrder::new(components, &nearby, &degrees);
        let node_from_slot = through(&slots.solver_from_slot, &order.vertex_from_solver);
        let slot_from_node = through(&order.solver_from_vertex, &slots.slot_from_solver);
        Ok(Self {
            rest_positions: node_from_slot
                .iter()
                .map(|&node| rest_positions[node as usize])
                .collect(),
            rings: SlotRings::new(laplacian, &node_from_slot, &slot_from_node),
            factor,
            patches: slots.patches(components, block_of_component),
            order: slots,
            slot_from_node,
            node_from_slot,
            solver_from_node: order.solver_from_vertex,
        })
    }

    /// N.
    pub fn node_count(&self) -> usize {
        self.rest_positions.len()
    }

    /// The system, borrowed, ready to be written.
    pub fn solve(&self) -> BakedSolve<'_> {
        let node_count = self.node_count();
        BakedSolve {
            ring_offsets: &self.rings.offsets,
            ring: Indices::of(node_count, &self.rings.ring),
            ring_weights: &self.rings.weights,
            tile_offsets: &self.factor.offsets,
            tile_rows: Indices::of(node_count, &self.factor.rows),
            tiles: &self.factor.tiles,
            inverse_diagonals: &self.factor.inverse_diagonals,
            solver_from_slot: Indices::of(node_count, &self.order.solver_from_slot),
        }
    }
}

/// One-rings and their weights in slots, for the right-hand side.
#[derive(Debug, Clone)]
pub struct SlotRings {
    /// Shape: `[N + 1]`.
    pub offsets: Vec<u32>,
    /// Slots, ascending within a row.
    pub ring: Vec<u32>,
    /// Shape: that of `ring`.
    pub weights: Vec<f32>,
}

impl SlotRings {
    fn new(laplacian: &AnchoredLaplacian<'_>, node_from_slot: &[u32], slot_from_node: &[u32]) -> Self {
        let mut rings = Self {
            offsets: vec![0],
            ring: Vec::new(),
            weights: Vec::new(),
        };
        for &node in node_from_slot {
            let node = node as usize;
            let row = laplacian.ring_offsets[node] as usize..laplacian.ring_offsets[node + 1] as usize;
            let mut entries: Vec<(u32, f32)> = row
                .map(|e| (slot_from_node[laplacian.ring[e] as usize], laplacian.weights[e] as f32))
                .collect();
            entries.sort_unstable_by_key(|&(slot, _)| slot);
            rings.ring.extend(entries.iter().map(|entry| entry.0));
            rings.weights.extend(entries.iter().map(|entry| entry.1));
            rings.offsets.push(rings.ring.len() as u32);
        }
        rings
    }
}
