//! Each rule broken once on the tiny package, and the error that names it.

use alloc::string::String;

use super::super::fixture::{COMPONENT_COUNT, TinyBaked, TinyCompact, VERTEX_COUNT, tiny_baked, tiny_compact};
use super::super::*;
use OpenError::*;

const V: u32 = VERTEX_COUNT as u32;
const HALF_INFINITY: u16 = 0x7c00;
const HALF_NAN: u16 = 0xfe01;

fn compact(damage: impl Fn(&mut TinyCompact), expected: OpenError) {
    let mut tiny = tiny_compact();
    damage(&mut tiny);
    assert_eq!(write_compact(&tiny.basis()).err(), Some(WriteError::Refused(expected)));
}

fn baked(damage: impl Fn(&mut TinyBaked), expected: OpenError) {
    let mut tiny = tiny_baked();
    damage(&mut tiny);
    assert_eq!(write_baked(&tiny.basis()).err(), Some(WriteError::Refused(expected)));
}

fn not_finite(field: &'static str, index: usize) -> OpenError {
    NotFinite { field, index }
}

fn beyond(field: &'static str, index: usize, value: u32, limit: u32) -> OpenError {
    IndexOutOfRange {
        field,
        index,
        value,
        limit,
    }
}

fn counts(field: &'static str, expected: u64, actual: u64) -> OpenError {
    CountMismatch {
        field,
        expected,
        actual,
    }
}

#[test]
fn mesh_rules() {
    let field = "rest_positions";
    compact(|t| t.rest_positions[4][2] = f32::NAN, not_finite(field, 4));
    baked(|t| t.rest_positions[8][0] = f32::INFINITY, not_finite(field, 8));
    let far = 2.0 * limits::POSITION;
    let (least, greatest) = (-limits::POSITION, limits::POSITION);
    compact(
        |t| t.rest_positions[1][1] = far,
        OutOfRange {
            field,
            index: 1,
            value: far,
            least,
            greatest,
        },
    );
    compact(
        |t| t.rest_positions.truncate(2),
        TooFew {
            field,
            least: 3,
            actual: 2,
        },
    );
    compact(
        |t| t.faces.clear(),
        TooFew {
            field: "faces",
            least: 1,
            actual: 0,
        },
    );
    compact(|t| t.faces[7][2] = V, beyond("faces", 7, V, V));
    baked(|t| t.faces[0][0] = u32::MAX, beyond("faces", 0, u32::MAX, V));
    compact(|t| t.anchor_vertex = V, beyond("anchor_vertex", 0, V, V));
    compact(|t| t.bridges[0][1] = V, beyond("bridges", 0, V, V));
    compact(
        |t| t.bridges[0] = [5, 5],
        NotAscending {
            field: "bridges",
            index: 0,
        },
    );
    compact(
        |t| t.bridges.push([0, 8]),
        NotAscending {
            field: "bridges",
            index: 1,
        },
    );
}

#[test]
fn scale_rules() {
    compact(
        |t| t.rotation_scale = 0.0,
        NotPositive {
            field: "rotation_scale",
            index: 0,
        },
    );
    baked(|t| t.rotation_scale = f32::NAN, not_finite("rotation_scale", 0));
    baked(
        |t| t.stretch_scale = -1.0,
        NotPositive {
            field: "stretch_scale",
            index: 0,
        },
    );
    let (least, greatest) = (f32::MIN, limits::FEATURE_SCALE);
    let value = 2.0 * greatest;
    compact(
        |t| t.stretch_scale = value,
        OutOfRange {
            field: "stretch_scale",
            index: 0,
            value,
            least,
            greatest,
        },
    );
}

#[test]
fn tree_rules() {
    compact(
        |t| t.blocks.clear(),
        TooFew {
            field: "blocks",
            least: 1,
            actual: 0,
        },
    );
    compact(
        |t| t.components.clear(),
        TooFew {
            field: "components",
            least: 1,
            actual: 0,
        },
    );
    compact(|t| t.blocks[0].level = 1, ParentAfterChild { block: 0 });
    compact(|t| t.blocks[0].parent_component = 0, ParentAfterChild { block: 0 });
    baked(|t| t.blocks[1].parent_component = NONE, ParentAfterChild { block: 1 });
    baked(|t| t.blocks[1].parent_component = 2, ParentAfterChild { block: 1 });
    baked(|t| t.blocks[2].parent_component = 2, ParentAfterChild { block: 2 });
    baked(|t| t.blocks[2].level = 2, ParentAfterChild { block: 2 });
    baked(|t| t.blocks[2].level = 0, ParentAfterChild { block: 2 });
    compact(
        |t| t.blocks[2].parent_component = 0,
        NotAscending {
            field: "blocks.parent_component",
            index: 2,
        },
    );
    compact(
        |t| t.blocks[1].first_component = 1,
        NotContiguous {
            field: "blocks.first_component",
            index: 1,
        },
    );
    compact(
        |t| t.components[2].block = 0,
        NotContiguous {
            field: "components.block",
            index: 2,
        },
    );
    compact(
        |t| t.components[1].block = u32::MAX,
        NotContiguous {
            field: "components.block",
            index: 1,
        },
    );
    compact(|t| t.blocks[2].component_count = 2, counts("components", 5, 4));
    compact(
        |t| t.blocks[2].component_count = u32::MAX,
        counts("components", 3 + u64::from(u32::MAX), 4),
    );
    compact(|t| t.blocks[2].component_count = 0, counts("components", 3, 4));
}

#[test]
fn component_rules() {
    let invalid = |index| NameInvalid {
        field: "components.name",
        index,
    };
    compact(|t| t.components[1].name = "", invalid(1));
    baked(|t| t.components[1].name = "a\tb", invalid(1));
    let long: &'static str = String::from_iter(core::iter::repeat_n('x', limits::NAME_BYTES + 1)).leak();
    compact(|t| t.components[3].name = long, invalid(3));
    compact(|t| t.components[3].name = "c01", NameDuplicate { first: 1, second: 3 });
    baked(|t| t.components[1].name = "c00", NameDuplicate { first: 0, second: 1 });
    compact(
        |t| t.components[2].centre_vertex = V,
        beyond("components.centre_vertex", 2, V, V),
    );
    let range = |field, index, value, least, greatest| OutOfRange {
        field,
        index,
        value,
        least,
        greatest,
    };
    compact(
        |t| t.components[2].scale = 1.5,
        range("components.scale", 2, 1.5, 0.0, 1.0),
    );
    compact(
        |t| t.components[2].locality = -0.5,
        range("components.locality", 2, -0.5, 0.0, 1.0),
    );
    compact(
        |t| t.components[2].strength = f32::NAN,
        not_finite("components.strength", 2),
    );
    compact(
        |t| t.components[2].minimum = f32::NEG_INFINITY,
        not_finite("components.minimum", 2),
    );
    baked(
        |t| t.components[2].maximum = f32::NAN,
        not_finite("components.maximum", 2),
    );
    compact(|t| t.components[0].minimum = 0.5, RangeWithoutZero { component: 0 });
    baked(|t| t.components[0].maximum = -0.5, RangeWithoutZero { component: 0 });
    compact(
        |t| t.components[0].value_scale = 0.0,
        NotPositive {
            field: "components.value_scale",
            index: 0,
        },
    );
    baked(
        |t| t.components[3].value_scale = f32::NAN,
        not_finite("components.value_scale", 3),
    );
}

#[test]
fn a_control_may_rest_at_a_stop() {
    let mut tiny = tiny_compact();
    tiny.components[0].minimum = 0.0;
    tiny.components[1].maximum = -0.0;
    assert!(write_compact(&tiny.basis()).is_ok());
}

#[test]
fn compact_network_and_value_rules() {
    compact(
        |t| t.blocks[1].encoder.point[3][4] = f32::NAN,
        not_finite("blocks.encoder", 1),
    );
    compact(
        |t| t.blocks[2].decoder.neighbour[8][8] = f32::INFINITY,
        not_finite("blocks.decoder", 2),
    );
    compact(
        |t| t.blocks[0].decoder.bias[0] = f32::NAN,
        not_finite("blocks.decoder", 0),
    );
    let value_count = tiny_compact().values.len() as u64;
    compact(
        |t| t.support_bits.truncate(3),
        counts("support_bits", COMPONENT_COUNT as u64, 3),
    );
    compact(|t| t.support_bits[1] |= 1 << V, BitmapTail { component: 1 });
    compact(
        |t| t.support_bits[1] ^= 1 << 8,
        counts("values", value_count - 1, value_count),
    );
    compact(
        |t| t.values.push([0; FEATURE_COUNT]),
        counts("values", value_count, value_count + 1),
    );
    compact(|t| t.values[5][8] = HALF_INFINITY, not_finite("values", 5));
    compact(|t| t.values[0][0] = HALF_NAN, not_finite("values", 0));
}

#[test]
fn provenance_and_quality_rules() {
    let invalid = |field| NameInvalid { field, index: 0 };
    compact(|t| t.provenance.tool = "", invalid("provenance.tool"));
    compact(|t| t.provenance.sequence = "a\nb", invalid("provenance.sequence"));
    let long: &'static str = String::from_iter(core::iter::repeat_n('#', limits::CONFIG_BYTES + 1)).leak();
    let (limit, actual) = (limits::CONFIG_BYTES, limits::CONFIG_BYTES + 1);
    compact(
        |t| t.provenance.config = long,
        TooMany {
            field: "provenance.config",
            limit,
            actual,
        },
    );
    compact(
        |t| t.provenance.shape_count = 0,
        TooFew {
            field: "provenance.shape_count",
            least: 1,
            actual: 0,
        },
    );
    let field = "provenance.train_shapes";
    compact(|t| t.provenance.train_shapes = &[0, 4], beyond(field, 1, 4, 4));
    compact(
        |t| t.provenance.train_shapes = &[2, 2],
        NotAscending { field, index: 1 },
    );
    compact(
        |t| t.quality.validation_e_rms = f32::NAN,
        not_finite("quality.validation_e_rms", 0),
    );
    let range = OutOfRange {
        field: "quality.validation_e_rms",
        index: 0,
        value: -0.5,
        least: 0.0,
        greatest: limits::QUALITY,
    };
    compact(|t| t.quality.validation_e_rms = -0.5, range);
    compact(
        |t| t.quality.steps = 41,
        TooMany {
            field: "quality.steps",
            limit: 40,
            actual: 41,
        },
    );
}

#[test]
fn a_figure_may_be_unmeasured() {
    let mut tiny = tiny_compact();
    tiny.quality.validation_e_rms = -1.0;
    assert!(write_compact(&tiny.basis()).is_ok());
}

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

#[test]
fn every_message_names_its_fault() {
    let named = NotFinite {
        field: "values",
        index: 12,
    };
    assert_eq!(alloc::format!("{named}"), "`values` 12 is not a finite number");
    let kind = WrongKind {
        expected: PackageKind::Baked,
        found: PackageKind::Compact,
    };
    assert!(alloc::format!("{kind}").contains("sinew bake"));
    let version = UnsupportedVersion {
        found: 9,
        first: 1,
        latest: 1,
    };
    assert!(alloc::format!("{version}").contains("version 9"));
}
