//! The closed-form start of the network: the basis that misses least of many mixes, in the metric that counts positions, made
//! local, ordered into a tree and cut to what it may cost.
//!
//! Mixes -> leading modes ([`modes`](super::modes)) -> local rows ([`varimax`](super::varimax)) -> tree
//! ([`grouping`](super::grouping)) -> supports and values ([`alternate`](super::alternate)) -> weights of the stack. Regions that
//! the user painted and components that stay from older packages come first; the rest is made from what they leave.

use faer::Mat;

use super::alternate::{Reader, Samples, cut_to_budget};
use super::embedding::Embedding;
use super::grouping::{Flat, Node, overlaps, places_of};
use super::modes::leading_modes;
use super::varimax::localise;
use crate::network::attention::Attention;
use crate::network::weights::{StackWeights, diagonal_convolution};

/// Vertices that belong to components from the outset.
#[derive(Debug, Clone, Default)]
pub struct Claims {
    /// The root component of a vertex, below `count`. Shape: `[V]`.
    pub labels: Vec<Option<u32>>,
    /// Root components that are claimed, fewer than there are to be; one may have lost all its vertices to others.
    pub count: usize,
}

/// What the start is made from.
pub struct StartInput<'a> {
    /// The mesh's metric.
    pub embedding: &'a Embedding<'a>,
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
    /// Entries of all rows together, kept ones aside.
    pub entry_budget: usize,
    /// Turns of codes and rows after the cut.
    pub rounds: usize,
}

/// A basis on its way: rows and where each stands in the tree.
struct Rows {
    rows: Vec<Vec<f32>>,
    paths: Vec<Vec<usize>>,
}

/// Computes the start.
pub fn closed_form_start(input: &StartInput<'_>) -> StackWeights {
    let samples = Samples::new(input.embedding, input.samples);
    let below = places_of(&input.component_counts[1..]);
    let mut basis = claimed(input, &samples, below);
    let free_roots = input.component_counts[0] - input.claims.count;
    let rest = left_over(&samples, &basis.rows);
    add_tree(input, rest.as_deref().unwrap_or(input.samples), free_roots, &mut basis);

    let is_fixed: Vec<bool> = basis.paths.iter().map(|path| is_kept(input, path)).collect();
    let codes = Reader::new(input.embedding, &basis.rows).codes(&samples);
    let supports = cut_to_budget(&mut basis.rows, codes.as_ref(), input.entry_budget, &is_fixed);
    for _ in 0..input.rounds {
        let codes = Reader::new(input.embedding, &basis.rows).codes(&samples);
        samples.fit_rows(&mut basis.rows, codes.as_ref(), &supports, &is_fixed);
    }
    weights_of(input, &basis)
}

fn is_kept(input: &StartInput<'_>, path: &[usize]) -> bool {
    let painted = input.claims.count - input.kept.len();
    path.len() == 1 && (painted..input.claims.count).contains(&path[0])
}

/// Rows of painted regions and kept components, and what goes below them: modes of what they leave, at their places.
fn claimed(input: &StartInput<'_>, samples: &Samples<'_>, below: usize) -> Rows {
    let mut basis = Rows {
        rows: Vec::new(),
        paths: Vec::new(),
    };
    let painted = input.claims.count - input.kept.len();
    let inside = |fields: &[f32], root: usize| -> Vec<f32> {
        let mut fields = fields.to_vec();
        let labels = &input.claims.labels;
        for field in fields.chunks_exact_mut(9 * labels.len()) {
            let places = field.as_chunks_mut::<9>().0.iter_mut().zip(labels);
            places
                .filter(|(_, label)| **label != Some(root as u32))
                .for_each(|(x, _)| *x = [0.0; 9]);
        }
        fields
    };
    for root in 0..input.claims.count {
        let row = match root.checked_sub(painted) {
            Some(kept) => input.kept[kept].clone(),
            None => leading_modes(input.embedding, &inside(input.samples, root), 1)
                .rows
                .pop()
                .unwrap_or_else(|| vec![0.0; 9 * input.claims.labels.len()]),
        };
        basis.rows.push(row);
        basis.paths.push(vec![root]);
    }
    if below > 0
        && let Some(rest) = left_over(samples, &basis.rows)
    {
        for root in 0..input.claims.count {
            let modes = leading_modes(input.embedding, &inside(&rest, root), below);
            let mut own = Rows {
                rows: Vec::new(),
                paths: Vec::new(),
            };
            add_rows(
                input,
                &rest,
                &modes.rows,
                &input.component_counts[1..],
                &[root],
                &mut own,
            );
            basis.rows.append(&mut own.rows);
            basis.paths.append(&mut own.paths);
        }
    }
    basis
}

/// What the rows leave of the samples; nothing where there are no rows.
fn left_over(samples: &Samples<'_>, rows: &[Vec<f32>]) -> Option<Vec<f32>> {
    (!rows.is_empty()).then(|| samples.residuals(rows, Reader::new(samples.embedding(), rows).codes(samples).as_ref()))
}

/// The `roots` free root components and all below them.
fn add_tree(input: &StartInput<'_>, samples: &[f32], roots: usize, basis: &mut Rows) {
    let mut counts = input.component_counts.to_vec();
    counts[0] = roots;
    let modes = leading_modes(input.embedding, samples, places_of(&counts));
    add_rows(input, samples, &modes.rows, &counts, &[], basis);
}

/// Makes modes local and a tree of them, under the component at `path`.
fn add_rows(
    input: &StartInput<'_>,
    samples: &[f32],
    modes: &[Vec<f32>],
    counts: &[usize],
    path: &[usize],
    basis: &mut Rows,
) {
    if modes.is_empty() {
        return;
    }
    let local = localise(modes, input.embedding.areas());
    let reader = Reader::new(input.embedding, &local);
    let codes = reader.codes(&Samples::new(input.embedding, samples));
    let squares: Mat<f64> = codes.transpose() * &codes;
    let overlap = overlaps(&local, input.embedding.areas());
    let flat = Flat {
        overlap: overlap.as_ref(),
        squares: squares.as_ref(),
        gram: reader.gram.as_ref(),
    };
    let everyone: Vec<usize> = (0..local.len()).collect();
    let first = if path.is_empty() { input.claims.count } else { 0 };
    for (i, node) in flat.tree(&everyone, counts).iter().enumerate() {
        let mut own = path.to_vec();
        own.push(first + i);
        add_node(&local, node, &own, basis);
    }
}

fn add_node(local: &[Vec<f32>], node: &Node, path: &[usize], basis: &mut Rows) {
    let mut row = vec![0.0; local[0].len()];
    for &(k, share) in &node.shares {
        row.iter_mut().zip(&local[k]).for_each(|(x, c)| *x += share as f32 * c);
    }
    basis.rows.push(row);
    basis.paths.push(path.to_vec());
    for (i, child) in node.children.iter().enumerate() {
        let mut below = path.to_vec();
        below.push(i);
        add_node(local, child, &below, basis);
    }
}

/// The stack: every row at its place, zeros where there is none, convolutions that pass values through.
fn weights_of(input: &StartInput<'_>, basis: &Rows) -> StackWeights {
    let vertex_count = input.embedding.vertex_count();
    let width = 9 * vertex_count;
    let mut weights = StackWeights::zeros(vertex_count, input.component_counts);
    // Where each block sees but an equal share of every vertex, its decoder answers so many times that.
    let gain = match input.attention {
        Attention::Components => 1.0,
        Attention::Equal => input.component_counts[0] as f32,
    };
    for (l, level) in weights.levels.iter_mut().enumerate() {
        for block in &mut level.blocks {
            block.encoder = diagonal_convolution(1.0);
            block.decoder = diagonal_convolution(if l == 0 { 1.0 } else { gain });
        }
    }
    for (row, path) in basis.rows.iter().zip(&basis.paths) {
        let (&last, above) = path.split_last().unwrap_or((&0, &[]));
        let counts = input.component_counts;
        let block = above
            .iter()
            .zip(counts)
            .fold(0, |block, (&k, &count)| block * count + k);
        let place = &mut weights.levels[above.len()].blocks[block].components;
        place[last * width..(last + 1) * width].copy_from_slice(row);
    }
    weights
}

#[cfg(test)]
mod tests;
