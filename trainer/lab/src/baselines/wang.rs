//! Sparse localized decomposition of edge lengths and dihedral angles: Wang et al., *Articulated-Motion-Aware Sparse
//! Localized Decomposition* (Computer Graphics Forum 36(8), 2017). What every edge's length and dihedral angle differ
//! from the reference's is factored by the sparse localized decomposition of [`super::splocs`]; blended ones become
//! positions through connection maps between faces ([`super::length_angle`]).
//!
//! As published, nothing in these values knows where a part of the mesh is: small errors of many angles add up along
//! the surface, so that far ends stray in position while edges keep their lengths.

use nalgebra::DMatrix;

use super::length_angle::LengthAngleField;
use super::linear::LinearBasis;
use super::model::{Handles, Model, count_elements};
use super::splocs::{SplocsSettings, splocs};

/// Factors `samples` (shape `[N][E x 2]`, from [`LengthAngleField::features`]) into K components. `distances(v)`: from a
/// vertex along the surface, shape `[V]`, the longest on the mesh being 1.
pub fn wang(
    field: &LengthAngleField<'_>,
    samples: &[Vec<f64>],
    distances: &(dyn Fn(usize) -> Vec<f32> + Sync),
    component_count: usize,
) -> LinearBasis {
    let of_edges = |e: usize| -> Vec<f32> {
        let of_vertices = distances(field.ends(e)[0]);
        let mean = |e: usize| {
            let [a, b] = field.ends(e);
            (of_vertices[a] + of_vertices[b]) / 2.0
        };
        (0..field.edge_count()).map(mean).collect()
    };
    splocs(samples, 2, &of_edges, &SplocsSettings::published(component_count))
}

/// A linear basis of lengths and angles, and the way back to positions.
pub struct LengthAngleModel<'m> {
    /// Width 2, elements are edges.
    pub basis: LinearBasis,
    /// To positions.
    pub field: &'m LengthAngleField<'m>,
    /// V.
    pub vertex_count: usize,
}

impl LengthAngleModel<'_> {
    fn edge_energies(&self) -> Vec<Vec<f64>> {
        (0..self.basis.directions.len()).map(|k| self.basis.energy(k)).collect()
    }
}

impl Model for LengthAngleModel<'_> {
    fn component_count(&self) -> usize {
        self.basis.directions.len()
    }

    fn pose(&self, weights: &[f64]) -> Vec<[f64; 3]> {
        self.field.positions(&self.basis.compose(weights))
    }

    fn energies(&self) -> Vec<Vec<f64>> {
        let spread = |of_edges: Vec<f64>| {
            let mut energies = vec![0.0; self.vertex_count];
            for (e, energy) in of_edges.iter().enumerate() {
                self.field.ends(e).iter().for_each(|&v| energies[v] += energy / 2.0);
            }
            energies
        };
        self.edge_energies().into_iter().map(spread).collect()
    }

    fn stored(&self) -> (Vec<usize>, usize) {
        (count_elements(&self.edge_energies()), 2)
    }

    fn handles(&self, vertices: &[usize]) -> Box<dyn Handles + '_> {
        Box::new(LengthAngleHandles {
            model: self,
            vertices: vertices.to_vec(),
        })
    }

    fn tangents(&self, weights: &[f64]) -> Vec<Vec<[f32; 3]>> {
        self.field
            .tangents(&self.basis.compose(weights), &self.basis.directions)
    }
}

struct LengthAngleHandles<'m> {
    model: &'m LengthAngleModel<'m>,
    vertices: Vec<usize>,
}

impl Handles for LengthAngleHandles<'_> {
    fn positions(&self, weights: &[f64], count: usize) -> Vec<[f64; 3]> {
        let posed = self.model.pose(weights);
        self.vertices[..count].iter().map(|&v| posed[v]).collect()
    }

    fn jacobian(&self, weights: &[f64], count: usize) -> DMatrix<f64> {
        let tangents = self.model.tangents(weights);
        DMatrix::from_fn(3 * count, tangents.len(), |row, k| {
            f64::from(tangents[k][self.vertices[row / 3]][row % 3])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::gradient_field::FaceField;
    use crate::baselines::linear::LinearProjection;
    use sinew_trainer::features::align::{RigidMotion, widened};
    use sinew_trainer::mesh::geodesic::HeatMethod;
    use sinew_trainer::mesh::shapes::{grid, merged, moved, sphere, tube};
    use sinew_trainer::mesh::topology::Topology;
    use sinew_trainer::synthesize::{Settings, Subject};

    /// Greatest distance between shapes laid onto each other.
    fn gap(shape: &[[f64; 3]], found: &[[f64; 3]]) -> f64 {
        let motion = RigidMotion::onto(shape, found);
        let pairs = found.iter().map(|&p| motion.apply(p)).zip(shape);
        pairs
            .flat_map(|(p, q)| (0..3).map(move |c| (p[c] - q[c]).abs()))
            .fold(0.0, f64::max)
    }

    fn bar() -> (Topology, Vec<Vec<[f64; 3]>>) {
        let settings = Settings {
            frames: 4,
            vertices: 150,
            seed: 1,
        };
        let sequence = Subject::Bar.synthesize(&settings).expect("a bar");
        let shapes: Vec<Vec<[f64; 3]>> = sequence.shapes.iter().map(widened).collect();
        (Topology::new(&sequence.faces, &shapes[0]), shapes)
    }

    #[test]
    fn a_bent_bar_comes_back_from_its_lengths_and_angles() {
        let (topology, shapes) = bar();
        let faces = FaceField::new(&topology, &shapes[0]).expect("definite");
        let field = LengthAngleField::new(&faces).expect("definite");
        for shape in &shapes {
            let found = field.positions(&field.features(shape));
            assert!(gap(shape, &found) < 1e-9, "{}", gap(shape, &found));
        }
        assert!(gap(&shapes[0], &shapes[3]) > 0.1, "the bar does bend");
    }

    #[test]
    fn pieces_boundaries_and_odd_faces_come_back() {
        let (rest, mut faces) = merged(&[sphere(2), moved(&grid(4, 4, 0.3), [2.0, 0.0, 0.0]), tube(6, 4, 1.0)]);
        // One without area, one against the grain, and a third at an edge.
        faces.push([0, 0, 1]);
        faces[3].swap(0, 1);
        faces.push([faces[0][0], faces[0][1], rest.len() as u32 - 1]);
        let topology = Topology::new(&faces, &rest);
        let field = FaceField::new(&topology, &rest).expect("definite");
        let own = LengthAngleField::new(&field).expect("definite");
        assert!(own.features(&rest).iter().all(|&x| x == 0.0));
        let found = own.positions(&vec![0.0; 2 * own.edge_count()]);
        assert!(gap(&rest, &found) < 1e-9);
        // Turned and larger: lengths grow alike, angles stay.
        let larger: Vec<[f64; 3]> = rest.iter().map(|p| [-1.5 * p[1], 1.5 * p[0], 1.5 * p[2]]).collect();
        let features = own.features(&larger);
        assert!(
            features
                .as_chunks::<2>()
                .0
                .iter()
                .all(|x| x[0] > 0.0 && x[1].abs() < 1e-9)
        );
    }

    #[test]
    fn tangents_are_the_poses_own() {
        let (topology, shapes) = bar();
        let faces = FaceField::new(&topology, &shapes[0]).expect("definite");
        let field = LengthAngleField::new(&faces).expect("definite");
        let directions: Vec<Vec<f64>> = shapes[1..].iter().map(|shape| field.features(shape)).collect();
        let model = LengthAngleModel {
            basis: LinearBasis {
                width: 2,
                mean: vec![0.0; directions[0].len()],
                directions,
            },
            field: &field,
            vertex_count: shapes[0].len(),
        };
        let (at, step) = ([0.0, 1.0, 0.0], 1e-4);
        let vertices = [4, 90];
        let (tangents, jacobian) = (model.tangents(&at), model.handles(&vertices).jacobian(&at, 2));
        for k in 0..3 {
            let pose = |by: f64| {
                let mut weights = at;
                weights[k] += by;
                model.pose(&weights)
            };
            let (ahead, behind) = (pose(step), pose(-step));
            let slope = |v: usize, c: usize| (ahead[v][c] - behind[v][c]) / (2.0 * step);
            let largest = (0..ahead.len())
                .flat_map(|v| (0..3).map(move |c| (v, c)))
                .map(|(v, c)| slope(v, c).abs())
                .fold(0.0, f64::max);
            for v in 0..ahead.len() {
                for c in 0..3 {
                    let found = f64::from(tangents[k][v][c]);
                    assert!((slope(v, c) - found).abs() < 1e-3 * largest, "{k}, {v}: {found}");
                }
            }
            for (row, &v) in vertices.iter().enumerate() {
                assert_eq!(jacobian[(3 * row, k)], f64::from(tangents[k][v][0]));
            }
        }
    }

    #[test]
    fn all_components_give_the_training_shapes_back_and_few_do_not() {
        let (topology, shapes) = bar();
        let heat = HeatMethod::new(&topology, &shapes[0]).expect("definite");
        let distances = |v: usize| heat.normalised_distances(v).iter().map(|&d| d as f32).collect();
        let faces = FaceField::new(&topology, &shapes[0]).expect("definite");
        let field = LengthAngleField::new(&faces).expect("definite");
        let samples: Vec<Vec<f64>> = shapes.iter().map(|shape| field.features(shape)).collect();
        let error = |count: usize| -> f64 {
            let basis = wang(&field, &samples, &distances, count);
            let projection = LinearProjection::new(&basis, &field.areas());
            let pairs = shapes.iter().zip(&samples);
            pairs
                .map(|(shape, sample)| {
                    let found = field.positions(&basis.compose(&projection.weights(sample)));
                    gap(shape, &found)
                })
                .fold(0.0, f64::max)
        };
        let (few, many) = (error(1), error(24));
        assert!(many < 0.5 * few, "{few} with one component, {many} with 24");
    }
}
