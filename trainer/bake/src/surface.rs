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
        let topology = Topology::with_bridges(package.faces(), &rest, package.bridges());
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
}
