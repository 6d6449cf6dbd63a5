//! Binary little-endian PLY: one shape each, with normals and colours where there are some.

use crate::mesh::Dress;
use crate::write::{FrameWriter, Output, OutputSurface, WriteError, check_length};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes one shape as binary little-endian PLY, with the surface's colours. Shape: `positions` and `normals` `[V][3]`.
///
/// Errors: `Io`; `LengthDiffers` unless there are V positions and normals.
pub fn write_ply(
    path: &Path,
    positions: &[[f32; 3]],
    normals: Option<&[[f32; 3]]>,
    surface: &OutputSurface<'_>,
) -> Result<(), WriteError> {
    surface.check(positions, path)?;
    if let Some(normals) = normals {
        check_length(path, "normals", normals.len(), positions.len())?;
    }
    let colors = Some(&surface.dress.colors).filter(|colors| !colors.is_empty());
    if let Some(colors) = colors {
        check_length(path, "colours", colors.len(), positions.len())?;
    }
    let mut out = Output::create(path)?;
    let mut head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        positions.len()
    );
    head += "property float x\nproperty float y\nproperty float z\n";
    if normals.is_some() {
        head += "property float nx\nproperty float ny\nproperty float nz\n";
    }
    if colors.is_some() {
        head += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    head += &format!(
        "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        surface.faces.len()
    );
    out.put(head.as_bytes())?;
    for v in 0..positions.len() {
        out.put_f32(&positions[v])?;
        if let Some(normals) = normals {
            out.put_f32(&normals[v])?;
        }
        if let Some(colors) = colors {
            let [red, green, blue, _] = colors[v].map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
            out.put(&[red, green, blue])?;
        }
    }
    for face in surface.faces {
        out.put(&[3])?;
        face.iter().try_for_each(|v| out.put(&v.to_le_bytes()))?;
    }
    out.flush().map_err(|source| out.fail(source))?;
    out.commit()
}

/// Frames as files.
struct Series {
    path: PathBuf,
    single: bool,
    next: usize,
    faces: Vec<[u32; 3]>,
    dress: Dress,
    vertex_count: usize,
}

/// `pose.ply` for one frame, `pose_0000.ply`, `pose_0001.ply` and so on for several.
pub(super) fn open(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    Ok(Box::new(Series {
        path: path.into(),
        single: surface.frame_count == Some(1),
        next: 0,
        faces: surface.faces.to_vec(),
        dress: surface.dress.clone(),
        vertex_count: surface.vertex_count,
    }))
}

impl FrameWriter for Series {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let path = if self.single {
            self.path.clone()
        } else {
            self.path.with_file_name(format!("{stem}_{:04}.ply", self.next))
        };
        self.next += 1;
        let surface = OutputSurface {
            dress: &self.dress,
            ..OutputSurface::bare("", self.vertex_count, &self.faces)
        };
        write_ply(&path, positions, None, &surface)
    }

    fn finish(self: Box<Self>) -> Result<(), WriteError> {
        Ok(())
    }
}
