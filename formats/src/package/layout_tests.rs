//! The tables of FORMAT.md, so that neither a field nor a new rkyv moves a byte unseen.

use super::*;

/// Where a field lies in its archived record.
macro_rules! places {
    ($record:ty { $($field:ident),* $(,)? }) => {
        [$(core::mem::offset_of!($record, $field)),*]
    };
}

#[test]
fn records_lie_as_documented() {
    use core::mem::{align_of, size_of};
    type Compact = ArchivedCompactBasis<'static>;
    type Component = ArchivedComponentRecord<'static>;
    type Baked = ArchivedBakedBasis<'static>;
    type Patches = ArchivedBakedPatches<'static>;
    type Solve = ArchivedBakedSolve<'static>;
    type Control = ArchivedBakedComponent<'static>;
    let compact = places!(Compact {
        rest_positions,
        surface,
        bridges,
        anchor_vertex,
        rotation_scale,
        stretch_scale,
        blocks,
        components,
        support_bits,
        values,
        after,
        prior,
        encoder,
        provenance,
        quality,
    });
    assert_eq!(compact, [0, 8, 48, 56, 60, 64, 68, 76, 84, 92, 100, 140, 168, 176, 224]);
    assert_eq!((size_of::<Compact>(), align_of::<Compact>()), (240, 8));
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
        value_scales,
    });
    assert_eq!(component, [0, 8, 12, 16, 20, 24, 28, 32, 36]);
    assert_eq!(size_of::<Component>(), 44);
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
        rotation_scale,
        stretch_scale,
        blocks,
        components,
        rest_positions,
        slot_from_vertex,
        vertex_from_slot,
        surface,
        fan_offsets,
        fans,
        exact,
        bones,
        after,
        prior,
    });
    assert_eq!(baked, [0, 16, 20, 24, 32, 40, 48, 64, 80, 120, 128, 144, 260, 464, 504]);
    assert_eq!((size_of::<Baked>(), align_of::<Baked>()), (532, 4));
    let exact = places!(ArchivedBakedExact<'static> { patches, solve });
    assert_eq!(exact, [0, 24]);
    assert_eq!(size_of::<ArchivedBakedExact<'static>>(), 112);
    let bones = places!(ArchivedBakedBones<'static> {
        patches,
        node_count,
        rest_places,
        axes,
        turn_nodes,
        turns,
        pulls,
        pull_scales,
        slides,
        slide_scales,
        skin,
        error,
    });
    assert_eq!(bones, [0, 24, 28, 36, 44, 52, 60, 68, 76, 84, 92, 120]);
    assert_eq!(size_of::<ArchivedBakedBones<'static>>(), 200);
    let skin = places!(ArchivedBakedSkin<'static> { influences, bones, weights, rest_normals });
    assert_eq!(skin, [0, 4, 12, 20]);
    assert_eq!(size_of::<ArchivedBakedSkin<'static>>(), 28);
    let error = places!(ArchivedBonesError {
        sliders,
        sliders_scaled,
        shapes,
        shapes_scaled
    });
    assert_eq!(error, [0, 20, 40, 60]);
    assert_eq!(
        places!(ArchivedPoseError {
            rms,
            p99,
            max,
            normal_rms,
            poses
        }),
        [0, 4, 8, 12, 16]
    );
    type Surface = ArchivedSurface<'static>;
    assert_eq!(
        places!(Surface {
            corners,
            render_points,
            uvs
        }),
        [0, 16, 32]
    );
    assert_eq!((size_of::<Surface>(), align_of::<Surface>()), (40, 4));
    assert_eq!(
        places!(Patches {
            offsets,
            owners,
            values
        }),
        [0, 8, 16]
    );
    assert_eq!((size_of::<Patches>(), align_of::<Patches>()), (24, 4));
    let solve = places!(Solve {
        ring_offsets,
        ring,
        ring_weights,
        tile_offsets,
        tile_rows,
        tiles,
        inverse_diagonals,
        solver_from_slot,
    });
    assert_eq!(solve, [0, 8, 24, 32, 40, 56, 64, 72]);
    assert_eq!((size_of::<Solve>(), align_of::<Solve>()), (88, 4));
    let after = places!(ArchivedAfter<'static> { piece_of, piece_offsets, mix, modes, mode_scales });
    assert_eq!(after, [0, 8, 16, 24, 32]);
    assert_eq!(size_of::<ArchivedAfter<'static>>(), 40);
    let prior = places!(ArchivedPrior<'static> { mean, factors, variances, strength });
    assert_eq!(prior, [0, 8, 16, 24]);
    assert_eq!(size_of::<ArchivedPrior<'static>>(), 28);
    assert_eq!(places!(ArchivedValueScales { rotation, stretch }), [0, 4]);
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
        value_scales
    });
    assert_eq!(control, [0, 8, 12, 16, 20]);
    assert_eq!(size_of::<Control>(), 28);
}
