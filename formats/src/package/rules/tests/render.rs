//! Rules of the render vertices, which are the same in both payloads.

use alloc::vec::Vec;

use super::*;

fn both(damage: impl Fn(&mut TinyRender), expected: OpenError) {
    compact(|t| damage(&mut t.render), expected);
    baked(|t| damage(&mut t.render), expected);
}

#[test]
fn a_surface_without_texture_has_no_render_vertices() {
    let (mut one, mut two) = (tiny_compact(), tiny_baked());
    (one.render, two.render) = (TinyRender::default(), TinyRender::default());
    let bytes = write_compact(&one.basis()).unwrap();
    assert_eq!(CompactView::open(&bytes).unwrap().render_mesh(), RenderMesh::NONE);
    let bytes = write_baked(&two.basis()).unwrap();
    assert_eq!(BakedView::open(&bytes).unwrap().render_mesh(), RenderMesh::NONE);
}

#[test]
fn render_rules() {
    let count = tiny_compact().render.vertices.len();
    let face_count = tiny_compact().faces.len() as u64;
    both(|t| t.vertices[3] = V, beyond("render.vertices", 3, V, V));
    both(|t| t.uvs[2][1] = f32::NAN, not_finite("render.uvs", 2));
    both(
        |t| t.uvs[2][0] = 2.0 * limits::TEXTURE,
        OutOfRange {
            field: "render.uvs",
            index: 2,
            value: 2.0 * limits::TEXTURE,
            least: -limits::TEXTURE,
            greatest: limits::TEXTURE,
        },
    );
    both(
        |t| t.uvs.truncate(count - 1),
        counts("render.uvs", count as u64, count as u64 - 1),
    );
    both(
        |t| t.faces.truncate(face_count as usize - 1),
        counts("render.faces", face_count, face_count - 1),
    );
    both(
        |t| (t.vertices, t.uvs) = (Vec::new(), Vec::new()),
        counts("render.faces", 0, face_count),
    );
    both(
        |t| t.faces[1][2] = count as u32,
        beyond("render.faces", 1, count as u32, count as u32),
    );
    both(|t| t.faces[4].swap(0, 1), RenderFaceDiffers { face: 4 });
    both(
        |t| {
            t.vertices = alloc::vec![0; limits::RENDER_VERTICES + 1];
            t.uvs = Vec::new();
        },
        TooMany {
            field: "render.vertices",
            limit: limits::RENDER_VERTICES,
            actual: limits::RENDER_VERTICES + 1,
        },
    );
}
