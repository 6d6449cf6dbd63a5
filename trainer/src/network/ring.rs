//! The mean over one-rings and its transpose, the linear map inside every graph convolution (method section 2).

use crate::mesh::topology::Topology;

/// Compressed one-rings with their transpose, so that both directions are gathers and need no atomics. V vertices.
#[derive(Debug, Clone)]
pub struct RingMean {
    /// Shape: `[V + 1]`.
    pub(crate) offsets: Vec<u32>,
    /// Neighbours of each vertex.
    pub(crate) neighbours: Vec<u32>,
    /// One over the size of the ring; zero for a vertex without neighbours, whose mean is zero. Shape: `[V]`.
    pub(crate) inverse_degree: Vec<f32>,
    /// Rows of the transpose. Shape: `[V + 1]`.
    pub(crate) transposed_offsets: Vec<u32>,
    /// Vertices whose ring holds the row's vertex, ascending.
    pub(crate) transposed: Vec<u32>,
}

impl RingMean {
    /// The mean over the rings of a mesh, bridges included.
    pub fn new(topology: &Topology) -> Self {
        Self::from_rings(topology.ring_offsets.clone(), topology.ring.clone())
    }

    fn from_rings(offsets: Vec<u32>, neighbours: Vec<u32>) -> Self {
        let vertex_count = offsets.len() - 1;
        let degree = |v: usize| offsets[v + 1] - offsets[v];
        let inverse_degree = (0..vertex_count)
            .map(|v| if degree(v) == 0 { 0.0 } else { 1.0 / degree(v) as f32 })
            .collect();
        let mut transposed_offsets = vec![0_u32; vertex_count + 1];
        for &j in &neighbours {
            transposed_offsets[j as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            transposed_offsets[v + 1] += transposed_offsets[v];
        }
        let mut cursor = transposed_offsets.clone();
        let mut transposed = vec![0; neighbours.len()];
        for v in 0..vertex_count {
            for &j in &neighbours[offsets[v] as usize..offsets[v + 1] as usize] {
                transposed[cursor[j as usize] as usize] = v as u32;
                cursor[j as usize] += 1;
            }
        }
        Self {
            offsets,
            neighbours,
            inverse_degree,
            transposed_offsets,
            transposed,
        }
    }

    /// Vertices in the order of a breadth-first walk (Cuthill and McKee 1969, without their sort by degree): a vertex and
    /// its ring then lie a few dozen rows apart, whatever the order of the mesh.
    pub(crate) fn breadth_first_order(&self) -> Vec<u32> {
        let vertex_count = self.vertex_count();
        let (mut order, mut is_placed) = (Vec::with_capacity(vertex_count), vec![false; vertex_count]);
        for start in 0..vertex_count {
            let mut next = order.len();
            if !core::mem::replace(&mut is_placed[start], true) {
                order.push(start as u32);
            }
            while next < order.len() {
                for &j in self.ring(order[next] as usize) {
                    if !core::mem::replace(&mut is_placed[j as usize], true) {
                        order.push(j);
                    }
                }
                next += 1;
            }
        }
        order
    }

    /// The same mean where vertex `v` is the one that was `order[v]`.
    pub(crate) fn reordered(&self, order: &[u32]) -> Self {
        let mut places = vec![0; order.len()];
        for (place, &v) in order.iter().enumerate() {
            places[v as usize] = place as u32;
        }
        let (mut offsets, mut neighbours) = (vec![0], Vec::with_capacity(self.neighbours.len()));
        for &v in order {
            let ring = self.ring(v as usize).iter().map(|&j| places[j as usize]);
            neighbours.extend(ring);
            neighbours[*offsets.last().unwrap_or(&0) as usize..].sort_unstable();
            offsets.push(neighbours.len() as u32);
        }
        Self::from_rings(offsets, neighbours)
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.inverse_degree.len()
    }

    pub(crate) fn ring(&self, v: usize) -> &[u32] {
        &self.neighbours[self.offsets[v] as usize..self.offsets[v + 1] as usize]
    }

    pub(crate) fn transposed_ring(&self, v: usize) -> &[u32] {
        &self.transposed[self.transposed_offsets[v] as usize..self.transposed_offsets[v + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reordering_keeps_every_ring_and_shortens_the_way_to_it() {
        // A ladder whose rungs were numbered in steps of 37.
        let place = |v: usize| v * 37 % 100;
        let mut rings = vec![Vec::new(); 100];
        for v in 0_usize..100 {
            for j in [v.checked_sub(2), Some(v ^ 1), (v + 2 < 100).then_some(v + 2)]
                .into_iter()
                .flatten()
            {
                rings[place(v)].push(place(j) as u32);
            }
        }
        let mut offsets = vec![0];
        rings
            .iter()
            .for_each(|ring| offsets.push(offsets.last().unwrap_or(&0) + ring.len() as u32));
        let ring = RingMean::from_rings(offsets, rings.concat());
        let order = ring.breadth_first_order();
        let reordered = ring.reordered(&order);
        for v in 0..100 {
            let mut found: Vec<u32> = reordered.ring(v).iter().map(|&j| order[j as usize]).collect();
            let mut expected = ring.ring(order[v] as usize).to_vec();
            found.sort_unstable();
            expected.sort_unstable();
            assert_eq!(found, expected);
            assert!(reordered.ring(v).iter().all(|&j| v.abs_diff(j as usize) <= 6));
        }
    }
}
