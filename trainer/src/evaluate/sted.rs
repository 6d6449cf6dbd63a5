//! STED (Vasa & Skala 2011; method section 4): how much edge lengths jitter, over the surface and over time. A smooth
//! error scores well, a rough one badly, as the eye has it.

use rayon::prelude::*;

use super::erms::NormalisedPair;

/// Temporal edges on either side of the one under test (w).
const WINDOW: usize = 1;
/// Pause between shapes in the unit of the mean bounding-box diagonal (dt).
const TIME_STEP: f64 = 0.01;
/// Share of the temporal part (c).
const TEMPORAL_SHARE: f64 = 0.127;
/// Truth edges shorter than this (unit: radius of the bounding ball) count as this long: no division by zero.
const LENGTH_FLOOR: f64 = 1e-12;

/// The two parts and their sum `sqrt(spatial^2 + (c temporal)^2)`. Unitless, not negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sted {
    /// Both parts.
    pub total: f64,
    /// Over the surface, one-ring neighbourhoods (d = 1).
    pub spatial: f64,
    /// Over time; 0 for a single shape.
    pub temporal: f64,
}

/// Measures a sequence; shapes stand in temporal order. Shape: `faces` is `[F]`, indices below V.
pub fn sted(pair: &NormalisedPair, faces: &[[u32; 3]]) -> Sted {
    let spatial = spatial_part(pair, &EdgeNeighbourhoods::new(faces, pair.truth[0].len()));
    let temporal = temporal_part(pair);
    Sted {
        total: spatial.hypot(TEMPORAL_SHARE * temporal),
        spatial,
        temporal,
    }
}

/// Edges, and for each vertex those with both ends in its closed one-ring: spokes and link.
struct EdgeNeighbourhoods {
    /// `[from, to]`, `from < to`, ascending.
    edges: Vec<[u32; 2]>,
    /// Compressed rows over `edge_indices`. Shape: `[V + 1]`.
    offsets: Vec<usize>,
    edge_indices: Vec<u32>,
}

impl EdgeNeighbourhoods {
    fn new(faces: &[[u32; 3]], vertex_count: usize) -> Self {
        let mut edges: Vec<[u32; 2]> = faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .filter(|[from, to]| from != to)
            .map(|[from, to]| [from.min(to), from.max(to)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut spokes = vec![Vec::new(); vertex_count];
        for (e, &[from, to]) in edges.iter().enumerate() {
            spokes[from as usize].push((to, e as u32));
            spokes[to as usize].push((from, e as u32));
        }
        let mut offsets = vec![0];
        let mut edge_indices = Vec::new();
        let mut in_ring = vec![false; vertex_count];
        for v in 0..vertex_count {
            for &(neighbour, e) in &spokes[v] {
                in_ring[neighbour as usize] = true;
                edge_indices.push(e);
            }
            for &(neighbour, _) in &spokes[v] {
                let link = spokes[neighbour as usize].iter();
                edge_indices.extend(
                    link.filter(|&&(end, _)| end > neighbour && in_ring[end as usize])
                        .map(|&(_, e)| e),
                );
            }
            for &(neighbour, _) in &spokes[v] {
                in_ring[neighbour as usize] = false;
            }
            offsets.push(edge_indices.len());
        }
        Self {
            edges,
            offsets,
            edge_indices,
        }
    }

    fn lengths(&self, shape: &[[f64; 3]]) -> Vec<f64> {
        let length = |&[from, to]: &[u32; 2]| squared_distance(shape[from as usize], shape[to as usize]).sqrt();
        self.edges.iter().map(length).collect()
    }
}

/// Mean over vertices and shapes of the length-weighted deviation of relative edge-length errors.
fn spatial_part(pair: &NormalisedPair, neighbourhoods: &EdgeNeighbourhoods) -> f64 {
    let sums: Vec<f64> = pair
        .truth
        .par_iter()
        .zip(&pair.reconstruction)
        .map(|(truth, reconstruction)| {
            let lengths = neighbourhoods.lengths(truth);
            let errors: Vec<f64> = lengths
                .iter()
                .zip(neighbourhoods.lengths(reconstruction))
                .map(|(truth, reconstruction)| (truth - reconstruction).abs() / truth.max(LENGTH_FLOOR))
                .collect();
            let rows = neighbourhoods
                .offsets
                .windows(2)
                .map(|row| &neighbourhoods.edge_indices[row[0]..row[1]]);
            rows.map(|row| weighted_deviation(row.iter().map(|&e| (lengths[e as usize], errors[e as usize]))))
                .sum()
        })
        .collect();
    let connected_count = neighbourhoods.offsets.windows(2).filter(|row| row[0] < row[1]).count();
    if connected_count == 0 {
        return 0.0;
    }
    sums.into_iter().sum::<f64>() / (connected_count * pair.truth.len()) as f64
}

/// The same over the edges that join each vertex to itself in the next shape.
fn temporal_part(pair: &NormalisedPair) -> f64 {
    let step_count = pair.truth.len() - 1;
    if step_count == 0 {
        return 0.0;
    }
    let diagonals: Vec<f64> = pair
        .truth
        .par_iter()
        .map(|shape| bounding_box_diagonal(shape))
        .collect();
    let diagonal = diagonals.into_iter().sum::<f64>() / pair.truth.len() as f64;
    let lengths_of = |shapes: &[Vec<[f64; 3]>]| -> Vec<Vec<f64>> {
        shapes
            .par_windows(2)
            .map(|pair| {
                let steps = pair[0].iter().zip(&pair[1]);
                steps
                    .map(|(&a, &b)| (squared_distance(a, b) / (diagonal * diagonal) + TIME_STEP * TIME_STEP).sqrt())
                    .collect()
            })
            .collect()
    };
    let truth = lengths_of(&pair.truth);
    let reconstruction = lengths_of(&pair.reconstruction);
    let vertex_count = pair.truth[0].len();
    let sums: Vec<f64> = (0..step_count)
        .into_par_iter()
        .map(|step| {
            let window = step.saturating_sub(WINDOW)..step_count.min(step + WINDOW + 1);
            (0..vertex_count)
                .map(|v| {
                    weighted_deviation(window.clone().map(|t| {
                        let length = truth[t][v];
                        (length, (length - reconstruction[t][v]).abs() / length)
                    }))
                })
                .sum::<f64>()
        })
        .collect();
    sums.into_iter().sum::<f64>() / (vertex_count * step_count) as f64
}

/// Standard deviation of `(weight, value)` pairs; 0 for none or no weight.
fn weighted_deviation(samples: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let weight: f64 = samples.clone().map(|(weight, _)| weight).sum();
    if weight <= 0.0 {
        return 0.0;
    }
    let mean = samples.clone().map(|(weight, value)| weight * value).sum::<f64>() / weight;
    let variance = samples
        .map(|(weight, value)| weight * (value - mean) * (value - mean))
        .sum::<f64>()
        / weight;
    variance.sqrt()
}

fn bounding_box_diagonal(shape: &[[f64; 3]]) -> f64 {
    let extent = |c: usize| {
        let (low, high) = shape
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), position| {
                (low.min(position[c]), high.max(position[c]))
            });
        high - low
    };
    (0..3).map(|c| extent(c).powi(2)).sum::<f64>().sqrt()
}

fn squared_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}
