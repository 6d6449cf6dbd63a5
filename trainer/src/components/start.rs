//! The closed-form start of the network: regions become the rows of the root block, the modes of each masked residual the
//! rows of its children. Before any training this already predicts unseen poses better than a network trained from a
//! random start, which learns its few poses by heart.

use faer::{Mat, Side};
use rayon::prelude::*;

use super::modes::WeightedSamples;
use super::regions::{Claims, find_regions, soft_windows};
use crate::mesh::topology::Topology;
use crate::network::attention::Attention;
use crate::network::weights::{BlockWeights, LevelWeights, StackWeights, zero_convolution};

/// Eigenvalues of the rows' products below this are those of rows that depend on others, or are zero.
const DEPENDENT: f64 = 1e-3;

/// Weights below this share of the strongest are left out of the mode computations.
const WINDOW_CUT: f32 = 1e-3;

/// What the start is made from.
pub struct StartInput<'a> {
    /// Connectivity of the mesh.
    pub topology: &'a Topology,
    /// Rest shape. Shape: `[V]`.
    pub rest: &'a [[f64; 3]],
    /// Mixes in network units. Shape: flat `[S][V][9]`.
    pub samples: &'a [f32],
    /// Which vertices belong to painted regions and kept components, each the place of one root component.
    pub claims: &'a Claims,
    /// Rows of the kept components, the last of those claims: they stay as they are. Shape: flat `[V][9]` each.
    pub kept: &'a [Vec<f32>],
    /// K of each level, coarse to fine; none is 0.
    pub component_counts: &'a [usize],
    /// How residuals are shared out among the blocks below.
    pub attention: Attention,
    /// How far a root component reaches from its centre, as a share of the longest distance; beyond, it is cut to zero.
    pub root_reach: f32,
    /// k-subspace rounds behind the first clustering.
    pub rounds: usize,
    /// Seed of the clustering.
    pub seed: u64,
}

/// Computes the start. `distances(v)` gives distances from vertex v along the surface, `[V]`, the longest on the mesh being 1.
pub fn closed_form_start(input: &StartInput<'_>, distances: &(dyn Fn(usize) -> Vec<f32> + Sync)) -> StackWeights {
    let vertex_count = input.topology.vertex_count;
    let root_count = input.component_counts[0];
    let labels = find_regions(
        input.topology,
        input.rest,
        input.samples,
        input.claims,
        root_count,
        input.rounds,
        input.seed,
    );
    let mut windows = soft_windows(input.topology, &labels, root_count);
    let labels = &input.claims.labels;
    let painted_count = input.claims.count - input.kept.len();
    for (region, window) in windows.iter_mut().enumerate().take(painted_count) {
        let outside = |label: &Option<u32>| *label != Some(region as u32);
        let places = window.iter_mut().zip(labels);
        places.filter(|(_, label)| outside(label)).for_each(|(w, _)| *w = 0.0);
    }
    let mut rows: Vec<Vec<f32>> = windows
        .par_iter()
        .enumerate()
        .map(|(region, window)| {
            if (painted_count..input.claims.count).contains(&region) {
                return vec![0.0; vertex_count * 9];
            }
            let mut row = windowed_modes(input.samples, vertex_count, window, 1).remove(0);
            // A painted region reaches as far as it is painted.
            if region < painted_count {
                return row;
            }
            let centre = strongest_vertex(&row);
            let distance = distances(centre);
            for (x, &d) in row.chunks_exact_mut(9).zip(&distance) {
                if d > input.root_reach {
                    x.fill(0.0);
                }
            }
            row
        })
        .collect();
    orthonormalise(&mut rows);
    for (region, row) in rows.iter_mut().enumerate().take(painted_count) {
        let places = row.chunks_exact_mut(9).zip(labels);
        places
            .filter(|(_, label)| **label != Some(region as u32))
            .for_each(|(x, _)| x.fill(0.0));
    }
    rows[painted_count..input.claims.count].clone_from_slice(input.kept);

    let mut levels = vec![LevelWeights {
        component_count: root_count,
        blocks: vec![block(&rows, 1.0)],
    }];
    let mut residuals = vec![input.samples.to_vec()];
    let mut parents = vec![rows];
    // What the decoders of a level multiply by: where each block sees but a share of every vertex, so many times that.
    let mut gain = 1.0;
    for &count in &input.component_counts[1..] {
        let child_gain = match input.attention {
            Attention::Components => 1.0,
            Attention::Equal => parents[0].len() as f32,
        };
        let mut blocks = Vec::new();
        let mut child_residuals = Vec::new();
        let mut child_rows = Vec::new();
        for (rows, residual) in parents.iter().zip(&residuals) {
            let residual = block_residual(rows, residual, gain);
            let masks = attention_masks(rows, vertex_count, input.attention);
            let children: Vec<Vec<Vec<f32>>> = match input.attention {
                Attention::Components => masks
                    .par_iter()
                    .map(|mask| windowed_modes(&residual, vertex_count, mask, count))
                    .collect(),
                // All see the same: they share out its modes.
                Attention::Equal => {
                    let modes = windowed_modes(&residual, vertex_count, &vec![1.0; vertex_count], count * masks.len());
                    modes.chunks(count).map(<[_]>::to_vec).collect()
                }
            };
            let is_last = levels.len() + 1 == input.component_counts.len();
            for (mask, rows) in masks.iter().zip(children) {
                blocks.push(block(&rows, child_gain));
                // The residuals of the last level feed nothing.
                child_residuals.push(if is_last { Vec::new() } else { masked(&residual, mask) });
                child_rows.push(rows);
            }
        }
        levels.push(LevelWeights {
            component_count: count,
            blocks,
        });
        gain = child_gain;
        residuals = child_residuals;
        parents = child_rows;
    }
    StackWeights { vertex_count, levels }
}

/// Convolutions that pass values through (`W_point = I`, the decoder's times `gain`), and the given rows as C.
fn block(rows: &[Vec<f32>], gain: f32) -> BlockWeights {
    let convolution = |diagonal: f32| {
        let mut convolution = zero_convolution();
        (0..9).for_each(|c| convolution.point[c][c] = diagonal);
        convolution
    };
    BlockWeights {
        encoder: convolution(1.0),
        decoder: convolution(gain),
        components: rows.concat(),
    }
}

/// The `count` leading modes of the samples under a window, as unit rows over all vertices. Shape: `[count][V * 9]`.
fn windowed_modes(samples: &[f32], vertex_count: usize, window: &[f32], count: usize) -> Vec<Vec<f32>> {
    let strongest = window.iter().copied().fold(0.0, f32::max);
    let vertices: Vec<u32> = (0..vertex_count as u32)
        .filter(|&v| window[v as usize] > WINDOW_CUT * strongest)
        .collect();
    let weights: Vec<f32> = vertices.iter().map(|&v| window[v as usize]).collect();
    let modes = WeightedSamples::gather(samples, vertex_count, &vertices, &weights).leading_modes(count);
    (0..count)
        .map(|i| {
            let mut row = vec![0.0; vertex_count * 9];
            if i < modes.shapes.ncols() {
                for (&v, x) in vertices.iter().zip(modes.shapes.col_as_slice(i).chunks_exact(9)) {
                    row[9 * v as usize..9 * v as usize + 9].copy_from_slice(x);
                }
            }
            row
        })
        .collect()
}

/// `argmax_v |C_v|`.
fn strongest_vertex(row: &[f32]) -> usize {
    let mut best = (0.0, 0);
    for (v, x) in row.chunks_exact(9).enumerate() {
        let energy: f32 = x.iter().map(|x| x * x).sum();
        if energy > best.0 {
            best = (energy, v);
        }
    }
    best.1
}

/// Löwdin: the orthonormal rows nearest to the given ones, `(C C^T)^(-1/2) C`. Rows of zeros stay; what
/// rows have beside others that they depend on is raised no further than to rows that nearly do.
fn orthonormalise(rows: &mut Vec<Vec<f32>>) {
    for row in rows.iter_mut() {
        let length = row.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        if length > 0.0 {
            row.iter_mut().for_each(|x| *x = (f64::from(*x) / length) as f32);
        }
    }
    let count = rows.len();
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(x, y)| f64::from(*x) * f64::from(*y)).sum::<f64>();
    let gram = Mat::<f64>::from_fn(count, count, |i, j| dot(&rows[i], &rows[j]));
    let Ok(eigen) = gram.self_adjoint_eigen(Side::Lower) else {
        return;
    };
    let (u, s) = (eigen.U(), eigen.S());
    let root = Mat::<f64>::from_fn(count, count, |i, j| {
        (0..count)
            .map(|q| u[(i, q)] * u[(j, q)] / s[q].max(DEPENDENT).sqrt())
            .sum()
    });
    let mixed: Vec<Vec<f32>> = (0..count)
        .map(|i| {
            let mut row = vec![0.0_f64; rows[0].len()];
            for (j, source) in rows.iter().enumerate() {
                row.iter_mut()
                    .zip(source)
                    .for_each(|(r, &x)| *r += root[(i, j)] * f64::from(x));
            }
            row.into_iter().map(|x| x as f32).collect()
        })
        .collect();
    *rows = mixed;
}

/// `x - y` of a block at its start, where the convolutions pass values through: `y = tanh(gain C^T C tanh(x))`.
fn block_residual(rows: &[Vec<f32>], inputs: &[f32], gain: f32) -> Vec<f32> {
    let width = rows[0].len();
    let mut residual = inputs.to_vec();
    residual.par_chunks_mut(width).for_each(|x| {
        let mut decoded = vec![0.0_f32; width];
        for row in rows {
            let z: f32 = row
                .iter()
                .zip(x.iter())
                .filter(|(c, _)| **c != 0.0)
                .map(|(c, x)| c * x.tanh())
                .sum();
            decoded.iter_mut().zip(row).for_each(|(y, c)| *y += gain * z * c);
        }
        x.iter_mut().zip(&decoded).for_each(|(x, y)| *x -= y.tanh());
    });
    residual
}

/// Attention masks of a block's components (method section 2). Shape: `[K][V]`; they sum to one at every vertex.
fn attention_masks(rows: &[Vec<f32>], vertex_count: usize, attention: Attention) -> Vec<Vec<f32>> {
    let floor = attention.floor(vertex_count);
    if floor.is_infinite() {
        return vec![vec![1.0 / rows.len() as f32; vertex_count]; rows.len()];
    }
    let energy = |row: &[f32], v: usize| row[9 * v..9 * v + 9].iter().map(|x| x * x).sum::<f32>() + floor;
    let totals: Vec<f32> = (0..vertex_count)
        .map(|v| rows.iter().map(|row| energy(row, v)).sum())
        .collect();
    rows.iter()
        .map(|row| (0..vertex_count).map(|v| energy(row, v) / totals[v]).collect())
        .collect()
}

/// Every sample times the mask of its vertex.
fn masked(samples: &[f32], mask: &[f32]) -> Vec<f32> {
    let mut masked = samples.to_vec();
    masked.par_chunks_mut(mask.len() * 9).for_each(|sample| {
        for (x, &m) in sample.chunks_exact_mut(9).zip(mask) {
            x.iter_mut().for_each(|x| *x *= m);
        }
    });
    masked
}
