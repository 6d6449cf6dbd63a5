//! Sparse localized decomposition of deformation gradients: Huang, Yao, Zhong, Liu, Guo, *Sparse Localized Decomposition of
//! Deformation Gradients* (Computer Graphics Forum 33(7), 2014). The gradient of every face (not of a vertex) is split by
//! polar decomposition into a rotation, kept as its logarithm, and a stretch; the two fields are factored apart, each by the
//! sparse localized decomposition of [`super::splocs`]; blended gradients become positions by least squares.
//!
//! As published, logarithms are those of single rotations, wrapped at half a turn: that nothing makes them consistent over
//! the surface is what the as-consistent-as-possible features came to cure. The budget is shared equally: rotations get
//! the odd component.

use nalgebra::{Rotation3, UnitQuaternion};
use rayon::prelude::*;

use super::gradient_field::FaceField;
use super::linear::LinearBasis;
use super::splocs::{SplocsSettings, splocs};
use sinew_trainer::features::acap::NEUTRAL_FEATURE;
use sinew_trainer::features::polar::Polar;

/// Rotation logarithm and stretch less the identity of every face, shape `[F x 9]`, of a shape aligned to the rest shape.
pub fn face_features(field: &FaceField, shape: &[[f64; 3]]) -> Vec<f64> {
    let gradients = field.gradients(shape);
    gradients
        .iter()
        .flat_map(|gradient| {
            let Polar { rotation, stretch: s } = Polar::of(gradient);
            // By way of quaternions: rounding near no turn and near half a turn does no harm there.
            let r = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)).scaled_axis();
            let feature = [
                r[0],
                r[1],
                r[2],
                s[(0, 0)],
                s[(0, 1)],
                s[(0, 2)],
                s[(1, 1)],
                s[(1, 2)],
                s[(2, 2)],
            ];
            core::array::from_fn::<f64, 9, _>(|c| feature[c] - NEUTRAL_FEATURE[c])
        })
        .collect()
}

/// Factors `samples` (shape `[N][F x 9]`, from [`face_features`]) into K components in all. `distances(v)`: from a vertex
/// along the surface, shape `[V]`, the longest on the mesh being 1.
pub fn huang(
    field: &FaceField,
    samples: &[Vec<f64>],
    distances: &(dyn Fn(usize) -> Vec<f32> + Sync),
    component_count: usize,
) -> LinearBasis {
    let faces = field.faces();
    let of_faces = |f: usize| -> Vec<f32> {
        let of_vertices = distances(faces[f][0] as usize);
        let mean = |face: &[u32; 3]| face.iter().map(|&v| of_vertices[v as usize]).sum::<f32>() / 3.0;
        faces.iter().map(mean).collect()
    };
    let part = |first: usize, width: usize, count: usize| {
        let values: Vec<Vec<f64>> = samples
            .par_iter()
            .map(|sample| {
                sample
                    .chunks_exact(9)
                    .flat_map(|x| &x[first..first + width])
                    .copied()
                    .collect()
            })
            .collect();
        splocs(&values, width, &of_faces, &SplocsSettings::published(count))
    };
    let stretch_count = component_count / 2;
    let rotations = part(0, 3, component_count - stretch_count);
    let stretches = part(3, 6, stretch_count);
    let joined = |rotation: Option<&Vec<f64>>, stretch: Option<&Vec<f64>>| {
        let mut values = vec![0.0; 9 * faces.len()];
        for (f, x) in values.chunks_exact_mut(9).enumerate() {
            if let Some(rotation) = rotation {
                x[..3].copy_from_slice(&rotation[3 * f..3 * f + 3]);
            }
            if let Some(stretch) = stretch {
                x[3..].copy_from_slice(&stretch[6 * f..6 * f + 6]);
            }
        }
        values
    };
    let turning = rotations
        .directions
        .iter()
        .map(|direction| joined(Some(direction), None));
    let stretching = stretches
        .directions
        .iter()
        .map(|direction| joined(None, Some(direction)));
    LinearBasis {
        width: 9,
        mean: joined(Some(&rotations.mean), Some(&stretches.mean)),
        directions: turning.chain(stretching).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::model::{GradientModel, Model};
    use sinew_trainer::features::align::{RigidMotion, widened};
    use sinew_trainer::mesh::geodesic::HeatMethod;
    use sinew_trainer::mesh::topology::Topology;
    use sinew_trainer::synthesize::{Settings, Subject};

    #[test]
    fn all_components_give_the_training_shapes_back_and_few_do_not() {
        let settings = Settings {
            frames: 4,
            vertices: 150,
            seed: 1,
        };
        let sequence = Subject::Bar.synthesize(&settings).expect("a bar");
        let rest = widened(&sequence.shapes[0]);
        let topology = Topology::new(&sequence.faces, &rest);
        let heat = HeatMethod::new(&topology, &rest).expect("definite");
        let distances = |v: usize| heat.normalised_distances(v).iter().map(|&d| d as f32).collect();
        let field = FaceField::new(&topology, &rest).expect("definite");
        let shapes: Vec<Vec<[f64; 3]>> = sequence.shapes.iter().map(widened).collect();
        let samples: Vec<Vec<f64>> = shapes.iter().map(|shape| face_features(&field, shape)).collect();
        let error = |count: usize| -> f64 {
            let model = GradientModel {
                decoder: Box::new(huang(&field, &samples, &distances, count)),
                field: &field,
                scales: [1.0; 9],
            };
            let basis = huang(&field, &samples, &distances, count);
            let areas = field.areas();
            let projection = super::super::linear::LinearProjection::new(&basis, &areas);
            let errors = shapes.iter().zip(&samples).map(|(shape, sample)| {
                let posed = model.pose(&projection.weights(sample));
                let motion = RigidMotion::onto(shape, &posed);
                let pairs = posed.iter().map(|&p| motion.apply(p)).zip(shape);
                pairs
                    .map(|(p, q)| (0..3).map(|c| (p[c] - q[c]).powi(2)).sum::<f64>())
                    .sum::<f64>()
            });
            (errors.sum::<f64>() / (4 * rest.len()) as f64).sqrt()
        };
        let (few, many) = (error(2), error(24));
        assert!(many < 0.5 * few, "{few} with 2 components, {many} with 24");
    }
}
