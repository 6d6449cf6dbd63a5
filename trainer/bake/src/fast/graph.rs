//! The mesh's energy on the nodes: a graph whose weights are what is left of the mesh's Laplacian L when vertices follow
//! nodes by the skin W, `W^T L W` (the Galerkin product). Rows of W sum to one, so this is a Laplacian again, and the frame
//! path runs on it as on the mesh: edges, gradients at their ends, one factor.
//!
//! **Measured** (rms of the bounding box, horse with smooth made-up components, V/8): these edges 3.4e-4; a right-hand side
//! that is the Galerkin product of the mesh's, a vector for each pair of nodes, 3.5e-4; negative weights left out 3.7e-4;
//! edges under a hundredth of the mean diagonal left out 5.3e-4; the graph of the distance weights 1.5e-3. A right-hand side
//! fitted to poses is no better on poses that it has not seen. On a trained horse, edges under two thousandths of the
//! smaller sum of weights at their ends left out: 1.21e-3 as before, with 69 of 100 edges and 0.92 of the frame; under five
//! thousandths 1.25e-3, 58 and 0.89. On a torus with made-up components both are nearer to the exact tier than all edges.

use std::collections::BTreeMap;

use sinew_formats::package::SKIN_WEIGHT_SUM;

use super::skin::Skin;
use crate::Surface;
use crate::factor::AnchoredLaplacian;

/// Edges under this share of the smaller sum of magnitudes at their two ends are left out.
pub(super) const NEGLIGIBLE: f64 = 2e-3;

/// Weighted edges between N nodes.
#[derive(Debug)]
pub struct NodeGraph {
    /// Shape: `[N + 1]`.
    offsets: Vec<u32>,
    /// Nodes, ascending within a row.
    ring: Vec<u32>,
    /// Symmetric to the bit; either sign. Shape: that of `ring`.
    weights: Vec<f64>,
}

impl NodeGraph {
    /// Gathers the mesh's edges. The first node is the one that does not move.
    pub fn new(surface: &Surface, skin: &Skin, node_count: usize) -> Self {
        // The part below the diagonal, row by row.
        let mut lower: Vec<BTreeMap<u32, f64>> = vec![BTreeMap::new(); node_count];
        let topology = &surface.topology;
        for v in 0..topology.vertex_count {
            for entry in topology
                .entries_of(v)
                .filter(|&entry| topology.ring[entry] as usize > v)
            {
                let difference = weight_difference(skin, v, topology.ring[entry] as usize);
                for &(a, of_a) in &difference {
                    for &(b, of_b) in difference.iter().filter(|&&(b, _)| b < a) {
                        *lower[a as usize].entry(b).or_insert(0.0) -= surface.weights.weights[entry] * of_a * of_b;
                    }
                }
            }
        }
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); node_count];
        for (a, row) in lower.iter().enumerate() {
            for (&b, &weight) in row.iter().filter(|&(_, &weight)| weight != 0.0) {
                rows[a].push((b, weight));
                rows[b as usize].push((a as u32, weight));
            }
        }
        let mut graph = Self {
            offsets: vec![0],
            ring: Vec::new(),
            weights: Vec::new(),
        };
        for row in &mut rows {
            row.sort_unstable_by_key(|&(node, _)| node);
            graph.ring.extend(row.iter().map(|&(node, _)| node));
            graph.weights.extend(row.iter().map(|&(_, weight)| weight));
            graph.offsets.push(graph.ring.len() as u32);
        }
        graph
    }

    /// The same without negligible edges. A node keeps its strongest one; whether the rest still holds together, the factor
    /// says.
    pub fn without_negligible(&self) -> Self {
        let row = |node: usize| self.offsets[node] as usize..self.offsets[node + 1] as usize;
        let node_count = self.offsets.len() - 1;
        let sums: Vec<f64> = (0..node_count)
            .map(|node| self.weights[row(node)].iter().map(|weight| weight.abs()).sum())
            .collect();
        let mut kept = Self {
            offsets: vec![0],
            ring: Vec::new(),
            weights: Vec::new(),
        };
        for node in 0..node_count {
            for (&other, &weight) in self.ring[row(node)].iter().zip(&self.weights[row(node)]) {
                if weight.abs() >= NEGLIGIBLE * sums[node].min(sums[other as usize]) {
                    kept.ring.push(other);
                    kept.weights.push(weight);
                }
            }
            kept.offsets.push(kept.ring.len() as u32);
        }
        kept
    }

    /// The graph's matrix, held at its first node.
    pub fn laplacian(&self) -> AnchoredLaplacian<'_> {
        AnchoredLaplacian {
            ring_offsets: &self.offsets,
            ring: &self.ring,
            weights: &self.weights,
            anchor_vertex: 0,
        }
    }
}

/// What the skin of two vertices differs by, node by node.
fn weight_difference(skin: &Skin, from: usize, to: usize) -> Vec<(u32, f64)> {
    let mut difference: Vec<(u32, f64)> = Vec::with_capacity(8);
    for (v, sign) in [(from, 1.0), (to, -1.0)] {
        for (&node, &weight) in skin.nodes[v]
            .iter()
            .zip(&skin.weights[v])
            .filter(|&(_, &weight)| weight > 0)
        {
            let share = sign * f64::from(weight) / f64::from(SKIN_WEIGHT_SUM);
            match difference.iter_mut().find(|(other, _)| *other == u32::from(node)) {
                Some((_, sum)) => *sum += share,
                None => difference.push((u32::from(node), share)),
            }
        }
    }
    difference
}
