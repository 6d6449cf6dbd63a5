//! Packages as a whole: what is written is read, byte for byte the same each time, and each rule refuses its fault.

use alloc::vec::Vec;

use super::fixture::{TinyTier, VERTEX_COUNT, tiny_baked, tiny_compact};
use super::*;

#[test]
fn a_compact_package_is_read_as_written() {
    let tiny = tiny_compact();
    let bytes = write_compact(&tiny.basis()).unwrap();
    let view = CompactView::open(&bytes).unwrap();
    assert_eq!(view.rest_positions(), tiny.rest_positions);
    assert_eq!(view.faces().to_vec(), tiny.faces);
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
    assert_eq!(view.render_mesh(), tiny.basis().render);
    assert!(
        view.render_mesh().vertices.len() > view.vertex_count(),
        "the seam is torn"
    );
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
    assert_eq!(view.faces(), tiny.faces);
    assert_eq!(view.lane_from_vertex(), tiny.lane_from_vertex);
    assert_eq!(view.vertex_from_lane(), tiny.vertex_from_lane);
    assert_eq!(view.rotation_scale(), tiny.rotation_scale);
    assert_eq!(view.stretch_scale(), tiny.stretch_scale);
    assert_eq!(view.blocks().collect::<Vec<_>>(), tiny.blocks);
    assert_eq!(view.components().collect::<Vec<_>>(), tiny.components);
    assert_eq!(view.fan_offsets(), tiny.fan_offsets);
    assert_eq!(view.fans(), tiny.fans);
    tier_is_read_as_written(&view.exact(), &tiny.exact);
    assert!(view.fast().is_none());
    assert_eq!(view.render_mesh(), tiny.basis().render);
}

fn tier_is_read_as_written(view: &TierView<'_>, tiny: &TinyTier) {
    assert_eq!(view.node_count(), tiny.rest_positions.len());
    assert_eq!(view.rest_positions(), tiny.rest_positions);
    assert_eq!(view.ring_offsets(), tiny.ring_offsets);
    assert_eq!(view.ring(), tiny.ring);
    assert_eq!(view.ring_weights(), tiny.ring_weights);
    assert_eq!(view.tile_offsets(), tiny.tile_offsets);
    assert_eq!(view.tile_rows(), tiny.tile_rows);
    assert_eq!(view.tiles(), tiny.tiles);
    assert_eq!(view.inverse_diagonals(), tiny.inverse_diagonals);
    assert_eq!(view.solver_from_lane(), tiny.solver_from_lane);
    assert_eq!(view.lane_from_solver(), tiny.lane_from_solver);
    assert_eq!(view.patch_offsets(), tiny.patch_offsets);
    assert_eq!(view.patch_owners(), tiny.patch_owners);
    assert_eq!(view.patch_values(), tiny.patch_values);
}

#[test]
fn entries_are_what_the_patches_hold() {
    let tiny = tiny_baked();
    let bytes = write_baked(&tiny.basis()).unwrap();
    let entries: Vec<_> = BakedView::open(&bytes).unwrap().exact().entries().collect();
    let held = tiny.exact.patch_values.iter().zip(&tiny.exact.patch_owners);
    for (values, owner) in held {
        for lane in 0..VERTEX_COUNT {
            let own = entries
                .iter()
                .find(|entry| entry.lane == lane && entry.component == usize::from(owner[0]));
            let stored = values.map(|row| row[lane]);
            assert_eq!(own.map_or([0; FEATURE_COUNT], |entry| entry.values), stored);
        }
    }
    assert!(entries.len() > 10);
}

#[test]
fn tiles_lie_on_cache_lines_of_the_file() {
    let bytes = write_baked(&tiny_baked().basis()).unwrap();
    let exact = BakedView::open(&bytes).unwrap().exact();
    for tiles in [exact.tiles(), exact.inverse_diagonals()] {
        assert_eq!((tiles.as_ptr().addr() - bytes.as_ptr().addr()) % 64, 0);
    }
}

#[test]
fn a_second_tier_is_read_as_written() {
    let mut tiny = tiny_baked();
    let mut fast = tiny.own_nodes();
    fast.nodes.rest_positions[0][0] = -0.5;
    fast.nodes.tiles[1][3] = 0.25;
    for weight in &mut fast.nodes.ring_weights {
        *weight = -*weight;
    }
    fast.skin_nodes[3] = [8, 0, 1, 0];
    fast.skin_weights[3] = [65_535, 0, 0, 0];
    tiny.fast = Some(fast.clone());
    let bytes = write_baked(&tiny.basis()).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    tier_is_read_as_written(&view.exact(), &tiny.exact);
    let read = view.fast().unwrap();
    tier_is_read_as_written(&read.nodes(), &fast.nodes);
    assert_eq!(read.centre(), fast.centre);
    assert_eq!(read.skin_nodes(), fast.skin_nodes);
    assert_eq!(read.skin_weights(), fast.skin_weights);
    assert_eq!(read.error(), fast.error);
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

/// Where a field lies in its archived record.
macro_rules! places {
    ($record:ty { $($field:ident),* $(,)? }) => {
        [$(core::mem::offset_of!($record, $field)),*]
    };
}

/// The tables of FORMAT.md, so that neither a field nor a new rkyv moves a byte unseen.
#[test]
fn records_lie_as_documented() {
    use core::mem::{align_of, size_of};
    type Compact = ArchivedCompactBasis<'static>;
    type Component = ArchivedComponentRecord<'static>;
    type Baked = ArchivedBakedBasis<'static>;
    type Tier = ArchivedBakedTier<'static>;
    type Control = ArchivedBakedComponent<'static>;
    let compact = places!(Compact {
        rest_positions,
        faces,
        bridges,
        anchor_vertex,
        rotation_scale,
        stretch_scale,
        blocks,
        components,
        support_bits,
        values,
        provenance,
        quality,
        render,
    });
    assert_eq!(compact, [0, 8, 24, 32, 36, 40, 44, 52, 60, 68, 80, 128, 140]);
    assert_eq!((size_of::<Compact>(), align_of::<Compact>()), (168, 8));
    let block = places!(ArchivedBlockRecord {
        level,
        parent_component,
        first_component,
        component_count,
        encoder,
        decoder,
    });
    assert_eq!(block, [0, 4, 8, 12, 16, 700]);
    assert_eq!(size_of::<ArchivedBlockRecord>(), 1384);
    assert_eq!(
        places!(ArchivedGraphConvRecord { point, neighbour, bias }),
        [0, 324, 648]
    );
    assert_eq!(size_of::<ArchivedGraphConvRecord>(), 684);
    let component = places!(Component {
        name,
        block,
        centre_vertex,
        scale,
        strength,
        locality,
        minimum,
        maximum,
        value_scale,
    });
    assert_eq!(component, [0, 8, 12, 16, 20, 24, 28, 32, 36]);
    assert_eq!(size_of::<Component>(), 40);
    let provenance = places!(ArchivedProvenance<'static> { tool, sequence, config, seed, shape_count, train_shapes });
    assert_eq!(provenance, [0, 8, 16, 24, 32, 36]);
    assert_eq!(size_of::<ArchivedProvenance<'static>>(), 48);
    assert_eq!(
        places!(ArchivedQuality {
            validation_e_rms,
            steps,
            steps_run
        }),
        [0, 4, 8]
    );
    assert_eq!(size_of::<ArchivedQuality>(), 12);
    let baked = places!(Baked {
        compact_id,
        faces,
        lane_from_vertex,
        vertex_from_lane,
        rotation_scale,
        stretch_scale,
        blocks,
        components,
        fan_offsets,
        fans,
        exact,
        fast,
        render,
    });
    assert_eq!(baked, [0, 16, 24, 32, 40, 44, 48, 56, 64, 72, 80, 184, 348]);
    assert_eq!((size_of::<Baked>(), align_of::<Baked>()), (372, 4));
    let fast = places!(ArchivedBakedFast<'static> { nodes, centre, skin_nodes, skin_weights, error });
    assert_eq!(fast, [0, 104, 116, 124, 132]);
    assert_eq!(size_of::<ArchivedBakedFast<'static>>(), 160);
    let error = places!(ArchivedFastError {
        mixed_rms,
        mixed_p99,
        mixed_max,
        single_rms,
        single_max,
        normal_rms,
        mixed_poses,
    });
    assert_eq!(error, [0, 4, 8, 12, 16, 20, 24]);
    assert_eq!(size_of::<ArchivedFastError>(), 28);
    type Render = ArchivedRenderMesh<'static>;
    assert_eq!(places!(Render { vertices, uvs, faces }), [0, 8, 16]);
    assert_eq!((size_of::<Render>(), align_of::<Render>()), (24, 4));
    let tier = places!(Tier {
        rest_positions,
        ring_offsets,
        ring,
        ring_weights,
        tile_offsets,
        tile_rows,
        tiles,
        inverse_diagonals,
        solver_from_lane,
        lane_from_solver,
        patch_offsets,
        patch_owners,
        patch_values,
    });
    assert_eq!(tier, [0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 80, 88, 96]);
    assert_eq!((size_of::<Tier>(), align_of::<Tier>()), (104, 4));
    let block = places!(ArchivedBakedBlock {
        level,
        parent_component,
        first_component,
        component_count,
        bias,
    });
    assert_eq!(block, [0, 4, 8, 12, 16]);
    assert_eq!(size_of::<ArchivedBakedBlock>(), 52);
    let control = places!(Control {
        name,
        block,
        minimum,
        maximum,
        value_scale
    });
    assert_eq!(control, [0, 8, 12, 16, 20]);
    assert_eq!(size_of::<Control>(), 24);
}
