//! Where the nodes stand: spread over the surface, each time at the vertex farthest from all before; and which of them are
//! near a vertex. Distances are shortest paths along edges, bridges included, so that a loose piece hangs on its
//! neighbours.

use core::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::mesh::topology::{Topology, difference, length};

/// The edges of a mesh and their lengths.
#[derive(Debug)]
pub struct SurfaceGraph<'a> {
    topology: &'a Topology,
    /// Shape: that of the topology's ring.
    lengths: Vec<f64>,
}

/// A node and how far it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near {
    /// Place among the nodes.
    pub node: u32,
    /// Along edges, units of the source.
    pub distance: f64,
}

/// A path that has come to `vertex`; the nearest first, then the lower indices.
#[derive(PartialEq)]
struct Path {
    distance: f64,
    vertex: u32,
    node: u32,
}

impl Eq for Path {}

impl Ord for Path {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap gives the greatest.
        let nearest_first = other.distance.total_cmp(&self.distance);
        nearest_first
            .then(other.vertex.cmp(&self.vertex))
            .then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Path {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<'a> SurfaceGraph<'a> {
    /// Measures the edges. Shape: `rest` `[V]`.
    pub fn new(topology: &'a Topology, rest: &[[f64; 3]]) -> Self {
        let edges = (0..topology.vertex_count).flat_map(|v| topology.ring_of(v).iter().map(move |&j| (v, j)));
        let lengths = edges
            .map(|(v, j)| length(difference(rest[v], rest[j as usize])))
            .collect();
        Self { topology, lengths }
    }

    /// Its edges, and others' lengths for them: what is far in the one need not be in the other. Shape: that of the
    /// topology's ring, not negative.
    pub fn with_lengths(&self, lengths: Vec<f64>) -> Self {
        Self {
            topology: self.topology,
            lengths,
        }
    }

    /// Shape: that of the topology's ring.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Up to `count` vertices: `first`, then each time the one farthest from all before (the lowest index of equals).
    /// Fewer where the rest stand at the same places.
    pub fn farthest_points(&self, first: usize, count: usize) -> Vec<u32> {
        let mut nearest = vec![f64::INFINITY; self.topology.vertex_count];
        // Every distance a vertex ever had; only its last one counts.
        let mut farthest = BinaryHeap::new();
        let mut points = Vec::new();
        let mut next = first as u32;
        while points.len() < count {
            points.push(next);
            nearest[next as usize] = 0.0;
            let mut open = BinaryHeap::from([Path {
                distance: 0.0,
                vertex: next,
                node: 0,
            }]);
            while let Some(Path { distance, vertex, .. }) = open.pop() {
                if distance > nearest[vertex as usize] {
                    continue;
                }
                for entry in self.topology.entries_of(vertex as usize) {
                    let (j, along) = (self.topology.ring[entry], distance + self.lengths[entry]);
                    if along < nearest[j as usize] {
                        nearest[j as usize] = along;
                        // Bits of floats that are not negative order like the floats.
                        farthest.push((along.to_bits(), Reverse(j)));
                        open.push(Path {
                            distance: along,
                            vertex: j,
                            node: 0,
                        });
                    }
                }
            }
            let last = core::iter::from_fn(|| farthest.pop())
                .find(|&(bits, Reverse(vertex))| nearest[vertex as usize].to_bits() == bits);
            match last {
                Some((bits, Reverse(vertex))) if bits > 0 => next = vertex,
                _ => break,
            }
        }
        points
    }

    /// The `count` nearest nodes of every vertex, nearest first; fewer where there are fewer. Shape: `[V]`.
    pub fn nearest(&self, nodes: &[u32], count: usize) -> Vec<Vec<Near>> {
        let mut near: Vec<Vec<Near>> = vec![Vec::with_capacity(count); self.topology.vertex_count];
        let starts = nodes.iter().enumerate().map(|(node, &vertex)| Path {
            distance: 0.0,
            vertex,
            node: node as u32,
        });
        let mut open: BinaryHeap<Path> = starts.collect();
        let wanted = |held: &[Near], node: u32| held.len() < count && held.iter().all(|near| near.node != node);
        while let Some(Path { distance, vertex, node }) = open.pop() {
            if !wanted(&near[vertex as usize], node) {
                continue;
            }
            near[vertex as usize].push(Near { node, distance });
            for entry in self.topology.entries_of(vertex as usize) {
                let j = self.topology.ring[entry];
                if wanted(&near[j as usize], node) {
                    open.push(Path {
                        distance: distance + self.lengths[entry],
                        vertex: j,
                        node,
                    });
                }
            }
        }
        near
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, merged, moved, tube};

    #[test]
    fn points_are_spread_and_repeatable() {
        let (rest, faces) = tube(12, 20, 10.0);
        let topology = Topology::new(&faces, &rest);
        let surface = SurfaceGraph::new(&topology, &rest);
        let points = surface.farthest_points(0, 30);
        assert_eq!((points[0], points.len()), (0, 30));
        assert!((rest[points[1] as usize][2] - 10.0).abs() < 1e-9, "the far end");
        let near = surface.nearest(&points, 1);
        let farthest = near.iter().map(|row| row[0].distance).fold(0.0, f64::max);
        let spacing = (core::f64::consts::TAU * 10.0 / 30.0_f64).sqrt();
        assert!(farthest < 1.5 * spacing, "{farthest} {spacing}");
        assert_eq!(points, surface.farthest_points(0, 30));
    }

    #[test]
    fn as_many_points_as_places() {
        let (mut rest, mut faces) = grid(2, 2, 1.0);
        rest.push(rest[0]);
        faces.push([9, 1, 3]);
        let topology = Topology::new(&faces, &rest);
        let points = SurfaceGraph::new(&topology, &rest).farthest_points(4, 100);
        assert!((9..=10).contains(&points.len()), "{points:?}");
    }

    #[test]
    fn nearest_nodes_are_those_of_a_search_from_each() {
        let (rest, faces) = merged(&[grid(6, 5, 1.0), moved(&grid(2, 2, 1.0), [9.0, 0.0, 0.0])]);
        let topology = Topology::new(&faces, &rest);
        let surface = SurfaceGraph::new(&topology, &rest);
        let nodes = surface.farthest_points(3, 7);
        let each: Vec<Vec<Vec<Near>>> = nodes.iter().map(|&node| surface.nearest(&[node], 1)).collect();
        for (v, row) in surface.nearest(&nodes, 4).iter().enumerate() {
            let mut all: Vec<f64> = each.iter().map(|from| from[v][0].distance).collect();
            for near in row {
                assert_eq!(near.distance, all[near.node as usize]);
            }
            all.sort_by(f64::total_cmp);
            let found: Vec<f64> = row.iter().map(|near| near.distance).collect();
            assert_eq!(found, all[..4]);
        }
    }
}
