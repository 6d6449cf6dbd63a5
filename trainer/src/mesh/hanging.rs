//! What separate pieces hang on: bridges chosen by the motion of the training shapes, so that teeth go with the jaw and an eyeball
//! with the skull, not with the lid that happens to be nearest. Faces, rest shape and some shapes -> the topology that everything
//! after it sees; the package keeps its bridges.
//!
//! The solve makes an edge from a to b `1/2 (T_a + T_b) (r_b - r_a)`, so a piece stands where it should as far as its bridges obey
//! that in the shapes. Each group of pieces takes those that do best.

use nalgebra::{Matrix3, Vector3};

use super::bridge::{BRIDGES_A_PIECE, Group, bridge_edges_with};
use super::topology::Topology;
use super::vector::difference;
use crate::features::gradient::{FeatureSettings, GradientFit, Weighting};

/// Vertices of a group that bridges may start on: so many nearest to the rest, and as many again, spread over the group.
const STARTS: usize = 16;
/// Vertices outside that they may lead to: so many nearest to each start,
const NEAR_ENDS: usize = 3;
/// and as many spread over everything else; fewer where there are many pieces.
const FAR_ENDS: usize = 256;
const FAR_ENDS_OF_MANY: usize = 16;
const MANY_PIECES: usize = 512;

/// How far gradients of shapes that were never seen are taken to be off, so that of two bridges that fit alike the shorter wins.
const GRADIENT_DOUBT: f64 = 0.02;

/// A further bridge may miss by so many times as much, squared, as the best one.
const NEARLY_AS_GOOD: f64 = 4.0;

/// Connectivity of `faces` over `rest` `[V]`, its pieces tied together by the vertices that move with them in `shapes`, each `[V]` and
/// laid onto `rest`. Without shapes, or of one piece, that of [`Topology::new`].
pub fn hung_by_motion(
    faces: &[[u32; 3]],
    rest: &[[f64; 3]],
    settings: &FeatureSettings,
    shapes: impl Iterator<Item = Vec<[f64; 3]>>,
) -> Topology {
    let nearest = Topology::new(faces, rest);
    let piece_count = nearest.findings.piece_count;
    if piece_count < 2 {
        return nearest;
    }
    // Of the pieces alone: the gradients that a bridge meets at its ends, before anything is moved to suit the bridges.
    let apart = Topology::with_bridges(faces, rest, &[]);
    let weighting = match settings.weighting {
        Weighting::Refined => Weighting::Cotangent,
        other => other,
    };
    let fit = GradientFit::new(&apart, rest, &FeatureSettings { weighting, ..*settings });
    let seen: Vec<Seen> = shapes
        .map(|positions| Seen {
            gradients: fit.gradients(&positions),
            positions,
        })
        .collect();
    if seen.is_empty() {
        return nearest;
    }
    let search = Search {
        rest,
        seen: &seen,
        far_ends: if piece_count > MANY_PIECES {
            FAR_ENDS_OF_MANY
        } else {
            FAR_ENDS
        },
        members: (0..rest.len() as u32)
            .filter(|&v| apart.piece_of[v as usize].is_some())
            .collect(),
    };
    let bridges = bridge_edges_with(rest, &apart.piece_of, piece_count, &|group| search.pairs(group));
    Topology::with_bridges(faces, rest, &bridges)
}

/// A shape and its gradients. Shapes: `[V]`.
struct Seen {
    positions: Vec<[f64; 3]>,
    gradients: Vec<Matrix3<f64>>,
}

struct Search<'a> {
    rest: &'a [[f64; 3]],
    seen: &'a [Seen],
    far_ends: usize,
    /// Vertices in faces, ascending.
    members: Vec<u32>,
}

impl Search<'_> {
    /// Up to [`BRIDGES_A_PIECE`] pairs `[inside, outside]`, no two from one vertex: the one that obeys the solve best, and those that
    /// do nearly as well.
    fn pairs(&self, group: &Group<'_>) -> Vec<[u32; 2]> {
        let mut by_distance: Vec<(f64, u32, Vec<u32>)> = group
            .inside
            .iter()
            .map(|&v| {
                let near = group.tree.nearest(self.rest[v as usize], Some(group.number), NEAR_ENDS);
                let distance = near.first().map_or(f64::INFINITY, |&(_, squared)| squared);
                (distance, v, near.into_iter().map(|(end, _)| end).collect())
            })
            .collect();
        let spread = evenly(by_distance.len(), STARTS).map(|i| by_distance[i].clone());
        let mut starts: Vec<_> = spread.collect();
        by_distance.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        by_distance.truncate(STARTS);
        starts.extend(by_distance);
        starts.sort_unstable_by_key(|&(_, v, _)| v);
        starts.dedup_by_key(|&mut (_, v, _)| v);
        let outside: Vec<u32> = self
            .members
            .iter()
            .copied()
            .filter(|&v| group.group_of[v as usize] != group.number)
            .collect();
        let far: Vec<u32> = evenly(outside.len(), self.far_ends).map(|i| outside[i]).collect();
        let mut found: Vec<(f64, [u32; 2])> = starts
            .iter()
            .flat_map(|(_, start, near)| near.iter().chain(&far).map(|&end| [*start, end]))
            .map(|pair| (self.miss(pair), pair))
            .collect();
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let limit = found.first().map_or(0.0, |best| NEARLY_AS_GOOD * best.0);
        let mut taken: Vec<[u32; 2]> = Vec::new();
        for (_, pair) in found.into_iter().take_while(|(miss, _)| *miss <= limit) {
            if taken.len() < BRIDGES_A_PIECE && taken.iter().all(|other| other[0] != pair[0]) {
                taken.push(pair);
            }
        }
        taken
    }

    /// Mean square of what the solve misses along a bridge, and of what it may miss in other shapes.
    fn miss(&self, [from, to]: [u32; 2]) -> f64 {
        let (from, to) = (from as usize, to as usize);
        let spoke = Vector3::from(difference(self.rest[from], self.rest[to]));
        let missed = self.seen.iter().map(|shape| {
            let edge = Vector3::from(difference(shape.positions[from], shape.positions[to]));
            (edge - (shape.gradients[from] + shape.gradients[to]) * spoke * 0.5).norm_squared()
        });
        missed.sum::<f64>() / self.seen.len() as f64 + GRADIENT_DOUBT.powi(2) * spoke.norm_squared()
    }
}

/// Up to `count` of the numbers below `length`, spread evenly.
fn evenly(length: usize, count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(length);
    (0..count).map(move |i| i * length / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, merged, moved, sphere};
    use nalgebra::Rotation3;

    /// A strip of which the right half swings up, and a ball above that half that stays with the left one. Vertices of the
    /// strip come first.
    fn swinging() -> (Vec<[f64; 3]>, Vec<[u32; 3]>, usize, Vec<[f64; 3]>) {
        let strip = grid(21, 5, 0.5);
        let count = strip.0.len();
        let middle = strip.0.iter().map(|p| p[0]).fold(f64::MIN, f64::max) / 2.0;
        let (rest, faces) = merged(&[strip, moved(&sphere(1), [1.5 * middle, 1.0, 1.4])]);
        let turn = Rotation3::from_euler_angles(0.0, -0.8, 0.0);
        let shape = rest.iter().enumerate().map(|(v, p)| {
            if v < count && p[0] > middle {
                let arm = turn * Vector3::new(p[0] - middle, p[1], p[2]);
                [arm.x + middle, arm.y, arm.z]
            } else {
                *p
            }
        });
        (rest.clone(), faces, count, shape.collect())
    }

    #[test]
    fn a_ball_hangs_on_what_moves_with_it_not_on_what_is_nearest() {
        let (rest, faces, count, shape) = swinging();
        let middle = rest[..count].iter().map(|p| p[0]).fold(f64::MIN, f64::max) / 2.0;
        let ends = |topology: &Topology| -> Vec<f64> {
            let outer = topology.bridges.iter().map(|pair| pair[0] as usize);
            outer.map(|v| rest[v][0]).collect()
        };
        let settings = FeatureSettings::default();
        let still = hung_by_motion(&faces, &rest, &settings, core::iter::empty());
        assert_eq!(still.bridges, Topology::new(&faces, &rest).bridges);
        assert!(ends(&still).iter().all(|&x| x > middle), "the nearest ends swing");
        let hung = hung_by_motion(&faces, &rest, &settings, core::iter::once(shape));
        assert!(!hung.bridges.is_empty());
        assert!(ends(&hung).iter().all(|&x| x <= middle), "{:?}", ends(&hung));
    }

    #[test]
    fn every_piece_is_tied_and_one_piece_is_left_alone() {
        let (rest, faces) = merged(&[
            sphere(2),
            moved(&grid(3, 3, 0.3), [3.0, 0.0, 0.0]),
            moved(&sphere(1), [0.0, 4.0, 0.0]),
        ]);
        let shape: Vec<[f64; 3]> = rest.iter().map(|p| [p[0] * 1.1, p[1], p[2]]).collect();
        let settings = FeatureSettings::default();
        let hung = hung_by_motion(&faces, &rest, &settings, core::iter::repeat_n(shape, 2));
        let mut met = vec![false; rest.len()];
        let mut open = vec![0_usize];
        while let Some(v) = open.pop() {
            if !core::mem::replace(&mut met[v], true) {
                open.extend(hung.ring_of(v).iter().map(|&j| j as usize));
            }
        }
        assert!(met.iter().all(|&met| met), "one connected graph");
        let (rest, faces) = sphere(2);
        let one = hung_by_motion(&faces, &rest, &settings, core::iter::once(rest.clone()));
        assert!(one.bridges.is_empty());
    }
}
