//! The table of formats: what a file's ending means, who reads it and who writes it. A new format is one file (or folder) of
//! its own and one row here.

use super::choose::Choice;
use super::error::SequenceError;
#[cfg(feature = "fbx")]
use super::fbx;
#[cfg(not(feature = "fbx"))]
use super::fbx_absent as fbx;
use super::mesh::PolygonMesh;
use super::scene::Scene;
use super::write::{FrameWriter, OutputSurface, WriteError};
use super::{abc, gltf, maya, md2, mdd, npy, obj, off, pc2, ply, usd};
use std::path::Path;

/// A kind of file.
pub struct Format {
    /// Name for messages.
    pub name: &'static str,
    /// Endings of file names, in small letters.
    pub extensions: &'static [&'static str],
    pub(crate) reading: Reading,
    /// Opens a file of this format for frames.
    pub(crate) writing: Option<Writing>,
}

/// Opens a file for frames.
pub(crate) type Writing = fn(&Path, &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError>;

/// What a file of a format holds.
pub(crate) enum Reading {
    /// One shape; a folder of them is a sequence.
    Shape(ShapeReader),
    /// Meshes and how they move.
    Scene(fn(&Path, &Choice) -> Result<Box<dyn Scene>, SequenceError>),
    /// How the vertices of a mesh move that another file holds.
    Points(fn(&Path, &Choice) -> Result<Box<dyn Scene>, SequenceError>),
}

/// Reads a file that holds one shape; the path serves messages only. Takes memory in proportion to the bytes.
#[derive(Clone, Copy)]
pub(crate) struct ShapeReader {
    /// Positions and faces.
    pub(crate) shape: fn(&[u8], &Path) -> Result<PolygonMesh, SequenceError>,
    /// Adds texture, materials and colours to a shape that was read from the same bytes: wanted of the reference alone, and
    /// never a reason to refuse it. The error says what was wrong with them.
    pub(crate) dress: fn(&[u8], &Path, &mut PolygonMesh) -> Result<(), String>,
}

/// All formats.
pub static FORMATS: [Format; 13] = [
    abc::FORMAT,
    gltf::FORMAT,
    usd::FORMAT,
    fbx::FORMAT,
    md2::FORMAT,
    obj::FORMAT,
    ply::FORMAT,
    off::FORMAT,
    npy::FORMAT,
    npy::NPZ,
    pc2::FORMAT,
    mdd::FORMAT,
    maya::FORMAT,
];

impl Format {
    /// The format that a file name's ending says, whatever its case.
    pub fn of_path(path: &Path) -> Option<&'static Format> {
        let extension = path.extension()?.to_str()?;
        let says = |known: &&str| extension.eq_ignore_ascii_case(known);
        FORMATS.iter().find(|format| format.extensions.iter().any(says))
    }

    /// The reader, if a file of this format is one shape.
    pub(crate) fn shape_reader(&self) -> Option<ShapeReader> {
        match self.reading {
            Reading::Shape(reader) => Some(reader),
            Reading::Scene(_) | Reading::Points(_) => None,
        }
    }
}

impl core::fmt::Debug for Format {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name)
    }
}

impl PolygonMesh {
    /// Reads one shape from the bytes of a file whose format holds one: OBJ, PLY or OFF, as the ending of `path` says.
    ///
    /// Errors: `UnknownKind` for other files; `Parse`, `NonFinite`, `IndexOutOfRange`, `NoFaces`, `TooLarge`. Takes memory in
    /// proportion to `bytes`.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<PolygonMesh, SequenceError> {
        let reader = Format::of_path(path).and_then(Format::shape_reader);
        let reader = reader.ok_or_else(|| SequenceError::UnknownKind {
            path: path.to_path_buf(),
        })?;
        (reader.shape)(bytes, path)?.checked(path)
    }
}

/// All formats as a table for people, a line each.
pub fn format_table() -> String {
    let line = |format: &Format| {
        let endings: Vec<String> = format.extensions.iter().map(|ending| format!(".{ending}")).collect();
        let holds = match format.reading {
            Reading::Shape(_) => "one shape a file: a folder of them is a sequence",
            Reading::Points(_) => "points without faces, on a mesh file (--surface)",
            Reading::Scene(_) => "meshes and how they move",
        };
        let written = if format.writing.is_some() {
            "read, written"
        } else {
            "read"
        };
        format!("  {:<11} {:<20} {written:<14} {holds}", format.name, endings.join(" "))
    };
    FORMATS.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The endings of files that hold meshes and how they move, for messages.
pub(crate) fn scene_endings() -> String {
    let scenes = FORMATS
        .iter()
        .filter(|format| !matches!(format.reading, Reading::Shape(_)));
    let endings: Vec<String> = scenes
        .flat_map(|format| format.extensions)
        .map(|ending| format!(".{ending}"))
        .collect();
    endings.join(", ")
}
