//! Rules of the bone tier: what decode, pull and skin rely on without looking.

use super::{
    super::{BakedView, BoneGroup, BonesView, GROUP_NODES, OpenError, PoseError, SKIN_WEIGHT_SUM, SkinView, limits},
    below, count,
    patches::patches,
    positions, same_count, within,
};

/// Proves every promise that [`super::super::BakedBones`] makes.
pub(super) fn check(view: &BakedView<'_>, bones: &BonesView<'_>) -> Result<(), OpenError> {
    count("bones.node_count", bones.node_count, 1, limits::BONE_NODES)?;
    let bone_count = positions(bones.rest_places, 1)?;
    count("bones.rest_places", bone_count, 1, limits::BONES)?;
    patches(view, &bones.patches, bones.node_count)?;
    axes(bones.axes, bone_count)?;
    turns(bones, bone_count)?;
    let groups = bone_count.div_ceil(GROUP_NODES);
    group_table("bones.pulls", bones.pulls, groups, bones.node_count)?;
    scales("bones.pull_scales", bones.pull_scales, groups)?;
    group_table("bones.slides", bones.slides, groups, view.component_count())?;
    scales("bones.slide_scales", bones.slide_scales, groups)?;
    skin(&bones.skin, view.vertex_count(), bone_count)?;
    let error = &bones.error;
    figures("bones.error.sliders", &error.sliders)?;
    figures("bones.error.sliders_scaled", &error.sliders_scaled)?;
    figures("bones.error.shapes", &error.shapes)?;
    figures("bones.error.shapes_scaled", &error.shapes_scaled)
}

/// Quaternions of length one, but for rounding.
fn axes(axes: &[[f32; 4]], bone_count: usize) -> Result<(), OpenError> {
    const ROUNDING: f32 = 1e-3;
    same_count("bones.axes", axes.len(), bone_count)?;
    for (b, q) in axes.iter().enumerate() {
        for &x in q {
            within("bones.axes", b, x, -1.0 - ROUNDING, 1.0 + ROUNDING)?;
        }
        let square = q.iter().map(|x| x * x).sum::<f32>();
        within("bones.axes", b, square, 1.0 - ROUNDING, 1.0 + ROUNDING)?;
    }
    Ok(())
}

fn turns(bones: &BonesView<'_>, bone_count: usize) -> Result<(), OpenError> {
    same_count("bones.turn_nodes", bones.turn_nodes.len(), bone_count)?;
    same_count("bones.turns", bones.turns.len(), bone_count)?;
    for (b, (nodes, turns)) in bones.turn_nodes.iter().zip(bones.turns).enumerate() {
        for &node in nodes {
            below("bones.turn_nodes", b, u32::from(node), bones.node_count)?;
        }
        for &value in turns.as_flattened() {
            within("bones.turns", b, value, -limits::BONE_VALUE, limits::BONE_VALUE)?;
        }
    }
    Ok(())
}

/// A row of groups for each group of bones. Any whole number is sound.
fn group_table(field: &'static str, table: &[BoneGroup], groups: usize, columns: usize) -> Result<(), OpenError> {
    // Neither factor exceeds its limit any more, so the product fits even 32 bits.
    same_count(field, table.len(), groups * columns)
}

fn scales(field: &'static str, scales: &[f32], groups: usize) -> Result<(), OpenError> {
    same_count(field, scales.len(), GROUP_NODES * groups)?;
    for (b, &scale) in scales.iter().enumerate() {
        within(field, b, scale, 0.0, limits::POSITION)?;
    }
    Ok(())
}

fn skin(skin: &SkinView<'_>, vertex_count: usize, bone_count: usize) -> Result<(), OpenError> {
    let field = "bones.skin.influences";
    if ![4, 8].contains(&skin.influences) {
        return Err(OpenError::CountMismatch {
            field,
            expected: 4,
            actual: skin.influences as u64,
        });
    }
    let count = skin.influences * vertex_count;
    same_count("bones.skin.bones", skin.bones.len(), count)?;
    same_count("bones.skin.weights", skin.weights.len(), count)?;
    same_count("bones.skin.rest_normals", skin.rest_normals.len(), vertex_count)?;
    let rows = skin.bones.chunks_exact(skin.influences);
    for (slot, (bones, weights)) in rows.zip(skin.weights.chunks_exact(skin.influences)).enumerate() {
        for &bone in bones {
            below("bones.skin.bones", slot, u32::from(bone), bone_count)?;
        }
        let sum = weights.iter().map(|&weight| u32::from(weight)).sum();
        if sum != SKIN_WEIGHT_SUM {
            return Err(OpenError::SkinWeightSum { slot, sum });
        }
        if let Some(n) = (1..weights.len()).find(|&n| weights[n] > weights[n - 1] || weights[n] == 0 && bones[n] != 0) {
            return Err(OpenError::NotAscending {
                field: "bones.skin.weights",
                index: slot * skin.influences + n,
            });
        }
    }
    Ok(())
}

fn figures(field: &'static str, error: &PoseError) -> Result<(), OpenError> {
    for figure in [error.rms, error.p99, error.max, error.normal_rms] {
        within(field, 0, figure, 0.0, limits::QUALITY)?;
    }
    Ok(())
}
