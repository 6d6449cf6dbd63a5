//! Packages as a whole: what is written is read, byte for byte the same each time, and each rule refuses its fault.

use alloc::vec::Vec;

use super::fixture::{tiny_baked, tiny_compact};
use super::*;

#[test]
fn a_compact_package_is_read_as_written() {
    let tiny = tiny_compact();
    let bytes = write_compact(&tiny.basis()).unwrap();
    let view = CompactView::open(&bytes).unwrap();
    assert_eq!(view.rest_positions(), tiny.rest_positions);
    assert_eq!(view.faces(), tiny.faces);
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
    assert_eq!(view.faces(), tiny.faces);
    assert_eq!(view.solver_from_vertex(), tiny.solver_from_vertex);
    assert_eq!(view.vertex_from_solver(), tiny.vertex_from_solver);
    assert_eq!(view.ring_offsets(), tiny.ring_offsets);
    assert_eq!(view.ring(), tiny.ring);
    assert_eq!(view.ring_weights(), tiny.ring_weights);
    assert_eq!(view.factor_offsets(), tiny.factor_offsets);
    assert_eq!(view.factor_rows(), tiny.factor_rows);
    assert_eq!(view.factor_values(), tiny.factor_values);
    assert_eq!(view.inverse_pivots(), tiny.inverse_pivots);
    assert_eq!(view.rotation_scale(), tiny.rotation_scale);
    assert_eq!(view.stretch_scale(), tiny.stretch_scale);
    assert_eq!(view.blocks().collect::<Vec<_>>(), tiny.blocks);
    assert_eq!(view.components().collect::<Vec<_>>(), tiny.components);
    assert_eq!(view.support(), tiny.support);
    assert_eq!(view.entry_slots(), tiny.entry_slots);
    assert_eq!(view.entry_values(), tiny.entry_values);
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
