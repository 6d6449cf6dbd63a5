//! OBJ files: one shape each, text that reads back to the same bits.

use crate::mesh::Dress;
use crate::sequence::RenderSurface;
use crate::write::{Corners, FrameWriter, Output, OutputSurface, WriteError, check_length, corners, make_folder};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Writes one shape as OBJ, with texture coordinates, names of materials and colours where the surface has some.
///
/// Errors: `Io`; `LengthDiffers` unless there are V positions and as many texture faces as faces.
pub fn write_obj(path: &Path, positions: &[[f32; 3]], surface: &OutputSurface<'_>) -> Result<(), WriteError> {
    surface.check(positions, path)?;
    let corners = corners(surface);
    if !corners.uv_faces.is_empty() {
        check_length(path, "texture faces", corners.uv_faces.len(), corners.faces.len())?;
    }
    let mut out = Output::create(path)?;
    write(&mut out, positions, &corners, surface.dress).map_err(|source| out.fail(source))?;
    out.commit()
}

fn write(out: &mut dyn Write, positions: &[[f32; 3]], corners: &Corners<'_>, dress: &Dress) -> io::Result<()> {
    let colored = dress.colors.len() == positions.len();
    for (v, [x, y, z]) in positions.iter().enumerate() {
        write!(out, "v {x} {y} {z}")?;
        if colored {
            let [red, green, blue, _] = dress.colors[v];
            write!(out, " {red} {green} {blue}")?;
        }
        writeln!(out)?;
    }
    for [u, v] in corners.uvs {
        writeln!(out, "vt {u} {v}")?;
    }
    let mut material = None;
    for (f, face) in corners.faces.iter().enumerate() {
        let own = dress.face_materials.get(f).copied();
        if own != material
            && let Some(own) = own
        {
            // A name is one word.
            let name = dress.materials.get(own as usize).map_or("", String::as_str);
            writeln!(out, "usemtl {}", name.split_whitespace().collect::<Vec<_>>().join("_"))?;
            material = Some(own);
        }
        let [a, b, c] = face.map(|v| u64::from(v) + 1);
        match corners.uv_faces.get(f) {
            Some(face) => {
                let [r, s, t] = face.map(|r| u64::from(r) + 1);
                writeln!(out, "f {a}/{r} {b}/{s} {c}/{t}")?;
            }
            None => writeln!(out, "f {a} {b} {c}")?,
        }
    }
    Ok(())
}

/// Frames as files.
struct Series {
    folder: PathBuf,
    stem: String,
    /// One frame is one file of that name.
    single: bool,
    next: usize,
    name: String,
    faces: Vec<[u32; 3]>,
    render: Option<RenderSurface>,
    dress: Dress,
    vertex_count: usize,
}

impl Series {
    fn boxed(folder: PathBuf, stem: String, surface: &OutputSurface<'_>) -> Box<dyn FrameWriter> {
        Box::new(Series {
            folder,
            stem,
            single: surface.frame_count == Some(1),
            next: 0,
            name: surface.name.into(),
            faces: surface.faces.to_vec(),
            render: surface.render.cloned(),
            dress: surface.dress.clone(),
            vertex_count: surface.vertex_count,
        })
    }
}

/// `pose.obj` for one frame, `pose_0000.obj`, `pose_0001.obj` and so on for several.
pub(super) fn open(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    Ok(Series::boxed(folder.into(), stem, surface))
}

/// `shape_0000.obj`, `shape_0001.obj` and so on in a folder, which is made if it is missing.
///
/// Errors: `Io`.
pub(crate) fn write_folder(folder: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    make_folder(folder)?;
    let several = OutputSurface {
        frame_count: None,
        ..*surface
    };
    Ok(Series::boxed(folder.into(), "shape".into(), &several))
}

impl FrameWriter for Series {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        let name = if self.single {
            format!("{}.obj", self.stem)
        } else {
            format!("{}_{:04}.obj", self.stem, self.next)
        };
        self.next += 1;
        let surface = OutputSurface {
            render: self.render.as_ref(),
            dress: &self.dress,
            ..OutputSurface::bare(&self.name, self.vertex_count, &self.faces)
        };
        write_obj(&self.folder.join(name), positions, &surface)
    }

    fn finish(self: Box<Self>) -> Result<(), WriteError> {
        Ok(())
    }
}

/// Writes a sequence as `shape_0000.obj`, `shape_0001.obj` and so on into `folder`, which is made if it is missing.
///
/// Errors: `Io`; shapes written before it stay.
pub fn write_sequence_obj(folder: &Path, sequence: &crate::MeshSequence) -> Result<(), WriteError> {
    let mut writer = write_folder(folder, &OutputSurface::of_sequence(sequence))?;
    sequence.shapes.iter().try_for_each(|shape| writer.frame(shape))?;
    writer.finish()
}
