//! Writes sequences frame by frame, in whatever format the file's ending names. Every file is written under a temporary name beside
//! its place and renamed at the end, so that none is ever half there.

mod file;
mod outline;
mod points;

use super::format::{FORMATS, Format};
use super::mesh::Dress;
use super::scene::UpAxis;
use super::sequence::{MeshSequence, RenderSurface};
pub(crate) use file::Output;
pub(crate) use outline::{Corners, corners, reversed};
pub(crate) use points::PointWriter;
use std::io;
use std::path::{Path, PathBuf};

/// Why a result could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The operating system refused.
    #[error("{}: cannot be written ({source}); check that the folder exists, its permissions and the disk's space", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Arrays that belong together have different lengths.
    #[error("{}: {what} has {found} items where {expected} are needed", path.display())]
    LengthDiffers {
        /// The file that was to be written.
        path: PathBuf,
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it should have.
        expected: usize,
    },
    /// No format that is written ends so.
    #[error(
        "{}: the name says no format that is written; give a folder, or a name that ends in one of {}",
        path.display(), written_endings()
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// A puppet is written as glTF alone.
    #[error("{}: joints and clips are written as glTF: give a name that ends in .glb or .gltf", path.display())]
    NotGltf {
        /// The file.
        path: PathBuf,
    },
    /// More than the format can count.
    #[error("{}: {count} {what} are more than {format} can count; choose fewer frames, or another format", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The format.
        format: &'static str,
        /// How many there are.
        count: usize,
        /// Of what.
        what: &'static str,
    },
}

/// What stays the same in every frame that is written.
#[derive(Debug, Clone, Copy)]
pub struct OutputSurface<'a> {
    /// Name of the mesh.
    pub name: &'a str,
    /// V.
    pub vertex_count: usize,
    /// Triangles. Shape: `[F]`; every index < V.
    pub faces: &'a [[u32; 3]],
    /// Texture coordinates and render vertices.
    pub render: Option<&'a RenderSurface>,
    /// Materials by triangles, colours and skin by vertices.
    pub dress: &'a Dress,
    /// Write render vertices where a format holds points alone.
    pub keep_split: bool,
    /// Frames a second.
    pub fps: f64,
    /// Length of a unit in metres, if it is known.
    pub unit_metres: Option<f64>,
    /// The axis that points up, if it is known.
    pub up: Option<UpAxis>,
    /// N, if it is known; one frame is no series.
    pub frame_count: Option<usize>,
}

/// Takes frames and writes them.
pub trait FrameWriter {
    /// Writes the next frame. Shape: `[V]`.
    ///
    /// Errors: `Io`; `LengthDiffers` unless there are V positions.
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError>;

    /// Writes what is left and gives the file its name. Without this call no file is left; of a series, those already written are.
    ///
    /// Errors: `Io`, `TooLarge`.
    fn finish(self: Box<Self>) -> Result<(), WriteError>;
}

/// Frames a second where nothing says them.
pub const DEFAULT_FPS: f64 = 24.0;

impl<'a> OutputSurface<'a> {
    /// Triangles alone.
    pub fn bare(name: &'a str, vertex_count: usize, faces: &'a [[u32; 3]]) -> OutputSurface<'a> {
        const NOTHING: &Dress = &Dress::EMPTY;
        OutputSurface {
            name,
            vertex_count,
            faces,
            render: None,
            dress: NOTHING,
            keep_split: false,
            fps: DEFAULT_FPS,
            unit_metres: None,
            up: None,
            frame_count: None,
        }
    }

    /// That of a sequence.
    pub fn of_sequence(sequence: &'a MeshSequence) -> OutputSurface<'a> {
        OutputSurface {
            render: sequence.render.as_ref(),
            dress: &sequence.dress,
            fps: sequence.fps.unwrap_or(DEFAULT_FPS),
            unit_metres: sequence.unit_metres,
            up: sequence.up,
            frame_count: Some(sequence.shape_count()),
            ..OutputSurface::bare(&sequence.name, sequence.vertex_count(), &sequence.faces)
        }
    }

    /// Refuses a frame of another number of vertices.
    pub(crate) fn check(&self, positions: &[[f32; 3]], path: &Path) -> Result<(), WriteError> {
        check_length(path, "a frame", positions.len(), self.vertex_count)
    }
}

/// Opens a file or folder for frames: as the ending of the name says, or a folder of OBJ files, where it has none.
///
/// Errors: `UnknownKind`, `Io`.
pub fn create_writer(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    if path.extension().is_none() || path.is_dir() {
        return super::obj::write_folder(path, surface);
    }
    let writing = Format::of_path(path).and_then(|format| format.writing);
    writing.ok_or_else(|| WriteError::UnknownKind { path: path.into() })?(path, surface)
}

/// Writes all shapes of a sequence, as the ending of the name says.
///
/// Errors: as of [`create_writer`] and [`FrameWriter`].
pub fn write_sequence(path: &Path, sequence: &MeshSequence) -> Result<(), WriteError> {
    let mut writer = create_writer(path, &OutputSurface::of_sequence(sequence))?;
    sequence.shapes.iter().try_for_each(|shape| writer.frame(shape))?;
    writer.finish()
}

/// The endings of files that are written, for messages.
pub(crate) fn written_endings() -> String {
    let written = FORMATS.iter().filter(|format| format.writing.is_some());
    let endings: Vec<String> = written.map(|format| format!(".{}", format.extensions[0])).collect();
    endings.join(", ")
}

pub(crate) fn check_length(path: &Path, what: &'static str, found: usize, expected: usize) -> Result<(), WriteError> {
    if found == expected {
        return Ok(());
    }
    Err(WriteError::LengthDiffers {
        path: path.into(),
        what,
        found,
        expected,
    })
}

pub(crate) fn make_folder(folder: &Path) -> Result<(), WriteError> {
    std::fs::create_dir_all(folder).map_err(|source| WriteError::Io {
        path: folder.into(),
        source,
    })
}
