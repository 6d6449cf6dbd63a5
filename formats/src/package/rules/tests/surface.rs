//! Rules of triangles and render vertices, which are the same in both payloads, and of the width of indices.

use alloc::vec::Vec;

use super::*;

fn both(damage: impl Fn(&mut TinySurface), expected: OpenError) {
    compact(|t| damage(&mut t.surface), expected);
    baked(|t| damage(&mut t.surface), expected);
}

#[test]
fn a_surface_without_texture_has_no_render_vertices() {
    let (mut one, mut two) = (tiny_compact(), tiny_baked());
    let bytes = write_compact(&one.basis()).unwrap();
    let faces = CompactView::open(&bytes).unwrap().faces().to_vec();
    one.surface = TinySurface::plain(&faces);
    let bytes = write_compact(&one.basis()).unwrap();
    let view = CompactView::open(&bytes).unwrap();
    assert!(!view.surface().has_texture());
    assert_eq!(view.faces().to_vec(), faces);
    let slots: Vec<[u32; 3]> = faces
        .iter()
        .map(|face| face.map(|v| two.slot_from_vertex[v as usize]))
        .collect();
    two.surface = TinySurface::plain(&slots);
    let bytes = write_baked(&two.basis()).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    assert!(!view.surface().has_texture());
    assert_eq!(view.surface().drawn_faces().to_vec(), slots);
    assert_eq!(view.faces().to_vec(), faces);
}

#[test]
fn surface_rules() {
    let count = tiny_compact().surface.uvs.len();
    both(
        |t| t.render_points[count - 1] = V,
        beyond("render_points", count - 1, V, V),
    );
    both(|t| t.uvs[2][1] = f32::NAN, not_finite("uvs", 2));
    both(
        |t| t.uvs[2][0] = 2.0 * limits::TEXTURE,
        OutOfRange {
            field: "uvs",
            index: 2,
            value: 2.0 * limits::TEXTURE,
            least: -limits::TEXTURE,
            greatest: limits::TEXTURE,
        },
    );
    both(
        |t| t.uvs.truncate(count - 1),
        counts("uvs", count as u64, count as u64 - 1),
    );
    let (field, least, actual) = ("corners", 1, 0);
    both(|t| t.corners.clear(), TooFew { field, least, actual });
    let value = count as u32;
    both(|t| t.corners[1][2] = value, beyond(field, 1, value, value));
    both(|t| t.corners[7][0] = u32::MAX, beyond(field, 7, u32::MAX, value));
    both(
        |t| {
            t.render_points = alloc::vec![0; limits::RENDER_VERTICES + 1];
            t.uvs = Vec::new();
        },
        TooMany {
            field: "render_points",
            limit: limits::RENDER_VERTICES,
            actual: limits::RENDER_VERTICES + 1,
        },
    );
    let field = "render_points";
    baked(|t| t.surface.render_points.swap(0, 4), NotAscending { field, index: 1 });
}

/// Whatever the width that the writer would choose.
fn indices_are(count: usize, values: &[u32]) -> Surface<'_> {
    Surface {
        corners: Indices::of(count, values),
        ..Surface::default()
    }
}

#[test]
fn the_count_of_the_things_decides_the_width_of_their_indices() {
    let tiny = tiny_compact();
    let width = |surface| {
        let mut basis = tiny.basis();
        basis.surface = surface;
        write_compact(&basis).map(|bytes| CompactView::open(&bytes).unwrap().surface().corners.len())
    };
    let triangle = [0, 1, 2];
    assert_eq!(width(indices_are(VERTEX_COUNT, &triangle)), Ok(3));
    let wide = WriteError::Refused(IndexWidth { field: "corners" });
    assert_eq!(width(indices_are(SHORT_COUNT + 1, &triangle)), Err(wide));

    // Vertices beyond u16, each on a place of its own.
    let mut tiny = tiny_compact();
    let count = SHORT_COUNT + 1 + VERTEX_COUNT;
    tiny.rest_positions.resize_with(count, || [0.0, 1.0, 2.0]);
    let words = count.div_ceil(32);
    tiny.support_bits = tiny
        .support_bits
        .iter()
        .flat_map(|&row| core::iter::once(row).chain(core::iter::repeat_n(0, words - 1)))
        .collect();
    tiny.after = Default::default();
    tiny.surface = TinySurface::plain(&[[0, 1, SHORT_COUNT as u32], [2, 1, 0]]);
    let bytes = write_compact(&tiny.basis()).unwrap();
    let view = CompactView::open(&bytes).unwrap();
    assert!(matches!(view.surface().corners, IndexSlice::Wide(corners) if corners.len() == 6));
    assert_eq!(view.faces().to_vec(), tiny.surface.corners);
    let mut narrow = tiny.basis();
    narrow.surface = indices_are(VERTEX_COUNT, &triangle);
    let refused = WriteError::Refused(IndexWidth { field: "corners" });
    assert_eq!(write_compact(&narrow).err(), Some(refused));
    tiny.surface.corners[0][1] = count as u32;
    let refused = WriteError::Refused(beyond("corners", 0, count as u32, count as u32));
    assert_eq!(write_compact(&tiny.basis()).err(), Some(refused));
}
