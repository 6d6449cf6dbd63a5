//! Folds the decoder's convolution into the components. Blend and convolution are both linear, so
//! `Chat_k,v = W_point C_k,v + W_neighbour mean_{j in ring(v)} C_k,j` is computed once, and the frame evaluates
//! `tanh(bias + sum_k z_k Chat_k,v) - tanh(bias)`: the trained network at the price of a sparse blend. The support grows
//! by one ring.

use half::f16;
use rayon::prelude::*;
use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::sparse::SparseComponent;

/// Largest folded magnitude, in units of the component's `value_scale`, lies in `[2^13, 2^14)`: below the half format's
/// 65504, and 28 binary digits above its smallest normal number.
const LARGEST_EXPONENT: i32 = 13;

/// One component after folding.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldedComponent {
    /// Solver indices, ascending.
    pub solver_indices: Vec<u32>,
    /// IEEE half bits, times `value_scale`. Shape: that of `solver_indices`.
    pub values: Vec<[u16; FEATURE_COUNT]>,
    /// Positive.
    pub value_scale: f32,
}

/// The rings that the convolution averages over, and the order that the result is wanted in.
#[derive(Debug, Clone, Copy)]
pub struct FoldFrame<'a> {
    /// Compressed rows over `ring`, source order. Shape: `[V + 1]`.
    pub ring_offsets: &'a [u32],
    /// Source indices.
    pub ring: &'a [u32],
    /// Shape: `[V]`.
    pub solver_from_vertex: &'a [u32],
}

impl FoldFrame<'_> {
    /// Folds each component with its block's decoder. `value_scales[k]` is the compact package's scale: the folded one is
    /// that times a power of two, so an identity convolution changes no value.
    pub fn fold(
        &self,
        components: &[SparseComponent],
        decoders: &[&GraphConvRecord],
        value_scales: &[f32],
    ) -> Vec<FoldedComponent> {
        let jobs = components.par_iter().zip(decoders).zip(value_scales);
        jobs.map(|((component, decoder), &scale)| self.fold_one(component, decoder, scale))
            .collect()
    }

    fn fold_one(&self, component: &SparseComponent, decoder: &GraphConvRecord, scale: f32) -> FoldedComponent {
        let vertex_count = self.solver_from_vertex.len();
        let mut folded = vec![[0.0_f64; FEATURE_COUNT]; vertex_count];
        for (&vertex, value) in component.vertices.iter().zip(&component.values) {
            let value = value.map(f64::from);
            add(&mut folded[vertex as usize], &times(&decoder.point, &value), 1.0);
            let towards_neighbours = times(&decoder.neighbour, &value);
            for &j in self.ring_of(vertex) {
                let mean_share = 1.0 / self.ring_of(j).len() as f64;
                add(&mut folded[j as usize], &towards_neighbours, mean_share);
            }
        }
        let largest = folded
            .as_flattened()
            .iter()
            .fold(0.0_f64, |largest, x| largest.max(x.abs()));
        let value_scale = power_of_two_scale(largest, scale);
        let mut entries: Vec<(u32, [u16; FEATURE_COUNT])> = folded
            .iter()
            .zip(self.solver_from_vertex)
            .map(|(value, &solver)| (solver, value.map(|x| f16::from_f64(x / f64::from(value_scale)))))
            .filter(|(_, value)| value.iter().any(|&x| x != f16::ZERO))
            .map(|(solver, value)| (solver, value.map(f16::to_bits)))
            .collect();
        entries.sort_unstable_by_key(|&(solver, _)| solver);
        let (solver_indices, values) = entries.into_iter().unzip();
        FoldedComponent {
            solver_indices,
            values,
            value_scale,
        }
    }

    fn ring_of(&self, v: u32) -> &[u32] {
        let v = v as usize;
        &self.ring[self.ring_offsets[v] as usize..self.ring_offsets[v + 1] as usize]
    }
}

/// `scale` times the power of two that brings `largest` into `[2^13, 2^14)` of it.
fn power_of_two_scale(largest: f64, scale: f32) -> f32 {
    let scale = if scale.abs().is_normal() { scale.abs() } else { 1.0 };
    if largest == 0.0 {
        return scale;
    }
    let exponent = (largest / f64::from(scale)).log2().floor() as i32 - LARGEST_EXPONENT;
    let folded_scale = (f64::from(scale) * f64::from(exponent).exp2()) as f32;
    if folded_scale.is_normal() { folded_scale } else { scale }
}

fn times(matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT], x: &[f64; FEATURE_COUNT]) -> [f64; FEATURE_COUNT] {
    matrix.map(|row| row.iter().zip(x).map(|(&m, &x)| f64::from(m) * x).sum())
}

fn add(sum: &mut [f64; FEATURE_COUNT], x: &[f64; FEATURE_COUNT], factor: f64) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += factor * x;
    }
}
