//! Faces as formats write them: corners with texture coordinates.

use super::OutputSurface;

/// Corners of all triangles: vertices, and texture coordinates where there are some.
pub(crate) struct Corners<'a> {
    pub(crate) faces: &'a [[u32; 3]],
    pub(crate) uvs: &'a [[f32; 2]],
    /// Texture coordinates of each triangle's corners; empty without texture.
    pub(crate) uv_faces: &'a [[u32; 3]],
}

/// The corners of a surface. Render vertices whose texture coordinates are all alike only keep seams of normals: they have no texture.
pub(crate) fn corners<'a>(surface: &OutputSurface<'a>) -> Corners<'a> {
    let textured = surface
        .render
        .filter(|render| render.uvs.iter().any(|uv| *uv != render.uvs[0]));
    Corners {
        faces: surface.faces,
        uvs: textured.map_or(&[], |render| &render.uvs),
        uv_faces: textured.map_or(&[], |render| &render.faces),
    }
}

/// The same triangle seen from behind, its first corner still the first.
pub(crate) fn reversed([a, b, c]: [u32; 3]) -> [u32; 3] {
    [a, c, b]
}
