//! NumPy's npy: positions of all shapes in one array, triangles in another beside it.

mod array;
mod npz;
mod write;

use super::bytes::Bytes;
use super::error::SequenceError;
use super::folder::{Folder, file_name};
use super::format::{Format, Reading};
use super::mesh::PolygonMesh;
use super::notice::Notice;
use super::scene::{ClipEntry, Contents, MeshEntry, Moment, Motion, Scene, Space};
pub use array::NpyArray;
use std::path::Path;
pub use write::{write_npy_f32, write_npy_matrix, write_npy_u32, write_npy_vertices, write_sequence_npy};

pub(super) const FORMAT: Format = Format {
    name: "npy",
    extensions: &["npy"],
    reading: Reading::Scene(|path, _| open(path, None)),
    writing: Some(write::open),
};

pub(super) const NPZ: Format = Format {
    name: "npz",
    extensions: &["npz"],
    reading: Reading::Scene(|path, _| npz::open(path)),
    writing: None,
};

/// Positions and triangles of one mesh in two arrays.
struct Arrays {
    positions: NpyArray,
    faces: Vec<[u32; 3]>,
    contents: Contents,
}

/// Opens `positions.npy` and the `faces.npy` beside it; `folder` is the folder that the user gave, if it was one.
///
/// Errors: `MissingFaces`, `OneShapeOnly`, `Parse`, `IndexOutOfRange`, `TooLarge`.
pub(super) fn open(path: &Path, folder: Option<&Path>) -> Result<Box<dyn Scene>, SequenceError> {
    let faces_path = path.with_file_name("faces.npy");
    let faces = || {
        if faces_path.is_file() {
            Bytes::open(&faces_path)
        } else {
            Err(SequenceError::MissingFaces {
                path: faces_path.clone(),
            })
        }
    };
    arrays(
        Bytes::open(path)?,
        faces,
        FORMAT.name,
        folder.map_or(Ok(Vec::new()), ignored)?,
    )
}

/// Puts positions and faces together.
fn arrays(
    positions: Bytes,
    faces: impl FnOnce() -> Result<Bytes, SequenceError>,
    format: &'static str,
    notices: Vec<Notice>,
) -> Result<Box<dyn Scene>, SequenceError> {
    let path = &*positions.path().to_path_buf();
    let positions = NpyArray::new(positions)?;
    if positions.is_float() && positions.shape().len() == 2 && positions.shape()[1] == 3 {
        return Err(SequenceError::OneShapeOnly { path: path.into() });
    }
    positions.check_float_positions()?;
    let (shape_count, vertex_count) = (positions.shape()[0], positions.shape()[1]);
    if shape_count < 2 {
        return Err(SequenceError::OneShapeOnly { path: path.into() });
    }
    PolygonMesh::check_vertex_count(vertex_count, path)?;
    let faces = faces()?;
    let faces_path = faces.path().to_path_buf();
    let mut faces = NpyArray::new(faces)?;
    faces.check_triangles()?;
    let faces = faces.triangles(vertex_count)?;
    if faces.is_empty() {
        return Err(SequenceError::NoFaces { path: faces_path });
    }
    let mesh = MeshEntry {
        name: file_name(path),
        vertex_count,
        face_count: faces.len(),
        joint_count: 0,
        morphs: Vec::new(),
        motion: Motion::Deforms,
    };
    let contents = Contents {
        format,
        meshes: vec![mesh],
        clips: vec![ClipEntry::untimed(file_name(path), shape_count)],
        notices,
        ..Contents::default()
    };
    Ok(Box::new(Arrays {
        positions,
        faces,
        contents,
    }))
}

/// What lies in the folder beside the arrays.
fn ignored(folder: &Path) -> Result<Vec<Notice>, SequenceError> {
    let Folder { files, others } = Folder::list(folder)?;
    let is_array = |name: &&String| matches!(name.as_str(), "positions.npy" | "faces.npy");
    let first_mesh = files.first().map(|file| file_name(file));
    let example = first_mesh.or_else(|| others.iter().find(|name| !is_array(name)).cloned());
    let count = files.len() + others.iter().filter(|name| !is_array(name)).count();
    Ok(example
        .map(|example| Notice::IgnoredFiles { count, example })
        .into_iter()
        .collect())
}

impl Scene for Arrays {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, _: usize) -> Result<PolygonMesh, SequenceError> {
        let mut mesh = PolygonMesh {
            corners: self.faces.as_flattened().to_vec(),
            face_ends: (1..=self.faces.len())
                .map(|end| (3 * end).min(u32::MAX as usize) as u32)
                .collect(),
            ..PolygonMesh::default()
        };
        self.positions.positions(0, &mut mesh.positions)?;
        Ok(mesh)
    }

    fn positions(&mut self, _: usize, moment: Moment, _: Space, out: &mut Vec<[f32; 3]>) -> Result<(), SequenceError> {
        let n = match moment {
            Moment::Rest => 0,
            Moment::At { time, .. } => time as usize,
        };
        self.positions.positions(n, out)
    }

    fn frame_name(&self, clip: usize, frame: usize) -> String {
        format!("{}[{frame}]", self.contents.clips[clip].name)
    }
}
