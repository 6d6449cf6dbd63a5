//! Rules of the bone tier.

use super::*;

fn bones(damage: impl Fn(&mut TinyBones), expected: OpenError) {
    baked(
        |t| {
            let mut bones = t.three_bones();
            damage(&mut bones);
            t.bones = Some(bones);
        },
        expected,
    );
}

/// The bones of the tiny package.
const B: u64 = 3;

fn outside(field: &'static str, index: usize, value: f32, least: f32, greatest: f32) -> OpenError {
    OutOfRange {
        field,
        index,
        value,
        least,
        greatest,
    }
}

#[test]
fn counts_of_bones_and_nodes() {
    let (field, limit) = ("bones.node_count", limits::BONE_NODES);
    bones(
        |t| t.node_count = 0,
        TooFew {
            field,
            least: 1,
            actual: 0,
        },
    );
    let actual = limit + 1;
    bones(|t| t.node_count = actual as u32, TooMany { field, limit, actual });
    let field = "rest_positions";
    bones(
        |t| t.rest_places.clear(),
        TooFew {
            field,
            least: 1,
            actual: 0,
        },
    );
    let (field, limit, actual) = ("bones.rest_places", limits::BONES, limits::BONES + 1);
    bones(
        |t| t.rest_places.resize(actual, [0.0; 3]),
        TooMany { field, limit, actual },
    );
    bones(|t| t.rest_places[1][2] = f32::NAN, not_finite("rest_positions", 1));
    // The patches of nodes obey the rules of all patches: one shows that they are looked at.
    bones(|t| t.patches.offsets.push(4), counts("patch_offsets", 2, 3));
}

#[test]
fn axes_are_rotations() {
    let field = "bones.axes";
    bones(|t| t.axes.truncate(2), counts(field, B, 2));
    bones(|t| t.axes[1][3] = f32::NAN, not_finite(field, 1));
    bones(|t| t.axes[2] = [0.0; 4], outside(field, 2, 0.0, 0.999, 1.001));
    bones(|t| t.axes[0][0] = 2.0, outside(field, 0, 2.0, -1.001, 1.001));
}

#[test]
fn turns_name_nodes() {
    bones(|t| t.turn_nodes.truncate(1), counts("bones.turn_nodes", B, 1));
    bones(|t| t.turns.truncate(1), counts("bones.turns", B, 1));
    bones(|t| t.turn_nodes[2][7] = 2, beyond("bones.turn_nodes", 2, 2, 2));
    bones(|t| t.turns[1][3][8] = f32::INFINITY, not_finite("bones.turns", 1));
    let limit = limits::BONE_VALUE;
    bones(
        |t| t.turns[1][0][0] = -2.0 * limit,
        outside("bones.turns", 1, -2.0 * limit, -limit, limit),
    );
}

#[test]
fn tables_fit_bones_nodes_and_components() {
    bones(|t| t.pulls.truncate(1), counts("bones.pulls", 2, 1));
    bones(|t| t.pull_scales.truncate(3), counts("bones.pull_scales", 16, 3));
    bones(
        |t| t.pull_scales[1] = -1.0,
        outside("bones.pull_scales", 1, -1.0, 0.0, limits::POSITION),
    );
    let components = COMPONENT_COUNT as u64;
    bones(|t| t.slides.truncate(1), counts("bones.slides", components, 1));
    bones(|t| t.slide_scales.clear(), counts("bones.slide_scales", 16, 0));
    bones(|t| t.slide_scales[2] = f32::NAN, not_finite("bones.slide_scales", 2));
}

#[test]
fn skin_rules() {
    let v = u64::from(V);
    bones(|t| t.influences = 5, counts("bones.skin.influences", 4, 5));
    bones(|t| t.influences = 8, counts("bones.skin.bones", 8 * v, 4 * v));
    bones(|t| t.bones.truncate(8), counts("bones.skin.bones", 4 * v, 8));
    bones(|t| t.weights.push(0), counts("bones.skin.weights", 4 * v, 4 * v + 1));
    bones(
        |t| t.rest_normals.truncate(8),
        counts("bones.skin.rest_normals", v, v - 1),
    );
    bones(|t| t.bones[21] = 3, beyond("bones.skin.bones", 5, 3, 3));
    bones(|t| t.weights[28] -= 1, SkinWeightSum { slot: 7, sum: 65_534 });
    bones(
        |t| t.weights[..4].fill(u16::MAX),
        SkinWeightSum {
            slot: 0,
            sum: 4 * 65_535,
        },
    );
    let field = "bones.skin.weights";
    bones(|t| t.weights.swap(4, 5), NotAscending { field, index: 5 });
    bones(|t| t.bones[3] = 1, NotAscending { field, index: 3 });
}

#[test]
fn figures_are_finite_and_not_negative() {
    bones(|t| t.error.sliders.rms = f32::NAN, not_finite("bones.error.sliders", 0));
    let negative = |field| outside(field, 0, -1.0, 0.0, limits::QUALITY);
    bones(
        |t| t.error.sliders_scaled.p99 = -1.0,
        negative("bones.error.sliders_scaled"),
    );
    bones(|t| t.error.shapes.max = -1.0, negative("bones.error.shapes"));
    bones(
        |t| t.error.shapes_scaled.normal_rms = -1.0,
        negative("bones.error.shapes_scaled"),
    );
}
