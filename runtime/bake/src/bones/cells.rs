//! Cells: every vertex belongs to one. Those of nodes are alike in place and gradient, for a node is decoded at their average;
//! those of bones move as one affine map.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use sinew_formats::package::FEATURE_COUNT;

use super::poses::Samples;
use super::{Matrix, Source, Vector};

/// What the spread of gradients counts beside the spread of places in a node's cell. **Measured**: from 0.15 to 0.3 alike,
/// 0.6 worse.
const GRADIENT_SHARE: f64 = 0.3;
/// Directions that the gradients of all described poses are projected to.
const PROJECTED: usize = 32;
const PROJECTION_SEED: u64 = 0x7072_6f6a_6563_7400;
const GRADIENT_ROUNDS: usize = 30;

/// What the distance from the middle counts beside the error of the cell's map, so that cells stay compact.
const COMPACTNESS: f64 = 0.02;
const MOTION_ROUNDS: usize = 12;
/// Rounds after which no cell is dissolved any more.
const SPLIT_ROUNDS: usize = 8;
/// A cell is dissolved in favour of one whose error is so many times as large.
const WORTH_SPLITTING: f64 = 6.0;
/// One cell in so many, at most, each round.
const SPLIT_PART: usize = 16;
/// Vertices that a cell must have to be split.
const LEAST_SPLIT: usize = 12;
/// What holds the map of a flat cell to a rotation, as a share of the cell's spread.
const MAP_RIDGE: f64 = 1e-2;

/// A partition of the vertices.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    /// Vertices of each cell, ascending, at least one. Shape: `[cells]`.
    pub(super) members: Vec<Vec<usize>>,
    /// Area-weighted means of the rest places. Shape: `[cells]`.
    pub(super) centres: Vec<Vector>,
    /// Shape: `[V]`, positive.
    pub(super) areas: Vec<f64>,
}

impl Cells {
    /// At most `count` cells, alike in place and gradient.
    pub(super) fn of_gradients(source: &Source<'_>, samples: &Samples, count: usize) -> Self {
        let areas = areas(source);
        let points = described(source, samples, &areas);
        let cell_of = k_means(&points, &areas, count, GRADIENT_ROUNDS);
        Self::new(source, areas, &cell_of, count)
    }

    /// At most `count` cells that move as one map each.
    pub(super) fn of_motion(source: &Source<'_>, samples: &Samples, count: usize) -> Self {
        let areas = areas(source);
        let points: Vec<Vec<f64>> = source.surface.rest.iter().map(|p| p.to_vec()).collect();
        let mut cell_of = k_means(&points, &areas, count, GRADIENT_ROUNDS);
        let motion = Motion {
            source,
            samples,
            areas: &areas,
            poses: samples.gradients.len(),
            count,
        };
        for round in 0..MOTION_ROUNDS {
            motion.round(&mut cell_of, round < SPLIT_ROUNDS);
        }
        Self::new(source, areas, &cell_of, count)
    }

    /// Leaves empty cells out.
    fn new(source: &Source<'_>, areas: Vec<f64>, cell_of: &[usize], count: usize) -> Self {
        let mut members = members(cell_of, count);
        members.retain(|members| !members.is_empty());
        let centre = |members: &Vec<usize>| mean(members, &areas, |v| Vector::from(source.surface.rest[v]));
        Self {
            centres: members.iter().map(centre).collect(),
            members,
            areas,
        }
    }
}

/// What each vertex counts: its area, and a little where it has none.
fn areas(source: &Source<'_>) -> Vec<f64> {
    let areas = source.surface.gradient_areas();
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let least = if mean > 0.0 { 1e-6 * mean } else { 1.0 };
    areas.into_iter().map(|area| area.max(least)).collect()
}

fn members(cell_of: &[usize], count: usize) -> Vec<Vec<usize>> {
    let mut members = vec![Vec::new(); count];
    cell_of.iter().enumerate().for_each(|(v, &cell)| members[cell].push(v));
    members
}

/// Of a not empty list.
fn mean(members: &[usize], areas: &[f64], value: impl Fn(usize) -> Vector) -> Vector {
    let area: f64 = members.iter().map(|&v| areas[v]).sum();
    members.iter().map(|&v| value(v) * areas[v]).sum::<Vector>() / area
}

/// Place, and gradients in all described poses, projected: distances of the latter are kept well enough. Both in shares of
/// their spread over the mesh. Shape: `[V][3 + PROJECTED]`.
fn described(source: &Source<'_>, samples: &Samples, areas: &[f64]) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(PROJECTION_SEED);
    let directions: Vec<[f64; PROJECTED]> = (0..samples.gradients.len() * FEATURE_COUNT)
        .map(|_| core::array::from_fn(|_| random.random_range(-1.0..1.0)))
        .collect();
    let mut points: Vec<Vec<f64>> = (0..source.surface.rest.len())
        .into_par_iter()
        .map(|v| {
            let mut point = source.surface.rest[v].to_vec();
            point.resize(3 + PROJECTED, 0.0);
            let numbers = samples.gradients.iter().flat_map(|pose| pose[v].iter());
            for (x, direction) in numbers.zip(&directions) {
                point[3..].iter_mut().zip(direction).for_each(|(sum, d)| *sum += x * d);
            }
            point
        })
        .collect();
    for (columns, share) in [(0..3, 1.0), (3..3 + PROJECTED, GRADIENT_SHARE)] {
        let total: f64 = areas.iter().sum();
        let mut spread = 0.0;
        for column in columns.clone() {
            let weighted = |f: &dyn Fn(f64) -> f64| -> f64 {
                points
                    .iter()
                    .zip(areas)
                    .map(|(point, area)| f(point[column]) * area)
                    .sum::<f64>()
                    / total
            };
            let mean = weighted(&|x| x);
            spread += weighted(&|x| (x - mean).powi(2));
        }
        let scale = if spread > 0.0 { share / spread.sqrt() } else { 0.0 };
        points
            .iter_mut()
            .for_each(|point| point[columns.clone()].iter_mut().for_each(|x| *x *= scale));
    }
    points
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The cell of each point: at most `count`, started at points that are far from each other. Shape: `[V]`.
fn k_means(points: &[Vec<f64>], areas: &[f64], count: usize, rounds: usize) -> Vec<usize> {
    let mut centres = farthest(points, count);
    let mut cell_of = vec![0; points.len()];
    for _ in 0..rounds {
        let nearest = |point: &Vec<f64>| {
            let distances = centres.iter().map(|centre| squared(point, centre)).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(cell, _)| cell)
        };
        cell_of = points.par_iter().map(nearest).collect();
        let width = points[0].len();
        let (mut sums, mut totals) = (vec![vec![0.0; width]; centres.len()], vec![0.0; centres.len()]);
        for ((point, &area), &cell) in points.iter().zip(areas).zip(&cell_of) {
            totals[cell] += area;
            sums[cell].iter_mut().zip(point).for_each(|(sum, x)| *sum += area * x);
        }
        for ((centre, sum), &total) in centres.iter_mut().zip(sums).zip(&totals) {
            if total > 0.0 {
                *centre = sum.into_iter().map(|x| x / total).collect();
            }
        }
    }
    cell_of
}

/// The first point, then each time the one farthest from all before; fewer where the rest lie on them.
fn farthest(points: &[Vec<f64>], count: usize) -> Vec<Vec<f64>> {
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut chosen: Vec<Vec<f64>> = Vec::new();
    let mut next = 0;
    while chosen.len() < count {
        let point = points[next].clone();
        distances
            .par_iter_mut()
            .zip(points)
            .for_each(|(distance, other)| *distance = distance.min(squared(&point, other)));
        chosen.push(point);
        next = (0..points.len()).fold(0, |best, v| if distances[v] > distances[best] { v } else { best });
        if distances[next] <= 0.0 {
            break;
        }
    }
    chosen
}

/// How a cell moves in each described pose: about its middle, as one map.
struct CellMotion {
    centre: Vector,
    /// Linear part and where the middle goes. Shape: `[poses]`.
    maps: Vec<(Matrix, Vector)>,
}

/// Cells by how they move: Lloyd's rounds, with a map of each pose in place of a mean.
struct Motion<'a> {
    source: &'a Source<'a>,
    samples: &'a Samples,
    areas: &'a [f64],
    poses: usize,
    count: usize,
}

impl Motion<'_> {
    fn rest(&self, v: usize) -> Vector {
        Vector::from(self.source.surface.rest[v])
    }

    fn round(&self, cell_of: &mut Vec<usize>, may_split: bool) {
        let members = members(cell_of, self.count);
        let cells: Vec<Option<CellMotion>> = members
            .par_iter()
            .map(|members| (!members.is_empty()).then(|| self.motion_of(members)))
            .collect();
        let error = |v: usize, cell: &CellMotion| -> f64 {
            let arm = self.rest(v) - cell.centre;
            let of_pose = |pose: usize| {
                let (linear, middle) = &cell.maps[pose];
                (middle + linear * arm - self.samples.position(pose, v)).norm_squared()
            };
            (0..self.poses).map(of_pose).sum()
        };
        let spread = |v: usize, cell: &CellMotion| (self.rest(v) - cell.centre).norm_squared();
        let own = |v: usize| cells[cell_of[v]].as_ref();
        let vertices = cell_of.len();
        let errors: Vec<f64> = (0..vertices)
            .into_par_iter()
            .map(|v| own(v).map_or(0.0, |cell| error(v, cell)))
            .collect();
        let mean_error = errors.iter().sum::<f64>() / vertices as f64;
        let mean_spread = (0..vertices)
            .filter_map(|v| own(v).map(|cell| spread(v, cell)))
            .sum::<f64>()
            / vertices as f64;
        let cost = |v: usize, cell: &CellMotion| {
            error(v, cell) / mean_error.max(f64::MIN_POSITIVE)
                + COMPACTNESS * spread(v, cell) / mean_spread.max(f64::MIN_POSITIVE)
        };
        let ring = |v: usize| self.source.surface.topology.ring_of(v);
        let chosen: Vec<usize> = (0..vertices)
            .into_par_iter()
            .map(|v| {
                let mut near: Vec<usize> = ring(v)
                    .iter()
                    .map(|&j| cell_of[j as usize])
                    .chain([cell_of[v]])
                    .collect();
                near.sort_unstable();
                near.dedup();
                let costs = near
                    .iter()
                    .filter_map(|&c| cells[c].as_ref().map(|cell| (cost(v, cell), c)));
                costs
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .map_or(cell_of[v], |(_, cell)| cell)
            })
            .collect();
        let mut sums = vec![0.0; self.count];
        for v in 0..vertices {
            sums[cell_of[v]] += self.areas[v] * errors[v];
        }
        *cell_of = chosen;
        if may_split {
            self.split(cell_of, &sums);
        }
    }

    /// The affine map that is nearest to how the vertices and their neighbours move, pulled to a rotation where they are flat.
    fn motion_of(&self, members: &[usize]) -> CellMotion {
        let mut grown: Vec<usize> = members.to_vec();
        let ring = |v: usize| self.source.surface.topology.ring_of(v);
        grown.extend(members.iter().flat_map(|&v| ring(v).iter().map(|&j| j as usize)));
        grown.sort_unstable();
        grown.dedup();
        let centre = mean(&grown, self.areas, |v| self.rest(v));
        let arms: Vec<Vector> = grown.iter().map(|&v| self.rest(v) - centre).collect();
        let spread: Matrix = grown
            .iter()
            .zip(&arms)
            .map(|(&v, e)| self.areas[v] * e * e.transpose())
            .sum();
        let ridge = MAP_RIDGE * spread.trace();
        let inverse = (spread + Matrix::identity() * ridge)
            .try_inverse()
            .unwrap_or_else(Matrix::zeros);
        let map = |pose: usize| {
            let middle = mean(&grown, self.areas, |v| self.samples.position(pose, v));
            let products = grown.iter().zip(&arms).map(|(&v, e)| {
                let moved = self.samples.position(pose, v) - middle;
                self.areas[v] * moved * e.transpose()
            });
            let products: Matrix = products.sum();
            ((products + rotation(&products) * ridge) * inverse, middle)
        };
        CellMotion {
            centre,
            maps: (0..self.poses).map(map).collect(),
        }
    }

    /// Gives the cells that are worth least to their neighbours, and splits those whose map is worst in two for them.
    fn split(&self, cell_of: &mut [usize], errors: &[f64]) {
        let mut order: Vec<usize> = (0..self.count).collect();
        order.sort_by(|&a, &b| errors[a].total_cmp(&errors[b]));
        for n in 0..(self.count / SPLIT_PART).max(1).min(self.count / 2) {
            let (least, worst) = (order[n], order[self.count - 1 - n]);
            let members: Vec<usize> = (0..cell_of.len()).filter(|&v| cell_of[v] == worst).collect();
            if errors[worst] < WORTH_SPLITTING * errors[least] || members.len() < LEAST_SPLIT {
                continue;
            }
            self.dissolve(cell_of, least);
            let centre = members.iter().map(|&v| self.rest(v)).sum::<Vector>() / members.len() as f64;
            let arm = |v: usize| self.rest(v) - centre;
            let spread: Matrix = members.iter().map(|&v| arm(v) * arm(v).transpose()).sum();
            let eigen = spread.symmetric_eigen();
            let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
            for &v in members.iter().filter(|&&v| arm(v).dot(&axis) > 0.0) {
                cell_of[v] = least;
            }
        }
    }

    /// Vertices of a cell go to the cells around it, ring by ring; what no other cell touches stays.
    fn dissolve(&self, cell_of: &mut [usize], cell: usize) {
        let mut left: Vec<usize> = (0..cell_of.len()).filter(|&v| cell_of[v] == cell).collect();
        while !left.is_empty() {
            let neighbour = |v: usize| {
                let ring = self.source.surface.topology.ring_of(v).iter();
                ring.map(|&j| cell_of[j as usize]).find(|&other| other != cell)
            };
            let given: Vec<(usize, usize)> = left.iter().filter_map(|&v| neighbour(v).map(|c| (v, c))).collect();
            if given.is_empty() {
                return;
            }
            given.iter().for_each(|&(v, c)| cell_of[v] = c);
            left.retain(|&v| cell_of[v] == cell);
        }
    }
}

/// The rotation nearest to a matrix.
pub(super) fn rotation(matrix: &Matrix) -> Matrix {
    let svd = matrix.svd(true, true);
    let (Some(u), Some(mut v_t)) = (svd.u, svd.v_t) else {
        return Matrix::identity();
    };
    if (u * v_t).determinant() < 0.0 {
        let least = svd.singular_values.imin();
        v_t.row_mut(least).neg_mut();
    }
    u * v_t
}
