//! Finds shapes whose vertices are in another order than the reference's: same faces, but edges torn across the mesh.
//!
//! A deformation, however strong, keeps an edge short beside the whole; another order makes edges join vertices from
//! anywhere. Two measures, both held against the reference: the share of edges that outgrew every plausible stretch
//! (finds a partly changed order), and the mean edge length beside the mean distance of vertices paired at random (finds
//! a shuffled coarse mesh, where no edge can grow much; ten real sequences come 3 % of the way to random at most). An order
//! that is a symmetry of the mesh leaves no trace in its edges.

use super::error::SequenceError;
use std::path::Path;

/// An edge is torn when it grew to this many times the larger of its own and the median reference length, after the shape's
/// own growth. The strongest edge of ten real sequences reached 7.2 (horse gallop), with none beyond 8.
const TORN_STRETCH: f64 = 8.0;
/// Share of torn edges that no deformation reaches. Real sequences: 0. Vertex order shifted by one: from 0.0004 (a grid wound
/// on itself) and 0.011 to 0.8; a tenth of the vertices shuffled: 0.12 and more.
const TORN_SHARE: f64 = 0.001;
/// A few torn edges are a stray vertex, no other order.
const TORN_COUNT_MIN: usize = 8;
/// Edges must be at most this long beside random pairs in the reference for the second measure to say anything.
const SPREAD_MAX: f64 = 0.6;
/// Edges are paired anew with the ends of edges this share of the list further on: the golden section and its powers spread
/// the pairs evenly.
const PAIR_OFFSETS: [f64; 3] = [0.618_034, 0.381_966, 0.236_068];

/// What the reference's edges look like; made once, then every shape is held against it.
#[derive(Default)]
pub(super) struct EdgeOrder {
    /// Unique edges, sorted.
    edges: Vec<[u32; 2]>,
    /// Reference lengths. Shape: `[E]`.
    lengths: Vec<f64>,
    median_length: f64,
    diagonal: f64,
    spread: f64,
}

/// How a shape's vertices were found to be in another order.
#[derive(Debug)]
pub(super) struct Torn {
    count: usize,
    example: [u32; 2],
}

impl EdgeOrder {
    /// Measures the reference.
    pub(super) fn new(faces: &[[u32; 3]], reference: &[[f32; 3]]) -> EdgeOrder {
        let mut edges: Vec<[u32; 2]> = faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let lengths: Vec<f64> = edges.iter().map(|&edge| length(reference, edge)).collect();
        let median_length = median(lengths.clone());
        let spread = spread(&edges, reference);
        EdgeOrder {
            edges,
            lengths,
            median_length,
            diagonal: diagonal(reference),
            spread,
        }
    }

    /// The torn edges, if `shape` has its vertices in another order.
    pub(super) fn check(&self, shape: &[[f32; 3]]) -> Option<Torn> {
        if self.median_length <= 0.0 {
            return None;
        }
        let lengths: Vec<f64> = self.edges.iter().map(|&edge| length(shape, edge)).collect();
        // A shape that grows or shrinks as a whole is allowed its growth; one that only folds up keeps its edges.
        let growth = diagonal(shape) / self.diagonal;
        let scale = growth.max((median(lengths.clone()) / self.median_length).min(1.0));
        let mut torn = Torn {
            count: 0,
            example: [0; 2],
        };
        let mut largest = 0.0;
        for (e, &length) in lengths.iter().enumerate() {
            let stretch = length / (self.lengths[e].max(self.median_length) * scale);
            torn.count += usize::from(stretch > TORN_STRETCH);
            if stretch > largest {
                (largest, torn.example) = (stretch, self.edges[e]);
            }
        }
        let many = torn.count >= TORN_COUNT_MIN && torn.count as f64 > TORN_SHARE * self.edges.len() as f64;
        // Half-way from the reference's spread to that of random order, which is 1.
        let spread_out = self.spread < SPREAD_MAX && spread(&self.edges, shape) > (1.0 + self.spread) / 2.0;
        // A mesh folded into a ball brings all its vertices close, but only another order makes its edges grow as well: to
        // 1 / spread when it is random, of which half the way counts.
        let edge_growth = lengths.iter().sum::<f64>() / (self.lengths.iter().sum::<f64>() * scale);
        let scattered = spread_out && edge_growth * edge_growth * self.spread > 1.0;
        if scattered && !many {
            torn.count = (0..lengths.len())
                .filter(|&e| lengths[e] > 2.0 * self.lengths[e] * scale)
                .count();
        }
        (many || scattered).then_some(torn)
    }

    /// The error for shape `m`.
    pub(super) fn refusal(&self, torn: Torn, path: &Path, m: usize, names: &[String]) -> SequenceError {
        SequenceError::VertexOrderDiffers {
            path: path.to_path_buf(),
            shape: m,
            name: names[m].clone(),
            reference: names[0].clone(),
            torn: torn.count,
            edges: self.edges.len(),
            example: torn.example,
        }
    }
}

/// Mean edge length over the mean distance of ends paired at random: small for a fine mesh in order, 1 for a shuffled one.
fn spread(edges: &[[u32; 2]], positions: &[[f32; 3]]) -> f64 {
    let along: f64 = edges.iter().map(|&edge| length(positions, edge)).sum();
    let mut across = 0.0;
    for offset in PAIR_OFFSETS {
        let step = (edges.len() as f64 * offset) as usize;
        for e in 0..edges.len() {
            across += length(positions, [edges[e][0], edges[(e + step) % edges.len()][1]]);
        }
    }
    if across > 0.0 {
        along * PAIR_OFFSETS.len() as f64 / across
    } else {
        // A shape in one point is a collapse, no other order.
        0.0
    }
}

fn length(positions: &[[f32; 3]], [a, b]: [u32; 2]) -> f64 {
    let (a, b) = (positions[a as usize], positions[b as usize]);
    (0..3)
        .map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Of the bounding box.
pub(super) fn diagonal(positions: &[[f32; 3]]) -> f64 {
    let side = |c: usize| {
        let values = positions.iter().map(|p| f64::from(p[c]));
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        (high - low).max(0.0)
    };
    (side(0).powi(2) + side(1).powi(2) + side(2).powi(2)).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 12;

    type Deformation = fn([f32; 3]) -> [f32; 3];

    fn grid() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let at = |i: usize, j: usize| (i * SIDE + j) as u32;
        let positions = (0..SIDE * SIDE)
            .map(|v| [(v / SIDE) as f32, (v % SIDE) as f32, 0.0])
            .collect();
        let cells = (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |j| (i, j)));
        let faces = cells
            .flat_map(|(i, j)| {
                [
                    [at(i, j), at(i + 1, j), at(i, j + 1)],
                    [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                ]
            })
            .collect();
        (positions, faces)
    }

    #[test]
    fn strong_deformations_pass() {
        let (rest, faces) = grid();
        let order = EdgeOrder::new(&faces, &rest);
        let deformations: [(&str, Deformation); 8] = [
            ("folded in both directions", |[x, y, _]| [x % 2.0, y % 2.0, 0.0]),
            ("in one point", |_| [1.0; 3]),
            ("grown", |p| p.map(|x| 100.0 * x)),
            ("shrunk", |p| p.map(|x| 0.001 * x)),
            ("stretched along one axis", |[x, y, z]| [30.0 * x, y, z]),
            ("flattened", |[x, y, z]| [x, 0.01 * y, z]),
            ("rolled up", |[x, y, _]| [(x * 2.0).cos(), y, (x * 2.0).sin()]),
            ("one corner pulled out", |[x, y, z]| {
                if x + y == 0.0 { [-20.0, -20.0, z] } else { [x, y, z] }
            }),
        ];
        for (name, deform) in deformations {
            let shape: Vec<_> = rest.iter().map(|&p| deform(p)).collect();
            assert!(order.check(&shape).is_none(), "{name}");
        }
    }

    #[test]
    fn a_shuffle_of_a_coarse_mesh_is_found_by_its_spread() {
        let (rest, faces) = grid();
        // 35 and 144 have no common factor: a permutation that scatters.
        let shuffled: Vec<_> = (0..rest.len()).map(|v| rest[v * 35 % rest.len()]).collect();
        assert!(EdgeOrder::new(&faces, &rest).check(&shuffled).is_some());
    }
}
