//! Rules of the baked payload alone.

use super::*;

#[test]
fn permutation_rules() {
    let (field, v) = ("slot_from_vertex", u64::from(V));
    baked(|t| t.slot_from_vertex.truncate(8), counts(field, v, v - 1));
    baked(|t| t.vertex_from_slot.push(0), counts("vertex_from_slot", v, v + 1));
    baked(|t| t.slot_from_vertex[6] = V, beyond(field, 6, V, V));
    baked(|t| t.slot_from_vertex[0] = 1, NotAPermutation { field, index: 0 });
    baked(|t| t.vertex_from_slot.swap(0, 1), NotAPermutation { field, index: 4 });
    let (field, index) = ("solver_from_slot", 1);
    baked(|t| t.exact.solver_from_slot.truncate(8), counts(field, v, v - 1));
    baked(|t| t.exact.solver_from_slot[3] = V, beyond(field, 3, V, V));
    baked(|t| t.exact.solver_from_slot[1] = 8, NotAPermutation { field, index });
}

#[test]
fn fan_rules() {
    let (field, tiny) = ("fan_offsets", tiny_baked());
    let (rows, steps) = (tiny.fan_offsets.len() as u64, tiny.fans.len() as u64);
    baked(|t| t.fan_offsets.truncate(2), counts(field, rows, 2));
    baked(|t| t.fan_offsets[0] = 1, NotContiguous { field, index: 0 });
    baked(|t| t.fan_offsets[1] = u32::MAX, NotAscending { field, index: 2 });
    baked(|t| t.fans.push([0; 4]), counts(field, steps + 1, steps));
    baked(|t| t.fans[2][3] = V, beyond("fans", 2, V, V));
}

#[test]
fn ring_rules() {
    let ring_count = tiny_baked().exact.ring.len() as u64;
    baked(
        |t| t.exact.ring_weights.truncate(1),
        counts("ring_weights", ring_count, 1),
    );
    baked(
        |t| t.exact.ring_offsets.truncate(9),
        counts("ring_offsets", u64::from(V) + 1, 9),
    );
    baked(
        |t| t.exact.ring_offsets[9] += 1,
        counts("ring_offsets", ring_count, ring_count + 1),
    );
    baked(
        |t| t.exact.ring_offsets[0] = 1,
        NotContiguous {
            field: "ring_offsets",
            index: 0,
        },
    );
    baked(
        |t| t.exact.ring_offsets[4] = 0,
        NotAscending {
            field: "ring_offsets",
            index: 4,
        },
    );
    baked(
        |t| t.exact.ring.swap(0, 1),
        NotAscending {
            field: "ring",
            index: 1,
        },
    );
    baked(
        |t| *t.exact.ring.last_mut().unwrap() = V,
        beyond("ring", ring_count as usize - 1, V, V),
    );
    // The row of solver 0 begins with itself.
    baked(
        |t| t.exact.ring[0] = 0,
        NotSymmetric {
            field: "ring",
            index: 0,
        },
    );
    let row_0 = tiny_baked().exact.ring[..tiny_baked().exact.ring_offsets[1] as usize].to_vec();
    let entry = row_0.iter().position(|&solver| solver == 4).unwrap();
    baked(
        |t| t.exact.ring_weights[entry] += 0.25,
        NotSymmetric {
            field: "ring",
            index: entry,
        },
    );
    baked(|t| t.exact.ring_weights[3] = f32::NAN, not_finite("ring_weights", 3));
    let (least, greatest) = (0.0, limits::EDGE_WEIGHT);
    let negative = OutOfRange {
        field: "ring_weights",
        index: 0,
        value: -1.0,
        least,
        greatest,
    };
    baked(|t| t.exact.ring_weights[0] = -1.0, negative);
}

#[test]
fn factor_rules() {
    let tiny = tiny_baked().exact;
    let (tile_count, column_count) = (tiny.tile_rows.len() as u64, u64::from(V).div_ceil(4));
    assert_eq!((tile_count, column_count), (2, 3));
    let ascends = |index| NotAscending {
        field: "tile_rows",
        index,
    };
    baked(|t| t.exact.tiles.clear(), counts("tiles", tile_count, 0));
    baked(
        |t| t.exact.tile_offsets.truncate(3),
        counts("tile_offsets", column_count + 1, 3),
    );
    baked(|t| t.exact.tile_offsets[3] = 0, counts("tile_offsets", tile_count, 0));
    let one_column = |t: &mut TinyBaked, rows: [u32; 2]| {
        t.exact.tile_offsets = alloc::vec![0, 2, 2, 2];
        t.exact.tile_rows = rows.to_vec();
    };
    baked(|t| one_column(t, [2, 1]), ascends(1));
    baked(|t| one_column(t, [1, 3]), beyond("tile_rows", 1, 3, 3));
    baked(|t| t.exact.tile_rows[0] = 0, ascends(0));
    baked(|t| t.exact.tiles[1][15] = f32::NAN, not_finite("tiles", 1));
    let (least, greatest) = (-limits::FACTOR_VALUE, limits::FACTOR_VALUE);
    let large = OutOfRange {
        field: "tiles",
        index: 1,
        value: -2.0 * greatest,
        least,
        greatest,
    };
    baked(|t| t.exact.tiles[1][4] = -2.0 * limits::FACTOR_VALUE, large);
    baked(
        |t| t.exact.inverse_diagonals.truncate(2),
        counts("inverse_diagonals", column_count, 2),
    );
    baked(|t| t.exact.inverse_diagonals[1][5] = 0.0, PivotNotPositive { index: 5 });
    baked(
        |t| t.exact.inverse_diagonals[2][0] = -1.0,
        PivotNotPositive { index: 8 },
    );
    baked(
        |t| t.exact.inverse_diagonals[0][1] = f32::INFINITY,
        not_finite("inverse_diagonals", 0),
    );
}

#[test]
fn patch_rules() {
    let tiny = tiny_baked().exact;
    let patch_count = tiny.patches.owners.len() as u64;
    baked(|t| t.blocks[1].bias[4] = f32::NAN, not_finite("blocks.bias", 1));
    let field = "patch_offsets";
    baked(|t| t.exact.patches.offsets.push(4), counts(field, 2, 3));
    baked(|t| t.exact.patches.offsets[0] = 1, NotContiguous { field, index: 0 });
    baked(|t| t.exact.patches.offsets[1] = 3, counts(field, patch_count, 3));
    let field = "patch_owners";
    baked(
        |t| t.exact.patches.values.truncate(1),
        counts("patch_values", patch_count, 1),
    );
    let (unknown, limit) = (COMPONENT_COUNT as u16, COMPONENT_COUNT as u32);
    baked(
        |t| t.exact.patches.owners[3][0] = unknown,
        beyond(field, 3, limit, limit),
    );
    baked(|t| t.exact.patches.owners[3][0] = 2, NotAscending { field, index: 3 });
    baked(|t| t.exact.patches.owners.swap(0, 1), NotAscending { field, index: 1 });
    baked(|t| t.exact.patches.owners[3][1] = 1, NotContiguous { field, index: 3 });
}
