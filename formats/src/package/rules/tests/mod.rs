//! Each rule broken once on the tiny package, and the error that names it.

mod added;
mod baked;
mod bones;
mod compact;
mod surface;

use alloc::string::String;

use super::super::fixture::{
    COMPONENT_COUNT, TinyBaked, TinyBones, TinyCompact, TinySurface, VERTEX_COUNT, tiny_baked, tiny_compact,
};
use super::super::*;
use OpenError::*;

const V: u32 = VERTEX_COUNT as u32;

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
        |t| t.components[0].value_scales.rotation = 0.0,
        NotPositive {
            field: "components.value_scales",
            index: 0,
        },
    );
    baked(
        |t| t.components[3].value_scales.stretch = f32::NAN,
        not_finite("components.value_scales", 3),
    );
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
        first: FIRST_VERSION,
        latest: FORMAT_VERSION,
    };
    assert!(alloc::format!("{version}").contains("version 9"));
}
