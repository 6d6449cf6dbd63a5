//! Deformation gradient of every one-ring (method section 1): an aligned shape -> T per vertex -> polar decomposition.
//!
//! The least-squares fit is linear in the shape, so all that depends on the rest shape is folded into one vector a ring
//! entry, once.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

use super::refine::Refinement;
use crate::mesh::cotangent::{EdgeWeights, half_cotangents, positive_mean};
use crate::mesh::topology::{Topology, corners, is_flat};
use crate::mesh::vector::{cross, difference};

/// A ring is undetermined when its least principal moment is below this share of the greatest: rounding would speak.
const MOMENT_FLOOR: f64 = 1e-7;

/// Length of the normal spoke of [`Weighting::Published`], in mean spoke lengths.
const PUBLISHED_NORMAL_LENGTH: f64 = 0.3;

/// How spokes weigh in the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// By their cotangent weight, as in the paper; the normal spoke by [`FeatureSettings::normal_weight`].
    Cotangent,
    /// As `Cotangent`, then moved as little as it takes for the solve to give the shape back nearly: see `refine`.
    #[default]
    Refined,
    /// As the original authors' program: by `sqrt(g(h))`, `h = 1/2 (cot a + cot b)`, `g = 1 + h` for h > 0 and `exp(h)`
    /// otherwise; the normal spoke is 0.3 mean spokes long and weighs 1.
    Published,
}

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FeatureSettings {
    /// How spokes weigh.
    pub weighting: Weighting,
    /// Weight of the normal spoke, one mean spoke long, in mean spoke weights; not for [`Weighting::Published`]. Positive:
    /// without it a flat ring says nothing about its normal. Small follows the surface, large resists noise.
    pub normal_weight: f64,
}

impl Default for FeatureSettings {
    fn default() -> Self {
        FeatureSettings {
            weighting: Weighting::Refined,
            normal_weight: 0.1,
        }
    }
}

/// The fit of one mesh, ready for any of its shapes. V vertices.
#[derive(Debug)]
pub struct GradientFit<'t> {
    topology: &'t Topology,
    /// Whether a ring entry is left out of the fit: a bridge, unless the vertex has nothing else. Shape: that of [`Topology::ring`].
    left_out: Vec<bool>,
    /// `w_ij A_i^-1 (r_j - r_i)`, A the ring's moments. Shape: that of [`Topology::ring`].
    spokes: Vec<Vector3<f64>>,
    /// The same for the normal spoke, times its length in mean spokes. Shape: `[V]`.
    normals: Vec<Vector3<f64>>,
    /// Rings that do not determine a gradient, in the order to fill them from their neighbours.
    undetermined: Vec<usize>,
    weighting: Weighting,
    refinement: Option<Refinement>,
}

impl<'t> GradientFit<'t> {
    /// Folds the rest shape into the fit. Where the rest shape's coordinates are too extreme for a factor, the fit goes
    /// unrefined; the solve refuses such a shape by itself.
    pub fn new(topology: &'t Topology, rest: &[[f64; 3]], settings: &FeatureSettings) -> Self {
        let weights = spoke_weights(topology, rest, settings.weighting);
        let rest_normals = vertex_normals(topology, rest, settings.weighting);
        let left_out = bridges_beside_faces(topology);
        let mut spokes = vec![Vector3::zeros(); topology.ring.len()];
        let mut normals = vec![Vector3::zeros(); topology.vertex_count];
        let mut determined = vec![false; topology.vertex_count];
        let mut inverses = vec![Matrix3::zeros(); topology.vertex_count];
        for v in 0..topology.vertex_count {
            let entries = topology.entries_of(v);
            let fitted = || entries.clone().filter(|&entry| !left_out[entry]);
            let count = fitted().count().max(1) as f64;
            let (length, weight) = match settings.weighting {
                Weighting::Cotangent | Weighting::Refined => (
                    1.0,
                    settings.normal_weight * fitted().map(|entry| weights[entry]).sum::<f64>() / count,
                ),
                Weighting::Published => (PUBLISHED_NORMAL_LENGTH, 1.0),
            };
            let normal = rest_normals[v] * (length * mean_spoke(topology, &left_out, rest, v));
            let mut moments = normal * normal.transpose() * weight;
            for entry in fitted() {
                let spoke = spoke(topology, rest, v, entry);
                moments += spoke * spoke.transpose() * weights[entry];
            }
            let Some(inverse) = inverse_moments(&moments) else {
                continue;
            };
            // A loose vertex has bridges alone: what its neighbours do says more than they.
            determined[v] = rest_normals[v] != Vector3::zeros();
            for entry in fitted() {
                spokes[entry] = inverse * spoke(topology, rest, v, entry) * weights[entry];
            }
            normals[v] = inverse * normal * (weight * length);
            inverses[v] = inverse;
        }
        let undetermined = fill_order(topology, &determined);
        for &v in &undetermined {
            inverses[v] = Matrix3::zeros();
        }
        let refinement = (settings.weighting == Weighting::Refined)
            .then(|| Refinement::new(topology, rest, weights, inverses).ok())
            .flatten();
        GradientFit {
            topology,
            left_out,
            spokes,
            normals,
            undetermined,
            weighting: settings.weighting,
            refinement,
        }
    }

    /// T of every vertex of `shape` (`[V][3]`): finite for finite positions. A ring that does not determine its own takes
    /// the mean of its neighbours'.
    pub fn gradients(&self, shape: &[[f64; 3]]) -> Vec<Matrix3<f64>> {
        let shape_normals = vertex_normals(self.topology, shape, self.weighting);
        let mut gradients: Vec<Matrix3<f64>> = (0..self.topology.vertex_count)
            .map(|v| {
                let normal = shape_normals[v] * mean_spoke(self.topology, &self.left_out, shape, v);
                let mut gradient = normal * self.normals[v].transpose();
                for entry in self.topology.entries_of(v) {
                    gradient += spoke(self.topology, shape, v, entry) * self.spokes[entry].transpose();
                }
                gradient
            })
            .collect();
        let mut known = vec![true; gradients.len()];
        for &v in &self.undetermined {
            known[v] = false;
        }
        for &v in &self.undetermined {
            let (sum, count) = self
                .topology
                .ring_of(v)
                .iter()
                .filter(|&&j| known[j as usize])
                .fold((Matrix3::zeros(), 0), |(sum, count), &j| {
                    (sum + gradients[j as usize], count + 1)
                });
            gradients[v] = if count == 0 {
                Matrix3::identity()
            } else {
                sum / f64::from(count)
            };
            known[v] = true;
        }
        if let Some(refinement) = &self.refinement {
            refinement.refine(self.topology, shape, &mut gradients);
        }
        gradients
    }
}

fn spoke_weights(topology: &Topology, rest: &[[f64; 3]], weighting: Weighting) -> Vec<f64> {
    match weighting {
        Weighting::Cotangent | Weighting::Refined => EdgeWeights::new(topology, rest).weights,
        Weighting::Published => {
            let halves = half_cotangents(topology, rest, f64::INFINITY);
            let mean = positive_mean(&halves);
            let emphasis = |half: f64| if half > 0.0 { 1.0 + half } else { half.exp() };
            halves
                .iter()
                .map(|half| emphasis(half.unwrap_or(mean)).sqrt())
                .collect()
        }
    }
}

/// `r_j - r_i` of a ring entry.
fn spoke(topology: &Topology, positions: &[[f64; 3]], v: usize, entry: usize) -> Vector3<f64> {
    Vector3::from(difference(positions[v], positions[topology.ring[entry] as usize]))
}

/// Bridges of vertices that have edges of faces too: what hangs on a vertex says nothing of the surface there.
fn bridges_beside_faces(topology: &Topology) -> Vec<bool> {
    let mut left_out = vec![false; topology.ring.len()];
    if topology.bridges.is_empty() {
        return left_out;
    }
    for v in 0..topology.vertex_count {
        let is_bridge = |entry: usize| topology.is_bridge(v as u32, topology.ring[entry]);
        if topology.entries_of(v).any(|entry| !is_bridge(entry)) {
            topology
                .entries_of(v)
                .for_each(|entry| left_out[entry] = is_bridge(entry));
        }
    }
    left_out
}

fn mean_spoke(topology: &Topology, left_out: &[bool], positions: &[[f64; 3]], v: usize) -> f64 {
    let entries = || topology.entries_of(v).filter(|&entry| !left_out[entry]);
    let count = entries().count().max(1) as f64;
    entries()
        .map(|entry| spoke(topology, positions, v, entry).norm())
        .sum::<f64>()
        / count
}

/// Unit normals; zero where no face has area. Faces count by area, and all the same in the original authors' program.
fn vertex_normals(topology: &Topology, positions: &[[f64; 3]], weighting: Weighting) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); topology.vertex_count];
    for face in topology.faces.iter().filter(|face| !is_flat(face, positions)) {
        let [a, b, c] = corners(face, positions);
        let mut normal = Vector3::from(cross(difference(a, b), difference(a, c)));
        if weighting == Weighting::Published {
            normal.normalize_mut();
        }
        for &v in face {
            normals[v as usize] += normal;
        }
    }
    for normal in &mut normals {
        *normal = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
    }
    normals
}

/// Inverse of a ring's moments, or `None` where a direction has next to none.
fn inverse_moments(moments: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let eigen = SymmetricEigen::new(*moments);
    let (least, greatest) = (eigen.eigenvalues.min(), eigen.eigenvalues.max());
    if !(greatest.is_finite() && greatest > 0.0 && least > MOMENT_FLOOR * greatest) {
        return None;
    }
    moments.try_inverse()
}

/// Undetermined vertices in the order that reaches them from the others, ring by ring.
fn fill_order(topology: &Topology, determined: &[bool]) -> Vec<usize> {
    let mut reached = determined.to_vec();
    let mut open: Vec<usize> = (0..reached.len()).filter(|&v| reached[v]).collect();
    let mut order = Vec::new();
    while !open.is_empty() {
        let mut next = Vec::new();
        for &v in &open {
            for &j in topology.ring_of(v) {
                if !reached[j as usize] {
                    reached[j as usize] = true;
                    next.push(j as usize);
                }
            }
        }
        order.extend_from_slice(&next);
        open = next;
    }
    order.extend((0..reached.len()).filter(|&v| !reached[v]));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, merged, moved, sphere};
    use nalgebra::Rotation3;

    /// Rounding of a fit of well-shaped rings.
    const TOLERANCE: f64 = 1e-9;

    const SETTINGS: [FeatureSettings; 4] = [
        FeatureSettings {
            weighting: Weighting::Refined,
            normal_weight: 0.1,
        },
        FeatureSettings {
            weighting: Weighting::Cotangent,
            normal_weight: 0.01,
        },
        FeatureSettings {
            weighting: Weighting::Cotangent,
            normal_weight: 0.1,
        },
        FeatureSettings {
            weighting: Weighting::Published,
            normal_weight: 0.01,
        },
    ];

    fn mapped(rest: &[[f64; 3]], map: &Matrix3<f64>) -> Vec<[f64; 3]> {
        rest.iter()
            .map(|p| (map * Vector3::from(*p) + Vector3::new(1.0, 2.0, 3.0)).into())
            .collect()
    }

    #[test]
    fn a_similarity_is_its_own_gradient_everywhere() {
        let (mut rest, faces) = merged(&[sphere(2), moved(&grid(4, 3, 0.3), [3.0, 0.0, 0.0])]);
        rest.push([0.0, 0.0, 3.0]);
        let topology = Topology::new(&faces, &rest);
        let map = Rotation3::from_euler_angles(0.4, 1.2, -2.0).into_inner() * 1.7;
        for settings in SETTINGS {
            let fit = GradientFit::new(&topology, &rest, &settings);
            for gradient in fit.gradients(&mapped(&rest, &map)) {
                assert!((gradient - map).norm() < TOLERANCE, "{settings:?} {gradient}");
            }
        }
    }

    #[test]
    fn a_stretch_in_the_plane_is_recovered_there() {
        let (rest, faces) = grid(6, 6, 0.2);
        let topology = Topology::new(&faces, &rest);
        let map = Matrix3::new(1.5, 0.2, 0.0, 0.2, 0.8, 0.0, 0.0, 0.0, 1.0);
        for settings in SETTINGS {
            for gradient in GradientFit::new(&topology, &rest, &settings).gradients(&mapped(&rest, &map)) {
                assert!((gradient - map).fixed_view::<3, 2>(0, 0).norm() < TOLERANCE);
                assert!(gradient[(0, 2)].abs() < TOLERANCE && gradient[(1, 2)].abs() < TOLERANCE);
            }
        }
    }

    #[test]
    fn degenerate_rings_follow_their_neighbours_and_stay_finite() {
        let (mut rest, mut faces) = grid(3, 3, 1.0);
        let last = rest.len() as u32;
        // A needle without area, a duplicate vertex, a face that names a vertex twice, and nothing but points far off.
        rest.extend([
            [5.0, 0.0, 0.0],
            [6.0, 0.0, 0.0],
            [7.0, 0.0, 0.0],
            rest[0],
            [50.0, 0.0, 0.0],
        ]);
        faces.extend([[last, last + 1, last + 2], [0, 1, last + 3], [4, 4, 5]]);
        let topology = Topology::new(&faces, &rest);
        let map = Rotation3::from_euler_angles(0.4, 0.2, -1.0).into_inner();
        for settings in SETTINGS {
            let fit = GradientFit::new(&topology, &rest, &settings);
            for gradient in fit.gradients(&mapped(&rest, &map)) {
                assert!((gradient - map).norm() < TOLERANCE, "{settings:?} {gradient}");
            }
            // Collapsed onto a point, a line, a plane.
            for keep in 0..3 {
                let map = Matrix3::from_fn(|r, c| if r == c && r < keep { 1.0 } else { 0.0 });
                assert!(
                    fit.gradients(&mapped(&rest, &map))
                        .iter()
                        .all(|g| g.iter().all(|x| x.is_finite()))
                );
            }
        }
    }
}
