//! Packages as a whole: what is written is read, byte for byte the same each time, and each rule refuses its fault.

use alloc::vec::Vec;

use super::fixture::{TinySurface, TinyTier, VERTEX_COUNT, tiny_baked, tiny_compact};
use super::*;

#[test]
fn a_compact_package_is_read_as_written() {
    let tiny = tiny_compact();
    let bytes = write_compact(&tiny.basis()).unwrap();
    let view = CompactView::open(&bytes).unwrap();
    assert_eq!(view.rest_positions(), tiny.rest_positions);
    assert_eq!(surface_of(&view.surface()), tiny.surface);
    assert_eq!(view.faces().to_vec()[0], [0, 1, 4]);
    assert_eq!(view.bridges(), tiny.bridges);
    assert_eq!(view.anchor_vertex(), tiny.anchor_vertex);
    assert_eq!(view.rotation_scale(), tiny.rotation_scale);
    assert_eq!(view.stretch_scale(), tiny.stretch_scale);
    assert_eq!(view.blocks().collect::<Vec<_>>(), tiny.blocks);
    assert_eq!(view.components().collect::<Vec<_>>(), tiny.components);
    assert_eq!(view.support_bits(), tiny.support_bits);
    assert_eq!(view.values(), tiny.values);
    assert_eq!(view.provenance(), tiny.provenance);
    assert_eq!(view.quality(), tiny.quality);
    assert_eq!((view.after(), view.prior()), (tiny.basis().after, tiny.basis().prior));
    assert_eq!(view.encoder(), tiny.encoder);
    assert!(view.surface().uvs.len() > view.vertex_count(), "the seam is torn");
    let places: Vec<_> = view.entries().map(|entry| (entry.component, entry.vertex)).collect();
    assert_eq!(places[..7], [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (0, 5), (1, 3)]);
    assert!(view.entries().map(|entry| *entry.values).eq(tiny.values));
}

#[test]
fn a_baked_package_is_read_as_written() {
    let tiny = tiny_baked();
    let bytes = write_baked(&tiny.basis()).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    assert_eq!(view.compact_id(), tiny.compact_id);
    assert_eq!(view.rest_positions(), tiny.rest_positions);
    assert_eq!(view.slot_from_vertex().to_vec(), tiny.slot_from_vertex);
    assert_eq!(view.vertex_from_slot().to_vec(), tiny.vertex_from_slot);
    assert_eq!(surface_of(&view.surface()), tiny.surface);
    let compact = write_compact(&tiny_compact().basis()).unwrap();
    let source = CompactView::open(&compact).unwrap().faces().to_vec();
    assert_eq!(view.faces().to_vec(), source, "triangles by vertices, from either kind");
    assert_eq!(view.rotation_scale(), tiny.rotation_scale);
    assert_eq!(view.stretch_scale(), tiny.stretch_scale);
    assert_eq!(view.blocks().collect::<Vec<_>>(), tiny.blocks);
    assert_eq!(view.components().collect::<Vec<_>>(), tiny.components);
    assert_eq!(view.fan_offsets(), tiny.fan_offsets);
    assert_eq!(view.fans().to_vec(), tiny.fans.as_flattened());
    let exact = view.exact().unwrap();
    tier_is_read_as_written(&exact.patches, &exact.solve, &tiny.exact);
    assert!(view.bones().is_none());
    assert_eq!((view.after(), view.prior()), (tiny.basis().after, tiny.basis().prior));
}

fn surface_of(view: &SurfaceView<'_>) -> TinySurface {
    TinySurface {
        corners: view.drawn_faces().to_vec(),
        render_points: view.render_points.to_vec(),
        uvs: view.uvs.to_vec(),
    }
}

fn tier_is_read_as_written(patches: &PatchesView<'_>, solve: &SolveView<'_>, tiny: &TinyTier) {
    assert_eq!(solve.ring_offsets, tiny.ring_offsets);
    assert_eq!(solve.ring.to_vec(), tiny.ring);
    assert_eq!(solve.ring_weights, tiny.ring_weights);
    assert_eq!(solve.tile_offsets, tiny.tile_offsets);
    assert_eq!(solve.tile_rows.to_vec(), tiny.tile_rows);
    assert_eq!(solve.tiles, tiny.tiles);
    assert_eq!(solve.inverse_diagonals, tiny.inverse_diagonals);
    assert_eq!(solve.solver_from_slot.to_vec(), tiny.solver_from_slot);
    assert_eq!(patches.offsets, tiny.patches.offsets);
    assert_eq!(patches.owners, tiny.patches.owners);
    assert_eq!(patches.values, tiny.patches.values);
}

#[test]
fn an_exact_tier_may_be_left_out_but_not_both() {
    let mut tiny = tiny_baked();
    tiny.has_exact = false;
    assert_eq!(
        write_baked(&tiny.basis()).err(),
        Some(WriteError::Refused(OpenError::NoTier))
    );
    tiny.bones = Some(tiny.three_bones());
    let bytes = write_baked(&tiny.basis()).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    assert!(view.exact().is_none() && view.bones().is_some());
}

#[test]
fn entries_are_what_the_patches_hold() {
    let tiny = tiny_baked();
    let bytes = write_baked(&tiny.basis()).unwrap();
    let exact = BakedView::open(&bytes).unwrap().exact().unwrap();
    let entries: Vec<_> = exact.patches.entries().collect();
    let held = tiny.exact.patches.values.iter().zip(&tiny.exact.patches.owners);
    for (values, owner) in held {
        for slot in 0..VERTEX_COUNT {
            let own = entries
                .iter()
                .find(|entry| entry.slot == slot && entry.component == usize::from(owner[0]));
            let stored = values.map(|row| row[slot]);
            assert_eq!(own.map_or([0; FEATURE_COUNT], |entry| entry.values), stored);
        }
    }
    assert!(entries.len() > 10);
}

#[test]
fn tiles_lie_on_cache_lines_of_the_file() {
    let bytes = write_baked(&tiny_baked().basis()).unwrap();
    let solve = BakedView::open(&bytes).unwrap().exact().unwrap().solve;
    for tiles in [solve.tiles, solve.inverse_diagonals] {
        assert_eq!((tiles.as_ptr().addr() - bytes.as_ptr().addr()) % 64, 0);
    }
}

#[test]
fn bones_are_read_as_written() {
    let mut tiny = tiny_baked();
    let bones = tiny.three_bones();
    tiny.bones = Some(bones.clone());
    let bytes = write_baked(&tiny.basis()).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    let exact = view.exact().unwrap();
    tier_is_read_as_written(&exact.patches, &exact.solve, &tiny.exact);
    let read = view.bones().unwrap();
    assert_eq!(read.patches.owners, bones.patches.owners);
    assert_eq!(read.patches.values, bones.patches.values);
    assert_eq!(read.node_count, 2);
    assert_eq!((read.rest_places, read.axes), (&bones.rest_places[..], &bones.axes[..]));
    assert_eq!((read.turn_nodes, read.turns), (&bones.turn_nodes[..], &bones.turns[..]));
    assert_eq!(
        (read.pulls, read.pull_scales),
        (&bones.pulls[..], &bones.pull_scales[..])
    );
    assert_eq!(
        (read.slides, read.slide_scales),
        (&bones.slides[..], &bones.slide_scales[..])
    );
    assert_eq!((read.skin.influences, read.skin.bones), (4, &bones.bones[..]));
    assert_eq!(
        (read.skin.weights, read.skin.rest_normals),
        (&bones.weights[..], &bones.rest_normals[..])
    );
    assert_eq!(read.error, bones.error);
}

#[test]
fn the_same_record_gives_the_same_bytes() {
    assert_eq!(
        write_compact(&tiny_compact().basis()),
        write_compact(&tiny_compact().basis())
    );
    assert_eq!(write_baked(&tiny_baked().basis()), write_baked(&tiny_baked().basis()));
}

#[test]
fn the_kind_is_checked() {
    let compact = write_compact(&tiny_compact().basis()).unwrap();
    let baked = write_baked(&tiny_baked().basis()).unwrap();
    assert_eq!(
        BakedView::open(&compact).err(),
        Some(OpenError::WrongKind {
            expected: PackageKind::Baked,
            found: PackageKind::Compact
        })
    );
    assert_eq!(
        CompactView::open(&baked).err(),
        Some(OpenError::WrongKind {
            expected: PackageKind::Compact,
            found: PackageKind::Baked
        })
    );
}

#[test]
fn the_content_id_is_the_contents() {
    let tiny = tiny_baked();
    let mut bytes = write_baked(&tiny.basis()).unwrap();
    let mut header = Header::read(&bytes).unwrap();
    header.content_id[3] ^= 1;
    bytes.as_mut_slice()[..HEADER_BYTES].copy_from_slice(&header.to_bytes());
    assert_eq!(BakedView::open(&bytes).err(), Some(OpenError::ContentIdMismatch));
}
