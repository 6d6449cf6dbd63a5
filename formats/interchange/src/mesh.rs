//! One shape as its file has it: positions and polygons, and what stands on them, before shapes are compared and triangulated.

use super::error::SequenceError;
use super::skin::Skin;
use std::path::Path;

/// Stands for the texture coordinate of a corner that has none.
pub const UNTEXTURED: u32 = u32::MAX;

/// One shape: positions and polygons in the order of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PolygonMesh {
    /// Positions, all finite. Shape: `[V][3]`.
    pub positions: Vec<[f32; 3]>,
    /// Corners of all faces, one after the other; every index < V. Counter-clockwise seen from outside.
    pub corners: Vec<u32>,
    /// Where each face ends in `corners`. Shape: `[F]`, increasing by at least 3.
    pub face_ends: Vec<u32>,
    /// Points, lines and other elements of the file that are no faces.
    pub ignored_element_count: usize,
    /// Texture coordinates, where the file has some.
    pub texture: Option<CornerTexture>,
    /// Materials, colours and skin.
    pub dress: Dress,
    /// The file's format gives a vertex one texture coordinate and one normal, so that seams part into vertices that lie and move
    /// together.
    pub is_split: bool,
}

/// Texture coordinates by corners.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CornerTexture {
    /// Texture coordinates, finite; v grows upwards.
    pub uvs: Vec<[f32; 2]>,
    /// The texture coordinate of each corner, or [`UNTEXTURED`]. As many as the mesh has corners.
    pub corners: Vec<u32>,
}

/// What a surface wears besides texture coordinates: carried from file to file, not used for learning.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Dress {
    /// Names of materials.
    pub materials: Vec<String>,
    /// The material of each face, an index into `materials`; empty where there are none.
    pub face_materials: Vec<u32>,
    /// Red, green, blue, alpha from 0 to 1 of each vertex; empty where there are none.
    pub colors: Vec<[f32; 4]>,
    /// Joints and their hold on vertices.
    pub skin: Option<Skin>,
}

impl Dress {
    /// Nothing.
    pub const EMPTY: Dress = Dress {
        materials: Vec::new(),
        face_materials: Vec::new(),
        colors: Vec::new(),
        skin: None,
    };
}

impl PolygonMesh {
    /// Refuses a mesh without faces, or with more of anything than an index can count.
    pub(super) fn checked(self, path: &Path) -> Result<PolygonMesh, SequenceError> {
        if self.face_ends.is_empty() {
            return Err(SequenceError::NoFaces {
                path: path.to_path_buf(),
            });
        }
        if self.corners.len() >= u32::MAX as usize {
            return Err(SequenceError::TooLarge {
                path: path.to_path_buf(),
                count: self.corners.len(),
                what: "corners of faces",
            });
        }
        Self::check_vertex_count(self.positions.len(), path)?;
        Ok(self)
    }

    /// F, polygons counted once.
    pub fn face_count(&self) -> usize {
        self.face_ends.len()
    }

    /// Where the corners of face `f` lie, which must be < F.
    pub fn corners_of(&self, f: usize) -> core::ops::Range<usize> {
        let start = if f == 0 { 0 } else { self.face_ends[f - 1] };
        start as usize..self.face_ends[f] as usize
    }

    /// Corners of face `f`, which must be < F.
    pub fn face(&self, f: usize) -> &[u32] {
        &self.corners[self.corners_of(f)]
    }

    /// Ends the face whose corners were pushed since the last one; with fewer than three it is no surface and is counted
    /// as ignored. Whether it was kept.
    pub(super) fn end_face(&mut self) -> bool {
        let start = self.face_ends.last().map_or(0, |&end| end as usize);
        let is_face = self.corners.len() - start >= 3;
        if is_face {
            // A mesh that is too large to count is refused as a whole.
            self.face_ends.push(self.corners.len().min(u32::MAX as usize) as u32);
        } else {
            self.corners.truncate(start);
            self.ignored_element_count += 1;
        }
        is_face
    }

    /// Refuses a mesh whose vertices a u32 cannot count.
    pub(super) fn check_vertex_count(count: usize, path: &Path) -> Result<(), SequenceError> {
        if count >= u32::MAX as usize {
            return Err(SequenceError::TooLarge {
                path: path.to_path_buf(),
                count,
                what: "vertices",
            });
        }
        Ok(())
    }
}
