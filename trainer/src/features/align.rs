//! Rigid motion of each shape onto the reference (method section 1): shapes of the sequence -> aligned shapes -> features.
//! What a shape is after its motion is what features describe; the motion is kept beside them.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::polar::Polar;
pub use crate::mesh::widened;

/// `p -> rotation p + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidMotion {
    /// Proper rotation.
    pub rotation: Matrix3<f64>,
    /// Units of the source.
    pub translation: Vector3<f64>,
}

/// A shape laid onto the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignedShape {
    /// Shape: `[V][3]`, units of the source.
    pub positions: Vec<[f64; 3]>,
    /// What took the shape here from where it was.
    pub motion: RigidMotion,
}

impl RigidMotion {
    /// The motion that brings `shape` nearest to `reference`, vertex by vertex in the least-squares sense, without
    /// reflection. Both of shape `[V][3]`; the identity's rotation where the shapes have no extent.
    pub fn onto(reference: &[[f64; 3]], shape: &[[f64; 3]]) -> RigidMotion {
        let (to, from) = (centroid(reference), centroid(shape));
        let mut covariance = Matrix3::zeros();
        for (target, source) in reference.iter().zip(shape) {
            covariance += (Vector3::from(*target) - to) * (Vector3::from(*source) - from).transpose();
        }
        // Of all rotations the polar one has the largest trace against the covariance (Kabsch).
        let rotation = Polar::of(&covariance).rotation;
        RigidMotion {
            rotation,
            translation: to - rotation * from,
        }
    }

    /// The point after the motion.
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        (self.rotation * Vector3::from(point) + self.translation).into()
    }

    /// The point before the motion.
    pub fn undo(&self, point: [f64; 3]) -> [f64; 3] {
        (self.rotation.transpose() * (Vector3::from(point) - self.translation)).into()
    }
}

/// Every shape aligned to `reference`. Shapes: `[N][V][3]`.
pub fn align_shapes<S: AsRef<[[f32; 3]]> + Sync>(reference: &[[f64; 3]], shapes: &[S]) -> Vec<AlignedShape> {
    shapes
        .par_iter()
        .map(|shape| {
            let positions = widened(shape.as_ref());
            let motion = RigidMotion::onto(reference, &positions);
            AlignedShape {
                positions: positions.into_iter().map(|p| motion.apply(p)).collect(),
                motion,
            }
        })
        .collect()
}

fn centroid(shape: &[[f64; 3]]) -> Vector3<f64> {
    let sum = shape.iter().fold(Vector3::zeros(), |sum, p| sum + Vector3::from(*p));
    sum / shape.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, sphere};
    use nalgebra::Rotation3;

    /// Rounding over a sum of some hundred products.
    const TOLERANCE: f64 = 1e-12;

    #[test]
    fn undoes_a_rigid_motion() {
        for (rest, _) in [sphere(2), grid(5, 3, 0.5)] {
            let rotation = Rotation3::from_euler_angles(2.5, 0.3, -1.0);
            let moved: Vec<[f64; 3]> = rest
                .iter()
                .map(|p| (rotation * Vector3::from(*p) + Vector3::new(1.0, 2.0, 3.0)).into())
                .collect();
            let motion = RigidMotion::onto(&rest, &moved);
            for (p, q) in rest.iter().zip(&moved) {
                assert!((Vector3::from(motion.apply(*q)) - Vector3::from(*p)).norm() < TOLERANCE);
                assert!((Vector3::from(motion.undo(*p)) - Vector3::from(*q)).norm() < TOLERANCE);
            }
        }
    }

    #[test]
    fn a_mirror_image_is_not_reflected_back() {
        let rest = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
        let mirrored = rest.map(|p| [-p[0], p[1], p[2]]);
        assert!((RigidMotion::onto(&rest, &mirrored).rotation.determinant() - 1.0).abs() < TOLERANCE);
        assert!((RigidMotion::onto(&[[1.0; 3]], &[[2.0; 3]]).rotation - Matrix3::identity()).norm() < TOLERANCE);
    }
}
