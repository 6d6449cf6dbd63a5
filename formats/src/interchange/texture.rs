//! Texture coordinates of an OBJ reference, as render vertices: a second, lenient reading of its `vt` and `f` lines. Shapes never
//! need them, so a fault costs the texture and not the sequence.

use super::mesh::PolygonMesh;
use super::sequence::RenderSurface;
use super::text::{Lines, integer, number, tokens};
use super::triangulate::triangulate;
use crate::package::limits;
use std::collections::HashMap;

/// Stands for the texture coordinate of a corner that has none.
const UNTEXTURED: i64 = 0;

/// Render vertices of `reference`, which was read from `bytes` and triangulated into `faces`; none where no corner names a
/// texture coordinate.
///
/// One for each pair of vertex and texture coordinate, in the order of their first use. A corner without a texture
/// coordinate beside others that have one gets (0, 0).
///
/// Errors: the line whose texture coordinate or index is wrong.
pub(super) fn read_render_surface(
    bytes: &[u8],
    reference: &PolygonMesh,
    faces: &[[u32; 3]],
) -> Result<Option<RenderSurface>, usize> {
    let (uvs, corners) = read(bytes)?;
    if corners.iter().all(|corner| corner.index == UNTEXTURED) {
        return Ok(None);
    }
    let mut surface = RenderSurface::default();
    let mut known = HashMap::new();
    let mut render = PolygonMesh {
        face_ends: reference.face_ends.clone(),
        ..PolygonMesh::default()
    };
    for (&vertex, corner) in reference.corners.iter().zip(&corners) {
        let uv = match corner.index {
            UNTEXTURED => [0.0; 2],
            // A face may name texture coordinates that only follow it, so indices are held against their count here.
            index => *uvs.get(index as usize - 1).ok_or(corner.line)?,
        };
        let r = *known.entry((vertex, corner.index)).or_insert_with(|| {
            surface.vertices.push(vertex);
            surface.uvs.push(uv);
            render.positions.push(reference.positions[vertex as usize]);
            surface.vertices.len() as u32 - 1
        });
        if r as usize >= limits::RENDER_VERTICES {
            return Err(corner.line);
        }
        render.corners.push(r);
    }
    // Polygons are split by their geometry, so the same positions are split alike.
    surface.faces = triangulate(&render).faces;
    let vertices = &surface.vertices;
    let corners_of = |face: &[u32; 3]| face.map(|r| vertices[r as usize]);
    surface.faces.retain(|face| {
        let [a, b, c] = corners_of(face);
        a != b && b != c && c != a
    });
    debug_assert!(surface.faces.iter().map(corners_of).eq(faces.iter().copied()));
    Ok(Some(surface))
}

/// A corner's texture coordinate, counted from 1, and its line.
struct Corner {
    index: i64,
    line: usize,
}

/// Texture coordinates, and one of them for each corner of the faces that are kept.
fn read(bytes: &[u8]) -> Result<(Vec<[f32; 2]>, Vec<Corner>), usize> {
    let (mut uvs, mut corners) = (Vec::new(), Vec::new());
    let mut lines = Lines::new(bytes);
    while let Some((line, text)) = lines.next(|start| matches!(start.first(), Some(b'v' | b'f' | b'l' | b'p'))) {
        let mut words = tokens(text);
        match words.next() {
            Some(b"vt") => {
                let u = words.next().and_then(coordinate).ok_or(line)?;
                // A texture may have one dimension.
                let v = words.next().map_or(Some(0.0), coordinate).ok_or(line)?;
                uvs.push([u, v]);
            }
            Some(b"f") => {
                let first = corners.len();
                for word in words {
                    let index = index_of(word, uvs.len()).ok_or(line)?;
                    corners.push(Corner { index, line });
                }
                if corners.len() - first < 3 {
                    corners.truncate(first);
                }
            }
            _ => {}
        }
    }
    Ok((uvs, corners))
}

fn coordinate(word: &[u8]) -> Option<f32> {
    number(word).filter(|x| x.abs() <= limits::TEXTURE)
}

/// Texture coordinate of the corner `v/vt` or `v/vt/vn`, counted from 1.
fn index_of(word: &[u8], so_far: usize) -> Option<i64> {
    let text = word.split(|&b| b == b'/').nth(1).unwrap_or_default();
    if text.is_empty() {
        return Some(UNTEXTURED);
    }
    let index = integer(text)?;
    let from_one = if index < 0 {
        (so_far as i64 + 1).checked_add(index)?
    } else {
        index
    };
    (1..i64::from(u32::MAX)).contains(&from_one).then_some(from_one)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interchange::MeshKind;
    use std::path::Path;

    fn surface(text: &str) -> Result<Option<RenderSurface>, usize> {
        let mesh = PolygonMesh::parse(MeshKind::Obj, text.as_bytes(), Path::new("a.obj")).unwrap();
        let faces = triangulate(&mesh).faces;
        let found = read_render_surface(text.as_bytes(), &mesh, &faces);
        if let Ok(Some(surface)) = &found {
            let corners: Vec<[u32; 3]> = surface
                .faces
                .iter()
                .map(|face| face.map(|r| surface.vertices[r as usize]))
                .collect();
            assert_eq!(corners, faces);
        }
        found
    }

    const SQUARES: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n";

    #[test]
    fn a_seam_gives_its_vertices_two_render_vertices() {
        let text = format!(
            "{SQUARES}vt 0 0\nvt .5 0 0\nvt .5 1\nvt 0 1\nvt 0.25\nvt 1 0\nf 1/1 2/2 3/3 4/4\nf 1 2\nf 2/5/7 5/-1 6/6 3/3\n"
        );
        let found = surface(&text).unwrap().unwrap();
        assert_eq!(found.vertices, [0, 1, 2, 3, 1, 4, 5]);
        assert_eq!(
            found.uvs[..5],
            [[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0], [0.25, 0.0]]
        );
        assert_eq!(found.uvs[5..], [[1.0, 0.0]; 2]);
        assert_eq!(found.faces.len(), 4);
    }

    #[test]
    fn no_texture_is_none_and_a_part_of_one_is_filled_up() {
        assert_eq!(
            surface(&format!("{SQUARES}vt 0 0\nf 1 2 3\nf 1//1 3//1 4//1\n")),
            Ok(None)
        );
        let found = surface(&format!("{SQUARES}f 1 2 3\nf 1/1 3/1 4/1\nvt .5 .5\n"))
            .unwrap()
            .unwrap();
        assert_eq!(found.vertices, [0, 1, 2, 0, 2, 3]);
        assert_eq!(found.uvs, [[0.0; 2], [0.0; 2], [0.0; 2], [0.5; 2], [0.5; 2], [0.5; 2]]);
    }

    #[test]
    fn polygons_that_name_a_vertex_twice_are_split_alike() {
        // The second corner repeats the first vertex with another texture coordinate: its triangle is dropped all the same.
        let text = format!("{SQUARES}vt 0 0\nvt 1 1\nf 1/1 1/2 2/1\nf 1/1 2/1 3/1 3/2 4/2\nf 1/1 5/1 6/2 3/1 4/1\n");
        assert!(surface(&text).unwrap().is_some());
    }

    #[test]
    fn faults_name_their_line() {
        for (rest, line) in [
            ("vt x 0\nf 1/1 2/1 3/1\n", 7),
            ("vt nan 0\nf 1/1 2/1 3/1\n", 7),
            ("vt 1e30 0\nf 1/1 2/1 3/1\n", 7),
            ("vt\nf 1/1 2/1 3/1\n", 7),
            ("vt 0 0\nf 1/1 2/2 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/0 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/-2 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/x 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/-9223372036854775808 3/1\n", 8),
            ("vt 0 0\nf 1/1 2/99999999999999 3/1\n", 8),
        ] {
            assert_eq!(surface(&format!("{SQUARES}{rest}")), Err(line), "{rest}");
        }
    }
}
