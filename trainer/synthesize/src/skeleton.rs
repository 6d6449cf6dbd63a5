//! The creature's skeleton: bones with a thickness, the soft field around them, and where a pose puts them.

use super::V3;
use nalgebra::Rotation3;

/// A tapered capsule that turns about its head.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bone {
    /// Index of the bone it hangs on; `None` for the root. Parents stand before children.
    pub(super) parent: Option<usize>,
    /// Ends at rest, in metres.
    pub(super) head: V3,
    pub(super) tail: V3,
    /// Radius at the two ends, in metres.
    pub(super) radii: [f64; 2],
}

/// Places of bones in [`bones`].
pub(super) const HIPS: usize = 0;
pub(super) const CHEST: usize = 1;
pub(super) const NECK: usize = 2;
pub(super) const HEAD: usize = 3;
pub(super) const EARS: [usize; 2] = [4, 5];
pub(super) const TAIL: [usize; 3] = [6, 7, 8];
/// First bone of each leg; the two below it follow. Left and right fore leg, left and right hind leg.
pub(super) const LEGS: [usize; 4] = [9, 12, 15, 18];

/// Length of [`bones`].
const BONE_COUNT: usize = 21;

/// The rest pose: standing on y = 0, looking along +z. Shape: `[21]`.
pub(super) fn bones() -> Vec<Bone> {
    let bone = |parent, head: [f64; 3], tail: [f64; 3], radii| Bone {
        parent,
        head: V3::from(head),
        tail: V3::from(tail),
        radii,
    };
    let mut bones = vec![
        bone(None, [0.0, 0.97, -0.02], [0.0, 0.98, -0.5], [0.225, 0.235]),
        bone(Some(HIPS), [0.0, 0.97, -0.02], [0.0, 0.99, 0.42], [0.225, 0.265]),
        bone(Some(CHEST), [0.0, 1.1, 0.52], [0.0, 1.5, 0.82], [0.19, 0.125]),
        bone(Some(NECK), [0.0, 1.57, 0.86], [0.0, 1.46, 1.2], [0.165, 0.085]),
        bone(Some(HEAD), [0.09, 1.68, 0.82], [0.165, 1.9, 0.76], [0.062, 0.042]),
        bone(Some(HEAD), [-0.09, 1.68, 0.82], [-0.165, 1.9, 0.76], [0.062, 0.042]),
        bone(Some(HIPS), [0.0, 1.08, -0.68], [0.0, 1.1, -0.96], [0.08, 0.064]),
        bone(Some(TAIL[0]), [0.0, 1.1, -0.96], [0.0, 1.22, -1.22], [0.064, 0.055]),
        bone(Some(TAIL[1]), [0.0, 1.22, -1.22], [0.0, 1.44, -1.38], [0.055, 0.05]),
    ];
    for side in [1.0, -1.0] {
        let root = bones.len();
        bones.extend([
            bone(
                Some(CHEST),
                [0.15 * side, 0.92, 0.42],
                [0.17 * side, 0.55, 0.33],
                [0.15, 0.095],
            ),
            bone(
                Some(root),
                [0.17 * side, 0.55, 0.33],
                [0.17 * side, 0.15, 0.42],
                [0.09, 0.068],
            ),
            bone(
                Some(root + 1),
                [0.17 * side, 0.15, 0.42],
                [0.17 * side, 0.075, 0.54],
                [0.072, 0.075],
            ),
        ]);
    }
    for side in [1.0, -1.0] {
        let root = bones.len();
        bones.extend([
            bone(
                Some(HIPS),
                [0.14 * side, 0.92, -0.5],
                [0.17 * side, 0.55, -0.38],
                [0.18, 0.11],
            ),
            bone(
                Some(root),
                [0.17 * side, 0.55, -0.38],
                [0.17 * side, 0.17, -0.58],
                [0.1, 0.068],
            ),
            bone(
                Some(root + 1),
                [0.17 * side, 0.17, -0.58],
                [0.17 * side, 0.075, -0.46],
                [0.072, 0.075],
            ),
        ]);
    }
    bones
}

/// Width of the soft union, in metres: how far bones melt into each other.
const BLEND: f64 = 0.028;

impl Bone {
    /// Signed distance to the tapered capsule, near enough to exact for a field to polygonize; nowhere thinner than `radius_min`.
    pub(super) fn distance(&self, p: &V3, radius_min: f64) -> f64 {
        let (along, from_head) = (self.tail - self.head, p - self.head);
        let share = (from_head.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (from_head - along * share).norm() - (self.radii[0] + share * (self.radii[1] - self.radii[0])).max(radius_min)
    }
}

/// Radii of at least this many cells are seen whole by the grid.
const CELLS_IN_RADIUS: f64 = 0.8;

/// The creature's surface is where this is 0; negative inside. Soft union: -b log(sum of exp(-d / b)).
///
/// `size` is that of the grid's cells, in metres: ears and tail grow thicker on coarse grids.
pub(super) fn field(bones: &[Bone], p: &V3, size: f64) -> f64 {
    let mut distances = [0.0; BONE_COUNT];
    for (distance, bone) in distances.iter_mut().zip(bones) {
        *distance = bone.distance(p, CELLS_IN_RADIUS * size);
    }
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    // Far bones add nothing: e^-16 is below the width of a hair.
    let reach = nearest + 16.0 * BLEND;
    let sum: f64 = distances
        .iter()
        .filter(|&&distance| distance < reach)
        .map(|distance| (-(distance - nearest) / BLEND).exp())
        .sum();
    nearest - BLEND * sum.ln()
}

/// Rotations of the bones about their heads, each relative to its parent, and the shift of the root.
#[derive(Debug, Clone)]
pub(super) struct Pose {
    pub(super) turns: Vec<Rotation3<f64>>,
    pub(super) shift: V3,
}

impl Pose {
    pub(super) fn rest(bone_count: usize) -> Self {
        Self {
            turns: vec![Rotation3::identity(); bone_count],
            shift: V3::zeros(),
        }
    }

    /// Rigid motion of bone `k` from rest: rotation, and where its head goes. Walks up to the root.
    pub(super) fn motion(&self, bones: &[Bone], k: usize) -> (Rotation3<f64>, V3) {
        match bones[k].parent {
            None => (self.turns[k], bones[k].head + self.shift),
            Some(parent) => {
                let (turn, head) = self.motion(bones, parent);
                (turn * self.turns[k], head + turn * (bones[k].head - bones[parent].head))
            }
        }
    }
}

/// Moves the rest surface: each vertex by the weighted mean of its bones' rigid motions (linear blend skinning).
///
/// Shape: `weights` is `[V]`, each a list of (bone, weight) that adds up to 1.
pub(super) fn skin(bones: &[Bone], pose: &Pose, rest: &[V3], weights: &[Vec<(u32, f64)>]) -> Vec<V3> {
    let motions: Vec<_> = (0..bones.len()).map(|k| pose.motion(bones, k)).collect();
    rest.iter()
        .zip(weights)
        .map(|(p, weights)| {
            weights.iter().fold(V3::zeros(), |sum, &(k, weight)| {
                let (turn, head) = &motions[k as usize];
                sum + (head + turn * (p - bones[k as usize].head)) * weight
            })
        })
        .collect()
}

/// Width of the zone where two bones share vertices, in metres.
const WEIGHT_REACH: f64 = 0.1;
/// Weights below this are dropped, and the rest scaled up to 1.
const WEIGHT_MIN: f64 = 2e-3;

/// Smooth weights: every vertex to its nearest bone, then diffused along the surface.
///
/// Diffusion follows the surface, so that a leg never takes hold of the other leg however near it is in space.
/// Shape: `rings` is `[V]`, the neighbours of each vertex.
pub(super) fn weights(bones: &[Bone], rest: &[V3], rings: &[Vec<u32>]) -> Vec<Vec<(u32, f64)>> {
    let bone_count = bones.len();
    let mut dense: Vec<Vec<f64>> = rest
        .iter()
        .map(|p| {
            let mut row = vec![0.0; bone_count];
            let nearest =
                (0..bone_count).min_by(|&a, &b| bones[a].distance(p, 0.0).total_cmp(&bones[b].distance(p, 0.0)));
            if let Some(k) = nearest {
                row[k] = 1.0;
            }
            row
        })
        .collect();
    let (mut length, mut edge_count) = (0.0, 0.0);
    for (v, ring) in rings.iter().enumerate() {
        for &j in ring {
            length += (rest[v] - rest[j as usize]).norm();
            edge_count += 1.0;
        }
    }
    // A round of averaging spreads by about half an edge squared; variances add up.
    let rounds = (2.0 * (WEIGHT_REACH * edge_count / length) * (WEIGHT_REACH * edge_count / length))
        .ceil()
        .max(2.0) as usize;
    for _ in 0..rounds {
        dense = (0..rest.len())
            .map(|v| {
                let share = 0.5 / rings[v].len() as f64;
                let mut row: Vec<f64> = dense[v].iter().map(|weight| 0.5 * weight).collect();
                for &j in &rings[v] {
                    for (sum, weight) in row.iter_mut().zip(&dense[j as usize]) {
                        *sum += share * weight;
                    }
                }
                row
            })
            .collect();
    }
    dense
        .iter()
        .map(|row| {
            let kept = row.iter().enumerate().filter(|(_, weight)| **weight > WEIGHT_MIN);
            let total: f64 = kept.clone().map(|(_, weight)| weight).sum();
            kept.map(|(k, weight)| (k as u32, weight / total)).collect()
        })
        .collect()
}
