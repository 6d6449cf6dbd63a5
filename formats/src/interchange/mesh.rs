//! One shape as its file has it: positions and polygons, before shapes are compared and triangulated.

use super::error::SequenceError;
use super::{obj, off, ply};
use std::path::Path;

/// The kinds of mesh file that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshKind {
    /// Wavefront OBJ.
    Obj,
    /// Polygon File Format, ascii or binary.
    Ply,
    /// Object File Format, text.
    Off,
}

impl MeshKind {
    /// The kind that a file name's ending says, whatever its case; none if it is not a mesh.
    pub fn of_path(path: &Path) -> Option<MeshKind> {
        let extension = path.extension()?.to_str()?;
        [MeshKind::Obj, MeshKind::Ply, MeshKind::Off]
            .into_iter()
            .find(|kind| extension.eq_ignore_ascii_case(kind.name()))
    }

    /// Name for messages.
    pub fn name(self) -> &'static str {
        match self {
            MeshKind::Obj => "OBJ",
            MeshKind::Ply => "PLY",
            MeshKind::Off => "OFF",
        }
    }
}

/// One shape: positions and polygons in the order of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PolygonMesh {
    /// Positions, all finite. Shape: `[V][3]`.
    pub positions: Vec<[f32; 3]>,
    /// Corners of all faces, one after the other; every index < V.
    pub corners: Vec<u32>,
    /// Where each face ends in `corners`. Shape: `[F]`, increasing by at least 3.
    pub face_ends: Vec<usize>,
    /// Points, lines and other elements of the file that are no faces.
    pub ignored_element_count: usize,
}

impl PolygonMesh {
    /// Reads one shape from the bytes of a file; `path` serves messages only.
    ///
    /// Errors: `Parse`, `NonFinite`, `IndexOutOfRange`, `NoFaces`, `TooLarge`. Takes memory in proportion to `bytes`.
    pub fn parse(kind: MeshKind, bytes: &[u8], path: &Path) -> Result<PolygonMesh, SequenceError> {
        let mesh = match kind {
            MeshKind::Obj => obj::parse(bytes, path),
            MeshKind::Ply => ply::parse(bytes, path),
            MeshKind::Off => off::parse(bytes, path),
        }?;
        if mesh.face_ends.is_empty() {
            return Err(SequenceError::NoFaces {
                path: path.to_path_buf(),
            });
        }
        Ok(mesh)
    }

    /// F, polygons counted once.
    pub fn face_count(&self) -> usize {
        self.face_ends.len()
    }

    /// Corners of face `f`, which must be < F.
    pub fn face(&self, f: usize) -> &[u32] {
        let start = if f == 0 { 0 } else { self.face_ends[f - 1] };
        &self.corners[start..self.face_ends[f]]
    }

    /// Ends the face whose corners were pushed since the last one; with fewer than three it is no surface and is counted
    /// as ignored.
    pub(super) fn end_face(&mut self) {
        let start = self.face_ends.last().copied().unwrap_or(0);
        if self.corners.len() - start < 3 {
            self.corners.truncate(start);
            self.ignored_element_count += 1;
        } else {
            self.face_ends.push(self.corners.len());
        }
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
