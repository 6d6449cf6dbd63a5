//! Folds the decoder's convolution into the components. Blend and convolution are both linear, so
//! `Chat_k,v = W_point C_k,v + W_neighbour mean_{j in ring(v)} C_k,j` is computed once, and the frame evaluates
//! `tanh(bias + sum_k z_k Chat_k,v) - tanh(bias)`: the trained network at the price of a sparse blend. The support grows
//! by one ring.
//!
//! What is folded is rounded to whole numbers of 16 bits, with one scale for log-rotation and one for stretch. Left alone the roundings of a region that moves as one all go one way, and
//! the solve adds them up over the limb; so each vertex hands its rounding on to the neighbours that are still to come, as
//! error diffusion does in printing (Floyd and Steinberg 1976).

use rayon::prelude::*;
use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord, ROTATION_FEATURES, ValueScales, nearest};

use super::sparse::SparseComponent;

/// One component after folding.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldedComponent {
    /// Solver places, ascending.
    pub solver_indices: Vec<u32>,
    /// Whole numbers, times the scales. Shape: that of `solver_indices`.
    pub values: Vec<[i16; FEATURE_COUNT]>,
    /// Of `values`.
    pub value_scales: ValueScales,
}

/// A vertex hands on at most so many times its own rounding: small neighbours of a large one stay what they are.
const MOST_HANDED_ON: f64 = 4.0;

/// The rings that the convolution averages over, and the order that the result is wanted in.
#[derive(Debug, Clone, Copy)]
pub struct FoldFrame<'a> {
    /// Compressed rows over `ring`, source order. Shape: `[V + 1]`.
    pub ring_offsets: &'a [u32],
    /// Source indices.
    pub ring: &'a [u32],
    /// What a gradient counts in the solve, about four times the area around the vertex. Shape: `[V]`.
    pub areas: &'a [f64],
    /// Source indices in the order of rounding. Shape: `[V]`, a permutation.
    pub rounding_order: &'a [u32],
    /// Shape: `[V]`.
    pub solver_from_vertex: &'a [u32],
}

impl FoldFrame<'_> {
    /// Folds each component with its block's decoder. An identity convolution changes no value of a component whose greatest
    /// whole numbers are [`ValueScales::GREATEST`].
    pub fn fold(&self, components: &[SparseComponent], decoders: &[&GraphConvRecord]) -> Vec<FoldedComponent> {
        let jobs = components.par_iter().zip(decoders);
        jobs.map(|(component, decoder)| self.fold_one(component, decoder))
            .collect()
    }

    fn fold_one(&self, component: &SparseComponent, decoder: &GraphConvRecord) -> FoldedComponent {
        let vertex_count = self.solver_from_vertex.len();
        let mut folded = vec![[0.0_f64; FEATURE_COUNT]; vertex_count];
        for (&vertex, value) in component.vertices.iter().zip(&component.values) {
            add(&mut folded[vertex as usize], &times(&decoder.point, value), 1.0);
            let towards_neighbours = times(&decoder.neighbour, value);
            for &j in self.ring_of(vertex) {
                let mean_share = 1.0 / self.ring_of(j).len() as f64;
                add(&mut folded[j as usize], &towards_neighbours, mean_share);
            }
        }
        let greatest = |features: core::ops::Range<usize>| {
            let numbers = folded.iter().flat_map(|value| &value[features.clone()]);
            numbers.fold(0.0_f64, |greatest, x| greatest.max(x.abs()))
        };
        let value_scales = ValueScales::for_greatest(
            greatest(0..ROTATION_FEATURES),
            greatest(ROTATION_FEATURES..FEATURE_COUNT),
        );
        let mut entries: Vec<(u32, [i16; FEATURE_COUNT])> = self
            .rounded(&folded, &value_scales.by_feature().map(f64::from))
            .into_iter()
            .zip(self.solver_from_vertex)
            .filter(|(value, _)| *value != [0; FEATURE_COUNT])
            .map(|(value, &solver)| (solver, value))
            .collect();
        entries.sort_unstable_by_key(|&(solver, _)| solver);
        let (solver_indices, values) = entries.into_iter().unzip();
        FoldedComponent {
            solver_indices,
            values,
            value_scales,
        }
    }

    /// `folded / scales` in whole numbers, the roundings handed on in [`Self::rounding_order`] within the support. Shape: both
    /// `[V]`.
    fn rounded(&self, folded: &[[f64; FEATURE_COUNT]], scales: &[f64; FEATURE_COUNT]) -> Vec<[i16; FEATURE_COUNT]> {
        let exact = |v: usize| -> [f64; FEATURE_COUNT] { core::array::from_fn(|c| folded[v][c] / scales[c]) };
        let mut whole: Vec<[i16; FEATURE_COUNT]> = (0..folded.len()).map(|v| exact(v).map(nearest)).collect();
        let mut waits: Vec<bool> = whole.iter().map(|value| *value != [0; FEATURE_COUNT]).collect();
        let mut handed = vec![[0.0_f64; FEATURE_COUNT]; folded.len()];
        for &vertex in self.rounding_order {
            let v = vertex as usize;
            if !core::mem::take(&mut waits[v]) {
                continue;
            }
            let exact = exact(v);
            let wanted: [f64; FEATURE_COUNT] = core::array::from_fn(|c| exact[c] + handed[v][c]);
            whole[v] = wanted.map(nearest);
            let next = || self.ring_of(vertex).iter().map(|&j| j as usize).filter(|&j| waits[j]);
            let area: f64 = next().map(|j| self.areas[j]).sum();
            let share = if area > 0.0 {
                (self.areas[v] / area).min(MOST_HANDED_ON)
            } else {
                0.0
            };
            for j in next() {
                for c in 0..FEATURE_COUNT {
                    handed[j][c] += share * (wanted[c] - f64::from(whole[v][c]));
                }
            }
        }
        whole
    }

    fn ring_of(&self, v: u32) -> &[u32] {
        let v = v as usize;
        &self.ring[self.ring_offsets[v] as usize..self.ring_offsets[v + 1] as usize]
    }
}

fn times(matrix: &[[f32; FEATURE_COUNT]; FEATURE_COUNT], x: &[f64; FEATURE_COUNT]) -> [f64; FEATURE_COUNT] {
    matrix.map(|row| row.iter().zip(x).map(|(&m, &x)| f64::from(m) * x).sum())
}

fn add(sum: &mut [f64; FEATURE_COUNT], x: &[f64; FEATURE_COUNT], factor: f64) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += factor * x;
    }
}

#[cfg(test)]
mod tests {
    use sinew_formats::package::GraphConvRecord;

    use super::*;
    use crate::mesh::{cotangent::EdgeWeights, shapes::grid, topology::Topology};
    use crate::surface::Surface;

    /// What is left of the sum of the roundings: the last vertex keeps its own.
    const LEFT_OVER: f64 = 0.02;

    #[test]
    fn roundings_of_a_region_that_moves_as_one_cancel() {
        let (rest, faces) = grid(20, 15, 0.1);
        let topology = Topology::new(&faces, &rest);
        let weights = EdgeWeights::new(&topology, &rest);
        let surface = Surface {
            rest,
            topology,
            weights,
        };
        let count = surface.rest.len();
        let areas = surface.gradient_areas();
        let identity: Vec<u32> = (0..count as u32).collect();
        let frame = FoldFrame {
            ring_offsets: &surface.topology.ring_offsets,
            ring: &surface.topology.ring,
            areas: &areas,
            rounding_order: &surface.towards(7),
            solver_from_vertex: &identity,
        };
        // Between two whole numbers; and two that are whole, the greatest of each kind.
        let value = [1.000_3, -0.700_1, 0.25, 0.0, 1.0, 3.0, -1.5, 1e-3, 0.123];
        let component = SparseComponent {
            vertices: identity.clone(),
            values: vec![value; count],
        };
        let mut point = [[0.0; FEATURE_COUNT]; FEATURE_COUNT];
        (0..FEATURE_COUNT).for_each(|c| point[c][c] = 1.0);
        let decoder = GraphConvRecord {
            point,
            neighbour: [[0.0; FEATURE_COUNT]; FEATURE_COUNT],
            bias: [0.0; FEATURE_COUNT],
        };
        let folded = &frame.fold(&[component], &[&decoder])[0];
        assert_eq!(folded.solver_indices, identity);
        let scales = folded.value_scales.by_feature().map(f64::from);
        for (c, &value) in value.iter().enumerate() {
            let unit = scales[c];
            let plain = unit * f64::from(nearest(value / unit)) - value;
            let off = |v: usize| unit * f64::from(folded.values[v][c]) - value;
            let sum: f64 = (0..count).map(|v| areas[v] * off(v)).sum();
            let plain_sum = areas.iter().sum::<f64>() * plain;
            // The greatest of each kind is whole, but for the rounding of its scale, which nothing greater can make good.
            if [1.000_3, 3.0, 0.0].contains(&value.abs()) {
                assert!((0..count).all(|v| off(v).abs() < 1.01 * unit), "feature {c} is whole");
                continue;
            }
            assert!(
                sum.abs() <= LEFT_OVER * plain_sum.abs(),
                "feature {c}: {sum:e} of {plain_sum:e}"
            );
            assert!((0..count).all(|v| off(v).abs() <= MOST_HANDED_ON * unit), "feature {c}");
        }
    }
}
