//! The triangles, and what an engine draws where texture coordinates tear the surface open. In both kinds of package;
//! written by the trainer, laid out in slots by the baker.
//!
//! A *point* is a vertex in a compact package and a slot in a baked one. A *render vertex* is a point with one texture
//! coordinate; a point on a seam has several. Where there are render vertices, triangles are told by them alone: they imply
//! the points.

#[cfg(feature = "alloc")]
use alloc::vec::Vec;

use rkyv::{Archive, Serialize, with::InlineAsBox};

use super::{IndexSlice, Indices, archive::native, indices::slice};

/// Triangles and render vertices to be written: F triangles, R render vertices.
#[derive(Archive, Serialize, Debug, Clone, Copy, Default, PartialEq)]
pub struct Surface<'a> {
    /// Corners of the triangles, counter-clockwise: render vertices where there are some, else points. Shape: `[F][3]`.
    pub corners: Indices<'a>,
    /// The point that each render vertex stands for; none where the source has no texture coordinates. Shape: `[R]`.
    pub render_points: Indices<'a>,
    /// Texture coordinates as in the source. Shape: `[R]`, finite.
    #[rkyv(with = InlineAsBox)]
    pub uvs: &'a [[f32; 2]],
}

impl<'a> Surface<'a> {
    /// A surface without texture. `points` counts what the corners name.
    pub fn plain(points: usize, faces: &'a [[u32; 3]]) -> Self {
        Self {
            corners: Indices::of(points, faces.as_flattened()),
            ..Self::textured(points, &[], &[], &[])
        }
    }

    /// A surface whose triangles name render vertices. `points` counts what these stand for.
    pub fn textured(points: usize, faces: &'a [[u32; 3]], render_points: &'a [u32], uvs: &'a [[f32; 2]]) -> Self {
        Self {
            corners: Indices::of(render_points.len(), faces.as_flattened()),
            render_points: Indices::of(points, render_points),
            uvs,
        }
    }
}

/// Triangles and render vertices of an opened package.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceView<'a> {
    /// Corners of the triangles, counter-clockwise, three each: what a graphics card takes as an index buffer. Render vertices
    /// where there are some, else points. Shape: `[F][3]`.
    pub corners: IndexSlice<'a>,
    /// The point that each render vertex stands for. Shape: `[R]`; empty where the source has no texture coordinates.
    pub render_points: IndexSlice<'a>,
    /// Texture coordinates as in the source. Shape: `[R]`.
    pub uvs: &'a [[f32; 2]],
}

impl<'a> SurfaceView<'a> {
    pub(super) fn new(archived: &'a ArchivedSurface<'static>) -> Self {
        Self {
            corners: slice(&archived.corners),
            render_points: slice(&archived.render_points),
            uvs: native(&archived.uvs),
        }
    }

    /// F.
    pub fn face_count(&self) -> usize {
        self.corners.len() / 3
    }

    /// Whether there are render vertices.
    pub fn has_texture(&self) -> bool {
        !self.render_points.is_empty()
    }

    /// The triangles as an engine draws them: by render vertices where there are some, else by points.
    pub fn drawn_faces(&self) -> Faces<'a> {
        Faces {
            corners: self.corners,
            through: [None; 2],
        }
    }

    /// The triangles by points.
    pub fn faces(&self) -> Faces<'a> {
        let through = self.has_texture().then_some(self.render_points);
        Faces {
            corners: self.corners,
            through: [through, None],
        }
    }
}

/// Triangles, read as they are asked for. Shape: `[F]`.
#[derive(Debug, Clone, Copy)]
pub struct Faces<'a> {
    corners: IndexSlice<'a>,
    /// What corners are looked up in, one after the other.
    through: [Option<IndexSlice<'a>>; 2],
}

impl<'a> Faces<'a> {
    /// The same triangles, each corner `i` being `names[i]`. For triangles by points.
    pub(super) fn renamed(self, names: IndexSlice<'a>) -> Self {
        Self {
            through: [self.through[0], Some(names)],
            ..self
        }
    }

    /// F.
    pub fn len(&self) -> usize {
        self.corners.len() / 3
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Triangle `f` < F. Panics past the end, like a slice.
    pub fn at(&self, f: usize) -> [u32; 3] {
        [0, 1, 2].map(|corner| {
            let names = self.through.iter().flatten();
            names.fold(self.corners.at(3 * f + corner), |index, names| names.at(index as usize))
        })
    }

    /// All triangles in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = [u32; 3]> + Clone + use<'a> {
        let faces = *self;
        (0..faces.len()).map(move |f| faces.at(f))
    }

    /// The same, owned.
    #[cfg(feature = "alloc")]
    pub fn to_vec(&self) -> Vec<[u32; 3]> {
        self.iter().collect()
    }
}
