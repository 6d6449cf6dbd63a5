//! From a field to a closed triangle mesh with about as many vertices as asked: surface nets, then relaxation on the surface.
//!
//! Surface nets (Gibson 1998): a vertex in each cell that the surface crosses, at the mean of its crossings, and a quad around each
//! grid edge that it crosses. Where sheets pass through a cell apart, each gets a vertex of its own (Nielson 2004, "Dual marching
//! cubes"), which keeps thin parts closed. The vertices then slide towards the mean of their neighbours and back onto the surface.

use super::V3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A closed surface in one piece.
pub(super) struct Surface {
    pub(super) positions: Vec<V3>,
    /// Triangles, counter-clockwise seen from outside.
    pub(super) faces: Vec<[u32; 3]>,
    /// Neighbours of each vertex, ascending. Shape: `[V]`.
    pub(super) rings: Vec<Vec<u32>>,
}

/// Sizes of the cells tried: each try moves the size towards the asked count.
const TRY_COUNT: usize = 10;
/// A count this near to the asked one is near enough.
const COUNT_TOLERANCE: f64 = 0.008;
/// Rounds of relaxation.
const RELAX_COUNT: usize = 12;

/// Meshes the zero set of `field` inside the box, symmetric in x. `None` where no try gave a closed surface in one piece.
///
/// `field` is given the size of the cells beside the point, so that it can keep parts thick enough to be seen by the grid.
pub(super) fn polygonize(
    field: impl Fn(&V3, f64) -> f64 + Sync,
    low: V3,
    high: V3,
    vertex_count: usize,
) -> Option<Surface> {
    let mut best: Option<(Surface, f64)> = None;
    let extent = high - low;
    // First guess: four tenths of the area of the box, in squares of the cell size.
    let box_area = 2.0 * (extent.x * extent.y + extent.y * extent.z + extent.z * extent.x);
    let mut size = (0.41 * box_area / vertex_count as f64).sqrt();
    for attempt in 0..TRY_COUNT {
        let (positions, quads) = surface_net(&|p: &V3| field(p, size), low, high, size);
        let count = positions.len().max(1);
        let gap = |count: usize| (count as f64 / vertex_count as f64).ln().abs();
        // A surface that is not closed is tried again a little finer or coarser.
        let nudge = match close(positions, &quads) {
            Some(surface) => {
                if best
                    .as_ref()
                    .is_none_or(|(best, _)| gap(count) < gap(best.positions.len()))
                {
                    best = Some((surface, size));
                }
                1.0
            }
            None => 1.0 + 0.003 * (attempt as f64 - 4.5),
        };
        if best
            .as_ref()
            .is_some_and(|(best, _)| gap(best.positions.len()) < COUNT_TOLERANCE)
        {
            break;
        }
        size *= (count as f64 / vertex_count as f64).sqrt() * nudge;
    }
    best.map(|(mut surface, size)| {
        surface.relax(&|p: &V3| field(p, size), 0.1 * size);
        surface
    })
}

/// One vertex for each crossed cell, one quad for each crossed grid edge.
fn surface_net(field: &(impl Fn(&V3) -> f64 + Sync), low: V3, high: V3, size: f64) -> (Vec<V3>, Vec<[u32; 4]>) {
    let counts: [usize; 3] = core::array::from_fn(|c| ((high[c] - low[c]) / size).ceil() as usize + 3);
    // Centred in x, so that a symmetric field gives a symmetric mesh.
    let origin = V3::new(
        (low.x + high.x - (counts[0] - 1) as f64 * size) / 2.0,
        low.y - size,
        low.z - size,
    );
    let corner = |i: [usize; 3]| origin + V3::new(i[0] as f64, i[1] as f64, i[2] as f64) * size;
    let index = |i: [usize; 3]| (i[2] * counts[1] + i[1]) * counts[0] + i[0];
    let place = |n: usize| [n % counts[0], n / counts[0] % counts[1], n / (counts[0] * counts[1])];
    let values: Vec<f64> = (0..counts[0] * counts[1] * counts[2])
        .into_par_iter()
        .map(|n| field(&corner(place(n))))
        .collect();
    let inside = |i: [usize; 3]| values[index(i)] < 0.0;

    // The vertex that stands for each of a cell's twelve edges.
    let mut cells: BTreeMap<usize, [u32; 12]> = BTreeMap::new();
    let mut positions = Vec::new();
    for n in 0..values.len() {
        let i = place(n);
        if (0..3).any(|c| i[c] + 1 >= counts[c]) {
            continue;
        }
        let corner_at = |bits: usize| -> [usize; 3] { core::array::from_fn(|c| i[c] + (bits >> c & 1)) };
        let corner_values: [f64; 8] = core::array::from_fn(|bits| values[index(corner_at(bits))]);
        let Some(sheets) = sheets_of(&corner_values) else {
            continue;
        };
        let mut vertices = [u32::MAX; 12];
        for sheet in 0..12 {
            let (mut sum, mut crossing_count) = (V3::zeros(), 0.0);
            for edge in (0..12).filter(|&edge| sheets[edge] == sheet) {
                let [from, to] = edge_ends(edge);
                let (a, b) = (corner_values[from], corner_values[to]);
                sum += corner(corner_at(from)).lerp(&corner(corner_at(to)), a / (a - b));
                crossing_count += 1.0;
                vertices[edge] = positions.len() as u32;
            }
            if crossing_count > 0.0 {
                positions.push(sum / crossing_count);
            }
        }
        cells.insert(n, vertices);
    }
    let mut quads = Vec::new();
    for n in 0..values.len() {
        let from = place(n);
        for c in 0..3 {
            let (u, w) = ((c + 1) % 3, (c + 2) % 3);
            let mut to = from;
            to[c] += 1;
            if to[c] >= counts[c] || from[u] == 0 || from[w] == 0 || inside(from) == inside(to) {
                continue;
            }
            let cell = |du: usize, dw: usize| {
                let mut i = from;
                i[u] -= du;
                i[w] -= dw;
                cells.get(&index(i)).map(|vertices| vertices[4 * c + du + 2 * dw])
            };
            // Around the edge, seen from its far end.
            if let (Some(a), Some(b), Some(d), Some(e)) = (cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)) {
                quads.push(if inside(from) { [a, b, d, e] } else { [a, e, d, b] });
            }
        }
    }
    (positions, quads)
}

/// The corners at the two ends of a cell's edge. Edge 4c + i + 2j runs along axis c at (i, j) of the two axes after it;
/// bit c of a corner is its place along axis c.
fn edge_ends(edge: usize) -> [usize; 2] {
    let (c, i, j) = (edge / 4, edge & 1, edge >> 1 & 1);
    let from = i << ((c + 1) % 3) | j << ((c + 2) % 3);
    [from, from | 1 << c]
}

/// The sheet each crossed edge of a cell belongs to, 12 for edges not crossed; `None` where the surface misses the cell.
///
/// On each side of the cell the crossed edges pair up. Where all four are crossed, the mean of the corners says whether the
/// inside or the outside is joined across; the cell beyond that side sees the same four values and so decides alike.
fn sheets_of(values: &[f64; 8]) -> Option<[usize; 12]> {
    let crossed = |edge: usize| {
        let [from, to] = edge_ends(edge);
        (values[from] < 0.0) != (values[to] < 0.0)
    };
    let mut sheets: [usize; 12] = core::array::from_fn(|edge| if crossed(edge) { edge } else { 12 });
    if sheets.iter().all(|&sheet| sheet == 12) {
        return None;
    }
    let mut join = |a: usize, b: usize| {
        let (keep, drop) = (sheets[a].min(sheets[b]), sheets[a].max(sheets[b]));
        sheets
            .iter_mut()
            .filter(|sheet| **sheet == drop)
            .for_each(|sheet| *sheet = keep);
    };
    for normal in 0..3 {
        let (u, w) = ((normal + 1) % 3, (normal + 2) % 3);
        for side in 0..2 {
            let corners = [0, 1 << u, 1 << u | 1 << w, 1 << w].map(|corner: usize| corner | side << normal);
            // Edge i runs from corner i to the next.
            let edges = [4 * u + 2 * side, 4 * w + side + 2, 4 * u + 1 + 2 * side, 4 * w + side];
            let around: Vec<usize> = edges.into_iter().filter(|&edge| crossed(edge)).collect();
            match around[..] {
                [a, b] => join(a, b),
                [_, _, _, _] => {
                    let joined_inside = corners.iter().map(|&corner| values[corner]).sum::<f64>() < 0.0;
                    // Cut off the two corners that are not joined.
                    let first = usize::from((values[corners[0]] < 0.0) == joined_inside);
                    for i in [first, first + 2] {
                        join(edges[(i + 3) % 4], edges[i]);
                    }
                }
                _ => {}
            }
        }
    }
    Some(sheets)
}

/// Splits the quads and keeps the result if it is a sphere in one piece: every edge once each way, Euler number 2, connected.
fn close(positions: Vec<V3>, quads: &[[u32; 4]]) -> Option<Surface> {
    let faces: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|&[a, b, c, d]| {
            let length = |i: u32, j: u32| (positions[i as usize] - positions[j as usize]).norm_squared();
            if length(a, c) <= length(b, d) {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            }
        })
        .collect();
    let mut edges: Vec<[u32; 2]> = faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    let once = edges.windows(2).all(|pair| pair[0] != pair[1]);
    let paired = edges.iter().all(|&[a, b]| edges.binary_search(&[b, a]).is_ok());
    let sphere = positions.len() + faces.len() == edges.len() / 2 + 2;
    if !(once && paired && sphere) {
        return None;
    }
    let mut rings = vec![Vec::new(); positions.len()];
    for [a, b] in edges {
        rings[a as usize].push(b);
    }
    let mut reached = vec![false; positions.len()];
    let mut open = vec![0u32];
    *reached.first_mut()? = true;
    while let Some(v) = open.pop() {
        for &j in &rings[v as usize] {
            if !core::mem::replace(&mut reached[j as usize], true) {
                open.push(j);
            }
        }
    }
    reached.iter().all(|&seen| seen).then_some(Surface {
        positions,
        faces,
        rings,
    })
}

impl Surface {
    /// Evens out the triangles: along the surface half-way to the mean of the neighbours, then back onto it.
    fn relax(&mut self, field: &(impl Fn(&V3) -> f64 + Sync), probe: f64) {
        for _ in 0..RELAX_COUNT {
            let positions = &self.positions;
            let relaxed = self.rings.par_iter().enumerate().map(|(v, ring)| {
                let mean = ring.iter().map(|&j| positions[j as usize]).sum::<V3>() / ring.len() as f64;
                let step = (mean - positions[v]) / 2.0;
                // Across the surface the mean would sink thin tips below their own axis.
                let normal = gradient(field, &positions[v], probe)
                    .try_normalize(0.0)
                    .unwrap_or_else(V3::zeros);
                onto(field, positions[v] + step - normal * normal.dot(&step), probe)
            });
            self.positions = relaxed.collect();
        }
    }
}

fn gradient(field: &impl Fn(&V3) -> f64, p: &V3, probe: f64) -> V3 {
    let slope = |axis: V3| (field(&(p + axis * probe)) - field(&(p - axis * probe))) / (2.0 * probe);
    V3::new(slope(V3::x()), slope(V3::y()), slope(V3::z()))
}

/// Two Newton steps towards the zero set.
fn onto(field: &impl Fn(&V3) -> f64, start: V3, probe: f64) -> V3 {
    (0..2).fold(start, |p, _| {
        let gradient = gradient(field, &p, probe);
        // The soft union's gradient nearly vanishes in tight forks; a step there is worse than none.
        if gradient.norm_squared() < 0.1 {
            p
        } else {
            p - gradient * (field(&p) / gradient.norm_squared())
        }
    })
}
