//! Values of every shape, where all later stages read them: in memory while they are few, in a file of the temporary folder
//! that is mapped where they are many. The file has no name and goes when the store does.

use core::ops::{Index, IndexMut};
use core::slice::{ChunksExact, ChunksExactMut};
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
    /// Errors: no room in the temporary folder, or more bytes than an address can count.
    pub fn zeros(shape_count: usize, vertex_count: usize, mapped_from: u64) -> io::Result<Self> {
        let count = shape_count.checked_mul(vertex_count).and_then(|n| n.checked_mul(C));
        let bytes = count.and_then(|count| count.checked_mul(size_of::<f32>()));
        let (Some(count), Some(bytes)) = (count, bytes) else {
            return Err(io::ErrorKind::OutOfMemory.into());
        };
        let bytes = bytes as u64;
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

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
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
    pub fn iter(&self) -> ChunksExact<'_, [f32; C]> {
        self.values().as_chunks().0.chunks_exact(self.vertex_count.max(1))
    }

    /// Every shape, `[V]` each, to be changed.
    pub fn iter_mut(&mut self) -> ChunksExactMut<'_, [f32; C]> {
        let vertex_count = self.vertex_count.max(1);
        self.values_mut().as_chunks_mut().0.chunks_exact_mut(vertex_count)
    }

    /// The first shapes alone, in memory.
    pub fn first(&self, count: usize) -> Self {
        Self {
            vertex_count: self.vertex_count,
            shape_count: count.min(self.shape_count),
            values: Values::Memory(self.values()[..count.min(self.shape_count) * self.vertex_count * C].to_vec()),
        }
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

/// Shape: `[V]`. Panics past the last shape, like a slice.
impl<const C: usize> IndexMut<usize> for ShapeStore<C> {
    fn index_mut(&mut self, m: usize) -> &mut Self::Output {
        let width = self.vertex_count * C;
        self.values_mut()[m * width..(m + 1) * width].as_chunks_mut().0
    }
}

impl<const C: usize> Default for ShapeStore<C> {
    fn default() -> Self {
        Self::of_shapes(&[])
    }
}

/// A copy is in memory, wherever the store is.
impl<const C: usize> Clone for ShapeStore<C> {
    fn clone(&self) -> Self {
        self.first(self.shape_count)
    }
}

impl<const C: usize> PartialEq for ShapeStore<C> {
    fn eq(&self, other: &Self) -> bool {
        (self.shape_count, self.vertex_count) == (other.shape_count, other.vertex_count)
            && self.values() == other.values()
    }
}

impl<'a, const C: usize> IntoIterator for &'a ShapeStore<C> {
    type Item = &'a [[f32; C]];
    type IntoIter = ChunksExact<'a, [f32; C]>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<'a, const C: usize> IntoIterator for &'a mut ShapeStore<C> {
    type Item = &'a mut [[f32; C]];
    type IntoIter = ChunksExactMut<'a, [f32; C]>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

/// In memory. All shapes have as many vertices.
impl<const C: usize> FromIterator<Vec<[f32; C]>> for ShapeStore<C> {
    fn from_iter<I: IntoIterator<Item = Vec<[f32; C]>>>(shapes: I) -> Self {
        Self::of_shapes(&shapes.into_iter().collect::<Vec<_>>())
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
