//! Arrays for NumPy.

use crate::write::{FrameWriter, Output, OutputSurface, WriteError, check_length, make_folder};
use std::path::Path;

/// Bytes of the header of an array of positions: room for any number of shapes, for it is written before their number is known.
const HEADER_BYTES: usize = 128;

/// Writes shapes as one npy array of f32 `[N][V][3]`.
///
/// Errors: `Io`; `LengthDiffers` unless all shapes have as many vertices.
pub fn write_npy_f32<S: AsRef<[[f32; 3]]>>(path: &Path, shapes: impl IntoIterator<Item = S>) -> Result<(), WriteError> {
    let mut shapes = shapes.into_iter().peekable();
    let vertex_count = shapes.peek().map_or(0, |shape| shape.as_ref().len());
    let mut positions = Positions::create(path, vertex_count)?;
    shapes.try_for_each(|shape| positions.add(shape.as_ref()))?;
    positions.finish()
}

/// An array of positions that grows by shapes.
struct Positions {
    out: Output,
    vertex_count: usize,
    shape_count: usize,
}

impl Positions {
    fn create(path: &Path, vertex_count: usize) -> Result<Positions, WriteError> {
        let mut out = Output::create(path)?;
        out.put(&[0; HEADER_BYTES])?;
        Ok(Positions {
            out,
            vertex_count,
            shape_count: 0,
        })
    }

    fn add(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        check_length(self.out.path(), "a shape", positions.len(), self.vertex_count)?;
        self.shape_count += 1;
        self.out.put_f32(positions.as_flattened())
    }

    fn finish(mut self) -> Result<(), WriteError> {
        let header = header("<f4", &[self.shape_count, self.vertex_count, 3], HEADER_BYTES);
        self.out.patch(0, &header)?;
        self.out.commit()
    }
}

/// Version 1.0, padded as numpy does so that the values begin at a multiple of 64 bytes.
fn header(descr: &str, shape: &[usize], size_bytes_min: usize) -> Vec<u8> {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let text = format!(
        "{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}",
        lengths.join(", ")
    );
    // Ten bytes stand before the text, and a line end behind the padding.
    let length = (10 + text.len() + 1).next_multiple_of(64).max(size_bytes_min) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{text:<width$}\n", width = length - 1).bytes());
    bytes
}

/// Writes one shape as an npy array of f32 `[V][3]`.
///
/// Errors: `Io`.
pub fn write_npy_vertices(path: &Path, positions: &[[f32; 3]]) -> Result<(), WriteError> {
    write_npy_matrix(path, positions.as_flattened(), 3)
}

/// Writes rows of `columns` numbers as an npy array of f32 `[rows][columns]`. Without columns there are no rows.
///
/// Errors: `Io`; `LengthDiffers` if the last row is cut.
pub fn write_npy_matrix(path: &Path, values: &[f32], columns: usize) -> Result<(), WriteError> {
    let rows = values.len() / columns.max(1);
    check_length(path, "the matrix", values.len(), rows * columns)?;
    let mut out = Output::create(path)?;
    out.put(&header("<f4", &[rows, columns], 0))?;
    out.put_f32(values)?;
    out.commit()
}

/// Writes triangles as an npy array of u32 `[F][3]`.
///
/// Errors: `Io`.
pub fn write_npy_u32(path: &Path, faces: &[[u32; 3]]) -> Result<(), WriteError> {
    let mut out = Output::create(path)?;
    out.put(&header("<u4", &[faces.len(), 3], 0))?;
    faces
        .as_flattened()
        .iter()
        .try_for_each(|v| out.put(&v.to_le_bytes()))?;
    out.commit()
}

/// `positions.npy`, and `faces.npy` beside it.
pub(super) fn open(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    let render = surface.render.filter(|_| surface.keep_split);
    write_npy_u32(
        &path.with_file_name("faces.npy"),
        render.map_or(surface.faces, |render| &render.faces),
    )?;
    let split = render.map(|render| render.vertices.clone());
    let vertex_count = split.as_ref().map_or(surface.vertex_count, Vec::len);
    Ok(Box::new(Arrays {
        positions: Positions::create(path, vertex_count)?,
        split,
        vertex_count: surface.vertex_count,
        buffer: Vec::new(),
    }))
}

struct Arrays {
    positions: Positions,
    /// The vertex that each written point stands for, where they differ.
    split: Option<Vec<u32>>,
    vertex_count: usize,
    buffer: Vec<[f32; 3]>,
}

impl FrameWriter for Arrays {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        check_length(self.positions.out.path(), "a frame", positions.len(), self.vertex_count)?;
        let Some(split) = &self.split else {
            return self.positions.add(positions);
        };
        self.buffer.clear();
        self.buffer.extend(split.iter().map(|&v| positions[v as usize]));
        self.positions.add(&self.buffer)
    }

    fn finish(self: Box<Self>) -> Result<(), WriteError> {
        self.positions.finish()
    }
}

/// Writes a sequence as `positions.npy` and `faces.npy` into `folder`, which is made if it is missing.
///
/// Errors: `Io`; `LengthDiffers` unless all shapes have as many vertices.
pub fn write_sequence_npy(folder: &Path, sequence: &crate::MeshSequence) -> Result<(), WriteError> {
    make_folder(folder)?;
    write_npy_u32(&folder.join("faces.npy"), &sequence.faces)?;
    write_npy_f32(&folder.join("positions.npy"), sequence.shapes.iter())
}
