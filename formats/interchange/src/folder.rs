//! A folder of mesh files, one a shape, in natural order; and the names of files.

use super::bytes::refuse_pointer;
use super::error::SequenceError;
use super::format::{Format, ShapeReader};
use super::mesh::PolygonMesh;
use super::notice::Notice;
use super::scene::{ClipEntry, Contents, MeshEntry, Moment, Motion, Scene, Space};
use std::fs;
use std::path::{Path, PathBuf};

/// Corners of a face that are quoted when it differs.
const QUOTED_CORNERS_MAX: usize = 8;

/// The files of a folder; hidden files and folders are left out.
pub(super) struct Folder {
    /// Mesh files of any kind, in natural order: `frame2` before `frame10`.
    pub(super) files: Vec<PathBuf>,
    /// Names of the others, sorted.
    pub(super) others: Vec<String>,
}

impl Folder {
    pub(super) fn list(path: &Path) -> Result<Folder, SequenceError> {
        let mut folder = Folder {
            files: Vec::new(),
            others: Vec::new(),
        };
        for file in entries(path)? {
            let name = file_name(&file);
            // Hidden files are leavings of other systems: `._frame1.obj` holds no mesh.
            if name.starts_with('.') || !file.is_file() {
                continue;
            }
            match shape_format(&file) {
                Some(_) => folder.files.push(file),
                None => folder.others.push(name),
            }
        }
        folder.files.sort_by(|a, b| {
            let by_number = natord::compare(&file_name(a), &file_name(b));
            by_number.then_with(|| a.cmp(b))
        });
        folder.others.sort();
        Ok(folder)
    }

    /// A folder inside `path` that holds shapes: what the user may have meant. The first by name.
    fn nearby(path: &Path) -> Result<Option<PathBuf>, SequenceError> {
        let mut folders: Vec<PathBuf> = entries(path)?.into_iter().filter(|entry| entry.is_dir()).collect();
        folders.sort();
        let holds_shapes = |folder: &PathBuf| {
            let meshes = Folder::list(folder).is_ok_and(|inside| inside.files.len() > 1);
            meshes || folder.join("positions.npy").is_file()
        };
        Ok(folders.into_iter().find(holds_shapes))
    }
}

fn shape_format(path: &Path) -> Option<&'static Format> {
    Format::of_path(path).filter(|format| format.shape_reader().is_some())
}

fn entries(path: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let io = |source| SequenceError::Io {
        path: path.to_path_buf(),
        source,
    };
    fs::read_dir(path)
        .map_err(io)?
        .map(|entry| entry.map(|entry| entry.path()).map_err(io))
        .collect()
}

/// The last part of a path, for messages.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

/// The whole file.
pub(super) fn read_file(path: &Path) -> Result<Vec<u8>, SequenceError> {
    let bytes = fs::read(path).map_err(|source| SequenceError::Io {
        path: path.to_path_buf(),
        source,
    })?;
    refuse_pointer(&bytes, path)?;
    Ok(bytes)
}

/// Shapes of one folder: one mesh, one clip.
struct ShapeFolder {
    files: Vec<PathBuf>,
    reader: ShapeReader,
    /// The first shape with texture and dress.
    reference: PolygonMesh,
    contents: Contents,
}

/// Opens a folder of mesh files.
///
/// Errors: `EmptyFolder`, `MixedKinds`, `OneShapeOnly`, and whatever is wrong with the first file.
pub(super) fn open(path: &Path) -> Result<Box<dyn Scene>, SequenceError> {
    let Folder { files, others } = Folder::list(path)?;
    let formats: Vec<&Format> = files.iter().filter_map(|file| shape_format(file)).collect();
    let (Some(first), Some(format)) = (files.first(), formats.first()) else {
        return Err(SequenceError::EmptyFolder {
            path: path.into(),
            nearby: Folder::nearby(path)?,
        });
    };
    if let Some(other) = formats.iter().position(|other| other.name != format.name) {
        return Err(SequenceError::MixedKinds {
            path: path.into(),
            first: format.name,
            first_file: file_name(first),
            second: formats[other].name,
            second_file: file_name(&files[other]),
        });
    }
    let Some(reader) = format.shape_reader().filter(|_| files.len() > 1) else {
        return Err(SequenceError::OneShapeOnly { path: first.clone() });
    };
    let mut notices = Vec::new();
    if let Some(example) = others.first() {
        notices.push(Notice::IgnoredFiles {
            count: others.len(),
            example: example.clone(),
        });
    }
    let bytes = read_file(first)?;
    let mut reference = (reader.shape)(&bytes, first)?.checked(first)?;
    if let Err(problem) = (reader.dress)(&bytes, first, &mut reference) {
        notices.push(Notice::TextureIgnored { problem });
    }
    let mesh = MeshEntry {
        name: file_name(path),
        vertex_count: reference.positions.len(),
        face_count: reference.face_count(),
        joint_count: 0,
        morphs: Vec::new(),
        motion: Motion::Deforms,
    };
    let contents = Contents {
        format: format.name,
        meshes: vec![mesh],
        clips: vec![ClipEntry::untimed(file_name(path), files.len())],
        notices,
        ..Contents::default()
    };
    Ok(Box::new(ShapeFolder {
        files,
        reader,
        reference,
        contents,
    }))
}

impl Scene for ShapeFolder {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, _: usize) -> Result<PolygonMesh, SequenceError> {
        Ok(self.reference.clone())
    }

    fn positions(&mut self, _: usize, moment: Moment, _: Space, out: &mut Vec<[f32; 3]>) -> Result<(), SequenceError> {
        let frame = match moment {
            Moment::Rest => 0,
            Moment::At { time, .. } => time as usize,
        };
        out.clear();
        if frame == 0 {
            out.extend_from_slice(&self.reference.positions);
            return Ok(());
        }
        let file = &self.files[frame];
        let mesh = (self.reader.shape)(&read_file(file)?, file)?.checked(file)?;
        check_same_faces(&self.reference, &mesh, &file_name(&self.files[0]), file)?;
        *out = mesh.positions;
        Ok(())
    }

    fn frame_name(&self, _: usize, frame: usize) -> String {
        file_name(&self.files[frame])
    }
}

/// Refuses a shape with other counts or other faces than the reference.
fn check_same_faces(
    reference: &PolygonMesh,
    mesh: &PolygonMesh,
    reference_name: &str,
    file: &Path,
) -> Result<(), SequenceError> {
    let (path, name) = (file.to_path_buf(), reference_name.to_string());
    let (expected, found) = (reference.positions.len(), mesh.positions.len());
    if expected != found {
        return Err(SequenceError::VertexCountDiffers {
            path,
            reference: name,
            expected,
            found,
        });
    }
    let (expected, found) = (reference.face_count(), mesh.face_count());
    if expected != found {
        return Err(SequenceError::FaceCountDiffers {
            path,
            reference: name,
            expected,
            found,
        });
    }
    if reference.corners == mesh.corners && reference.face_ends == mesh.face_ends {
        return Ok(());
    }
    let differs = (0..expected).find(|&f| reference.face(f) != mesh.face(f)).unwrap_or(0);
    let quoted = |corners: &[u32]| corners[..corners.len().min(QUOTED_CORNERS_MAX)].to_vec();
    Err(SequenceError::FacesDiffer {
        path,
        reference: name,
        face: differs,
        expected: quoted(reference.face(differs)),
        found: quoted(mesh.face(differs)),
    })
}
