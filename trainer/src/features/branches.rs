//! Logarithms of rotations over a mesh, on branches that agree: the same rotation is `(angle + 2 pi n) axis` for every n,
//! and neighbours must choose alike (method section 1). Called by [`features_of_shape`](super::acap::features_of_shape).
//!
//! The choice spreads over the minimum spanning tree of relative rotation angles, from the vertex that turns least (shapes
//! are aligned, so that one is on the principal branch), and a few rounds of voting mend what a tree cannot see.

use core::f64::consts::TAU;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::mesh::topology::Topology;

/// Rounds of voting; most shapes are still after one or two.
const VOTING_ROUNDS: usize = 8;

/// Below this angle the axis is rounding, and any axis serves as well.
const NO_ANGLE: f64 = 1e-9;

/// A vote must win by this much, radians, lest ties flip for ever.
const VOTE_MARGIN: f64 = 1e-9;

/// Axis times angle of every rotation, not wrapped. Shape: `[V]`.
pub(super) fn consistent_logarithms(topology: &Topology, rotations: &[Matrix3<f64>]) -> Vec<Vector3<f64>> {
    let quaternions: Vec<UnitQuaternion<f64>> = rotations
        .iter()
        .map(|rotation| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation)))
        .collect();
    let turns: Vec<Turn> = quaternions.iter().map(Turn::of).collect();
    let Some(root) = (0..turns.len()).min_by(|&a, &b| turns[a].angle.total_cmp(&turns[b].angle)) else {
        return Vec::new();
    };
    let mut logarithms: Vec<Vector3<f64>> = turns.iter().map(|turn| turn.axis * turn.angle).collect();
    for (v, parent) in spanning_tree(topology, &quaternions, root) {
        logarithms[v] = turns[v].nearest_to(logarithms[parent]);
    }
    for _ in 0..VOTING_ROUNDS {
        if !vote(topology, &turns, &mut logarithms) {
            break;
        }
    }
    logarithms
}

/// A rotation as its principal logarithm: angle in [0, pi], unit axis.
#[derive(Debug, Clone, Copy)]
struct Turn {
    angle: f64,
    axis: Vector3<f64>,
}

impl Turn {
    fn of(quaternion: &UnitQuaternion<f64>) -> Turn {
        let sign = if quaternion.w < 0.0 { -1.0 } else { 1.0 };
        let imaginary = quaternion.imag() * sign;
        let sine = imaginary.norm();
        let axis = if sine > 0.0 { imaginary / sine } else { Vector3::x() };
        Turn {
            angle: 2.0 * sine.atan2(quaternion.w.abs()),
            axis,
        }
    }

    /// The logarithm of this rotation nearest to `other`: the sign of the axis is among the branches.
    fn nearest_to(&self, other: Vector3<f64>) -> Vector3<f64> {
        let (angle, axis) = if self.angle < NO_ANGLE {
            match other.try_normalize(NO_ANGLE) {
                // Any axis turns by nothing: the neighbour's keeps a whole turn going.
                Some(axis) if other.norm() > TAU / 2.0 => (0.0, axis),
                _ => (self.angle, self.axis),
            }
        } else {
            (self.angle, self.axis)
        };
        let whole_turns = ((other.dot(&axis) - angle) / TAU).round();
        axis * (angle + TAU * whole_turns)
    }
}

/// `(vertex, parent)` in the order of growth: Prim's tree over relative rotation angles, ties by vertex index.
fn spanning_tree(
    topology: &Topology,
    quaternions: &[UnitQuaternion<f64>],
    root: usize,
) -> impl Iterator<Item = (usize, usize)> {
    let mut order = Vec::with_capacity(quaternions.len());
    let mut reached = vec![false; quaternions.len()];
    let mut open = std::collections::BinaryHeap::new();
    let mut v = root;
    loop {
        reached[v] = true;
        for &j in topology.ring_of(v) {
            if !reached[j as usize] {
                open.push(Reach {
                    alike: quaternions[v].dot(&quaternions[j as usize]).abs(),
                    vertex: j,
                    parent: v as u32,
                });
            }
        }
        let next = loop {
            match open.pop() {
                Some(reach) if reached[reach.vertex as usize] => {}
                other => break other,
            }
        };
        let Some(reach) = next else { break };
        v = reach.vertex as usize;
        order.push((v, reach.parent as usize));
    }
    order.into_iter()
}

/// An edge out of the tree; the greatest joins two rotations that are most alike.
#[derive(Debug, Clone, Copy)]
struct Reach {
    /// Cosine of half the angle between the two rotations.
    alike: f64,
    vertex: u32,
    parent: u32,
}

impl Ord for Reach {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        self.alike
            .total_cmp(&other.alike)
            .then(other.vertex.cmp(&self.vertex))
            .then(other.parent.cmp(&self.parent))
    }
}

impl PartialOrd for Reach {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reach {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Reach {}

/// One round, vertex by vertex: each may move to the branch that a neighbour would choose for it if that is nearer to all
/// its neighbours together. Returns whether any did.
fn vote(topology: &Topology, turns: &[Turn], logarithms: &mut [Vector3<f64>]) -> bool {
    let mut moved = false;
    for v in 0..turns.len() {
        let ring = topology.ring_of(v);
        let distance = |candidate: Vector3<f64>, logarithms: &[Vector3<f64>]| {
            ring.iter()
                .map(|&j| (candidate - logarithms[j as usize]).norm())
                .sum::<f64>()
        };
        let (held, mut best) = (distance(logarithms[v], logarithms), logarithms[v]);
        let mut least = held - VOTE_MARGIN;
        for &j in ring {
            let candidate = turns[v].nearest_to(logarithms[j as usize]);
            if candidate != logarithms[v] && candidate != best {
                let sum = distance(candidate, logarithms);
                if sum < least {
                    (least, best) = (sum, candidate);
                }
            }
        }
        if best != logarithms[v] {
            logarithms[v] = best;
            moved = true;
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::tube;

    /// Rounding of an angle through a quaternion.
    const TOLERANCE: f64 = 1e-9;

    #[test]
    fn a_twist_past_half_a_turn_keeps_growing() {
        let (rest, faces) = tube(8, 30, 10.0);
        let topology = Topology::new(&faces, &rest);
        for total in [3.5, 5.9, 9.0] {
            let angles: Vec<f64> = rest.iter().map(|p| total * p[2] / 10.0).collect();
            let axis = Vector3::new(1.0, 2.0, -0.5).normalize();
            let rotations: Vec<Matrix3<f64>> = angles
                .iter()
                .map(|angle| Rotation3::new(axis * *angle).into_inner())
                .collect();
            for (r, angle) in consistent_logarithms(&topology, &rotations).iter().zip(&angles) {
                assert!((r - axis * *angle).norm() < TOLERANCE, "{r} {angle}");
            }
        }
    }

    #[test]
    fn one_rotation_everywhere_is_one_logarithm() {
        let (rest, faces) = tube(6, 4, 1.0);
        let topology = Topology::new(&faces, &rest);
        let turn = Vector3::new(0.0, 3.1, 0.2);
        let rotations = vec![Rotation3::new(turn).into_inner(); rest.len()];
        for r in consistent_logarithms(&topology, &rotations) {
            assert!((r - turn).norm() < TOLERANCE);
        }
    }
}
