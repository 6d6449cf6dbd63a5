//! A mesh sequence: shapes of one connectivity, the trainer's only input.

/// N shapes of V vertices and F triangles with one connectivity, vertex order kept as in the files.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshSequence {
    /// Name of the sequence: the last part of its path.
    pub name: String,
    /// Triangles. Shape: `[F]`; every index < V.
    pub faces: Vec<[u32; 3]>,
    /// Positions. Shape: `[N][V][3]`, units of the source; shape 0 is the reference.
    pub shapes: Vec<Vec<[f32; 3]>>,
    /// Where each shape comes from, for messages: a file name, or `positions.npy[12]`. Shape: `[N]`.
    pub shape_names: Vec<String>,
}

impl MeshSequence {
    /// V.
    pub fn vertex_count(&self) -> usize {
        self.shapes.first().map_or(0, Vec::len)
    }

    /// N.
    pub fn shape_count(&self) -> usize {
        self.shapes.len()
    }
}
