//! Connectivity of a sequence: one-rings, boundaries, separate pieces and the bridges that tie them together.

/// One-rings and what is unusual about the mesh. V vertices.
#[derive(Debug, Clone)]
pub struct Topology {
    /// V.
    pub vertex_count: usize,
    /// Triangles. Shape: `[F]`.
    pub faces: Vec<[u32; 3]>,
    /// Compressed rows over `ring`, bridges included. Shape: `[V + 1]`.
    pub ring_offsets: Vec<u32>,
    /// Neighbours, ascending within a row.
    pub ring: Vec<u32>,
    /// Extra edges `[from, to]`, `from < to`, sorted, that tie separate pieces and loose vertices to their nearest neighbours.
    pub bridges: Vec<[u32; 2]>,
    /// What a user should know about the mesh.
    pub findings: TopologyFindings,
}

/// Counts of what is unusual; none of it is fatal.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TopologyFindings {
    /// Connected pieces with at least one face.
    pub piece_count: usize,
    /// Vertices in no face.
    pub isolated_vertex_count: usize,
    /// Edges with one face.
    pub boundary_edge_count: usize,
    /// Edges with more than two faces.
    pub non_manifold_edge_count: usize,
    /// Vertices that share their rest position with an earlier one.
    pub duplicate_vertex_count: usize,
    /// Faces of zero area at rest.
    pub zero_area_face_count: usize,
}

impl Topology {
    /// Neighbours of `v`, bridges included, ascending.
    pub fn ring_of(&self, v: usize) -> &[u32] {
        &self.ring[self.ring_offsets[v] as usize..self.ring_offsets[v + 1] as usize]
    }
}
