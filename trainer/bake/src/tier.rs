//! One tier of a baked package, owned: order, factor, rings, rest shape and folded components of its nodes. Laplacian and
//! [`FoldedComponent`]s -> [`Tier`] -> [`BakedTier`], the record that is written.

use sinew_formats::package::BakedTier;

use super::BakeError;
use super::factor::{AnchoredLaplacian, EliminationOrder, Factor};
use super::fold::{FoldedBlocks, FoldedComponent};

/// What a frame reads from blend to solve, for N nodes: the vertices, or those that stand for them.
#[derive(Debug)]
pub struct Tier {
    /// Place of each node in solver order, and back. Shape: both `[N]`.
    pub solver_from_node: Vec<u32>,
    /// The inverse of `solver_from_node`.
    pub node_from_solver: Vec<u32>,
    /// Solver order. Shape: `[N]`.
    pub rest_positions: Vec<[f32; 3]>,
    /// Solver order.
    pub rings: SolverRings,
    /// Solver order.
    pub factor: Factor,
    /// Supports and entries, solver order.
    pub folded: FoldedBlocks,
}

impl Tier {
    /// Factors the Laplacian in `order` and lays everything out in it. Shape: `rest_positions` `[N]`, in node order;
    /// `components` `[K]`, in solver order; `component_counts` `[B]`.
    /// Errors: those of [`Factor::new`].
    pub fn new(
        laplacian: &AnchoredLaplacian<'_>,
        order: EliminationOrder,
        rest_positions: &[[f32; 3]],
        components: &[FoldedComponent],
        component_counts: &[usize],
    ) -> Result<Self, BakeError> {
        let factor = Factor::new(laplacian, &order)?;
        let rings = SolverRings::new(laplacian, &order);
        let in_solver_order = order.vertex_from_solver.iter().map(|&v| rest_positions[v as usize]);
        Ok(Self {
            rest_positions: in_solver_order.collect(),
            rings,
            factor,
            folded: FoldedBlocks::gather(components, component_counts),
            solver_from_node: order.solver_from_vertex,
            node_from_solver: order.vertex_from_solver,
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
            support_offsets: &self.folded.support_offsets,
            support: &self.folded.support,
            entry_offsets: &self.folded.entry_offsets,
            entry_slots: &self.folded.entry_slots,
            entry_values: &self.folded.entry_values,
        }
    }
}

/// One-rings and their weights in solver order, for the right-hand side.
#[derive(Debug)]
pub struct SolverRings {
    /// Shape: `[N + 1]`.
    pub offsets: Vec<u32>,
    /// Solver indices, ascending within a row.
    pub ring: Vec<u32>,
    /// Shape: that of `ring`.
    pub weights: Vec<f32>,
}

impl SolverRings {
    fn new(laplacian: &AnchoredLaplacian<'_>, order: &EliminationOrder) -> Self {
        let mut rings = Self {
            offsets: vec![0],
            ring: Vec::new(),
            weights: Vec::new(),
        };
        for &v in &order.vertex_from_solver {
            let row = laplacian.ring_offsets[v as usize] as usize..laplacian.ring_offsets[v as usize + 1] as usize;
            let mut entries: Vec<(u32, f32)> = row
                .map(|e| {
                    (
                        order.solver_from_vertex[laplacian.ring[e] as usize],
                        laplacian.weights[e] as f32,
                    )
                })
                .collect();
            entries.sort_unstable_by_key(|&(solver, _)| solver);
            rings.ring.extend(entries.iter().map(|entry| entry.0));
            rings.weights.extend(entries.iter().map(|entry| entry.1));
            rings.offsets.push(rings.ring.len() as u32);
        }
        rings
    }
}
