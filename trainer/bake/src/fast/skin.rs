//! The skin: which four nodes a vertex follows, and how much.
//!
//! A vertex looks at its nearest nodes. Poses of the exact tier say how far from the truth each of them alone would carry
//! it, the node being where its own vertex is in the exact tier; the weights are those, not negative and of sum one, whose
//! mixture is nearest to the truth in the least squares. A small pull towards weights that fall with the distance decides
//! where the poses do not. **Measured** on a horse with smooth made-up components, V/8 nodes: rms error 3.4e-4 of the bounding
//! box, where the distance weights alone give 1.5e-3; fitting again to the nodes as the graph moves them gains nothing.
//! Weights of either sign give smaller rms and larger maxima, and normals half as good again.

use rayon::prelude::*;
use sinew_formats::package::{SKIN_NODES, SKIN_WEIGHT_SUM};

use super::nodes::{Near, SurfaceGraph};
use super::play::{Player, times};
use super::{MIXED_SHARE, Source};

/// Nodes a vertex chooses its four from.
const CANDIDATES: usize = 10;

/// Mixed poses that the weights are fitted to, and their seed: not those that the error is measured on.
const FIT_POSES: usize = 48;
const FIT_SEED: u64 = 0x6669_7470_6f73_6573;

/// Poses held in memory at a time.
const POSES_AT_ONCE: usize = 8;

/// Pull towards the distance weights, as a share of the mean square error of a candidate.
const DISTANCE_PULL: f64 = 3e-3;

/// Weights of the vertices, in order of the nodes as they were chosen.
#[derive(Debug)]
pub struct Skin {
    /// Places among the nodes; where there are fewer than four, the first again, with weight zero. Shape: `[V]`.
    pub nodes: Vec<[u16; SKIN_NODES]>,
    /// Units of 1 / 65535; each row sums to that. Shape: `[V]`.
    pub weights: Vec<[u16; SKIN_NODES]>,
}

/// Symmetric: products of the candidates' errors, summed over poses.
type Gram = [[f64; CANDIDATES]; CANDIDATES];

impl Skin {
    /// Fits the skin of `nodes` (vertices) to poses of the exact tier.
    pub fn fit(source: &Source<'_>, surface: &SurfaceGraph<'_>, nodes: &[u32], exact: &Player<'_>) -> Self {
        let near = surface.nearest(nodes, CANDIDATES);
        let rest = &source.surface.rest;
        let mut grams: Vec<Gram> = vec![[[0.0; CANDIDATES]; CANDIDATES]; rest.len()];
        let poses = source.network.mixed_poses(FIT_SEED, FIT_POSES, MIXED_SHARE);
        for poses in poses.chunks(POSES_AT_ONCE) {
            let played = exact.play_all(poses);
            grams.par_iter_mut().enumerate().for_each(|(v, gram)| {
                for pose in &played {
                    let mut errors = [[0.0; 3]; CANDIDATES];
                    for (error, near) in errors.iter_mut().zip(&near[v]) {
                        let node = nodes[near.node as usize] as usize;
                        let arm = core::array::from_fn(|c| rest[v][c] - rest[node][c]);
                        let turned = times(&pose.gradients[node], &arm);
                        *error =
                            core::array::from_fn(|c| turned[c] + pose.displacement[node][c] - pose.displacement[v][c]);
                    }
                    add_products(gram, &errors);
                }
            });
        }
        let rows = near.par_iter().zip(&grams).map(|(near, gram)| row(near, gram));
        let (nodes, weights) = rows.unzip();
        Self { nodes, weights }
    }
}

fn add_products(gram: &mut Gram, errors: &[[f64; 3]; CANDIDATES]) {
    for i in 0..CANDIDATES {
        for j in 0..CANDIDATES {
            gram[i][j] += (0..3).map(|c| errors[i][c] * errors[j][c]).sum::<f64>();
        }
    }
}

/// Four nodes and their weights in whole units.
fn row(near: &[Near], gram: &Gram) -> ([u16; SKIN_NODES], [u16; SKIN_NODES]) {
    let mut nodes = [near[0].node as u16; SKIN_NODES];
    let mut weights = [0.0; SKIN_NODES];
    // A node's own vertex is where the node is: it makes the coarse matrix definite, whatever the rest.
    if near[0].distance > 0.0 {
        for (place, (candidate, weight)) in fitted(gram, &distance_weights(near)).into_iter().enumerate() {
            nodes[place] = near[candidate].node as u16;
            weights[place] = weight;
        }
    } else {
        weights[0] = 1.0;
    }
    (nodes, whole_units(&weights))
}

/// Weights of the four nearest, falling to zero at the fifth.
fn distance_weights(near: &[Near]) -> Vec<f64> {
    let own = near.len().min(SKIN_NODES);
    // Where there is no fifth: a little beyond the last.
    let beyond = near
        .get(SKIN_NODES)
        .map_or(1.25 * near[own - 1].distance, |fifth| fifth.distance);
    let falling = |near: &Near| (1.0 - near.distance / beyond).max(0.0).powi(2);
    let mut weights: Vec<f64> = near.iter().take(own).map(falling).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter_mut().for_each(|weight| *weight /= sum);
    } else {
        weights.fill(1.0 / own as f64);
    }
    weights.resize(near.len(), 0.0);
    weights
}

/// Minimises `w^T G w + pull |w - prior|^2` over weights that are not negative and sum to one, leaving the weakest candidate
/// out until four are left. Gives candidates and their weights.
fn fitted(gram: &Gram, prior: &[f64]) -> Vec<(usize, f64)> {
    let mean_square = (0..prior.len()).map(|i| gram[i][i]).sum::<f64>() / prior.len() as f64;
    let mut left: Vec<usize> = (0..prior.len()).collect();
    if mean_square <= f64::MIN_POSITIVE {
        // Nothing moves it, or all nodes carry it right.
        left.retain(|&i| prior[i] > 0.0);
        return left.into_iter().map(|i| (i, prior[i])).collect();
    }
    let pull = DISTANCE_PULL * mean_square;
    loop {
        let weights = minimum(gram, &left, prior, pull);
        let weakest = (0..left.len()).min_by(|&a, &b| weights[a].total_cmp(&weights[b]));
        match weakest {
            Some(place) if weights[place] < 0.0 || left.len() > SKIN_NODES => {
                left.remove(place);
            }
            _ => return left.into_iter().zip(weights).collect(),
        }
    }
}

/// The minimum over weights of sum one, of either sign: `(G + pull) w = pull prior + mu`.
fn minimum(gram: &Gram, left: &[usize], prior: &[f64], pull: f64) -> Vec<f64> {
    let n = left.len();
    let matrix = nalgebra::DMatrix::from_fn(n, n, |i, j| gram[left[i]][left[j]] + if i == j { pull } else { 0.0 });
    let sides = nalgebra::DMatrix::from_fn(n, 2, |i, side| if side == 0 { pull * prior[left[i]] } else { 1.0 });
    // Definite: a sum of squares and a positive diagonal.
    let Some(factor) = matrix.cholesky() else {
        let sum: f64 = left.iter().map(|&i| prior[i]).sum();
        return left
            .iter()
            .map(|&i| if sum > 0.0 { prior[i] / sum } else { 1.0 / n as f64 })
            .collect();
    };
    let solved = factor.solve(&sides);
    let mu = (1.0 - solved.column(0).sum()) / solved.column(1).sum();
    (0..n).map(|i| solved[(i, 0)] + mu * solved[(i, 1)]).collect()
}

/// Rounds down, then gives what is missing to the largest remainders.
fn whole_units(weights: &[f64; SKIN_NODES]) -> [u16; SKIN_NODES] {
    let exact = weights.map(|weight| weight.clamp(0.0, 1.0) * f64::from(SKIN_WEIGHT_SUM));
    let mut whole = exact.map(|units| units.floor() as u32);
    let mut order: [usize; SKIN_NODES] = core::array::from_fn(|i| i);
    order.sort_by(|&a, &b| (exact[b] - exact[b].floor()).total_cmp(&(exact[a] - exact[a].floor())));
    let missing = SKIN_WEIGHT_SUM.saturating_sub(whole.iter().sum());
    for &i in order.iter().cycle().take(missing as usize) {
        whole[i] += 1;
    }
    // Rounding of a sum that is one but for a few last digits can only lack units; too many would be one at most.
    let sum: u32 = whole.iter().sum();
    if sum > SKIN_WEIGHT_SUM {
        let largest = (0..SKIN_NODES).max_by_key(|&i| whole[i]).unwrap_or(0);
        whole[largest] -= sum - SKIN_WEIGHT_SUM;
    }
    whole.map(|units| units as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights in whole units.
    const TOLERANCE: f64 = 1e-4;

    fn near(distances: &[f64]) -> Vec<Near> {
        let rows = distances.iter().enumerate();
        rows.map(|(node, &distance)| Near {
            node: node as u32,
            distance,
        })
        .collect()
    }

    #[test]
    fn whole_units_sum_to_one() {
        assert_eq!(whole_units(&[1.0, 0.0, 0.0, 0.0]), [65_535, 0, 0, 0]);
        assert_eq!(whole_units(&[0.25; 4]), [16_384, 16_384, 16_384, 16_383]);
        for weights in [[0.1, 0.2, 0.3, 0.4], [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0]] {
            let whole = whole_units(&weights);
            assert_eq!(whole.iter().map(|&w| u32::from(w)).sum::<u32>(), SKIN_WEIGHT_SUM);
            for (units, weight) in whole.iter().zip(weights) {
                assert!((f64::from(*units) / 65_535.0 - weight).abs() < TOLERANCE);
            }
        }
    }

    #[test]
    fn the_fit_finds_the_mixture_that_poses_were_made_of() {
        // Six candidates with errors whose mixture 0.5, 0.3, 0.2 of the second, fourth and fifth cancels.
        let mixture = [0.0, 0.5, 0.0, 0.3, 0.2, 0.0];
        let mut gram = [[0.0; CANDIDATES]; CANDIDATES];
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / (1 << 23) as f64 - 1.0
        };
        for _ in 0..50 {
            let mut errors = [[0.0; 3]; CANDIDATES];
            for error in errors.iter_mut().take(6) {
                *error = core::array::from_fn(|_| noise());
            }
            for c in 0..3 {
                let others: f64 = (0..4).map(|i| mixture[i] * errors[i][c]).sum();
                errors[4][c] = -others / mixture[4];
            }
            add_products(&mut gram, &errors);
        }
        let prior = distance_weights(&near(&[1.0, 1.1, 1.2, 1.3, 1.4, 1.5]));
        let found = fitted(&gram, &prior);
        let dense: [f64; 6] = core::array::from_fn(|i| found.iter().find(|f| f.0 == i).map_or(0.0, |f| f.1));
        for (weight, expected) in dense.iter().zip(mixture) {
            assert!((weight - expected).abs() < 0.02, "{dense:?}");
        }
        assert!((dense.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn without_evidence_the_distance_decides() {
        let gram = [[0.0; CANDIDATES]; CANDIDATES];
        let (nodes, weights) = row(&near(&[1.0, 1.0, 2.0, 3.0, 4.0, 5.0]), &gram);
        assert_eq!(nodes, [0, 1, 2, 3]);
        assert!(weights[0].abs_diff(weights[1]) <= 1 && weights[1] > weights[2] && weights[2] > weights[3]);
        assert_eq!(row(&near(&[0.0, 1.0, 2.0]), &gram), ([0; 4], [65_535, 0, 0, 0]));
        let (nodes, weights) = row(&near(&[2.0]), &gram);
        assert_eq!((nodes, weights), ([0; 4], [65_535, 0, 0, 0]));
    }
}
