//! The axes along which a bone is scaled where an engine knows only such scales: those in which its stretches, over many
//! poses, are nearest to diagonal.

use nalgebra::{Rotation3, UnitQuaternion};

use super::Matrix;
use super::cells::rotation;

/// Sweeps of plane rotations; stretches of one bone are nearly of one frame, so a few do.
const SWEEPS: usize = 12;

/// A unit quaternion x y z w that turns the coordinate axes onto the bone's. Shape: `gradients` `[poses]`, `T` of one bone.
pub(super) fn axes(gradients: &[Matrix]) -> [f32; 4] {
    let mut stretches: Vec<Matrix> = gradients
        .iter()
        .map(|gradient| {
            let stretch = rotation(gradient).transpose() * gradient;
            0.5 * (stretch + stretch.transpose()) - Matrix::identity()
        })
        .collect();
    let mut axes = Matrix::identity();
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let turn = plane_rotation(&stretches, p, q);
            stretches.iter_mut().for_each(|s| *s = turn.transpose() * *s * turn);
            axes *= turn;
        }
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    [q.i, q.j, q.k, q.w].map(|x| x as f32)
}

/// The rotation in the plane of two axes that leaves least off the diagonals of all matrices together (Cardoso and Souloumiac
/// 1996).
fn plane_rotation(matrices: &[Matrix], p: usize, q: usize) -> Matrix {
    let (mut on, mut off) = (0.0, 0.0);
    for m in matrices {
        let (difference, twice) = (m[(p, p)] - m[(q, q)], 2.0 * m[(p, q)]);
        on += difference * difference - twice * twice;
        off += 2.0 * difference * twice;
    }
    let angle = 0.5 * off.atan2(on + on.hypot(off));
    let angle = if angle.is_finite() { angle } else { 0.0 };
    let mut turn = Matrix::identity();
    let (sine, cosine) = angle.sin_cos();
    turn[(p, p)] = cosine;
    turn[(q, q)] = cosine;
    turn[(p, q)] = -sine;
    turn[(q, p)] = sine;
    turn
}

#[cfg(test)]
mod tests {
    use nalgebra::{Quaternion, Vector3};

    use super::*;

    #[test]
    fn stretches_of_one_frame_are_diagonal_in_it() {
        let frame = Rotation3::new(Vector3::new(0.3, -0.8, 0.5)).into_inner();
        let stretched = |x: f64, y: f64, z: f64, turn: f64| {
            let stretch = frame * Matrix::from_diagonal(&Vector3::new(x, y, z)) * frame.transpose();
            Rotation3::new(Vector3::new(0.0, turn, 1.0)).into_inner() * stretch
        };
        let gradients = [
            stretched(1.5, 0.8, 1.0, 0.2),
            stretched(0.9, 1.3, 0.7, -2.0),
            stretched(1.1, 1.0, 1.4, 1.0),
        ];
        let [x, y, z, w] = axes(&gradients).map(f64::from);
        let found = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
            .to_rotation_matrix()
            .into_inner();
        for gradient in gradients {
            let stretch = found.transpose() * rotation(&gradient).transpose() * gradient * found;
            for (r, c) in [(0, 1), (0, 2), (1, 2)] {
                assert!(stretch[(r, c)].abs() < 1e-6, "{stretch}");
            }
        }
        // Nothing is stretched: any frame will do.
        let q = axes(&[Matrix::identity(); 3]);
        assert!((q.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-6);
    }
}
