//! The fast tier: a graph of N nodes on the surface stands for its V vertices. Each vertex follows four nodes, which carry
//! the network's deformation gradients and are moved by a small system of their own.
//!
//! Path of data: exact [`Tier`] -> [`nodes`] (which vertices) -> [`skin`] (four weights a vertex, fitted to poses of the
//! exact tier) -> [`graph`] (the mesh's energy on the nodes) -> a [`Tier`] of the nodes -> [`measure`] (its error).
//!
//! Sources: embedded deformation graphs (Sumner, Schmid, Pauly 2007); weights fitted to examples as for skinning
//! decomposition (Le and Deng 2012), but with the nodes' transforms given by the network; the coarse matrix is the Galerkin
//! product of multigrid methods. What was measured on the way is in [`skin`] and [`graph`].

pub mod graph;
pub mod measure;
pub mod nodes;
pub mod play;
pub mod skin;

use sinew_formats::package::{BakedFast, FastError, SKIN_NODES, limits};

use crate::BakeError;
use crate::factor::EliminationOrder;
use crate::fold::FoldedComponent;
use crate::tier::Tier;
use graph::NodeGraph;
use measure::Measure;
use nodes::SurfaceGraph;
use play::{Network, Player};
use skin::Skin;

/// Chance of a control to move in a mixed pose: a performer holds some of them, not all at once.
pub const MIXED_SHARE: f64 = 0.25;

/// A fast tier, owned.
#[derive(Debug)]
pub struct Fast {
    nodes: Tier,
    /// At the nodes, in their solver order. Shape: `[K]`.
    components: Vec<FoldedComponent>,
    centre: [f32; 3],
    skin_nodes: Vec<[u16; SKIN_NODES]>,
    skin_weights: Vec<[u16; SKIN_NODES]>,
    /// What was measured.
    pub error: FastError,
}

/// The mesh that a fast tier is made for.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// Connectivity, rest shape and edge weights, source order.
    pub surface: &'a crate::Surface,
    /// The vertex that the solve holds.
    pub anchor_vertex: usize,
    /// Shape: `[V]`, source order.
    pub rest_positions: &'a [[f32; 3]],
    /// The exact tier; its nodes are the vertices in source order.
    pub exact: &'a Tier,
    /// The exact tier's components, in its solver order. Shape: `[K]`.
    pub components: &'a [FoldedComponent],
    /// Blocks, controls and scales.
    pub network: Network<'a>,
}

impl Fast {
    /// Makes a tier of about `node_count` nodes, at least one and at most those the format allows, and measures it.
    /// Deterministic, whatever the thread count. Errors: those of [`Tier::new`].
    pub fn new(source: &Source<'_>, node_count: usize) -> Result<Self, BakeError> {
        let surface = SurfaceGraph::new(&source.surface.topology, &source.surface.rest);
        let node_count = node_count.clamp(1, limits::FAST_NODES);
        let exact = Player::new(source.network, source.exact, source.components);
        let strained = surface.with_lengths(strained_lengths(source, &surface, &exact));
        let nodes = strained.farthest_points(source.anchor_vertex, node_count);
        let skin = Skin::fit(source, &surface, &nodes, &exact);

        let rest: Vec<[f32; 3]> = nodes.iter().map(|&v| source.rest_positions[v as usize]).collect();
        let blocks = source.network.block_of_component();
        let tier_on = |graph: &NodeGraph| {
            let laplacian = graph.laplacian();
            let order = EliminationOrder::new(&laplacian)?;
            let components = at_nodes(source, &nodes, &order.solver_from_vertex);
            Tier::new(&laplacian, order, &rest, &components, &blocks).map(|tier| (tier, components))
        };
        let graph = NodeGraph::new(source.surface, &skin, nodes.len());
        // Where parts hang together by negligible edges alone, all are wanted.
        let (tier, components) = tier_on(&graph.without_negligible()).or_else(|_| tier_on(&graph))?;

        let in_lanes = |row: [u16; SKIN_NODES]| row.map(|node| tier.lane_from_node[usize::from(node)] as u16);
        let vertices = || source.exact.node_from_lane.iter().map(|&v| v as usize);
        let mut fast = Self {
            centre: middle(source.rest_positions),
            skin_nodes: vertices().map(|v| in_lanes(skin.nodes[v])).collect(),
            skin_weights: vertices().map(|v| skin.weights[v]).collect(),
            components,
            error: FastError {
                mixed_rms: 0.0,
                mixed_p99: 0.0,
                mixed_max: 0.0,
                single_rms: 0.0,
                single_max: 0.0,
                normal_rms: 0.0,
                mixed_poses: 0,
            },
            nodes: tier,
        };
        fast.error = Measure::new(source, &exact, &fast).error();
        Ok(fast)
    }

    /// Borrowed, ready to be written.
    pub fn record(&self) -> BakedFast<'_> {
        BakedFast {
            nodes: self.nodes.record(),
            centre: self.centre,
            skin_nodes: &self.skin_nodes,
            skin_weights: &self.skin_weights,
            error: self.error,
        }
    }
}

/// Mixed poses that say where nodes are wanted, and their seed.
const STRAIN_POSES: usize = 24;
const STRAIN_SEED: u64 = 0x7374_7261_696e_7073;

/// What the difference of gradients counts in the lengths that nodes are spread by; the edge's own length counts the rest.
const STRAIN_SHARE: f64 = 0.4;

/// Lengths that are long where gradients differ much, so that nodes spread by them stand closer where joints bend: the length
/// of an edge and the difference of its ends' gradients, as multiples of their means.
///
/// **Measured** on a trained horse, V/8 nodes, mixed poses: rms 1.0e-3 and maximum 0.8e-2 of the bounding box; spread by
/// length alone 1.9e-3 and 2.6e-2. Shares from 0.3 to 0.5 do nearly the same.
fn strained_lengths(source: &Source<'_>, surface: &SurfaceGraph<'_>, exact: &Player<'_>) -> Vec<f64> {
    let topology = &source.surface.topology;
    let played = exact.play_all(&source.network.mixed_poses(STRAIN_SEED, STRAIN_POSES, MIXED_SHARE));
    let differences = (0..topology.vertex_count).flat_map(|v| {
        let played = &played;
        topology.ring_of(v).iter().map(move |&j| {
            let squares = played.iter().map(|pose| {
                let (a, b) = (&pose.gradients[v], &pose.gradients[j as usize]);
                a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
            });
            squares.sum::<f64>().sqrt()
        })
    });
    let differences: Vec<f64> = differences.collect();
    let share = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        if mean > 0.0 { 1.0 / mean } else { 0.0 }
    };
    let (of_length, of_difference) = (share(surface.lengths()), share(&differences));
    let edges = surface.lengths().iter().zip(&differences);
    edges
        .map(|(length, difference)| {
            (1.0 - STRAIN_SHARE) * of_length * length + STRAIN_SHARE * of_difference * difference
        })
        .collect()
}

/// The components where the nodes are, in the nodes' solver order.
fn at_nodes(source: &Source<'_>, nodes: &[u32], solver_from_node: &[u32]) -> Vec<FoldedComponent> {
    let mut node_from_exact = vec![None; source.rest_positions.len()];
    for (&vertex, &solver) in nodes.iter().zip(solver_from_node) {
        node_from_exact[source.exact.solver_from_node[vertex as usize] as usize] = Some(solver);
    }
    let restricted = source.components.iter().map(|component| {
        let entries = component.solver_indices.iter().zip(&component.values);
        let mut entries: Vec<_> = entries
            .filter_map(|(&solver, &value)| node_from_exact[solver as usize].map(|node: u32| (node, value)))
            .collect();
        entries.sort_unstable_by_key(|&(node, _)| node);
        let (solver_indices, values) = entries.into_iter().unzip();
        FoldedComponent {
            solver_indices,
            values,
            value_scale: component.value_scale,
        }
    });
    restricted.collect()
}

/// Middle of the bounding box.
fn middle(positions: &[[f32; 3]]) -> [f32; 3] {
    core::array::from_fn(|c| {
        let coordinates = positions.iter().map(|p| p[c]);
        let (low, high) = coordinates.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        0.5 * low + 0.5 * high
    })
}

#[cfg(test)]
mod tests;
