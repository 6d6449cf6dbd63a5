//! Rules of the compact payload alone.

use super::*;

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
