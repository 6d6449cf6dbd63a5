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
    /// The reference's texture coordinates, where its files have some.
    pub render: Option<RenderSurface>,
}

/// What an engine draws: vertices, several where texture coordinates tear the surface open. R render vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderSurface {
    /// The vertex that each stands for. Shape: `[R]`; every index < V.
    pub vertices: Vec<u32>,
    /// Texture coordinates as in the file. Shape: `[R]`, finite.
    pub uvs: Vec<[f32; 2]>,
    /// Triangles by render vertices. Shape: `[F]`; every index < R.
    pub faces: Vec<[u32; 3]>,
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
