//! Render vertices: what an engine draws where texture coordinates tear the surface open. In both kinds of package, last;
//! written by the trainer from the reference's texture coordinates, copied by the baker.

use rkyv::{Archive, Serialize, with::InlineAsBox};

use super::{OpenError, limits, open::native, rules};

/// R render vertices, each a vertex with one texture coordinate; a vertex on a seam has several. All empty where the source
/// has no texture coordinates.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq)]
pub struct RenderMesh<'a> {
    /// The vertex that each stands for, source order. Shape: `[R]`; every index < V.
    #[rkyv(with = InlineAsBox)]
    pub vertices: &'a [u32],
    /// Texture coordinates as in the source. Shape: `[R]`, finite.
    #[rkyv(with = InlineAsBox)]
    pub uvs: &'a [[f32; 2]],
    /// The triangles again, by render vertices. Shape: `[F]`; `vertices[faces[f][c]]` is corner c of triangle f.
    #[rkyv(with = InlineAsBox)]
    pub faces: &'a [[u32; 3]],
}

impl RenderMesh<'_> {
    /// Of a surface without texture coordinates.
    pub const NONE: RenderMesh<'static> = RenderMesh {
        vertices: &[],
        uvs: &[],
        faces: &[],
    };
}

/// Borrows an archived one.
pub(super) fn view<'a>(archived: &'a ArchivedRenderMesh<'static>) -> RenderMesh<'a> {
    RenderMesh {
        vertices: native(&archived.vertices),
        uvs: native(&archived.uvs),
        faces: native(&archived.faces),
    }
}

/// Proves every promise that [`RenderMesh`] makes, for the triangles of a package.
pub(super) fn check(
    render: &RenderMesh<'_>,
    face_count: usize,
    faces: impl Iterator<Item = [u32; 3]>,
    vertex_count: usize,
) -> Result<(), OpenError> {
    let count = render.vertices.len();
    rules::count("render.vertices", count, 0, limits::RENDER_VERTICES)?;
    rules::same_count("render.uvs", render.uvs.len(), count)?;
    let face_count = if count == 0 { 0 } else { face_count };
    rules::same_count("render.faces", render.faces.len(), face_count)?;
    for (r, &vertex) in render.vertices.iter().enumerate() {
        rules::below("render.vertices", r, vertex, vertex_count)?;
        for &coordinate in &render.uvs[r] {
            rules::within("render.uvs", r, coordinate, -limits::TEXTURE, limits::TEXTURE)?;
        }
    }
    for (f, (corners, face)) in render.faces.iter().zip(faces).enumerate() {
        for &corner in corners {
            rules::below("render.faces", f, corner, count)?;
        }
        if corners.map(|r| render.vertices[r as usize]) != face {
            return Err(OpenError::RenderFaceDiffers { face: f });
        }
    }
    Ok(())
}
