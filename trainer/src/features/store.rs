//! Values of every training shape, where all later stages read them: in memory while they are few, in a file of the
//! temporary folder that is mapped where they are many. The file has no name and goes when the store does.

use core::ops::Index;
use std::fs::File;
use std::io::{self, Write};

use memmap2::MmapMut;

/// Stores of more bytes than this go to a file.
pub const MAPPED_FROM_BYTES: u64 = 1 << 30;

/// The file is made in pieces of this many bytes.
const PIECE_BYTES: usize = 1 << 20;

/// C values of every vertex of every shape. M shapes, V vertices.
#[derive(Debug)]
pub struct ShapeStore<const C: usize> {
    vertex_count: usize,
    shape_count: usize,
    values: Values,
}

#[derive(Debug)]
enum Values {
    Memory(Vec<f32>),
    Mapped(MmapMut),
}

impl<const C: usize> ShapeStore<C> {
    /// All zero. Stores of more than `mapped_from` bytes ([`MAPPED_FROM_BYTES`] for those of a training) are a file.
    /// Errors: no room in the temporary folder.
    pub fn zeros(shape_count: usize, vertex_count: usize, mapped_from: u64) -> io::Result<Self> {
        let count = shape_count * vertex_count * C;
        let bytes = (count * size_of::<f32>()) as u64;
        let values = if bytes > mapped_from {
            Values::Mapped(mapped_zeros(bytes)?)
        } else {
            Values::Memory(vec![0.0; count])
        };
        Ok(Self {
            vertex_count,
            shape_count,
            values,
        })
    }

    /// In memory. All shapes have as many vertices.
    pub fn of_shapes(shapes: &[Vec<[f32; C]>]) -> Self {
        let values: Vec<f32> = shapes.iter().flat_map(|shape| shape.as_flattened()).copied().collect();
        Self {
            vertex_count: shapes.first().map_or(0, Vec::len),
            shape_count: shapes.len(),
            values: Values::Memory(values),
        }
    }

    /// M.
    pub fn len(&self) -> usize {
        self.shape_count
    }

    /// Whether there is no shape.
    pub fn is_empty(&self) -> bool {
        self.shape_count == 0
    }

    /// Bytes of the file; nothing where the store is in memory.
    pub fn mapped_bytes(&self) -> Option<usize> {
        match &self.values {
            Values::Memory(_) => None,
            Values::Mapped(map) => Some(map.len()),
        }
    }

    /// Every shape, `[V]` each.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[[f32; C]]> + Clone {
        (0..self.shape_count).map(|m| &self[m])
    }

    /// Flat values of all shapes, to be filled. Shape: `[M][V][C]`.
    pub fn values_mut(&mut self) -> &mut [f32] {
        match &mut self.values {
            Values::Memory(values) => values,
            Values::Mapped(map) => bytemuck::cast_slice_mut(map),
        }
    }

    fn values(&self) -> &[f32] {
        match &self.values {
            Values::Memory(values) => values,
            Values::Mapped(map) => bytemuck::cast_slice(map),
        }
    }
}

/// Shape: `[V]`. Panics past the last shape, like a slice.
impl<const C: usize> Index<usize> for ShapeStore<C> {
    type Output = [[f32; C]];

    fn index(&self, m: usize) -> &Self::Output {
        let width = self.vertex_count * C;
        self.values()[m * width..(m + 1) * width].as_chunks().0
    }
}

/// Written, not only lengthened: a folder without room says so here, and not as a fault of memory later.
fn mapped_zeros(bytes: u64) -> io::Result<MmapMut> {
    let mut file: File = tempfile::tempfile()?;
    let piece = vec![0; PIECE_BYTES];
    let mut left = bytes;
    while left > 0 {
        let now = left.min(PIECE_BYTES as u64) as usize;
        file.write_all(&piece[..now])?;
        left -= now as u64;
    }
    // SAFETY: the file has no name, so nothing else shortens or writes it while it is mapped.
    unsafe { MmapMut::map_mut(&file) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_holds_what_memory_holds() {
        let shapes: Vec<Vec<[f32; 3]>> = (0..5)
            .map(|m| (0..7).map(|v| [m as f32, v as f32, 0.5]).collect())
            .collect();
        let memory = ShapeStore::of_shapes(&shapes);
        let mut mapped = ShapeStore::<3>::zeros(5, 7, 0).expect("a temporary file");
        assert_eq!(
            (mapped.mapped_bytes(), memory.mapped_bytes()),
            (Some(5 * 7 * 3 * 4), None)
        );
        assert!(mapped.iter().all(|shape| shape == [[0.0; 3]; 7]));
        mapped.values_mut().copy_from_slice(memory.values());
        assert!(memory.iter().eq(mapped.iter()) && mapped.len() == 5 && !mapped.is_empty());
        assert_eq!(mapped[3][6], [3.0, 6.0, 0.5]);
    }
}
