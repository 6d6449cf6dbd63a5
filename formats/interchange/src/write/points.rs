//! What files of points alone share: render vertices where they are wanted, and counts of 31 bits.

use super::{Output, OutputSurface, WriteError, check_length};

/// Writes points.
pub(crate) struct PointWriter {
    pub(crate) out: Output,
    /// The vertex that each written point stands for, where they differ.
    split: Option<Vec<u32>>,
    vertex_count: usize,
    frame_count: usize,
}

impl PointWriter {
    pub(crate) fn new(out: Output, surface: &OutputSurface<'_>) -> PointWriter {
        PointWriter {
            out,
            split: surface
                .render
                .filter(|_| surface.keep_split)
                .map(|render| render.vertices.clone()),
            vertex_count: surface.vertex_count,
            frame_count: 0,
        }
    }

    /// Writes the points of a frame.
    pub(crate) fn frame(&mut self, positions: &[[f32; 3]], of: impl Fn(f32) -> [u8; 4]) -> Result<(), WriteError> {
        check_length(self.out.path(), "a frame", positions.len(), self.vertex_count)?;
        self.frame_count += 1;
        let mut put = |p: &[f32; 3]| p.iter().try_for_each(|&x| self.out.put(&of(x)));
        match &self.split {
            Some(split) => split.iter().try_for_each(|&v| put(&positions[v as usize])),
            None => positions.iter().try_for_each(put),
        }
    }

    /// Points a frame, and frames.
    pub(crate) fn counts(&self, format: &'static str) -> Result<[i32; 2], WriteError> {
        let counted = |count: usize, what: &'static str| {
            i32::try_from(count).map_err(|_| WriteError::TooLarge {
                path: self.out.path().into(),
                format,
                count,
                what,
            })
        };
        let points = self.split.as_ref().map_or(self.vertex_count, Vec::len);
        Ok([counted(points, "points")?, counted(self.frame_count, "frames")?])
    }
}
