//! A mesh sequence: shapes of one connectivity, the trainer's only input.

use super::mesh::Dress;
use super::scene::UpAxis;
use super::store::ShapeStore;

/// N shapes of V vertices and F triangles with one connectivity, vertex order kept as in the files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshSequence {
    /// Name of the sequence: the last part of its path.
    pub name: String,
    /// Triangles, counter-clockwise seen from outside in right-handed coordinates: the side from which the corners turn so is the
    /// front, and normals point there. Shape: `[F]`; every index < V.
    pub faces: Vec<[u32; 3]>,
    /// Positions. Shape: `[N][V][3]`, units and axes of the source; shape 0 is the reference.
    pub shapes: ShapeStore<3>,
    /// Where each shape comes from, for messages: a file name, or `positions.npy[12]`. Shape: `[N]`.
    pub shape_names: Vec<String>,
    /// What an engine draws, where that is not the surface itself: texture coordinates, and vertices that seams part.
    pub render: Option<RenderSurface>,
    /// Materials by triangles, colours and skin by vertices: passed on, not learned from.
    pub dress: Dress,
    /// Length of a unit in metres, where the source says so.
    pub unit_metres: Option<f64>,
    /// The axis that points up, where the source says so.
    pub up: Option<UpAxis>,
    /// Frames a second, where the source says so.
    pub fps: Option<f64>,
}

/// What an engine draws: vertices, several where texture coordinates or normals tear the surface open. R render vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderSurface {
    /// The vertex that each stands for. Shape: `[R]`; every index < V.
    pub vertices: Vec<u32>,
    /// Texture coordinates as in the file. Shape: `[R]`, finite; v grows upwards.
    pub uvs: Vec<[f32; 2]>,
    /// Triangles by render vertices. Shape: `[F]`; every index < R.
    pub faces: Vec<[u32; 3]>,
}

impl MeshSequence {
    /// V.
    pub fn vertex_count(&self) -> usize {
        self.shapes.vertex_count()
    }

    /// N.
    pub fn shape_count(&self) -> usize {
        self.shapes.len()
    }
}
