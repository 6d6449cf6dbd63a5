//! From deformation gradients to positions, for gradients of vertices (this project's features) and of faces (Huang 2014):
//! one interface, so that every peer in gradients is fitted, solved and moved by handles in the same way.
//!
//! Both solve `L d = b(T - I)` for displacements d; both are linear in T, so what a single vertex hears of all gradients
//! can be computed once.

use faer::sparse::Triplet;
use nalgebra::{Matrix3, Vector3};

use sinew_trainer::features::reconstruct::PoissonSystem;
use sinew_trainer::mesh::sparse_factor::{FactorError, SparseFactor};
use sinew_trainer::mesh::topology::{Topology, corners, is_flat, names_a_vertex_twice};
use sinew_trainer::mesh::vector::{cross, difference, dot, length};

/// Half a cotangent stays within this: obtuse corners still pull a little, slivers do not outweigh all.
const HALF_COTANGENT_RANGE: (f64, f64) = (0.01, 10.0);

/// Gradients over elements E, and the solve that makes positions of them.
pub trait GradientField: Sync {
    /// E.
    fn element_count(&self) -> usize;
    /// Rest shape. Shape: `[V]`.
    fn rest(&self) -> &[[f64; 3]];
    /// Displacements of `deviations` T - I. Shapes: `[E]` to `[V]`.
    fn displacements(&self, deviations: &[Matrix3<f64>]) -> Vec<[f64; 3]>;
    /// u with `displacement of vertex = sum_e deviation_e u_e`. Shape: `[E]`.
    fn influence(&self, vertex: usize) -> Vec<[f64; 3]>;
    /// Energies of elements, shared out to vertices. Shapes: `[E]` to `[V]`.
    fn to_vertices(&self, energies: &[f64]) -> Vec<f64>;
}

impl GradientField for PoissonSystem {
    fn element_count(&self) -> usize {
        self.rest().len()
    }

    fn rest(&self) -> &[[f64; 3]] {
        self.rest()
    }

    fn displacements(&self, deviations: &[Matrix3<f64>]) -> Vec<[f64; 3]> {
        let mut values = self.right_hand_side(deviations);
        self.solve(&mut values);
        values
    }

    fn influence(&self, vertex: usize) -> Vec<[f64; 3]> {
        let mut potential = vec![[0.0; 3]; self.rest().len()];
        potential[vertex][0] = 1.0;
        self.solve(&mut potential);
        let adjoint = self.right_hand_side_adjoint(&potential);
        adjoint.iter().map(|g| [g[(0, 0)], g[(0, 1)], g[(0, 2)]]).collect()
    }

    fn to_vertices(&self, energies: &[f64]) -> Vec<f64> {
        energies.to_vec()
    }
}

/// Gradients of faces (Sumner and Popović 2004): the solve weighs a face's edges by their cotangents, and bridges by one
/// with the mean gradient of the faces around their ends. F faces, V vertices.
#[derive(Debug)]
pub struct FaceField {
    rest: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    /// Half cotangent opposite to each corner. Shape: `[F]`.
    halves: Vec<[f64; 3]>,
    bridges: Vec<[u32; 2]>,
    /// Faces around the ends of each bridge.
    bridge_faces: Vec<Vec<usize>>,
    /// Inverses of the faces' edges and normals at rest; `None` for those without area. Shape: `[F]`.
    rest_inverses: Vec<Option<Matrix3<f64>>>,
    factor: SparseFactor,
}

impl FaceField {
    /// Factors the matrix of the rest shape, its first vertex anchored.
    pub fn new(topology: &Topology, rest: &[[f64; 3]]) -> Result<Self, FactorError> {
        let faces = topology.faces.clone();
        let halves: Vec<[f64; 3]> = faces.iter().map(|face| half_cotangents(face, rest)).collect();
        let mut lower = Vec::new();
        let mut stretch = |a: u32, b: u32, weight: f64| {
            let (a, b) = (a as usize, b as usize);
            lower.push(Triplet::new(a, a, weight));
            lower.push(Triplet::new(b, b, weight));
            lower.push(Triplet::new(a.max(b), a.min(b), -weight));
        };
        for (face, halves) in faces.iter().zip(&halves) {
            for n in 0..3 {
                if halves[n] > 0.0 {
                    stretch(face[(n + 1) % 3], face[(n + 2) % 3], halves[n]);
                }
            }
        }
        // A flat face has no angles, but its corners must hang on something.
        let mut bridges = topology.bridges.clone();
        for (face, halves) in faces.iter().zip(&halves).filter(|(_, halves)| halves[0] == 0.0) {
            debug_assert_eq!(halves, &[0.0; 3]);
            let [a, b, c] = *face;
            bridges.extend([[a, b], [b, c], [c, a]].into_iter().filter(|[a, b]| a != b));
        }
        for &[a, b] in &bridges {
            stretch(a, b, 1.0);
        }
        lower.push(Triplet::new(0, 0, 1.0));
        let mut faces_around = vec![Vec::new(); rest.len()];
        for (f, face) in faces.iter().enumerate().filter(|(f, _)| halves[*f][0] > 0.0) {
            for &v in face {
                faces_around[v as usize].push(f);
            }
        }
        let ends = bridges.iter().map(|bridge| bridge.map(|v| v as usize));
        let bridge_faces = ends.map(|ends| ends.iter().flat_map(|&v| faces_around[v].clone()).collect());
        let sound = faces.iter().zip(&halves);
        let rest_inverses = sound.map(|(face, halves)| {
            let frame = (halves[0] != 0.0).then(|| frame(face, rest));
            frame.and_then(|frame| frame.try_inverse())
        });
        Ok(Self {
            rest_inverses: rest_inverses.collect(),
            bridge_faces: bridge_faces.collect(),
            rest: rest.to_vec(),
            factor: SparseFactor::from_lower(rest.len(), &lower)?,
            faces,
            halves,
            bridges,
        })
    }

    /// T of every face: takes its rest edges and unit normal to those of `shape` (`[V]`). Shape: `[F]`; the identity for
    /// faces without area at rest.
    pub fn gradients(&self, shape: &[[f64; 3]]) -> Vec<Matrix3<f64>> {
        let faces = self.faces.iter().zip(&self.rest_inverses);
        faces
            .map(|(face, inverse)| inverse.map_or_else(Matrix3::identity, |inverse| frame(face, shape) * inverse))
            .collect()
    }

    /// Areas of the faces at rest, mean one, kept above a hundredth. Shape: `[F]`.
    pub fn areas(&self) -> Vec<f64> {
        let areas: Vec<f64> = self
            .faces
            .iter()
            .map(|face| {
                let [a, b, c] = corners(face, &self.rest);
                length(cross(difference(a, b), difference(a, c)))
            })
            .collect();
        let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
        areas
            .iter()
            .map(|area| if mean > 0.0 { (area / mean).max(0.01) } else { 1.0 })
            .collect()
    }

    /// The faces.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Pairs of vertices that no face joins and the solve does.
    pub fn bridges(&self) -> &[[u32; 2]] {
        &self.bridges
    }

    /// Whether face `f` has area at rest; one without has no gradient of its own.
    pub fn has_area(&self, f: usize) -> bool {
        self.rest_inverses[f].is_some()
    }

    /// Inverse of the matrix whose columns are two edges and the unit normal of face `f` at rest.
    pub fn rest_inverse(&self, f: usize) -> Option<&Matrix3<f64>> {
        self.rest_inverses[f].as_ref()
    }

    fn spoke(&self, from: u32, to: u32) -> Vector3<f64> {
        Vector3::from(self.rest[from as usize]) - Vector3::from(self.rest[to as usize])
    }

    /// Calls `visit(a, b, weight, elements)` for every weighted edge and the faces that share its gradient equally.
    fn for_each_edge(&self, mut visit: impl FnMut(u32, u32, f64, &[usize])) {
        for (f, (face, halves)) in self.faces.iter().zip(&self.halves).enumerate() {
            for n in 0..3 {
                if halves[n] > 0.0 {
                    visit(face[(n + 1) % 3], face[(n + 2) % 3], halves[n], &[f]);
                }
            }
        }
        for (bridge, faces) in self.bridges.iter().zip(&self.bridge_faces) {
            visit(bridge[0], bridge[1], 1.0, faces);
        }
    }
}

impl GradientField for FaceField {
    fn element_count(&self) -> usize {
        self.faces.len()
    }

    fn rest(&self) -> &[[f64; 3]] {
        &self.rest
    }

    fn displacements(&self, deviations: &[Matrix3<f64>]) -> Vec<[f64; 3]> {
        let mut values = vec![[0.0; 3]; self.rest.len()];
        self.for_each_edge(|a, b, weight, faces| {
            let share = weight / faces.len().max(1) as f64;
            let gradient: Matrix3<f64> = faces.iter().map(|&f| deviations[f]).sum();
            let pull = gradient * self.spoke(a, b) * share;
            for c in 0..3 {
                values[a as usize][c] += pull[c];
                values[b as usize][c] -= pull[c];
            }
        });
        self.factor.solve(&mut values);
        values
    }

    fn influence(&self, vertex: usize) -> Vec<[f64; 3]> {
        let mut potential = vec![[0.0]; self.rest.len()];
        potential[vertex] = [1.0];
        self.factor.solve(&mut potential);
        let mut influence = vec![[0.0; 3]; self.faces.len()];
        self.for_each_edge(|a, b, weight, faces| {
            let step = potential[a as usize][0] - potential[b as usize][0];
            let share = self.spoke(a, b) * (weight * step / faces.len().max(1) as f64);
            for &f in faces {
                for c in 0..3 {
                    influence[f][c] += share[c];
                }
            }
        });
        influence
    }

    fn to_vertices(&self, energies: &[f64]) -> Vec<f64> {
        let mut shared = vec![0.0; self.rest.len()];
        for (face, energy) in self.faces.iter().zip(energies) {
            for &v in face {
                shared[v as usize] += energy / 3.0;
            }
        }
        shared
    }
}

/// Edges and unit normal of a face, as columns.
fn frame(face: &[u32; 3], shape: &[[f64; 3]]) -> Matrix3<f64> {
    let [a, b, c] = corners(face, shape);
    let (u, w) = (difference(a, b), difference(a, c));
    let normal = Vector3::from(cross(u, w));
    let norm = normal.norm();
    let normal = if norm > 0.0 { normal / norm } else { normal };
    Matrix3::from_columns(&[Vector3::from(u), Vector3::from(w), normal])
}

/// Half cotangents of the corners, held in range; zeros for a face without area.
fn half_cotangents(face: &[u32; 3], rest: &[[f64; 3]]) -> [f64; 3] {
    if names_a_vertex_twice(face) || is_flat(face, rest) {
        return [0.0; 3];
    }
    let at = corners(face, rest);
    core::array::from_fn(|n| {
        let (u, w) = (difference(at[n], at[(n + 1) % 3]), difference(at[n], at[(n + 2) % 3]));
        let (least, most) = HALF_COTANGENT_RANGE;
        (0.5 * dot(u, w) / length(cross(u, w))).clamp(least, most)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use sinew_trainer::mesh::cotangent::EdgeWeights;
    use sinew_trainer::mesh::shapes::{grid, merged, moved, sphere, tube};

    /// Rounding of a solve of some hundred unknowns in f64, against a mesh of size 1.
    const TOLERANCE: f64 = 1e-9;

    fn mesh() -> (Topology, Vec<[f64; 3]>) {
        let (rest, mut faces) = merged(&[sphere(2), moved(&grid(4, 4, 0.3), [2.0, 0.0, 0.0]), tube(6, 4, 1.0)]);
        faces.push([0, 0, 1]);
        (Topology::new(&faces, &rest), rest)
    }

    #[test]
    fn faces_give_an_affine_shape_back() {
        let (topology, rest) = mesh();
        let field = FaceField::new(&topology, &rest).expect("definite");
        let turn = Rotation3::from_euler_angles(0.3, 0.8, -0.2).into_inner();
        // A turn keeps normals normal, so the gradient is the map itself.
        let shape: Vec<[f64; 3]> = rest.iter().map(|p| (turn * Vector3::from(*p)).into()).collect();
        let deviations: Vec<Matrix3<f64>> = field
            .gradients(&shape)
            .iter()
            .map(|t| t - Matrix3::identity())
            .collect();
        let found = field.displacements(&deviations);
        let held = Vector3::from(shape[0]) - Vector3::from(rest[0]);
        for (v, d) in found.iter().enumerate() {
            let expected = Vector3::from(shape[v]) - Vector3::from(rest[v]) - held;
            assert!((Vector3::from(*d) - expected).norm() < TOLERANCE, "vertex {v}");
        }
    }

    #[test]
    fn influences_are_rows_of_the_solve() {
        let (topology, rest) = mesh();
        let faces = FaceField::new(&topology, &rest).expect("definite");
        let weights = EdgeWeights::new(&topology, &rest);
        let vertices = PoissonSystem::new(&topology, &weights, &rest, 3).expect("definite");
        for field in [&faces as &dyn GradientField, &vertices] {
            let deviations: Vec<Matrix3<f64>> = (0..field.element_count())
                .map(|e| Matrix3::from_fn(|i, j| ((7 * e + 3 * i + j) as f64).sin()))
                .collect();
            let all = field.displacements(&deviations);
            for v in [0, 5, rest.len() - 1] {
                let influence = field.influence(v);
                let sum: Vector3<f64> = deviations
                    .iter()
                    .zip(&influence)
                    .map(|(d, u)| d * Vector3::from(*u))
                    .sum();
                assert!((sum - Vector3::from(all[v])).norm() < TOLERANCE, "vertex {v}");
            }
        }
    }
}
