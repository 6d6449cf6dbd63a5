//! One shape as a scene: a mesh that nothing moves. It can be listed and converted; to learn from, it takes several.

use super::error::SequenceError;
use super::folder::{file_name, read_file};
use super::format::ShapeReader;
use super::mesh::PolygonMesh;
use super::notice::Notice;
use super::scene::{Contents, MeshEntry, Moment, Motion, Scene, Space};
use std::path::Path;

struct Still {
    mesh: PolygonMesh,
    contents: Contents,
}

/// Opens a file that holds one shape.
///
/// Errors: whatever is wrong with the file.
pub(crate) fn open(path: &Path, format: &'static str, reader: ShapeReader) -> Result<Box<dyn Scene>, SequenceError> {
    let bytes = read_file(path)?;
    let mut mesh = (reader.shape)(&bytes, path)?.checked(path)?;
    let mut contents = Contents {
        format,
        ..Contents::default()
    };
    if let Err(problem) = (reader.dress)(&bytes, path, &mut mesh) {
        contents.notices.push(Notice::TextureIgnored { problem });
    }
    contents.meshes.push(MeshEntry {
        name: file_name(path),
        vertex_count: mesh.positions.len(),
        face_count: mesh.face_count(),
        joint_count: 0,
        morphs: Vec::new(),
        motion: Motion::Still,
    });
    Ok(Box::new(Still { mesh, contents }))
}

impl Scene for Still {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, _: usize) -> Result<PolygonMesh, SequenceError> {
        Ok(self.mesh.clone())
    }

    fn positions(&mut self, _: usize, _: Moment, _: Space, out: &mut Vec<[f32; 3]>) -> Result<(), SequenceError> {
        out.clone_from(&self.mesh.positions);
        Ok(())
    }

    fn frame_name(&self, _: usize, _: usize) -> String {
        self.contents.meshes[0].name.clone()
    }
}
