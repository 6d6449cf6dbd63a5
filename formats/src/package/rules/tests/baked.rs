//! Rules of the baked payload alone.

use super::*;

#[test]
fn permutation_rules() {
    let (field, v) = ("solver_from_vertex", u64::from(V));
    baked(|t| t.solver_from_vertex.truncate(8), counts(field, v, v - 1));
    baked(|t| t.vertex_from_solver.push(0), counts("vertex_from_solver", v, v + 1));
    baked(|t| t.solver_from_vertex[6] = V, beyond(field, 6, V, V));
    baked(|t| t.solver_from_vertex[0] = 1, NotAPermutation { field, index: 0 });
    baked(|t| t.vertex_from_solver.swap(0, 1), NotAPermutation { field, index: 0 });
}

#[test]
fn ring_rules() {
    let ring_count = tiny_baked().ring.len() as u64;
    baked(|t| t.ring_weights.truncate(1), counts("ring_weights", ring_count, 1));
    baked(
        |t| t.ring_offsets.truncate(9),
        counts("ring_offsets", u64::from(V) + 1, 9),
    );
    baked(
        |t| t.ring_offsets[9] += 1,
        counts("ring_offsets", ring_count, ring_count + 1),
    );
    baked(
        |t| t.ring_offsets[0] = 1,
        NotContiguous {
            field: "ring_offsets",
            index: 0,
        },
    );
    baked(
        |t| t.ring_offsets[4] = 0,
        NotAscending {
            field: "ring_offsets",
            index: 4,
        },
    );
    baked(
        |t| t.ring.swap(0, 1),
        NotAscending {
            field: "ring",
            index: 1,
        },
    );
    baked(
        |t| *t.ring.last_mut().unwrap() = V,
        beyond("ring", ring_count as usize - 1, V, V),
    );
    // The row of solver 0 begins with itself.
    baked(
        |t| t.ring[0] = 0,
        NotSymmetric {
            field: "ring",
            index: 0,
        },
    );
    let row_0 = tiny_baked().ring[..tiny_baked().ring_offsets[1] as usize].to_vec();
    let entry = row_0.iter().position(|&solver| solver == 4).unwrap();
    baked(
        |t| t.ring_weights[entry] += 0.25,
        NotSymmetric {
            field: "ring",
            index: entry,
        },
    );
    baked(|t| t.ring_weights[3] = f32::NAN, not_finite("ring_weights", 3));
    let (least, greatest) = (0.0, limits::EDGE_WEIGHT);
    let negative = OutOfRange {
        field: "ring_weights",
        index: 0,
        value: -1.0,
        least,
        greatest,
    };
    baked(|t| t.ring_weights[0] = -1.0, negative);
}

#[test]
fn factor_rules() {
    let tiny = tiny_baked();
    let entry_count = tiny.factor_rows.len() as u64;
    baked(|t| t.factor_values.clear(), counts("factor_values", entry_count, 0));
    baked(|t| t.factor_offsets[9] = 0, counts("factor_offsets", entry_count, 0));
    baked(
        |t| t.factor_rows.swap(0, 1),
        NotAscending {
            field: "factor_rows",
            index: 1,
        },
    );
    baked(
        |t| t.factor_rows[0] = 0,
        NotAscending {
            field: "factor_rows",
            index: 0,
        },
    );
    let last = entry_count as usize - 1;
    baked(|t| t.factor_rows[last] = V, beyond("factor_rows", last, V, V));
    baked(|t| t.factor_values[2] = f32::NAN, not_finite("factor_values", 2));
    baked(|t| t.inverse_pivots.truncate(8), counts("inverse_pivots", 9, 8));
    baked(|t| t.inverse_pivots[8] = 0.0, PivotNotPositive { index: 8 });
    baked(|t| t.inverse_pivots[2] = -1.0, PivotNotPositive { index: 2 });
    baked(|t| t.inverse_pivots[2] = f32::INFINITY, not_finite("inverse_pivots", 2));
}

#[test]
fn support_and_entry_rules() {
    let tiny = tiny_baked();
    let (support_count, entry_count) = (tiny.support.len() as u64, tiny.entry_slots.len() as u64);
    baked(|t| t.blocks[1].bias[4] = f32::NAN, not_finite("blocks.bias", 1));
    baked(
        |t| t.blocks[1].first_support += 1,
        NotContiguous {
            field: "blocks.first_support",
            index: 1,
        },
    );
    let start = tiny.blocks[2].first_support;
    let overlong = counts("support", u64::from(start) + u64::from(u32::MAX), support_count);
    baked(|t| t.blocks[2].support_count = u32::MAX, overlong);
    baked(
        |t| t.support.push(0),
        counts("support", support_count, support_count + 1),
    );
    baked(
        |t| t.support.swap(0, 1),
        NotAscending {
            field: "support",
            index: 1,
        },
    );
    let last = support_count as usize - 1;
    baked(|t| t.support[last] = V, beyond("support", last, V, V));
    baked(
        |t| t.components[1].first_entry += 1,
        NotContiguous {
            field: "components.first_entry",
            index: 1,
        },
    );
    let start = tiny.components[3].first_entry;
    let overlong = counts("entry_slots", u64::from(start) + u64::from(u32::MAX), entry_count);
    baked(|t| t.components[3].entry_count = u32::MAX, overlong);
    baked(|t| t.entry_values.truncate(1), counts("entry_values", entry_count, 1));
    let own = tiny.blocks[2].support_count;
    let last = entry_count as usize - 1;
    baked(|t| t.entry_slots[last] = own, beyond("entry_slots", last, own, own));
    baked(
        |t| t.entry_slots.swap(0, 1),
        NotAscending {
            field: "entry_slots",
            index: 1,
        },
    );
    baked(|t| t.entry_values[7][0] = HALF_NAN, not_finite("entry_values", 7));
}
