//! The rest surface of a package: the very rings that the network was trained on (bridges come from the package, not
//! from a new search) and their cotangent weights.

use sinew_formats::package::CompactView;

use super::factor::AnchoredLaplacian;
use crate::mesh::{cotangent::EdgeWeights, topology::Topology, widened};

/// Connectivity and weights of a package's rest shape, source order. V vertices.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Shape: `[V]`, units of the source.
    pub rest: Vec<[f64; 3]>,
    /// One-rings with the package's bridges.
    pub topology: Topology,
    /// Cotangent weights, aligned with the topology's rings.
    pub weights: EdgeWeights,
}

impl Surface {
    /// Rebuilds the surface that the trainer had.
    pub fn of_package(package: &CompactView<'_>) -> Self {
        let rest = widened(package.rest_positions());
        let topology = Topology::with_bridges(&package.faces().to_vec(), &rest, package.bridges());
        let weights = EdgeWeights::new(&topology, &rest);
        Self {
            rest,
            topology,
            weights,
        }
    }

    /// The solver's matrix, held at `anchor_vertex`.
    pub fn laplacian(&self, anchor_vertex: usize) -> AnchoredLaplacian<'_> {
        AnchoredLaplacian {
            ring_offsets: &self.topology.ring_offsets,
            ring: &self.topology.ring,
            weights: &self.weights.weights,
            anchor_vertex,
        }
    }

    /// What a gradient counts in the right-hand side, `sum_j c_ij |r_i - r_j|^2`: four times the vertex's area, where no
    /// weight was clamped. Shape: `[V]`.
    pub fn gradient_areas(&self) -> Vec<f64> {
        let area = |v: usize| {
            let entries = self.topology.entries_of(v);
            let squared = |j: u32| {
                (0..3)
                    .map(|c| (self.rest[v][c] - self.rest[j as usize][c]).powi(2))
                    .sum::<f64>()
            };
            entries
                .map(|entry| self.weights.weights[entry] * squared(self.topology.ring[entry]))
                .sum()
        };
        (0..self.topology.vertex_count).map(area).collect()
    }

    /// Vertices by falling distance in edges from `vertex`: all but the last have a neighbour that comes later.
    pub fn towards(&self, vertex: usize) -> Vec<u32> {
        let mut met = vec![false; self.topology.vertex_count];
        met[vertex] = true;
        let mut order = vec![vertex as u32];
        let mut next = 0;
        while let Some(&v) = order.get(next) {
            next += 1;
            for entry in self.topology.entries_of(v as usize) {
                let j = self.topology.ring[entry];
                if !core::mem::replace(&mut met[j as usize], true) {
                    order.push(j);
                }
            }
        }
        order.reverse();
        order
    }
}
