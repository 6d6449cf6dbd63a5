//! Bones: gradients of the nodes to gradients and displacements of the bones, which are linear in them (see
//! [`sinew_formats::package::BakedBones`]). Written once for any [`Lanes`]: displacements have sixteen bones side by side.

use sinew_formats::package::{BoneGroup, BonesView, GROUP_NODES, TURN_NODES};

use super::lanes::{Gradient, Lanes};

/// x, y and z of sixteen bones.
pub(crate) type BoneLanes = [[f32; GROUP_NODES]; 3];

/// Gradients of the bones: `D_b = sum_n D_n turns[b][n]`. Shape: `gradients` `[N]`, `turned` `[B]`.
#[inline(always)]
pub(crate) fn turn<L: Lanes>(bones: &BonesView<'_>, gradients: &[Gradient], turned: &mut [Gradient]) {
    for ((turned, nodes), turns) in turned.iter_mut().zip(bones.turn_nodes).zip(bones.turns) {
        let mut sum = [[0.0_f32; 4]; 3];
        for n in 0..TURN_NODES {
            let (node, turn) = (&gradients[usize::from(nodes[n])], &turns[n]);
            for (column, sum) in sum.iter_mut().enumerate() {
                for (row, of_node) in node.iter().enumerate() {
                    let share = turn[3 * row + column];
                    for c in 0..4 {
                        sum[c] += share * of_node[c];
                    }
                }
            }
        }
        *turned = sum;
    }
}

/// Displacements of the bones: `d_b = sum_n D_n pulls[b][n] + sum_k z_k slides[b][k]`. Shape: `gradients` `[N]`, `weights` `[K]`,
/// `displaced` `[H]`.
#[inline(always)]
pub(crate) fn displace<L: Lanes>(
    bones: &BonesView<'_>,
    gradients: &[Gradient],
    weights: &[f32],
    displaced: &mut [BoneLanes],
) {
    for (h, displaced) in displaced.iter_mut().enumerate() {
        let pulls = &bones.pulls[h * gradients.len()..][..gradients.len()];
        let slides = &bones.slides[h * weights.len()..][..weights.len()];
        for lane in (0..GROUP_NODES).step_by(L::COUNT) {
            let pulled = pulled::<L>(pulls, gradients, lane);
            let slid = slid::<L>(slides, weights, lane);
            let scale = |scales: &[f32]| L::load(&scales[h * GROUP_NODES + lane..]);
            let (pull_scale, slide_scale) = (scale(bones.pull_scales), scale(bones.slide_scales));
            for c in 0..3 {
                let slid = slid[c].mul(slide_scale);
                pulled[c].mul_add(pull_scale, slid).store(&mut displaced[c][lane..]);
            }
        }
    }
}

/// `sum_n D_n pull`, in whole numbers. Shape: both `[N]`.
#[inline(always)]
fn pulled<L: Lanes>(pulls: &[BoneGroup], gradients: &[Gradient], lane: usize) -> [L; 3] {
    let mut sum = [L::splat(0.0); 3];
    for (pull, gradient) in pulls.iter().zip(gradients) {
        for (pull, column) in pull.iter().zip(gradient) {
            let pull = L::load_whole(&pull[lane..]);
            for c in 0..3 {
                sum[c] = pull.mul_add(L::splat(column[c]), sum[c]);
            }
        }
    }
    sum
}

/// `sum_k z_k slide`, in whole numbers. Shape: both `[K]`.
#[inline(always)]
fn slid<L: Lanes>(slides: &[BoneGroup], weights: &[f32], lane: usize) -> [L; 3] {
    let mut sum = [L::splat(0.0); 3];
    for (slide, &weight) in slides.iter().zip(weights) {
        if weight != 0.0 {
            let weight = L::splat(weight);
            for c in 0..3 {
                sum[c] = L::load_whole(&slide[c][lane..]).mul_add(weight, sum[c]);
            }
        }
    }
    sum
}
