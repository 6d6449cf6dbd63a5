//! The mean over one-rings and its transpose, the linear map inside every graph convolution (method section 2).

use crate::mesh::topology::Topology;

/// Compressed one-rings with their transpose, so that both directions are gathers and need no atomics. V vertices.
#[derive(Debug, Clone)]
pub struct RingMean {
    /// Shape: `[V + 1]`.
    pub(crate) offsets: Vec<u32>,
    /// Neighbours of each vertex.
    pub(crate) neighbours: Vec<u32>,
    /// One over the size of the ring; zero for a vertex without neighbours, whose mean is zero. Shape: `[V]`.
    pub(crate) inverse_degree: Vec<f32>,
    /// Rows of the transpose. Shape: `[V + 1]`.
    pub(crate) transposed_offsets: Vec<u32>,
    /// Vertices whose ring holds the row's vertex, ascending.
    pub(crate) transposed: Vec<u32>,
}

impl RingMean {
    /// The mean over the rings of a mesh, bridges included.
    pub fn new(topology: &Topology) -> Self {
        let vertex_count = topology.vertex_count;
        let offsets = topology.ring_offsets.clone();
        let neighbours = topology.ring.clone();
        let degree = |v: usize| offsets[v + 1] - offsets[v];
        let inverse_degree = (0..vertex_count)
            .map(|v| if degree(v) == 0 { 0.0 } else { 1.0 / degree(v) as f32 })
            .collect();
        let mut transposed_offsets = vec![0_u32; vertex_count + 1];
        for &j in &neighbours {
            transposed_offsets[j as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            transposed_offsets[v + 1] += transposed_offsets[v];
        }
        let mut cursor = transposed_offsets.clone();
        let mut transposed = vec![0; neighbours.len()];
        for v in 0..vertex_count {
            for &j in topology.ring_of(v) {
                transposed[cursor[j as usize] as usize] = v as u32;
                cursor[j as usize] += 1;
            }
        }
        Self {
            offsets,
            neighbours,
            inverse_degree,
            transposed_offsets,
            transposed,
        }
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.inverse_degree.len()
    }

    pub(crate) fn ring(&self, v: usize) -> &[u32] {
        &self.neighbours[self.offsets[v] as usize..self.offsets[v + 1] as usize]
    }

    pub(crate) fn transposed_ring(&self, v: usize) -> &[u32] {
        &self.transposed[self.transposed_offsets[v] as usize..self.transposed_offsets[v + 1] as usize]
    }
}
