//! Distances that count what moves differently as far apart: along the edges of the mesh, each as long as it is, and longer
//! the more its ends turn against each other in the shapes. Regions of mixes that are measured so end at joints.

use core::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;
use sinew_interchange::ShapeStore;

use super::mix::some_of;
use crate::mesh::topology::Topology;

/// Distances from each of `centres` to every vertex, the longest of all being 1. `weight`: how much bends count against lengths,
/// both as shares of their mean. Shapes: `rest` `[V]`; the answer `[centres][V]`.
pub fn bend_distances(
    topology: &Topology,
    rest: &[[f64; 3]],
    store: &ShapeStore<9>,
    shapes: &[usize],
    weight: f64,
    centres: &[usize],
) -> Vec<Vec<f32>> {
    let costs = edge_costs(topology, rest, store, shapes, weight);
    let mut distances: Vec<Vec<f32>> = centres
        .par_iter()
        .map(|&centre| from_one(topology, &costs, centre))
        .collect();
    let finite = distances.iter().flatten().copied().filter(|d| d.is_finite());
    let longest = finite.fold(0.0, f32::max);
    let scale = if longest > 0.0 { 1.0 / longest } else { 0.0 };
    distances.iter_mut().flatten().for_each(|d| *d = (*d * scale).min(1.0));
    distances
}

/// One cost a ring entry; 0 nowhere but between vertices at one place.
fn edge_costs(
    topology: &Topology,
    rest: &[[f64; 3]],
    store: &ShapeStore<9>,
    shapes: &[usize],
    weight: f64,
) -> Vec<f64> {
    let looked_at: Vec<&[[f32; 9]]> = some_of(shapes).map(|m| &store[m]).collect();
    let (mut lengths, mut bends) = (
        Vec::with_capacity(topology.ring.len()),
        Vec::with_capacity(topology.ring.len()),
    );
    for v in 0..topology.vertex_count {
        for &j in topology.ring_of(v) {
            let j = j as usize;
            lengths.push((0..3).map(|c| (rest[v][c] - rest[j][c]).powi(2)).sum::<f64>().sqrt());
            let against = |shape: &&[[f32; 9]]| {
                (0..3)
                    .map(|c| f64::from(shape[v][c] - shape[j][c]).powi(2))
                    .sum::<f64>()
            };
            bends.push(looked_at.iter().map(against).sum::<f64>().sqrt());
        }
    }
    let share = |values: &[f64]| 1.0 / values.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let (of_lengths, of_bends) = (share(&lengths), share(&bends));
    let pairs = lengths.iter().zip(&bends);
    pairs
        .map(|(length, bend)| (length * of_lengths + weight * bend * of_bends) / (1.0 + weight))
        .collect()
}

/// Dijkstra 1959. Shape: `[V]`; infinite where no edge leads.
fn from_one(topology: &Topology, costs: &[f64], centre: usize) -> Vec<f32> {
    let mut distances = vec![f64::INFINITY; topology.vertex_count];
    distances[centre] = 0.0;
    // Bits of positive numbers are in the order of the numbers.
    let mut open = BinaryHeap::from([(Reverse(0_u64), centre)]);
    while let Some((Reverse(bits), v)) = open.pop() {
        let here = f64::from_bits(bits);
        if here > distances[v] {
            continue;
        }
        for entry in topology.entries_of(v) {
            let (j, there) = (topology.ring[entry] as usize, here + costs[entry]);
            if there < distances[j] {
                distances[j] = there;
                open.push((Reverse(there.to_bits()), j));
            }
        }
    }
    distances.into_iter().map(|d| d as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of two rows of vertices, ten long.
    fn strip() -> (Topology, Vec<[f64; 3]>) {
        let rest: Vec<[f64; 3]> = (0..20).map(|v| [f64::from(v / 2), f64::from(v % 2), 0.0]).collect();
        let faces: Vec<[u32; 3]> = (0..9)
            .flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]])
            .collect();
        (Topology::new(&faces, &rest), rest)
    }

    #[test]
    fn a_joint_is_farther_than_it_lies() {
        let (topology, rest) = strip();
        // The far half turns as one: all bending is between vertices 9 and 10.
        let shape: Vec<[f32; 9]> = (0..20)
            .map(|v| {
                let mut x = [0.0; 9];
                x[2] = if v >= 10 { 0.5 } else { 0.0 };
                x
            })
            .collect();
        let store = ShapeStore::of_shapes(&[shape]);
        let from_start = |weight: f64| bend_distances(&topology, &rest, &store, &[0], weight, &[0]).remove(0);
        let (plain, bent) = (from_start(0.0), from_start(1.0));
        assert!((plain[18] - 1.0).abs() < 0.2 && plain[0] == 0.0);
        let jump = |d: &[f32]| (d[10] - d[8]) / (d[8] - d[6]);
        assert!((jump(&plain) - 1.0).abs() < 1e-3, "{}", jump(&plain));
        assert!(jump(&bent) > 3.0, "{}", jump(&bent));
    }
}
