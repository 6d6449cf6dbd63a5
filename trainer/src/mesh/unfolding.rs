//! Distances along the surface by Dijkstra's search with unfolding: where both ends of an edge are reached, the source is
//! laid into the plane of the next face and seen from its far corner. Slower and sharper than the heat method, which it
//! checks.

use std::collections::BinaryHeap;

use super::topology::{Topology, names_a_vertex_twice};
use super::vector::{difference, length};

/// A new distance counts if it is shorter by this share: keeps rounding from going in circles.
const GAIN: f64 = 1e-12;

/// Distance of every vertex from `source`, in units of `rest`. Shape: `[V]`. Never shorter than the shortest path over
/// faces by more than rounding on a flat mesh; bridges are walked along.
pub fn unfolding_dijkstra(topology: &Topology, rest: &[[f64; 3]], source: usize) -> Vec<f64> {
    let faces_at = faces_of_vertices(topology);
    let mut distances = vec![f64::INFINITY; topology.vertex_count];
    distances[source] = 0.0;
    let mut open = BinaryHeap::from([Reach {
        distance: 0.0,
        vertex: source as u32,
    }]);
    let between = |a: u32, b: u32| length(difference(rest[a as usize], rest[b as usize]));
    while let Some(Reach { distance, vertex }) = open.pop() {
        if distance > distances[vertex as usize] {
            continue;
        }
        let mut offer = |v: u32, candidate: f64, distances: &mut [f64]| {
            if candidate < distances[v as usize] * (1.0 - GAIN) {
                distances[v as usize] = candidate;
                open.push(Reach {
                    distance: candidate,
                    vertex: v,
                });
            }
        };
        for &j in topology.ring_of(vertex as usize) {
            offer(j, distance + between(vertex, j), &mut distances);
        }
        for &f in &faces_at[vertex as usize] {
            let face = topology.faces[f as usize];
            for n in 0..3 {
                let (a, b, far) = (face[n], face[(n + 1) % 3], face[(n + 2) % 3]);
                if far == vertex || distances[a as usize].is_infinite() || distances[b as usize].is_infinite() {
                    continue;
                }
                let sides = [between(a, b), between(b, far), between(far, a)];
                if let Some(seen) = unfolded(sides, distances[a as usize], distances[b as usize]) {
                    offer(far, seen, &mut distances);
                }
            }
        }
    }
    distances
}

/// Distance from the source to the far corner of a face, `sides` being ab, bc, ca, when the straight line from the source,
/// `from_a` and `from_b` away from a and b, crosses the edge ab. `None` where it passes beside, or there is no such point.
fn unfolded([ab, bc, ca]: [f64; 3], from_a: f64, from_b: f64) -> Option<f64> {
    if ab <= 0.0 {
        return None;
    }
    // a at the origin, b on the x axis, c above, the source below.
    let corner = (ca * ca - bc * bc + ab * ab) / (2.0 * ab);
    let height = (ca * ca - corner * corner).max(0.0).sqrt();
    let along = (from_a * from_a - from_b * from_b + ab * ab) / (2.0 * ab);
    let below = from_a * from_a - along * along;
    if below < 0.0 || height <= 0.0 {
        return None;
    }
    let depth = below.sqrt();
    let crossing = along + (corner - along) * depth / (depth + height);
    (0.0..=ab)
        .contains(&crossing)
        .then(|| (corner - along).hypot(height + depth))
}

fn faces_of_vertices(topology: &Topology) -> Vec<Vec<u32>> {
    let mut faces_at = vec![Vec::new(); topology.vertex_count];
    for (f, face) in topology
        .faces
        .iter()
        .enumerate()
        .filter(|(_, face)| !names_a_vertex_twice(face))
    {
        for &v in face {
            faces_at[v as usize].push(f as u32);
        }
    }
    faces_at
}

/// A vertex to continue from; the greatest is the nearest.
#[derive(Debug, Clone, Copy)]
struct Reach {
    distance: f64,
    vertex: u32,
}

impl Ord for Reach {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        other
            .distance
            .total_cmp(&self.distance)
            .then(other.vertex.cmp(&self.vertex))
    }
}

impl PartialOrd for Reach {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reach {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Reach {}
