//! Connectivity of a sequence: one-rings, boundaries, separate pieces and the bridges that tie them together.
//!
//! First step of the path of data: faces and rest shape -> [`Topology`] -> edge weights, distances, features, solve.
//! Everything after this sees one connected graph: an eyeball or a button hangs on bridges and follows the head.

use super::bridge::bridge_edges;
use super::vector::{cross, difference, dot, length};

/// A face counts as flat when twice its area is below this share of its longest edge squared: rounding, not shape.
pub const FLAT_FACE: f64 = 1e-12;

/// No vertex weighs less than this share of the mean area, so that loose vertices still count in a fit.
const AREA_FLOOR: f64 = 0.01;

/// One-rings and what is unusual about the mesh. V vertices.
#[derive(Debug, Clone)]
pub struct Topology {
    /// V.
    pub vertex_count: usize,
    /// Triangles. Shape: `[F]`.
    pub faces: Vec<[u32; 3]>,
    /// Compressed rows over `ring`, bridges included. Shape: `[V + 1]`.
    pub ring_offsets: Vec<u32>,
    /// Neighbours, ascending within a row.
    pub ring: Vec<u32>,
    /// The connected piece of each vertex, numbered by first vertex, bridges not counted; nothing for a vertex in no face. Shape: `[V]`.
    pub piece_of: Vec<Option<u32>>,
    /// Extra edges `[from, to]`, `from < to`, sorted, that tie separate pieces and loose vertices to their nearest neighbours.
    pub bridges: Vec<[u32; 2]>,
    /// What a user should know about the mesh.
    pub findings: TopologyFindings,
}

/// Counts of what is unusual; none of it is fatal.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TopologyFindings {
    /// Connected pieces with at least one face.
    pub piece_count: usize,
    /// Vertices in no face.
    pub isolated_vertex_count: usize,
    /// Edges with one face.
    pub boundary_edge_count: usize,
    /// Edges with more than two faces.
    pub non_manifold_edge_count: usize,
    /// Vertices where faces meet that are not joined along edges around them.
    pub non_manifold_vertex_count: usize,
    /// Vertices that share their rest position with an earlier one.
    pub duplicate_vertex_count: usize,
    /// Faces of zero area at rest.
    pub zero_area_face_count: usize,
}

impl Topology {
    /// One-rings of `faces` over the vertices of `rest`, tied into one connected graph.
    ///
    /// Every index in `faces` must be below `rest.len()` and every position finite: the readers and the package's
    /// semantic pass have checked both. A face that names a vertex twice adds no edge. O(V log V).
    pub fn new(faces: &[[u32; 3]], rest: &[[f64; 3]]) -> Topology {
        Self::build(faces, rest, None)
    }

    /// The same with known bridges, `[from, to]`, `from < to`, sorted, all below `rest.len()`: those of a package, so that
    /// its rings are the ones it was trained on. A bridge along an edge of a face adds nothing.
    pub fn with_bridges(faces: &[[u32; 3]], rest: &[[f64; 3]], bridges: &[[u32; 2]]) -> Topology {
        Self::build(faces, rest, Some(bridges))
    }

    fn build(faces: &[[u32; 3]], rest: &[[f64; 3]], known_bridges: Option<&[[u32; 2]]>) -> Topology {
        let vertex_count = rest.len();
        let mut half_edges: Vec<[u32; 2]> = faces
            .iter()
            .filter(|face| !names_a_vertex_twice(face))
            .flat_map(|&[a, b, c]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]])
            .collect();
        half_edges.sort_unstable();

        let mut findings = TopologyFindings {
            duplicate_vertex_count: duplicate_vertex_count(rest),
            zero_area_face_count: faces.iter().filter(|face| is_flat(face, rest)).count(),
            non_manifold_vertex_count: non_manifold_vertex_count(faces),
            ..TopologyFindings::default()
        };
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(half_edges.len() / 2);
        for run in half_edges.chunk_by(|a, b| a == b) {
            match run.len() {
                1 => findings.boundary_edge_count += 1,
                2 => {}
                _ => findings.non_manifold_edge_count += 1,
            }
            edges.push(run[0]);
        }

        let (piece_of, piece_count) = label_pieces(vertex_count, &edges);
        findings.piece_count = piece_count;
        findings.isolated_vertex_count = piece_of.iter().filter(|piece| piece.is_none()).count();

        let bridges = match known_bridges {
            Some(known) => known
                .iter()
                .copied()
                .filter(|bridge| edges.binary_search(bridge).is_err())
                .collect(),
            None => bridge_edges(rest, &piece_of, piece_count),
        };
        edges.extend_from_slice(&bridges);
        let (ring_offsets, ring) = compressed_rings(vertex_count, &edges);
        Topology {
            vertex_count,
            faces: faces.to_vec(),
            ring_offsets,
            ring,
            piece_of,
            bridges,
            findings,
        }
    }

    /// Neighbours of `v`, bridges included, ascending.
    pub fn ring_of(&self, v: usize) -> &[u32] {
        &self.ring[self.entries_of(v)]
    }

    /// Places of the neighbours of `v` in `ring`, and in everything aligned with it.
    pub fn entries_of(&self, v: usize) -> core::ops::Range<usize> {
        self.ring_offsets[v] as usize..self.ring_offsets[v + 1] as usize
    }

    /// Place in `ring` of the entry for neighbour `j` in the row of `v`.
    pub fn entry(&self, v: usize, j: u32) -> Option<usize> {
        self.ring_of(v)
            .binary_search(&j)
            .ok()
            .map(|place| self.ring_offsets[v] as usize + place)
    }

    /// Every edge once, bridges included, as `[from, to]` with `from < to`, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        (0..self.vertex_count)
            .flat_map(|v| {
                let from = v as u32;
                self.ring_of(v)
                    .iter()
                    .filter(move |&&to| to > from)
                    .map(move |&to| [from, to])
            })
            .collect()
    }

    /// Whether the edge between `a` and `b` is a bridge.
    pub fn is_bridge(&self, a: u32, b: u32) -> bool {
        self.bridges.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }

    /// Barycentric vertex areas of the rest shape, scaled to mean 1 and then kept above a hundredth.
    /// Shape: `[V]`. All 1 where the mesh has no area.
    pub fn vertex_areas(&self, rest: &[[f64; 3]]) -> Vec<f64> {
        let mut areas = vec![0.0; self.vertex_count];
        for face in &self.faces {
            let doubled = doubled_area(face, rest);
            for &v in face {
                areas[v as usize] += doubled;
            }
        }
        let mean = areas.iter().sum::<f64>() / self.vertex_count.max(1) as f64;
        if mean <= 0.0 || !mean.is_finite() {
            return vec![1.0; self.vertex_count];
        }
        areas.iter().map(|area| (area / mean).max(AREA_FLOOR)).collect()
    }
}

/// Corners of a face.
pub fn corners(face: &[u32; 3], positions: &[[f64; 3]]) -> [[f64; 3]; 3] {
    face.map(|v| positions[v as usize])
}

/// Whether a face names a vertex twice: it has no edges worth the name.
pub fn names_a_vertex_twice(&[a, b, c]: &[u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// Whether a face has no area but rounding's.
pub fn is_flat(face: &[u32; 3], positions: &[[f64; 3]]) -> bool {
    let [a, b, c] = corners(face, positions);
    let longest = [difference(a, b), difference(b, c), difference(c, a)]
        .iter()
        .map(|&edge| dot(edge, edge))
        .fold(0.0, f64::max);
    doubled_area(face, positions) <= FLAT_FACE * longest
}

fn doubled_area(face: &[u32; 3], positions: &[[f64; 3]]) -> f64 {
    let [a, b, c] = corners(face, positions);
    length(cross(difference(a, b), difference(a, c)))
}

fn duplicate_vertex_count(rest: &[[f64; 3]]) -> usize {
    // Adding zero turns -0 into 0, which compares unequal to it below.
    let mut sorted: Vec<[f64; 3]> = rest.iter().map(|p| p.map(|x| x + 0.0)).collect();
    sorted.sort_unstable_by(|a, b| {
        a[0].total_cmp(&b[0])
            .then(a[1].total_cmp(&b[1]))
            .then(a[2].total_cmp(&b[2]))
    });
    sorted.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

/// Vertices whose faces fall apart when only joined along the edges at the vertex.
fn non_manifold_vertex_count(faces: &[[u32; 3]]) -> usize {
    let mut corners: Vec<[u32; 3]> = faces
        .iter()
        .filter(|face| !names_a_vertex_twice(face))
        .flat_map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]])
        .collect();
    corners.sort_unstable();
    let falls_apart = |fan: &[[u32; 3]]| {
        let mut around: Vec<u32> = fan.iter().flat_map(|&[_, b, c]| [b, c]).collect();
        around.sort_unstable();
        around.dedup();
        let place = |v: &u32| around.partition_point(|other| other < v);
        let joints: Vec<[u32; 2]> = fan.iter().map(|[_, b, c]| [place(b) as u32, place(c) as u32]).collect();
        label_pieces(around.len(), &joints).1 > 1
    };
    corners
        .chunk_by(|a, b| a[0] == b[0])
        .filter(|fan| falls_apart(fan))
        .count()
}

/// Piece of each vertex (`None` for one without edges), numbered in order of their first vertex, and how many there are.
fn label_pieces(vertex_count: usize, edges: &[[u32; 2]]) -> (Vec<Option<u32>>, usize) {
    let (offsets, ring) = compressed_rings(vertex_count, edges);
    let mut piece_of = vec![None; vertex_count];
    let mut piece_count = 0;
    let mut open = Vec::new();
    for seed in 0..vertex_count {
        if piece_of[seed].is_some() || offsets[seed] == offsets[seed + 1] {
            continue;
        }
        let piece = Some(piece_count as u32);
        piece_count += 1;
        piece_of[seed] = piece;
        open.push(seed);
        while let Some(v) = open.pop() {
            for &j in &ring[offsets[v] as usize..offsets[v + 1] as usize] {
                if piece_of[j as usize].is_none() {
                    piece_of[j as usize] = piece;
                    open.push(j as usize);
                }
            }
        }
    }
    (piece_of, piece_count)
}

/// Compressed rows of the symmetric graph of `edges` (each given once), ascending within a row.
fn compressed_rings(vertex_count: usize, edges: &[[u32; 2]]) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; vertex_count + 1];
    for edge in edges {
        for &v in edge {
            offsets[v as usize + 1] += 1;
        }
    }
    for v in 0..vertex_count {
        offsets[v + 1] += offsets[v];
    }
    let mut next = offsets.clone();
    let mut ring = vec![0u32; 2 * edges.len()];
    for &[a, b] in edges {
        for (from, to) in [(a, b), (b, a)] {
            ring[next[from as usize] as usize] = to;
            next[from as usize] += 1;
        }
    }
    for v in 0..vertex_count {
        ring[offsets[v] as usize..offsets[v + 1] as usize].sort_unstable();
    }
    (offsets, ring)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, merged, moved, sphere};

    fn is_connected(topology: &Topology) -> bool {
        label_pieces(topology.vertex_count, &topology.edges()).1 == 1
            && (0..topology.vertex_count).all(|v| !topology.ring_of(v).is_empty())
    }

    #[test]
    fn a_grid_has_ascending_symmetric_rings_and_a_boundary() {
        let (rest, faces) = grid(4, 3, 1.0);
        let topology = Topology::new(&faces, &rest);
        assert_eq!(topology.findings.boundary_edge_count, 2 * (4 + 3));
        assert_eq!(topology.findings.piece_count, 1);
        assert_eq!(topology.findings.non_manifold_edge_count, 0);
        assert!(topology.bridges.is_empty());
        for v in 0..topology.vertex_count {
            assert!(topology.ring_of(v).windows(2).all(|pair| pair[0] < pair[1]));
            for &j in topology.ring_of(v) {
                assert!(topology.entry(j as usize, v as u32).is_some());
            }
        }
        // Euler: V - E + F = 1 for a disc.
        assert_eq!(rest.len() + faces.len(), topology.edges().len() + 1);
    }

    #[test]
    fn separate_pieces_and_loose_vertices_are_tied_on() {
        let (mut rest, faces) = merged(&[
            sphere(2),
            moved(&sphere(1), [3.0, 0.0, 0.0]),
            moved(&sphere(1), [3.0, 5.0, 0.0]),
        ]);
        rest.push([0.0, 0.0, 2.0]);
        rest.push([9.0, 9.0, 9.0]);
        let topology = Topology::new(&faces, &rest);
        assert_eq!(topology.findings.piece_count, 3);
        assert_eq!(topology.findings.isolated_vertex_count, 2);
        assert!(is_connected(&topology));
        assert!(topology.bridges.iter().all(|&[a, b]| a < b && topology.is_bridge(b, a)));
        assert!(topology.bridges.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(
            topology.ring_of(rest.len() - 1).len(),
            3,
            "a loose vertex hangs on three others"
        );
        assert_eq!(topology.bridges, Topology::new(&faces, &rest).bridges);
    }

    #[test]
    fn what_is_unusual_is_counted() {
        let rest = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, -1.0, 0.0],
            [2.0, 0.0, 0.0],
            [-0.0, 0.0, 0.0],
        ];
        // Three faces on edge 0-1; one along a line; one that names a vertex twice.
        let faces = [[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 5], [2, 2, 3]];
        let findings = Topology::new(&faces, &rest).findings;
        assert_eq!(findings.non_manifold_edge_count, 1);
        assert_eq!(findings.non_manifold_vertex_count, 0);
        assert_eq!(findings.zero_area_face_count, 2);
        assert_eq!(findings.duplicate_vertex_count, 1);
        assert_eq!(findings.isolated_vertex_count, 1);
        assert_eq!(findings.piece_count, 1);
    }

    #[test]
    fn surfaces_that_meet_in_a_point_are_counted() {
        let (mut rest, mut faces) = grid(2, 2, 1.0);
        assert_eq!(Topology::new(&faces, &rest).findings.non_manifold_vertex_count, 0);
        let corner = 0;
        let next = rest.len() as u32;
        rest.extend([[-1.0, 0.0, 1.0], [0.0, -1.0, 1.0]]);
        faces.push([corner, next, next + 1]);
        let findings = Topology::new(&faces, &rest).findings;
        assert_eq!((findings.non_manifold_vertex_count, findings.piece_count), (1, 1));
    }

    #[test]
    fn a_mesh_without_faces_is_still_one_graph() {
        let rest: Vec<[f64; 3]> = (0..20).map(|v| [f64::from(v), f64::from(v % 3), 0.0]).collect();
        let topology = Topology::new(&[], &rest);
        assert_eq!(topology.findings.isolated_vertex_count, 20);
        let reached = label_pieces(20, &topology.edges());
        assert_eq!(reached.1, 1);
        assert!(Topology::new(&[], &[]).ring.is_empty());
        assert!(Topology::new(&[], &[[0.0; 3]]).ring.is_empty());
    }

    #[test]
    fn areas_have_mean_one_and_a_floor() {
        let (mut rest, faces) = grid(10, 10, 0.1);
        let topology = Topology::new(&faces, &rest);
        let areas = topology.vertex_areas(&rest);
        let mean = areas.iter().sum::<f64>() / areas.len() as f64;
        assert!((mean - 1.0).abs() < 1e-12);
        rest.push([5.0; 3]);
        let topology = Topology::new(&faces, &rest);
        assert_eq!(topology.vertex_areas(&rest).last(), Some(&AREA_FLOOR));
    }

    #[test]
    fn many_pieces_of_many_vertices_are_quick() {
        // 48 spheres of 1,026 vertices: about 50,000.
        let pieces: Vec<_> = (0..48)
            .map(|n| moved(&sphere(4), [f64::from(n % 7) * 3.0, f64::from(n / 7) * 2.5, 0.0]))
            .collect();
        let (rest, faces) = merged(&pieces);
        let start = std::time::Instant::now();
        let topology = Topology::new(&faces, &rest);
        let seconds = start.elapsed().as_secs_f64();
        println!("{} vertices in {seconds:.3} s", rest.len());
        assert_eq!(topology.findings.piece_count, 48);
        assert!(is_connected(&topology));
    }
}
