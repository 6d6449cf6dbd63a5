//! Locally supported linear models: Bernard, Gemmar, Hertel, Goncalves, Thunberg, *Linear Shape Deformation Models with Local
//! Support using Graph-based Structured Matrix Factorisation* (CVPR 2016). Minimises
//! `1/2 |X - sum_m a_m f_m^T|^2 + sum_m |a_m|_2 (l sum_v |f_mv|_inf + l2 |f_m|_2 + g |E f_m|_2)` over factors f and coefficients
//! a: the product of norms makes scale cost nothing, the maximum norm over a vertex's coordinates makes factors sparse, and
//! the edge differences E f make what is left smooth and connected. Nothing is told where a factor lies.
//!
//! Solved by turns over single factors, each exactly (the shape term is isotropic in one factor), where the paper takes
//! accelerated steps; started from the greatest residuals, as [`super::splocs`] is. The paper tunes its weights for each data
//! set: here they are chosen among a few by a held-out part of the training shapes. Factors of several pieces are split, as
//! published, and the strongest K pieces are kept.

use rayon::prelude::*;

use super::linear::{LinearBasis, LinearProjection, product};
use super::splocs::{SplocsSettings, greedy_start};
use sinew_trainer::mesh::topology::Topology;

/// Candidates of the weight l of sparsity, on values of unit variance.
const SPARSITIES: [f64; 4] = [0.01, 0.05, 0.2, 0.5];
/// Candidates of g, in l times the root of V.
const SMOOTHNESSES: [f64; 2] = [0.02, 0.2];
/// l2, in l.
const WHOLE_FACTOR: f64 = 0.1;
/// Turns over all factors.
const ROUNDS: usize = 15;
/// Steps on the dual of the edge term in each; it starts where the last turn left it.
const DUAL_STEPS: usize = 8;
/// Every so many training shapes one is held out while weights are chosen.
const HELD_OUT_EVERY: usize = 3;

/// Weights of the penalty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BernardSettings {
    /// K.
    pub component_count: usize,
    /// l, on values scaled to unit variance.
    pub sparsity: f64,
    /// g, in l times the root of V.
    pub smoothness: f64,
}

/// Factors `samples` (positions, shape `[N][V x 3]`) with weights chosen on held-out samples. `distances` as for
/// [`super::splocs::splocs`], for the start alone. The same bits for any number of threads.
pub fn bernard(
    samples: &[Vec<f64>],
    topology: &Topology,
    rest: &[[f64; 3]],
    distances: &(dyn Fn(usize) -> Vec<f32> + Sync),
    component_count: usize,
) -> LinearBasis {
    let held_out = |m: usize| m % HELD_OUT_EVERY == HELD_OUT_EVERY - 1;
    let (test, train): (Vec<_>, Vec<_>) = (0..samples.len()).partition(|&m| held_out(m));
    let mut candidates = Vec::new();
    for sparsity in SPARSITIES {
        candidates.extend(SMOOTHNESSES.map(|smoothness| BernardSettings {
            component_count,
            sparsity,
            smoothness,
        }));
    }
    let middle = candidates[candidates.len() / 2];
    let settings = if test.is_empty() || train.len() < 2 {
        middle
    } else {
        let train: Vec<Vec<f64>> = train.iter().map(|&m| samples[m].clone()).collect();
        let errors: Vec<f64> = candidates
            .par_iter()
            .map(|settings| {
                let basis = factorise(&train, topology, rest, distances, settings);
                let projection = LinearProjection::new(&basis, &vec![1.0; rest.len()]);
                let error = |&m: &usize| {
                    let nearest = basis.compose(&projection.weights(&samples[m]));
                    let pairs = nearest.iter().zip(&samples[m]);
                    pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>()
                };
                test.iter().map(error).sum()
            })
            .collect();
        let best = (0..errors.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]));
        best.map_or(middle, |best| candidates[best])
    };
    factorise(samples, topology, rest, distances, &settings)
}

/// The factorisation itself, with given weights.
pub fn factorise(
    samples: &[Vec<f64>],
    topology: &Topology,
    rest: &[[f64; 3]],
    distances: &(dyn Fn(usize) -> Vec<f32> + Sync),
    settings: &BernardSettings,
) -> LinearBasis {
    let mean: Vec<f64> = (0..3 * rest.len())
        .map(|d| samples.iter().map(|x| x[d]).sum::<f64>() / samples.len() as f64)
        .collect();
    let published = SplocsSettings::published(settings.component_count);
    let start = greedy_start(samples, &mean, 3, distances, &published, true);
    let mut residual = start.residual;
    let (mut coefficients, mut factors) = (start.weights, start.components);
    let edges = Edges::new(topology, rest);
    let smoothness = settings.smoothness * settings.sparsity * (rest.len() as f64).sqrt();
    let penalty = Penalty {
        vertex: settings.sparsity,
        whole: WHOLE_FACTOR * settings.sparsity,
        edge: smoothness,
    };
    let mut duals = vec![vec![[0.0; 3]; edges.list.len()]; factors.len()];
    for _ in 0..ROUNDS {
        for m in 0..factors.len() {
            let (factor, coefficient) = (&mut factors[m], &mut coefficients[m]);
            let length = product(coefficient, coefficient).sqrt();
            if length == 0.0 || factor.iter().all(|&x| x == 0.0) {
                factor.fill(0.0);
                continue;
            }
            // The whole of what this factor could explain, then the prox of its penalty.
            for (residual, &a) in residual.iter_mut().zip(&*coefficient) {
                add(residual, factor, a);
            }
            let mut target = vec![0.0; factor.len()];
            for (residual, &a) in residual.iter().zip(&*coefficient) {
                add(&mut target, residual, a / (length * length));
            }
            *factor = edges.shrink(&target, &penalty.scaled(1.0 / length), &mut duals[m]);
            let squared = product(factor, factor);
            if squared > 0.0 {
                let cost = penalty.of(factor, &edges);
                let best: Vec<f64> = residual
                    .iter()
                    .map(|residual| product(residual, factor) / squared)
                    .collect();
                let norm = product(&best, &best).sqrt();
                let shrink = (1.0 - cost / (squared * norm.max(f64::MIN_POSITIVE))).max(0.0);
                *coefficient = best.iter().map(|a| shrink * a).collect();
            }
            for (residual, &a) in residual.iter_mut().zip(&*coefficient) {
                add(residual, factor, -a);
            }
        }
    }
    let mut pieces = Vec::new();
    for (factor, coefficient) in factors.iter().zip(&coefficients) {
        let strength = product(coefficient, coefficient);
        pieces.extend(
            connected_pieces(factor, topology)
                .into_iter()
                .map(|piece| (strength * product(&piece, &piece), piece)),
        );
    }
    pieces.retain(|(strength, _)| *strength > 0.0);
    // A stable sort: equals keep their order.
    pieces.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut directions: Vec<Vec<f64>> = pieces.into_iter().map(|(_, piece)| piece).collect();
    directions.resize(settings.component_count, vec![0.0; rest.len() * 3]);
    directions.iter_mut().flatten().for_each(|x| *x *= start.deviation);
    LinearBasis {
        width: 3,
        mean,
        directions,
    }
}

/// `sum += share * values`.
fn add(sum: &mut [f64], values: &[f64], share: f64) {
    for (sum, value) in sum.iter_mut().zip(values) {
        *sum += share * value;
    }
}

/// The three terms of a factor's norm.
#[derive(Debug, Clone, Copy)]
struct Penalty {
    vertex: f64,
    whole: f64,
    edge: f64,
}

impl Penalty {
    fn scaled(self, by: f64) -> Self {
        Self {
            vertex: by * self.vertex,
            whole: by * self.whole,
            edge: by * self.edge,
        }
    }

    fn of(&self, factor: &[f64], edges: &Edges) -> f64 {
        let vertices = factor.as_chunks::<3>().0;
        let largest: f64 = vertices
            .iter()
            .map(|x| x.iter().fold(0.0, |most: f64, x| most.max(x.abs())))
            .sum();
        let rough: f64 = edges.differences(vertices).as_flattened().iter().map(|x| x * x).sum();
        self.vertex * largest + self.whole * product(factor, factor).sqrt() + self.edge * rough.sqrt()
    }

    /// Prox of the vertex and whole-factor terms; they are nested, so one follows the other.
    fn shrink_vertices(&self, values: &mut [[f64; 3]]) {
        for x in values.iter_mut() {
            let nearest = onto_taxicab_ball(*x, self.vertex);
            *x = core::array::from_fn(|c| x[c] - nearest[c]);
        }
        let norm = values.as_flattened().iter().map(|x| x * x).sum::<f64>().sqrt();
        let keep = if norm > self.whole {
            1.0 - self.whole / norm
        } else {
            0.0
        };
        values.as_flattened_mut().iter_mut().for_each(|x| *x *= keep);
    }
}

/// The nearest point whose absolute coordinates sum to at most `radius`.
fn onto_taxicab_ball(x: [f64; 3], radius: f64) -> [f64; 3] {
    let sizes = x.map(f64::abs);
    if sizes.iter().sum::<f64>() <= radius {
        return x;
    }
    let mut falling = sizes;
    falling.sort_by(|a, b| b.total_cmp(a));
    let (mut sum, mut threshold) = (0.0, 0.0);
    for (n, size) in falling.iter().enumerate() {
        sum += size;
        let candidate = (sum - radius) / (n + 1) as f64;
        if candidate < *size {
            threshold = candidate;
        }
    }
    core::array::from_fn(|c| (sizes[c] - threshold).max(0.0).copysign(x[c]))
}

/// Weighted differences along edges: near vertices should move alike.
struct Edges {
    list: Vec<([usize; 2], f64)>,
    /// Below one over the largest eigenvalue of E^T E.
    step: f64,
}

impl Edges {
    /// Weights `exp(-(length / mean length)^2)`, as published.
    fn new(topology: &Topology, rest: &[[f64; 3]]) -> Self {
        let edges = topology.edges();
        let length = |[a, b]: &[u32; 2]| {
            let (a, b) = (rest[*a as usize], rest[*b as usize]);
            (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
        };
        let mean = edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64;
        let mut degrees = vec![0.0; rest.len()];
        let weighted = edges.iter().map(|edge| {
            let ends = edge.map(|v| v as usize);
            let weight = if mean > 0.0 {
                (-(length(edge) / mean).powi(2)).exp()
            } else {
                1.0
            };
            ends.iter().for_each(|&v| degrees[v] += weight * weight);
            (ends, weight)
        });
        let list = weighted.collect();
        let most = degrees.iter().copied().fold(0.0, f64::max);
        Self {
            list,
            step: if most > 0.0 { 0.5 / most } else { 1.0 },
        }
    }

    fn differences(&self, values: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let difference =
            |&([a, b], weight): &([usize; 2], f64)| core::array::from_fn(|c| weight * (values[a][c] - values[b][c]));
        self.list.iter().map(difference).collect()
    }

    /// Prox of the whole penalty at `target`, by projected steps on the dual of the edge term.
    fn shrink(&self, target: &[f64], penalty: &Penalty, dual: &mut [[f64; 3]]) -> Vec<f64> {
        let at = |dual: &[[f64; 3]]| {
            let mut values = target.as_chunks::<3>().0.to_vec();
            for (([a, b], weight), y) in self.list.iter().zip(dual) {
                for c in 0..3 {
                    values[*a][c] -= weight * y[c];
                    values[*b][c] += weight * y[c];
                }
            }
            penalty.shrink_vertices(&mut values);
            values
        };
        onto_ball(dual, penalty.edge);
        for _ in 0..DUAL_STEPS {
            let differences = self.differences(&at(dual));
            for (y, difference) in dual.as_flattened_mut().iter_mut().zip(differences.as_flattened()) {
                *y += self.step * difference;
            }
            onto_ball(dual, penalty.edge);
        }
        at(dual).into_flattened()
    }
}

fn onto_ball(values: &mut [[f64; 3]], radius: f64) {
    let norm = values.as_flattened().iter().map(|x| x * x).sum::<f64>().sqrt();
    if norm > radius {
        values.as_flattened_mut().iter_mut().for_each(|x| *x *= radius / norm);
    }
}

/// A factor's connected pieces, each with zeros elsewhere, in the order of their first vertices.
fn connected_pieces(factor: &[f64], topology: &Topology) -> Vec<Vec<f64>> {
    let vertices = factor.as_chunks::<3>().0;
    let mut left: Vec<bool> = vertices.iter().map(|x| *x != [0.0; 3]).collect();
    let mut pieces = Vec::new();
    for first in 0..left.len() {
        if !left[first] {
            continue;
        }
        let mut piece = vec![[0.0; 3]; vertices.len()];
        let mut open = vec![first];
        left[first] = false;
        while let Some(v) = open.pop() {
            piece[v] = vertices[v];
            for &j in topology.ring_of(v) {
                if core::mem::take(&mut left[j as usize]) {
                    open.push(j as usize);
                }
            }
        }
        pieces.push(piece.into_flattened());
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use sinew_trainer::mesh::geodesic::HeatMethod;
    use sinew_trainer::mesh::shapes::tube;

    /// Two bumps at the ends of a tube, moved independently.
    fn planted() -> (Vec<Vec<f64>>, [Vec<f64>; 2], Topology, Vec<[f64; 3]>) {
        let (rest, faces) = tube(10, 16, 4.0);
        let topology = Topology::new(&faces, &rest);
        let axis = (0..3)
            .max_by(|&a, &b| extent(&rest, a).total_cmp(&extent(&rest, b)))
            .expect("three axes");
        let (low, high) = (
            rest.iter().map(|p| p[axis]).fold(f64::MAX, f64::min),
            rest.iter().map(|p| p[axis]).fold(f64::MIN, f64::max),
        );
        let bump = |end: f64, direction: [f64; 3]| -> Vec<f64> {
            let height = |p: &[f64; 3]| (1.0 - (p[axis] - end).abs() / (0.3 * (high - low))).max(0.0);
            rest.iter().flat_map(|p| direction.map(|d| d * height(p))).collect()
        };
        let factors = [bump(low, [1.0, 0.2, 0.0]), bump(high, [0.0, 1.0, -1.0])];
        let samples = (0..9)
            .map(|m| {
                let a = [f64::from(m % 3), f64::from(m / 3)];
                (0..3 * rest.len())
                    .map(|d| rest[d / 3][d % 3] + a[0] * factors[0][d] + a[1] * factors[1][d])
                    .collect()
            })
            .collect();
        (samples, factors, topology, rest)
    }

    fn extent(rest: &[[f64; 3]], c: usize) -> f64 {
        let values = rest.iter().map(|p| p[c]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    }

    #[test]
    fn recovers_planted_factors_which_stay_local() {
        let (samples, planted, topology, rest) = planted();
        let heat = HeatMethod::new(&topology, &rest).expect("definite");
        let distances = |v: usize| heat.normalised_distances(v).iter().map(|&d| d as f32).collect();
        let basis = bernard(&samples, &topology, &rest, &distances, 2);
        for truth in &planted {
            let cosine = |f: &Vec<f64>| {
                let lengths = (product(f, f) * product(truth, truth)).sqrt();
                if lengths > 0.0 {
                    (product(f, truth) / lengths).abs()
                } else {
                    0.0
                }
            };
            let best = basis.directions.iter().map(cosine).fold(0.0, f64::max);
            assert!(best > 0.97, "cosine {best}");
        }
        for direction in &basis.directions {
            let present = direction.as_chunks::<3>().0.iter().filter(|x| **x != [0.0; 3]).count();
            assert!(present < rest.len() * 6 / 10, "{present} of {}", rest.len());
        }
    }

    #[test]
    fn pieces_are_split_and_sum_to_the_factor() {
        let (_, planted, topology, _) = planted();
        let both: Vec<f64> = planted[0].iter().zip(&planted[1]).map(|(a, b)| a + b).collect();
        let pieces = connected_pieces(&both, &topology);
        assert_eq!(pieces.len(), 2);
        let sum: Vec<f64> = pieces[0].iter().zip(&pieces[1]).map(|(a, b)| a + b).collect();
        assert_eq!(sum, both);
    }

    #[test]
    fn the_taxicab_ball_is_met_at_its_nearest_point() {
        assert_eq!(onto_taxicab_ball([0.1, -0.2, 0.3], 1.0), [0.1, -0.2, 0.3]);
        let nearest = onto_taxicab_ball([2.0, -1.0, 0.1], 1.0);
        assert!(
            nearest.iter().zip([1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12),
            "{nearest:?}"
        );
    }
}
