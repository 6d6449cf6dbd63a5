//! Distances along the surface: the heat method (Crane, Weischedel, Wardetzky 2013), which the locality of components is
//! measured with. [`unfolding_dijkstra`](super::unfolding::unfolding_dijkstra) checks it.
//!
//! Rest shape -> two sparse factors, once -> distances from any vertex by two solves. Both matrices have the clamped, hence
//! positive, weights of [`EdgeWeights`]: heat stays positive however far it flows, and every mesh has an answer.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::cotangent::EdgeWeights;
use super::sparse_factor::{FactorError, SparseFactor};
use super::topology::{Topology, corners, is_flat, names_a_vertex_twice};
use super::vector::{cross, difference, dot, length};

/// Heat falls by e each step of length sqrt(time). The step is an edge, but no less than this share of the bounding box,
/// or heat at the far end of a long mesh would underflow.
const STEP_SHARE: f64 = 1.0 / 250.0;

/// Both factors of one mesh. V vertices.
#[derive(Debug)]
pub struct HeatMethod {
    topology: Topology,
    rest: Vec<[f64; 3]>,
    weights: EdgeWeights,
    heat: SparseFactor,
    potential: SparseFactor,
    diameter: f64,
}

impl HeatMethod {
    /// Factors `M + t L` and `L` (its first vertex anchored) of the rest shape.
    pub fn new(topology: &Topology, rest: &[[f64; 3]]) -> Result<Self, FactorError> {
        let weights = EdgeWeights::new(topology, rest);
        let edges = topology.edges();
        let edge_length = edges.iter().map(|&[a, b]| spoke(rest, a, b).norm()).sum::<f64>() / edges.len().max(1) as f64;
        let step = edge_length.max(STEP_SHARE * bounding_diagonal(rest));
        let time = step * step;

        let areas = barycentric_areas(topology, rest);
        let mean_area = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
        let sums: Vec<f64> = (0..topology.vertex_count)
            .map(|v| topology.entries_of(v).map(|entry| weights.weights[entry]).sum::<f64>())
            .collect();
        // A vertex without area holds heat like any other; a mesh without any still has a definite matrix.
        let floor = if mean_area > 0.0 { 0.01 * mean_area } else { 1.0 };
        let diagonal: Vec<f64> = areas
            .iter()
            .zip(&sums)
            .map(|(area, sum)| area.max(floor) + time * sum)
            .collect();
        let off_diagonal: Vec<f64> = weights.weights.iter().map(|weight| -time * weight).collect();
        let heat = SparseFactor::new(topology, &diagonal, &off_diagonal)?;

        let mut diagonal = sums;
        if let Some(first) = diagonal.first_mut() {
            *first += if *first > 0.0 { *first } else { 1.0 };
        }
        let off_diagonal: Vec<f64> = weights.weights.iter().map(|weight| -weight).collect();
        let potential = SparseFactor::new(topology, &diagonal, &off_diagonal)?;

        let mut method = HeatMethod {
            topology: topology.clone(),
            rest: rest.to_vec(),
            weights,
            heat,
            potential,
            diameter: 0.0,
        };
        if !rest.is_empty() {
            // Two sweeps: from the far end of a far end the distances are as long as they get, or nearly.
            let far = farthest(&method.distances(0));
            let distances = method.distances(far);
            method.diameter = distances[farthest(&distances)];
        }
        Ok(method)
    }

    /// Distance of every vertex from `source`, in units of the source files, at least 0. Shape: `[V]`. Separate pieces are
    /// as far as their bridges are long.
    pub fn distances(&self, source: usize) -> Vec<f64> {
        let mut heat = vec![[0.0]; self.topology.vertex_count];
        heat[source] = [1.0];
        self.heat.solve(&mut heat);
        let mut steps = vec![0.0; self.topology.ring.len()];
        self.steps_along_faces(&heat, &mut steps);
        let mut potential: Vec<[f64; 1]> = (0..self.topology.vertex_count)
            .map(|v| {
                let entries = self.topology.entries_of(v);
                [entries.map(|entry| -self.weights.weights[entry] * steps[entry]).sum()]
            })
            .collect();
        self.potential.solve(&mut potential);
        let origin = potential[source][0];
        potential.iter().map(|[value]| (value - origin).max(0.0)).collect()
    }

    /// [`distances`](Self::distances) from each of `sources`, in parallel. Shape: `[sources][V]`.
    pub fn distances_from_each(&self, sources: &[usize]) -> Vec<Vec<f64>> {
        sources.par_iter().map(|&source| self.distances(source)).collect()
    }

    /// The longest distance on the mesh, from two sweeps.
    pub fn diameter(&self) -> f64 {
        self.diameter
    }

    /// [`distances`](Self::distances) as shares of the [`diameter`](Self::diameter), in [0, 1].
    pub fn normalised_distances(&self, source: usize) -> Vec<f64> {
        let scale = if self.diameter > 0.0 { 1.0 / self.diameter } else { 0.0 };
        self.distances(source)
            .iter()
            .map(|distance| (distance * scale).min(1.0))
            .collect()
    }

    /// Up to `count` vertices spread over the surface: `first`, then each time the one farthest from all before.
    pub fn farthest_points(&self, first: usize, count: usize) -> Vec<usize> {
        let mut points = Vec::new();
        let mut nearest = vec![f64::INFINITY; self.topology.vertex_count];
        let mut next = first;
        while points.len() < count.min(self.topology.vertex_count) {
            points.push(next);
            for (held, distance) in nearest.iter_mut().zip(self.distances(next)) {
                *held = held.min(distance);
            }
            nearest[next] = 0.0;
            next = farthest(&nearest);
            if nearest[next] <= 0.0 {
                break;
            }
        }
        points
    }

    /// For every ring entry `v -> j` how much farther `j` should be than `v`: the mean over the faces at the edge of the
    /// unit direction away from the heat along it; along a bridge its length, away from the heat.
    fn steps_along_faces(&self, heat: &[[f64; 1]], steps: &mut [f64]) {
        let mut face_counts = vec![0u32; steps.len()];
        for face in self
            .topology
            .faces
            .iter()
            .filter(|face| !names_a_vertex_twice(face) && !is_flat(face, &self.rest))
        {
            let away = direction_away(corners(face, &self.rest), face.map(|v| heat[v as usize][0]));
            for n in 0..3 {
                let (a, b) = (face[n], face[(n + 1) % 3]);
                let step = away.dot(&spoke(&self.rest, a, b));
                for (from, to, step) in [(a, b, step), (b, a, -step)] {
                    if let Some(entry) = self.topology.entry(from as usize, to) {
                        steps[entry] += step;
                        face_counts[entry] += 1;
                    }
                }
            }
        }
        for v in 0..self.topology.vertex_count {
            for entry in self.topology.entries_of(v) {
                let j = self.topology.ring[entry];
                if face_counts[entry] > 0 {
                    steps[entry] /= f64::from(face_counts[entry]);
                } else {
                    let sign = match heat[v][0].total_cmp(&heat[j as usize][0]) {
                        core::cmp::Ordering::Greater => 1.0,
                        core::cmp::Ordering::Less => -1.0,
                        core::cmp::Ordering::Equal => 0.0,
                    };
                    steps[entry] = sign * spoke(&self.rest, v as u32, j).norm();
                }
            }
        }
    }
}

/// Unit vector in the face against the gradient of `heat` at its corners; zero where there is none.
fn direction_away(corners: [[f64; 3]; 3], heat: [f64; 3]) -> Vector3<f64> {
    // Far from the source heat is near the least f64: only ratios count.
    let greatest = heat.iter().fold(0.0, |greatest: f64, h| greatest.max(h.abs()));
    if greatest <= 0.0 {
        return Vector3::zeros();
    }
    let [a, b, c] = corners;
    let normal = Vector3::from(cross(difference(a, b), difference(a, c)));
    let gradient = (0..3).fold(Vector3::zeros(), |sum, n| {
        let opposite = Vector3::from(difference(corners[(n + 1) % 3], corners[(n + 2) % 3]));
        sum + normal.cross(&opposite) * (heat[n] / greatest)
    });
    -gradient.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
}

fn barycentric_areas(topology: &Topology, rest: &[[f64; 3]]) -> Vec<f64> {
    let mut areas = vec![0.0; topology.vertex_count];
    for face in &topology.faces {
        let [a, b, c] = corners(face, rest);
        let share = length(cross(difference(a, b), difference(a, c))) / 6.0;
        for &v in face {
            areas[v as usize] += share;
        }
    }
    areas
}

fn spoke(rest: &[[f64; 3]], from: u32, to: u32) -> Vector3<f64> {
    Vector3::from(difference(rest[from as usize], rest[to as usize]))
}

fn bounding_diagonal(positions: &[[f64; 3]]) -> f64 {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for position in positions {
        for c in 0..3 {
            low[c] = low[c].min(position[c]);
            high[c] = high[c].max(position[c]);
        }
    }
    let extent = difference(low, high);
    if positions.is_empty() {
        0.0
    } else {
        dot(extent, extent).sqrt()
    }
}

/// The first of the greatest.
fn farthest(distances: &[f64]) -> usize {
    (0..distances.len())
        .rev()
        .max_by(|&a, &b| distances[a].total_cmp(&distances[b]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{Mesh, grid, merged, moved, sphere, tube};
    use crate::mesh::unfolding::unfolding_dijkstra;

    /// Mean relative error of the heat method at one edge length squared; it falls with the edge length.
    const HEAT_TOLERANCE: f64 = 0.03;

    /// Mean relative error of unfolding, exact but for paths that miss a virtual source.
    const UNFOLDING_TOLERANCE: f64 = 0.01;

    /// Mean of |a - b| / b, over the vertices farther than a few edges, where a relative error means something.
    fn mean_error(a: &[f64], b: &[f64]) -> f64 {
        let least = 0.05 * b.iter().fold(0.0, |greatest: f64, x| greatest.max(*x));
        let errors: Vec<f64> = a
            .iter()
            .zip(b)
            .filter(|(_, b)| **b > least)
            .map(|(a, b)| (a - b).abs() / b)
            .collect();
        errors.iter().sum::<f64>() / errors.len() as f64
    }

    fn check(name: &str, mesh: &Mesh, source: usize, truth: impl Fn([f64; 3]) -> f64) {
        let topology = Topology::new(&mesh.1, &mesh.0);
        let truth: Vec<f64> = mesh.0.iter().map(|p| truth(*p)).collect();
        let heat = HeatMethod::new(&topology, &mesh.0).expect("definite").distances(source);
        let unfolded = unfolding_dijkstra(&topology, &mesh.0, source);
        let errors = (mean_error(&heat, &truth), mean_error(&unfolded, &truth));
        println!("{name}: heat {:.4}, unfolding {:.4}", errors.0, errors.1);
        assert!(
            errors.0 < HEAT_TOLERANCE && errors.1 < UNFOLDING_TOLERANCE,
            "{name}: {errors:?}"
        );
    }

    #[test]
    fn sphere_plane_and_tube_have_known_distances() {
        check("sphere", &sphere(5), 0, |p| p[0].clamp(-1.0, 1.0).acos());
        check("plane", &grid(40, 40, 0.1), 20 * 41 + 20, |p| {
            (p[0] - 2.0).hypot(p[1] - 2.0)
        });
        check("corner", &grid(40, 40, 0.1), 0, |p| p[0].hypot(p[1]));
        check("tube", &tube(48, 40, 4.0), 0, |p| p[1].atan2(p[0]).hypot(p[2]));
    }

    #[test]
    #[ignore = "needs SINEW_DATA, a folder of real sequences"]
    fn a_real_animal_agrees_with_unfolding() {
        /// Coarse ears and hooves, and obtuse triangles that clamped weights blur.
        const ANIMAL_TOLERANCE: f64 = 0.06;
        let folder = std::env::var_os("SINEW_DATA").expect("SINEW_DATA names the folder with real sequences");
        let horse = std::path::Path::new(&folder).join("horse");
        let horse = sinew_interchange::read_sequence(&horse, &Default::default(), &mut |_, _| {}).expect("the horse");
        let rest = crate::mesh::widened(&horse.sequence.shapes[0]);
        let topology = Topology::new(&horse.sequence.faces, &rest);
        let start = std::time::Instant::now();
        let method = HeatMethod::new(&topology, &rest).expect("definite");
        println!(
            "factors and two sweeps: {:.3} s, diameter {:.4}",
            start.elapsed().as_secs_f64(),
            method.diameter()
        );
        for source in method.farthest_points(0, 4) {
            let error = mean_error(&method.distances(source), &unfolding_dijkstra(&topology, &rest, source));
            println!("source {source}: {error:.4}");
            assert!(error < ANIMAL_TOLERANCE, "from {source}: {error}");
        }
    }

    #[test]
    fn distances_cross_bridges_and_bad_triangles() {
        let (mut rest, mut faces) = merged(&[sphere(3), moved(&sphere(3), [3.0, 0.0, 0.0])]);
        let last = rest.len() as u32;
        rest.extend([rest[0], [0.0, 0.0, 4.0]]);
        faces.extend([[0, 6, last], [7, 7, 8]]);
        let topology = Topology::new(&faces, &rest);
        let method = HeatMethod::new(&topology, &rest).expect("definite");
        let distances = method.normalised_distances(1);
        assert!(distances.iter().all(|d| (0.0..=1.0).contains(d)));
        // Of the second sphere every vertex is farther than the near side of the first.
        assert!((258..516).all(|v| distances[v] > distances[2]));
        let unfolded = unfolding_dijkstra(&topology, &rest, 1);
        assert!(unfolded.iter().all(|d| d.is_finite()));
    }

    #[test]
    fn farthest_points_are_far_apart() {
        let (rest, faces) = tube(12, 20, 10.0);
        let topology = Topology::new(&faces, &rest);
        let method = HeatMethod::new(&topology, &rest).expect("definite");
        let points = method.farthest_points(0, 3);
        assert!((rest[points[1]][2] - 10.0).abs() < 1e-9, "the far end");
        assert!((rest[points[2]][2] - 5.0).abs() < 2.5, "between the ends");
        assert_eq!(method.farthest_points(0, 10_000).len(), rest.len());
    }
}
