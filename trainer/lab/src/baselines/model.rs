//! A trained peer as the measures see it: weights in, positions out, and what its components touch. Linear ones are
//! positions themselves; the others are features or gradients behind a solve.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;

use super::gradient_field::GradientField;
use super::linear::LinearBasis;
use sinew_trainer::evaluate::FeatureDecoder;
use sinew_trainer::features::acap::{NEUTRAL_FEATURE, gradient_of_feature};

/// Step of the central differences over rotations, in radians: error and rounding both near 1e-10.
const ROTATION_STEP: f64 = 1e-5;

/// V vertices, K components.
pub trait Model: Sync {
    /// K.
    fn component_count(&self) -> usize;
    /// Positions at `weights` (`[K]`), near the rest shape. Shape: `[V]`.
    fn pose(&self, weights: &[f64]) -> Vec<[f64; 3]>;
    /// Squared size of each component at each vertex, in the values it is stored in, at rest. Shape: `[K][V]`.
    fn energies(&self) -> Vec<Vec<f64>>;
    /// Elements a component stores (not zero), and numbers an element. Shape: `[K]`.
    fn stored(&self) -> (Vec<usize>, usize);
    /// How some vertices follow the weights.
    fn handles(&self, vertices: &[usize]) -> Box<dyn Handles + '_>;
    /// Derivative of all positions with respect to every weight. Shape: `[K][V]`.
    fn tangents(&self, weights: &[f64]) -> Vec<Vec<[f32; 3]>>;
}

/// Some vertices of a model, in the order they were asked for.
pub trait Handles: Sync {
    /// Where the first `count` are at `weights`.
    fn positions(&self, weights: &[f64], count: usize) -> Vec<[f64; 3]>;
    /// Their derivative. Shape: `[3 count][K]`.
    fn jacobian(&self, weights: &[f64], count: usize) -> DMatrix<f64>;
}

/// A linear basis of positions.
#[derive(Debug, Clone)]
pub struct PositionModel(pub LinearBasis);

impl Model for PositionModel {
    fn component_count(&self) -> usize {
        self.0.directions.len()
    }

    fn pose(&self, weights: &[f64]) -> Vec<[f64; 3]> {
        self.0.compose(weights).as_chunks::<3>().0.to_vec()
    }

    fn energies(&self) -> Vec<Vec<f64>> {
        (0..self.component_count()).map(|k| self.0.energy(k)).collect()
    }

    fn stored(&self) -> (Vec<usize>, usize) {
        (count_elements(&self.energies()), 3)
    }

    fn handles(&self, vertices: &[usize]) -> Box<dyn Handles + '_> {
        Box::new(PositionHandles {
            basis: &self.0,
            vertices: vertices.to_vec(),
        })
    }

    fn tangents(&self, _weights: &[f64]) -> Vec<Vec<[f32; 3]>> {
        let narrowed = |direction: &Vec<f64>| {
            direction
                .as_chunks::<3>()
                .0
                .iter()
                .map(|p| p.map(|x| x as f32))
                .collect()
        };
        self.0.directions.iter().map(narrowed).collect()
    }
}

struct PositionHandles<'b> {
    basis: &'b LinearBasis,
    vertices: Vec<usize>,
}

impl Handles for PositionHandles<'_> {
    fn positions(&self, weights: &[f64], count: usize) -> Vec<[f64; 3]> {
        let at = |v: usize, c: usize| {
            let directions = self.basis.directions.iter().zip(weights);
            self.basis.mean[3 * v + c] + directions.map(|(direction, w)| w * direction[3 * v + c]).sum::<f64>()
        };
        let vertices = self.vertices[..count].iter();
        vertices.map(|&v| core::array::from_fn(|c| at(v, c))).collect()
    }

    fn jacobian(&self, _weights: &[f64], count: usize) -> DMatrix<f64> {
        DMatrix::from_fn(3 * count, self.basis.directions.len(), |row, k| {
            self.basis.directions[k][3 * self.vertices[row / 3] + row % 3]
        })
    }
}

/// From weights to nine scaled values an element; the reference is all zeros.
pub trait Decoder: Sync {
    /// K.
    fn component_count(&self) -> usize;
    /// Values at `weights`. Shape: `[E]`.
    fn values(&self, weights: &[f64]) -> Vec<[f64; 9]>;
    /// Their derivatives, elements without one left out. Shape: `[K]`.
    fn derivatives(&self, weights: &[f64]) -> Vec<Vec<(u32, [f64; 9])>>;
}

impl Decoder for LinearBasis {
    fn component_count(&self) -> usize {
        self.directions.len()
    }

    fn values(&self, weights: &[f64]) -> Vec<[f64; 9]> {
        self.compose(weights).as_chunks::<9>().0.to_vec()
    }

    fn derivatives(&self, _weights: &[f64]) -> Vec<Vec<(u32, [f64; 9])>> {
        let sparse = |direction: &Vec<f64>| {
            let elements = direction.as_chunks::<9>().0.iter().enumerate();
            let present = elements.filter(|(_, x)| x.iter().any(|&x| x != 0.0));
            present.map(|(e, x)| (e as u32, *x)).collect()
        };
        self.directions.iter().map(sparse).collect()
    }
}

impl Decoder for FeatureDecoder {
    fn component_count(&self) -> usize {
        self.component_count()
    }

    fn values(&self, weights: &[f64]) -> Vec<[f64; 9]> {
        self.decode_all(weights)
    }

    fn derivatives(&self, weights: &[f64]) -> Vec<Vec<(u32, [f64; 9])>> {
        self.derivatives(weights)
    }
}

/// A decoder of features, and the solve behind it.
pub struct GradientModel<'m> {
    /// Weights to values.
    pub decoder: Box<dyn Decoder + 'm>,
    /// Gradients to positions.
    pub field: &'m dyn GradientField,
    /// Feature units in one of the decoder's.
    pub scales: [f64; 9],
}

impl GradientModel<'_> {
    fn features(&self, weights: &[f64]) -> Vec<[f64; 9]> {
        let values = self.decoder.values(weights);
        let scaled = |x: &[f64; 9]| core::array::from_fn(|c| NEUTRAL_FEATURE[c] + self.scales[c] * x[c]);
        values.iter().map(scaled).collect()
    }

    /// Derivatives of the gradients T. Shape: `[K]`, elements without one left out.
    fn gradient_derivatives(&self, weights: &[f64]) -> Vec<Vec<(u32, Matrix3<f64>)>> {
        let slopes: Vec<[Matrix3<f64>; 9]> = self.features(weights).par_iter().map(gradient_slopes).collect();
        let derivatives = self.decoder.derivatives(weights);
        derivatives
            .par_iter()
            .map(|derivative| {
                let elements = derivative.iter();
                let chained = elements.map(|&(e, x)| {
                    let slopes = &slopes[e as usize];
                    (e, (0..9).map(|c| slopes[c] * (self.scales[c] * x[c])).sum())
                });
                chained.collect()
            })
            .collect()
    }

    fn deviations(&self, weights: &[f64]) -> Vec<Matrix3<f64>> {
        let features = self.features(weights);
        features
            .iter()
            .map(|x| gradient_of_feature(x) - Matrix3::identity())
            .collect()
    }
}

/// Derivatives of `T = exp(r) S` with respect to the nine numbers of a feature.
fn gradient_slopes(feature: &[f64; 9]) -> [Matrix3<f64>; 9] {
    core::array::from_fn(|c| {
        // T is linear in S: there any step is exact.
        let step = if c < 3 { ROTATION_STEP } else { 1.0 };
        let shifted = |by: f64| {
            let mut feature = *feature;
            feature[c] += by;
            gradient_of_feature(&feature)
        };
        (shifted(step) - shifted(-step)) / (2.0 * step)
    })
}

impl Model for GradientModel<'_> {
    fn component_count(&self) -> usize {
        self.decoder.component_count()
    }

    fn pose(&self, weights: &[f64]) -> Vec<[f64; 3]> {
        let mut positions = self.field.displacements(&self.deviations(weights));
        for (position, rest) in positions.iter_mut().zip(self.field.rest()) {
            for c in 0..3 {
                position[c] += rest[c];
            }
        }
        positions
    }

    fn energies(&self) -> Vec<Vec<f64>> {
        let at_rest = self.decoder.derivatives(&vec![0.0; self.component_count()]);
        let spread = |derivative: &Vec<(u32, [f64; 9])>| {
            let mut energies = vec![0.0; self.field.element_count()];
            for (e, x) in derivative {
                energies[*e as usize] = x.iter().map(|x| x * x).sum();
            }
            self.field.to_vertices(&energies)
        };
        at_rest.iter().map(spread).collect()
    }

    fn stored(&self) -> (Vec<usize>, usize) {
        let at_rest = self.decoder.derivatives(&vec![0.0; self.component_count()]);
        (at_rest.iter().map(Vec::len).collect(), 9)
    }

    fn handles(&self, vertices: &[usize]) -> Box<dyn Handles + '_> {
        Box::new(GradientHandles {
            model: self,
            vertices: vertices.to_vec(),
            influences: vertices.par_iter().map(|&v| self.field.influence(v)).collect(),
        })
    }

    fn tangents(&self, weights: &[f64]) -> Vec<Vec<[f32; 3]>> {
        let derivatives = self.gradient_derivatives(weights);
        derivatives
            .par_iter()
            .map(|derivative| {
                let mut deviations = vec![Matrix3::zeros(); self.field.element_count()];
                for (e, gradient) in derivative {
                    deviations[*e as usize] = *gradient;
                }
                let moved = self.field.displacements(&deviations);
                moved.iter().map(|p| p.map(|x| x as f32)).collect()
            })
            .collect()
    }
}

struct GradientHandles<'m> {
    model: &'m GradientModel<'m>,
    vertices: Vec<usize>,
    /// Shape: `[vertices][E]`.
    influences: Vec<Vec<[f64; 3]>>,
}

impl Handles for GradientHandles<'_> {
    fn positions(&self, weights: &[f64], count: usize) -> Vec<[f64; 3]> {
        let deviations = self.model.deviations(weights);
        let handles = self.influences[..count].par_iter().zip(&self.vertices);
        handles
            .map(|(influence, &v)| {
                let elements = deviations.iter().zip(influence);
                let moved: Vector3<f64> = elements.map(|(d, u)| d * Vector3::from(*u)).sum();
                (moved + Vector3::from(self.model.field.rest()[v])).into()
            })
            .collect()
    }

    fn jacobian(&self, weights: &[f64], count: usize) -> DMatrix<f64> {
        let derivatives = self.model.gradient_derivatives(weights);
        let columns: Vec<Vec<[f64; 3]>> = derivatives
            .par_iter()
            .map(|derivative| {
                let follow = |influence: &Vec<[f64; 3]>| -> [f64; 3] {
                    let elements = derivative.iter();
                    elements
                        .map(|(e, d)| d * Vector3::from(influence[*e as usize]))
                        .sum::<Vector3<f64>>()
                        .into()
                };
                self.influences[..count].iter().map(follow).collect()
            })
            .collect();
        DMatrix::from_fn(3 * count, columns.len(), |row, k| columns[k][row / 3][row % 3])
    }
}

pub(super) fn count_elements(energies: &[Vec<f64>]) -> Vec<usize> {
    energies
        .iter()
        .map(|energy| energy.iter().filter(|&&e| e != 0.0).count())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sinew_trainer::features::reconstruct::PoissonSystem;
    use sinew_trainer::mesh::cotangent::EdgeWeights;
    use sinew_trainer::mesh::shapes::tube;
    use sinew_trainer::mesh::topology::Topology;

    #[test]
    fn handles_and_tangents_are_the_poses_own() {
        /// Second-order remainder of a step of 1e-4, and f32 tangents.
        const TOLERANCE: f64 = 1e-3;
        let (rest, faces) = tube(8, 6, 2.0);
        let topology = Topology::new(&faces, &rest);
        let weights = EdgeWeights::new(&topology, &rest);
        let system = PoissonSystem::new(&topology, &weights, &rest, 0).expect("definite");
        let wave = |seed: usize| {
            (0..9 * rest.len())
                .map(|d| 0.2 * ((d * seed) as f64).sin())
                .collect::<Vec<f64>>()
        };
        let mut second = wave(5);
        second[..45].fill(0.0);
        let basis = LinearBasis {
            width: 9,
            mean: vec![0.0; 9 * rest.len()],
            directions: vec![wave(3), second],
        };
        let model = GradientModel {
            decoder: Box::new(basis),
            field: &system,
            scales: [1.5, 1.5, 1.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5],
        };
        assert_eq!(model.stored(), (vec![rest.len(), rest.len() - 5], 9));
        let at = [0.7, -0.4];
        let vertices = [3, rest.len() - 1];
        let (posed, handles) = (model.pose(&at), model.handles(&vertices));
        for (handle, &v) in handles.positions(&at, 2).iter().zip(&vertices) {
            assert!((Vector3::from(*handle) - Vector3::from(posed[v])).norm() < 1e-9);
        }
        let (tangents, jacobian) = (model.tangents(&at), handles.jacobian(&at, 2));
        for k in 0..2 {
            let step = 1e-4;
            let mut ahead = at;
            ahead[k] += step;
            let ahead = model.pose(&ahead);
            for (row, &v) in vertices.iter().enumerate() {
                for c in 0..3 {
                    let slope = (ahead[v][c] - posed[v][c]) / step;
                    assert!((slope - f64::from(tangents[k][v][c])).abs() < TOLERANCE);
                    assert!((slope - jacobian[(3 * row + c, k)]).abs() < TOLERANCE);
                }
            }
        }
    }
}
