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
    let entry_count = tiny.factor_rows.len() as u64;
    baked(
        |t| t.exact.factor_values.clear(),
        counts("factor_values", entry_count, 0),
    );
    baked(
        |t| t.exact.factor_offsets[9] = 0,
        counts("factor_offsets", entry_count, 0),
    );
    baked(
        |t| t.exact.factor_rows.swap(0, 1),
        NotAscending {
            field: "factor_rows",
            index: 1,
        },
    );
    baked(
        |t| t.exact.factor_rows[0] = 0,
        NotAscending {
            field: "factor_rows",
            index: 0,
        },
    );
    let last = entry_count as usize - 1;
    baked(|t| t.exact.factor_rows[last] = V, beyond("factor_rows", last, V, V));
    baked(|t| t.exact.factor_values[2] = f32::NAN, not_finite("factor_values", 2));
    baked(|t| t.exact.inverse_pivots.truncate(8), counts("inverse_pivots", 9, 8));
    baked(|t| t.exact.inverse_pivots[8] = 0.0, PivotNotPositive { index: 8 });
    baked(|t| t.exact.inverse_pivots[2] = -1.0, PivotNotPositive { index: 2 });
    baked(
        |t| t.exact.inverse_pivots[2] = f32::INFINITY,
        not_finite("inverse_pivots", 2),
    );
}

#[test]
fn support_and_entry_rules() {
    let tiny = tiny_baked().exact;
    let (support_count, entry_count) = (tiny.support.len() as u64, tiny.entry_slots.len() as u64);
    baked(|t| t.blocks[1].bias[4] = f32::NAN, not_finite("blocks.bias", 1));
    let (last, end) = (tiny.support_offsets.len(), support_count);
    baked(
        |t| t.exact.support_offsets.truncate(last - 1),
        counts("support_offsets", last as u64, last as u64 - 1),
    );
    baked(
        |t| t.exact.support_offsets[0] = 1,
        NotContiguous {
            field: "support_offsets",
            index: 0,
        },
    );
    baked(
        |t| t.exact.support_offsets[1] = u32::MAX,
        NotAscending {
            field: "support_offsets",
            index: 2,
        },
    );
    baked(|t| t.exact.support.push(0), counts("support_offsets", end + 1, end));
    baked(
        |t| t.exact.support.swap(0, 1),
        NotAscending {
            field: "support",
            index: 1,
        },
    );
    let last = support_count as usize - 1;
    baked(|t| t.exact.support[last] = V, beyond("support", last, V, V));
    baked(
        |t| t.exact.entry_offsets[2] = 0,
        NotAscending {
            field: "entry_offsets",
            index: 2,
        },
    );
    baked(
        |t| t.exact.entry_offsets[4] += 1,
        counts("entry_offsets", entry_count, entry_count + 1),
    );
    baked(
        |t| t.exact.entry_values.truncate(1),
        counts("entry_values", entry_count, 1),
    );
    let own = tiny.support_offsets[3] - tiny.support_offsets[2];
    let last = entry_count as usize - 1;
    baked(
        |t| t.exact.entry_slots[last] = own,
        beyond("entry_slots", last, own, own),
    );
    baked(
        |t| t.exact.entry_slots.swap(0, 1),
        NotAscending {
            field: "entry_slots",
            index: 1,
        },
    );
    baked(|t| t.exact.entry_values[7][0] = HALF_NAN, not_finite("entry_values", 7));
}

/// The same checks run on both tiers: one rule of each kind shows that they do.
#[test]
fn rules_of_the_fast_tier() {
    let fast = |damage: fn(&mut TinyTier), expected| {
        baked(
            |t| {
                let mut tier = t.exact.clone();
                damage(&mut tier);
                t.fast = Some(tier);
            },
            expected,
        );
    };
    let field = "rest_positions";
    fast(
        |t| t.rest_positions.clear(),
        TooFew {
            field,
            least: 1,
            actual: 0,
        },
    );
    let (limit, actual) = (V as usize, V as usize + 1);
    fast(|t| t.rest_positions.push([0.0; 3]), TooMany { field, limit, actual });
    fast(|t| t.rest_positions[2][1] = f32::NAN, not_finite(field, 2));
    fast(|t| t.ring_weights[3] = f32::NAN, not_finite("ring_weights", 3));
    fast(|t| t.factor_values[2] = f32::NAN, not_finite("factor_values", 2));
    fast(|t| t.support[0] = V, beyond("support", 0, V, V));
    fast(|t| t.entry_values[7][0] = HALF_NAN, not_finite("entry_values", 7));
}
