//! Regions that move as one: k-means on how vertices turn and where they are, then k-subspace rounds that give each
//! vertex to the region whose few modes explain it best, then soft windows. First step of the closed-form start.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::modes::{WeightedSamples, columns};
use crate::mesh::topology::Topology;

/// How strongly the first clustering weighs where a vertex is against how it turns.
const POSITION_WEIGHT: f64 = 6.0;
/// Rounds of k-means; it has settled long before on meshes of this size.
const KMEANS_ROUNDS: usize = 30;
/// Modes that a region may use to explain its vertices.
const REGION_MODES: usize = 6;
/// Rounds of "take the label that most neighbours carry" after each assignment.
const VOTES: usize = 2;
/// Half-steps of smoothing that suit a mesh of [`SMOOTHING_VERTICES`]; more vertices need more to reach as far.
const SMOOTHING_STEPS: f64 = 20.0;
/// See [`SMOOTHING_STEPS`].
const SMOOTHING_VERTICES: f64 = 1504.0;

/// Vertices that belong to a region from the outset.
#[derive(Debug, Clone, Default)]
pub struct Claims {
    /// The region of a vertex, below `count`. Shape: `[V]`.
    pub labels: Vec<Option<u32>>,
    /// Regions that were claimed, fewer than there are to be; one may have lost all its vertices to others.
    pub count: usize,
}

/// Splits the mesh into `count` regions. Shape: `samples` is flat `[S][V][9]` in network units; the result is `[V]`, each
/// below `count`. `rounds` k-subspace rounds follow the first clustering. What `claims` names keeps its label, and no other
/// vertex takes that.
pub fn find_regions(
    topology: &Topology,
    rest: &[[f64; 3]],
    samples: &[f32],
    claims: &Claims,
    count: usize,
    rounds: usize,
    seed: u64,
) -> Vec<u32> {
    let (claimed, claimed_count) = (&claims.labels, claims.count);
    let points = descriptors(rest, samples);
    let free: Vec<usize> = (0..points.len()).filter(|&v| claimed[v].is_none()).collect();
    let mut labels: Vec<u32> = claimed.iter().map(|label| label.unwrap_or(0)).collect();
    if !free.is_empty() {
        let free_points: Vec<Vec<f32>> = free.iter().map(|&v| points[v].clone()).collect();
        let found = cluster(&free_points, count - claimed_count, seed);
        for (&v, label) in free.iter().zip(found) {
            labels[v] = label + claimed_count as u32;
        }
    }
    let keep = |own: &[u32], next: Vec<u32>| -> Vec<u32> {
        let pairs = own.iter().zip(next).zip(claimed);
        pairs
            .map(|((&own, next), claimed)| match claimed {
                Some(label) => *label,
                None if (next as usize) < claimed_count => own,
                None => next,
            })
            .collect()
    };
    for _ in 0..rounds {
        let next = keep(&labels, assign_by_subspace(topology, samples, &labels, count));
        if next == labels {
            break;
        }
        labels = next;
    }
    labels
}

/// A soft window a region: its indicator after half-steps of smoothing over the one-rings. Shape: `[count][V]`; the
/// windows of a vertex sum to one.
pub fn soft_windows(topology: &Topology, labels: &[u32], count: usize) -> Vec<Vec<f32>> {
    let vertex_count = topology.vertex_count;
    let steps = (SMOOTHING_STEPS * vertex_count as f64 / SMOOTHING_VERTICES)
        .clamp(2.0, 400.0)
        .round() as usize;
    (0..count)
        .into_par_iter()
        .map(|region| {
            let mut window: Vec<f32> = labels
                .iter()
                .map(|&label| f32::from(u8::from(label as usize == region)))
                .collect();
            let mut next = window.clone();
            for _ in 0..steps {
                for v in 0..vertex_count {
                    let ring = topology.ring_of(v);
                    if !ring.is_empty() {
                        let mean = ring.iter().map(|&j| window[j as usize]).sum::<f32>() / ring.len() as f32;
                        next[v] = 0.5 * (window[v] + mean);
                    }
                }
                core::mem::swap(&mut window, &mut next);
            }
            window
        })
        .collect()
}

/// What k-means compares: log-rotations over the first samples, and the rest position; both scaled to unit spread, the
/// latter times [`POSITION_WEIGHT`].
fn descriptors(rest: &[[f64; 3]], samples: &[f32]) -> Vec<Vec<f32>> {
    const SAMPLES: usize = 48;
    let vertex_count = rest.len();
    let width = vertex_count * 9;
    let used = (samples.len() / width.max(1)).min(SAMPLES);
    let spread = |values: &mut dyn Iterator<Item = f64>, per_vertex: usize| {
        let (mut sum, mut n) = (0.0, 0.0);
        values.for_each(|x| {
            sum += x * x;
            n += 1.0;
        });
        // Spread of the whole descriptor part of a vertex, not of one number in it.
        (sum / f64::max(n, 1.0) * per_vertex as f64).sqrt().max(1e-12)
    };
    let mut centre = [0.0; 3];
    rest.iter()
        .for_each(|p| (0..3).for_each(|c| centre[c] += p[c] / vertex_count.max(1) as f64));
    let position_scale =
        POSITION_WEIGHT / 3.0 / spread(&mut rest.iter().flat_map(|p| (0..3).map(move |c| p[c] - centre[c])), 3);
    let turn = |n: usize, v: usize, c: usize| f64::from(samples[n * width + v * 9 + c]);
    let turn_scale = 1.0
        / spread(
            &mut (0..used)
                .flat_map(|n| (0..vertex_count).flat_map(move |v| (0..3).map(move |c| (n, v, c))))
                .map(|(n, v, c)| turn(n, v, c)),
            3 * used,
        );
    (0..vertex_count)
        .map(|v| {
            let place = (0..3).map(|c| ((rest[v][c] - centre[c]) * position_scale) as f32);
            let turns = (0..used)
                .flat_map(|n| (0..3).map(move |c| (n, c)))
                .map(|(n, c)| (turn(n, v, c) * turn_scale) as f32);
            place.chain(turns).collect()
        })
        .collect()
}

/// k-means with k-means++ seeding (Arthur and Vassilvitskii 2007).
fn cluster(points: &[Vec<f32>], count: usize, seed: u64) -> Vec<u32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(u64::MAX);
    let mut centres: Vec<Vec<f32>> = Vec::with_capacity(count);
    centres.push(points[rng.random_range(0..points.len())].clone());
    let mut nearest: Vec<f32> = points.iter().map(|p| squared_distance(p, &centres[0])).collect();
    while centres.len() < count {
        let total: f64 = nearest.iter().map(|&d| f64::from(d)).sum();
        let mut target = rng.random::<f64>() * total;
        let chosen = nearest
            .iter()
            .position(|&d| {
                target -= f64::from(d);
                target < 0.0
            })
            .unwrap_or(points.len() - 1);
        let centre = points[chosen].clone();
        nearest
            .par_iter_mut()
            .zip(points)
            .for_each(|(d, p)| *d = d.min(squared_distance(p, &centre)));
        centres.push(centre);
    }
    let mut labels = vec![0_u32; points.len()];
    for _ in 0..KMEANS_ROUNDS {
        let next: Vec<u32> = points
            .par_iter()
            .map(|p| {
                let mut best = (f32::INFINITY, 0);
                for (k, centre) in centres.iter().enumerate() {
                    let d = squared_distance(p, centre);
                    if d < best.0 {
                        best = (d, k as u32);
                    }
                }
                best.1
            })
            .collect();
        let settled = next == labels;
        labels = next;
        if settled {
            break;
        }
        let mut sums = vec![vec![0.0_f64; points[0].len()]; count];
        let mut sizes = vec![0_usize; count];
        for (point, &label) in points.iter().zip(&labels) {
            sizes[label as usize] += 1;
            sums[label as usize]
                .iter_mut()
                .zip(point)
                .for_each(|(s, &x)| *s += f64::from(x));
        }
        for k in 0..count {
            if sizes[k] > 0 {
                centres[k] = sums[k].iter().map(|s| (s / sizes[k] as f64) as f32).collect();
            }
        }
    }
    labels
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

/// One k-subspace round: the leading coefficients of each region over the samples, then each vertex to the region that
/// explains most of it.
fn assign_by_subspace(topology: &Topology, samples: &[f32], labels: &[u32], count: usize) -> Vec<u32> {
    let vertex_count = topology.vertex_count;
    let width = vertex_count * 9;
    let explained: Vec<Vec<f32>> = (0..count)
        .into_par_iter()
        .map(|region| {
            let vertices: Vec<u32> = (0..vertex_count as u32)
                .filter(|&v| labels[v as usize] as usize == region)
                .collect();
            if vertices.is_empty() {
                return vec![-1.0; vertex_count];
            }
            let modes = WeightedSamples::gather(samples, vertex_count, &vertices, &vec![1.0; vertices.len()])
                .leading_modes(REGION_MODES);
            let mut projected = Mat::<f32>::zeros(width, modes.coefficients.ncols());
            matmul(
                projected.as_mut(),
                Accum::Replace,
                columns(samples, width),
                modes.coefficients.as_ref(),
                1.0,
                Par::Seq,
            );
            let mut energy = vec![0.0_f32; vertex_count];
            for i in 0..projected.ncols() {
                for (e, x) in energy.iter_mut().zip(projected.col_as_slice(i).chunks_exact(9)) {
                    *e += x.iter().map(|x| x * x).sum::<f32>();
                }
            }
            energy
        })
        .collect();
    let mut next: Vec<u32> = (0..vertex_count)
        .map(|v| {
            let mut best = (labels[v] as usize, explained[labels[v] as usize][v]);
            for (region, energy) in explained.iter().enumerate() {
                if energy[v] > best.1 * 1.000_1 {
                    best = (region, energy[v]);
                }
            }
            best.0 as u32
        })
        .collect();
    for _ in 0..VOTES {
        next = vote(topology, &next, count);
    }
    next
}

/// Each vertex takes the label that most of its ring and itself carry; it keeps its own where that is among the most.
fn vote(topology: &Topology, labels: &[u32], count: usize) -> Vec<u32> {
    let mut votes = vec![0_u32; count];
    (0..labels.len())
        .map(|v| {
            votes.fill(0);
            votes[labels[v] as usize] += 1;
            for &j in topology.ring_of(v) {
                votes[labels[j as usize] as usize] += 1;
            }
            let most = votes.iter().copied().max().unwrap_or(0);
            if votes[labels[v] as usize] == most {
                labels[v]
            } else {
                votes.iter().position(|&n| n == most).map_or(labels[v], |k| k as u32)
            }
        })
        .collect()
}
