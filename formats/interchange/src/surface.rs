//! From one or several meshes, as their files have them, to what stays the same in every frame: triangles, which vertices of the
//! files are one vertex of the sequence, and what an engine draws.

use super::error::SequenceError;
use super::mesh::{CornerTexture, Dress, PolygonMesh, UNTEXTURED};
use super::notice::Notice;
use super::sequence::RenderSurface;
use super::skin::Skin;
use super::triangulate::triangulate;
use sinew_formats::package::limits;
use std::collections::HashMap;
use std::path::Path;

/// What stays the same in every frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Surface {
    /// The first of the file's vertices that each vertex of the sequence stands for. Shape: `[V]`, ascending.
    pub(super) vertices: Vec<u32>,
    /// Triangles. Shape: `[F]`; every index < V.
    pub(super) faces: Vec<[u32; 3]>,
    /// What an engine draws.
    pub(super) render: Option<RenderSurface>,
    /// By vertices and triangles of the sequence.
    pub(super) dress: Dress,
    pub(super) notices: Vec<Notice>,
}

/// Joins meshes to one, piece after piece. Skins of several pieces become one skin.
pub(super) fn join(mut pieces: Vec<PolygonMesh>) -> PolygonMesh {
    if pieces.len() == 1 {
        return pieces.remove(0);
    }
    let any = |has: fn(&PolygonMesh) -> bool| pieces.iter().any(has);
    let textured = any(|mesh| mesh.texture.is_some());
    let painted = any(|mesh| !mesh.dress.face_materials.is_empty());
    let colored = any(|mesh| !mesh.dress.colors.is_empty());
    let skinned = any(|mesh| mesh.dress.skin.is_some());
    let mut whole = PolygonMesh {
        is_split: any(|mesh| mesh.is_split),
        ..PolygonMesh::default()
    };
    let (mut texture, mut skin) = (CornerTexture::default(), Skin::default());
    for piece in pieces {
        let first = whole.positions.len() as u32;
        let corner_start = whole.corners.len() as u32;
        let (vertex_count, face_count, corner_count) = (piece.positions.len(), piece.face_count(), piece.corners.len());
        whole.positions.extend(piece.positions);
        whole.corners.extend(piece.corners.iter().map(|v| v + first));
        whole
            .face_ends
            .extend(piece.face_ends.iter().map(|end| end + corner_start));
        whole.ignored_element_count += piece.ignored_element_count;
        if textured {
            let uv_start = texture.uvs.len() as u32;
            match piece.texture {
                Some(own) => {
                    texture.uvs.extend(own.uvs);
                    let moved = |&uv: &u32| if uv == UNTEXTURED { uv } else { uv + uv_start };
                    texture.corners.extend(own.corners.iter().map(moved));
                }
                None => texture.corners.resize(texture.corners.len() + corner_count, UNTEXTURED),
            }
        }
        let dress = piece.dress;
        if painted {
            let material_start = whole.dress.materials.len() as u32;
            if dress.face_materials.is_empty() {
                whole.dress.materials.push(String::new());
                whole
                    .dress
                    .face_materials
                    .extend(core::iter::repeat_n(material_start, face_count));
            } else {
                whole.dress.materials.extend(dress.materials);
                let moved = dress.face_materials.iter().map(|material| material + material_start);
                whole.dress.face_materials.extend(moved);
            }
        }
        if colored {
            if dress.colors.is_empty() {
                whole.dress.colors.extend(core::iter::repeat_n([1.0; 4], vertex_count));
            } else {
                whole.dress.colors.extend(dress.colors);
            }
        }
        if skinned {
            skin.append(dress.skin, vertex_count);
        }
    }
    whole.texture = textured.then_some(texture);
    whole.dress.skin = skinned.then_some(skin);
    whole
}

impl Surface {
    /// Triangulates `mesh`. `weld` gives each of its vertices the vertex of the sequence, where they differ.
    ///
    /// Errors: `TooLarge`, `NoFaces` when all triangles collapse.
    pub(super) fn new(mesh: &PolygonMesh, weld: Option<&[u32]>, path: &Path) -> Result<Surface, SequenceError> {
        let vertex_of = |v: u32| weld.map_or(v, |weld| weld[v as usize]);
        let triangulation = triangulate(mesh, vertex_of);
        let face_count = triangulation.triangles.len();
        if face_count >= u32::MAX as usize {
            return Err(SequenceError::TooLarge {
                path: path.to_path_buf(),
                count: face_count,
                what: "triangles",
            });
        }
        let mut surface = Surface {
            vertices: representatives(mesh.positions.len(), weld),
            ..Surface::default()
        };
        let of_corners = |triangle: &[u32; 3]| triangle.map(|corner| vertex_of(mesh.corners[corner as usize]));
        surface.faces = triangulation.triangles.iter().map(of_corners).collect();
        let (count, triangle_count) = (triangulation.polygon_count, triangulation.polygon_triangle_count);
        if count > 0 {
            surface
                .notices
                .push(Notice::PolygonsTriangulated { count, triangle_count });
        }
        if triangulation.collapsed_count > 0 {
            let count = triangulation.collapsed_count;
            surface.notices.push(Notice::CollapsedTriangles { count });
        }
        if mesh.ignored_element_count > 0 {
            let count = mesh.ignored_element_count;
            surface.notices.push(Notice::IgnoredElements { count });
        }
        let render = match weld {
            Some(_) => split_again(mesh, &triangulation.triangles, vertex_of),
            None => split_by_texture(mesh, &triangulation.triangles),
        };
        match render {
            Ok(render) => surface.render = render,
            Err(problem) => surface.notices.push(Notice::TextureIgnored { problem }),
        }
        surface.dress = surface.dressed(&mesh.dress, &triangulation.faces);
        Ok(surface)
    }

    /// Materials by triangles; colours and skin by vertices of the sequence.
    fn dressed(&self, dress: &Dress, faces: &[u32]) -> Dress {
        let mut own = Dress::default();
        if !dress.face_materials.is_empty() {
            own.materials = dress.materials.clone();
            own.face_materials = faces.iter().map(|&f| dress.face_materials[f as usize]).collect();
        }
        if !dress.colors.is_empty() {
            own.colors = self.vertices.iter().map(|&v| dress.colors[v as usize]).collect();
        }
        own.skin = dress.skin.as_ref().map(|skin| skin.of_vertices(&self.vertices));
        own
    }
}

/// The first vertex that is welded into each.
fn representatives(vertex_count: usize, weld: Option<&[u32]>) -> Vec<u32> {
    let Some(weld) = weld else {
        return (0..vertex_count as u32).collect();
    };
    let mut first = Vec::new();
    for (v, &welded) in weld.iter().enumerate() {
        if welded as usize == first.len() {
            first.push(v as u32);
        }
    }
    first
}

/// Render vertices of a mesh whose seams were welded: its own vertices, in its own order.
fn split_again(
    mesh: &PolygonMesh,
    triangles: &[[u32; 3]],
    vertex_of: impl Fn(u32) -> u32,
) -> Result<Option<RenderSurface>, String> {
    let vertex_count = mesh.positions.len();
    if vertex_count > limits::RENDER_VERTICES {
        return Err(too_many(vertex_count));
    }
    let mut uvs = vec![[0.0; 2]; vertex_count];
    if let Some(texture) = &mesh.texture {
        for (&v, &uv) in mesh.corners.iter().zip(&texture.corners) {
            if uv != UNTEXTURED {
                uvs[v as usize] = usable(texture.uvs[uv as usize])?;
            }
        }
    }
    Ok(Some(RenderSurface {
        vertices: (0..vertex_count as u32).map(vertex_of).collect(),
        uvs,
        faces: triangles
            .iter()
            .map(|triangle| triangle.map(|corner| mesh.corners[corner as usize]))
            .collect(),
    }))
}

/// Render vertices of a mesh with texture coordinates by corners: one for each pair of vertex and texture coordinate, in the order
/// of their first use. A corner without a texture coordinate beside others that have one gets (0, 0).
fn split_by_texture(mesh: &PolygonMesh, triangles: &[[u32; 3]]) -> Result<Option<RenderSurface>, String> {
    let Some(texture) = &mesh.texture else {
        return Ok(None);
    };
    if texture.corners.iter().all(|&uv| uv == UNTEXTURED) {
        return Ok(None);
    }
    let mut surface = RenderSurface::default();
    let mut known = HashMap::new();
    let mut of_corner = Vec::with_capacity(mesh.corners.len());
    for (&vertex, &uv) in mesh.corners.iter().zip(&texture.corners) {
        let r = match known.entry((vertex, uv)) {
            std::collections::hash_map::Entry::Occupied(known) => *known.get(),
            std::collections::hash_map::Entry::Vacant(place) => {
                surface.vertices.push(vertex);
                surface.uvs.push(match uv {
                    UNTEXTURED => [0.0; 2],
                    _ => usable(texture.uvs[uv as usize])?,
                });
                *place.insert(surface.vertices.len() as u32 - 1)
            }
        };
        of_corner.push(r);
    }
    if surface.vertices.len() > limits::RENDER_VERTICES {
        return Err(too_many(surface.vertices.len()));
    }
    surface.faces = triangles
        .iter()
        .map(|triangle| triangle.map(|corner| of_corner[corner as usize]))
        .collect();
    Ok(Some(surface))
}

fn too_many(count: usize) -> String {
    format!(
        "they part the surface into {count} render vertices, more than the {} of a package",
        limits::RENDER_VERTICES
    )
}

fn usable(uv: [f32; 2]) -> Result<[f32; 2], String> {
    // A NaN fails as well.
    if uv.iter().all(|x| x.abs() <= limits::TEXTURE) {
        Ok(uv)
    } else {
        Err(format!(
            "({:?}, {:?}) is not a finite pair of numbers up to {:e}",
            uv[0],
            uv[1],
            limits::TEXTURE
        ))
    }
}
