//! Writes results for other programs: OBJ, PLY and npy. Every file is written under a temporary name beside its place and
//! then renamed, so that none is ever half there; float text reads back to the same bits.

use super::sequence::MeshSequence;
use std::fs;
use std::io::{self, BufWriter, Write};
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
}

/// Writes one shape as OBJ. Shape: `positions` `[V][3]`, `faces` `[F]`, counted from 0.
///
/// Errors: `Io`.
pub fn write_obj(path: &Path, positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Result<(), WriteError> {
    write_file(path, |out| {
        for [x, y, z] in positions {
            writeln!(out, "v {x} {y} {z}")?;
        }
        for face in faces {
            let [a, b, c] = face.map(|v| u64::from(v) + 1);
            writeln!(out, "f {a} {b} {c}")?;
        }
        Ok(())
    })
}

/// Writes one shape as OBJ with texture coordinates. Shape: `positions` `[V]`, `faces` `[F]`, `uvs` `[R]`, `uv_faces` `[F]`: the
/// texture coordinates of each triangle's corners, counted from 0.
///
/// Errors: `Io`; `LengthDiffers` unless both kinds of faces are F.
pub fn write_textured_obj(
    path: &Path,
    positions: &[[f32; 3]],
    faces: &[[u32; 3]],
    uvs: &[[f32; 2]],
    uv_faces: &[[u32; 3]],
) -> Result<(), WriteError> {
    check_length(path, "texture faces", Some(uv_faces.len()), faces.len())?;
    write_file(path, |out| {
        for [x, y, z] in positions {
            writeln!(out, "v {x} {y} {z}")?;
        }
        for [u, v] in uvs {
            writeln!(out, "vt {u} {v}")?;
        }
        for (face, corners) in faces.iter().zip(uv_faces) {
            let [a, b, c] = face.map(|v| u64::from(v) + 1);
            let [r, s, t] = corners.map(|r| u64::from(r) + 1);
            writeln!(out, "f {a}/{r} {b}/{s} {c}/{t}")?;
        }
        Ok(())
    })
}

/// Writes one shape as binary little-endian PLY. Shape: `positions` and `normals` `[V][3]`, `colors` `[V]` red, green, blue,
/// `faces` `[F]`.
///
/// Errors: `Io`; `LengthDiffers` unless normals and colours have V items.
pub fn write_ply(
    path: &Path,
    positions: &[[f32; 3]],
    faces: &[[u32; 3]],
    normals: Option<&[[f32; 3]]>,
    colors: Option<&[[u8; 3]]>,
) -> Result<(), WriteError> {
    check_length(path, "normals", normals.map(<[_]>::len), positions.len())?;
    check_length(path, "colours", colors.map(<[_]>::len), positions.len())?;
    write_file(path, |out| {
        writeln!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}",
            positions.len()
        )?;
        writeln!(out, "property float x\nproperty float y\nproperty float z")?;
        if normals.is_some() {
            writeln!(out, "property float nx\nproperty float ny\nproperty float nz")?;
        }
        if colors.is_some() {
            writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
        }
        writeln!(
            out,
            "element face {}\nproperty list uchar uint vertex_indices\nend_header",
            faces.len()
        )?;
        for v in 0..positions.len() {
            write_f32(out, &positions[v])?;
            if let Some(normals) = normals {
                write_f32(out, &normals[v])?;
            }
            if let Some(colors) = colors {
                out.write_all(&colors[v])?;
            }
        }
        for face in faces {
            out.write_all(&[3])?;
            face.iter().try_for_each(|v| out.write_all(&v.to_le_bytes()))?;
        }
        Ok(())
    })
}

/// Writes shapes as one npy array of f32 `[N][V][3]`.
///
/// Errors: `Io`; `LengthDiffers` unless all shapes have as many vertices.
pub fn write_npy_f32<S: AsRef<[[f32; 3]]>>(path: &Path, shapes: &[S]) -> Result<(), WriteError> {
    let vertex_count = shapes.first().map_or(0, |shape| shape.as_ref().len());
    for shape in shapes {
        check_length(path, "a shape", Some(shape.as_ref().len()), vertex_count)?;
    }
    write_file(path, |out| {
        write_npy_header(out, "<f4", &[shapes.len(), vertex_count, 3])?;
        shapes
            .iter()
            .try_for_each(|shape| write_f32(out, shape.as_ref().as_flattened()))
    })
}

/// Writes one shape as an npy array of f32 `[V][3]`.
///
/// Errors: `Io`.
pub fn write_npy_vertices(path: &Path, positions: &[[f32; 3]]) -> Result<(), WriteError> {
    write_file(path, |out| {
        write_npy_header(out, "<f4", &[positions.len(), 3])?;
        write_f32(out, positions.as_flattened())
    })
}

/// Writes rows of `columns` numbers as an npy array of f32 `[rows][columns]`. Without columns there are no rows.
///
/// Errors: `Io`; `LengthDiffers` if the last row is cut.
pub fn write_npy_matrix(path: &Path, values: &[f32], columns: usize) -> Result<(), WriteError> {
    let rows = values.len() / columns.max(1);
    check_length(path, "the matrix", Some(values.len()), rows * columns)?;
    write_file(path, |out| {
        write_npy_header(out, "<f4", &[rows, columns])?;
        write_f32(out, values)
    })
}

/// Writes triangles as an npy array of u32 `[F][3]`.
///
/// Errors: `Io`.
pub fn write_npy_u32(path: &Path, faces: &[[u32; 3]]) -> Result<(), WriteError> {
    write_file(path, |out| {
        write_npy_header(out, "<u4", &[faces.len(), 3])?;
        faces
            .as_flattened()
            .iter()
            .try_for_each(|v| out.write_all(&v.to_le_bytes()))
    })
}

/// Writes a sequence as `positions.npy` and `faces.npy` into `folder`, which is made if it is missing.
///
/// Errors: `Io`; `LengthDiffers` unless all shapes have as many vertices.
pub fn write_sequence_npy(folder: &Path, sequence: &MeshSequence) -> Result<(), WriteError> {
    make_folder(folder)?;
    write_npy_u32(&folder.join("faces.npy"), &sequence.faces)?;
    write_npy_f32(&folder.join("positions.npy"), &sequence.shapes)
}

/// Writes a sequence as `shape_0000.obj`, `shape_0001.obj` and so on into `folder`, which is made if it is missing.
///
/// Errors: `Io`; shapes written before it stay.
pub fn write_sequence_obj(folder: &Path, sequence: &MeshSequence) -> Result<(), WriteError> {
    make_folder(folder)?;
    for (m, shape) in sequence.shapes.iter().enumerate() {
        let path = folder.join(format!("shape_{m:04}.obj"));
        match &sequence.render {
            Some(render) => write_textured_obj(&path, shape, &sequence.faces, &render.uvs, &render.faces)?,
            None => write_obj(&path, shape, &sequence.faces)?,
        }
    }
    Ok(())
}

fn check_length(path: &Path, what: &'static str, found: Option<usize>, expected: usize) -> Result<(), WriteError> {
    match found {
        Some(found) if found != expected => Err(WriteError::LengthDiffers {
            path: path.to_path_buf(),
            what,
            found,
            expected,
        }),
        _ => Ok(()),
    }
}

fn make_folder(folder: &Path) -> Result<(), WriteError> {
    fs::create_dir_all(folder).map_err(|source| WriteError::Io {
        path: folder.to_path_buf(),
        source,
    })
}

fn write_f32(out: &mut dyn Write, values: &[f32]) -> io::Result<()> {
    values.iter().try_for_each(|value| out.write_all(&value.to_le_bytes()))
}

/// Version 1.0, padded as numpy does so that the values begin at a multiple of 64 bytes.
fn write_npy_header(out: &mut dyn Write, descr: &str, shape: &[usize]) -> io::Result<()> {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let text = format!(
        "{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}",
        lengths.join(", ")
    );
    // Ten bytes stand before the text, and a line end behind the padding.
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&(length as u16).to_le_bytes())?;
    writeln!(out, "{text:<width$}", width = length - 1)
}

/// Writes `path` whole or not at all.
fn write_file(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let io = |source| WriteError::Io {
        path: path.to_path_buf(),
        source,
    };
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // The umask decides who may read the result, not the temporary file's own caution.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.prefix(".sinew-").tempfile_in(folder).map_err(io)?;
    let mut out = BufWriter::new(file);
    content(&mut out).map_err(io)?;
    let file = out.into_inner().map_err(|error| io(error.into_error()))?;
    file.persist(path).map_err(|error| io(error.error))?;
    Ok(())
}
