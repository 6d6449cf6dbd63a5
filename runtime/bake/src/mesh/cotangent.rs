//! Cotangent edge weights of the rest shape (method section 1): topology and rest shape -> [`EdgeWeights`] -> fit of the
//! deformation gradients, and the Laplacian of the solve.

use super::topology::{Topology, corners, is_flat, names_a_vertex_twice};
use super::vector::{cross, difference, dot, length};

/// One angle's cotangent is held within this: about 3 degrees. A sliver must not outweigh its whole neighbourhood.
const COTANGENT_BOUND: f64 = 20.0;

/// Least weight, as a share of the mean: obtuse pairs would go to zero or below, and the solve must stay definite.
const WEIGHT_FLOOR: f64 = 0.01;

/// Greatest weight, as a multiple of the mean.
const WEIGHT_CEILING: f64 = 10.0;

/// One positive weight for every ring entry.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeWeights {
    /// Half the sum of the cotangents opposite to the edge, clamped. Positive, finite, symmetric. Shape: that of
    /// [`Topology::ring`].
    pub weights: Vec<f64>,
}

impl EdgeWeights {
    /// Weights `c_ij = 1/2 (cot a_ij + cot b_ij)` of the rest shape, kept between a small share and a multiple of their
    /// mean. Bridges, and edges of flat faces only, have no angles: they get the mean.
    pub fn new(topology: &Topology, rest: &[[f64; 3]]) -> EdgeWeights {
        let halves = half_cotangents(topology, rest, COTANGENT_BOUND);
        let mean = positive_mean(&halves);
        let weights = halves
            .iter()
            .map(|half| half.map_or(mean, |half| half.clamp(WEIGHT_FLOOR * mean, WEIGHT_CEILING * mean)))
            .collect();
        EdgeWeights { weights }
    }
}

/// `1/2 (cot a_ij + cot b_ij)` for every ring entry, each cotangent held within `bound`; `None` where no face with area
/// has the edge.
pub fn half_cotangents(topology: &Topology, rest: &[[f64; 3]], bound: f64) -> Vec<Option<f64>> {
    let mut halves: Vec<Option<f64>> = vec![None; topology.ring.len()];
    for face in topology
        .faces
        .iter()
        .filter(|face| !names_a_vertex_twice(face) && !is_flat(face, rest))
    {
        let at = corners(face, rest);
        for n in 0..3 {
            let (u, w) = (difference(at[n], at[(n + 1) % 3]), difference(at[n], at[(n + 2) % 3]));
            let half = 0.5 * (dot(u, w) / length(cross(u, w))).clamp(-bound, bound);
            let (a, b) = (face[(n + 1) % 3], face[(n + 2) % 3]);
            for (from, to) in [(a, b), (b, a)] {
                if let Some(entry) = topology.entry(from as usize, to) {
                    *halves[entry].get_or_insert(0.0) += half;
                }
            }
        }
    }
    halves
}

/// Mean of the positive ones; 1 where there are none.
pub fn positive_mean(halves: &[Option<f64>]) -> f64 {
    let (sum, count) = halves
        .iter()
        .flatten()
        .filter(|&&half| half > 0.0)
        .fold((0.0, 0usize), |(sum, count), half| (sum + half, count + 1));
    if count == 0 { 1.0 } else { sum / count as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, merged, moved, sphere};

    #[test]
    fn an_equilateral_pair_has_the_textbook_weight() {
        let height = 3f64.sqrt() / 2.0;
        let rest = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, height, 0.0], [0.5, -height, 0.0]];
        let topology = Topology::new(&[[0, 1, 2], [1, 0, 3]], &rest);
        let weights = EdgeWeights::new(&topology, &rest).weights;
        let cotangent = 1.0 / 3f64.sqrt();
        let weight = |a: usize, b: u32| topology.entry(a, b).map(|entry| weights[entry]);
        assert!(weight(0, 1).is_some_and(|w| (w - cotangent).abs() < 1e-12));
        assert!(weight(0, 2).is_some_and(|w| (w - cotangent / 2.0).abs() < 1e-12));
    }

    #[test]
    fn weights_are_symmetric_positive_and_finite_on_a_bad_mesh() {
        let (mut rest, mut faces) = merged(&[sphere(2), moved(&grid(3, 3, 0.2), [2.0, 0.0, 0.0])]);
        let last = rest.len() as u32;
        rest.extend([rest[0], rest[0], [4.0, 0.0, 0.0]]);
        faces.extend([[0, last, last + 1], [0, 1, last], [3, 3, 5], [0, 6, last]]);
        let topology = Topology::new(&faces, &rest);
        let weights = EdgeWeights::new(&topology, &rest).weights;
        assert!(weights.iter().all(|w| w.is_finite() && *w > 0.0));
        for v in 0..topology.vertex_count {
            for entry in topology.entries_of(v) {
                let back = topology.entry(topology.ring[entry] as usize, v as u32);
                assert_eq!(back.map(|back| weights[back]), Some(weights[entry]));
            }
        }
    }
}
