//! Polar decomposition T = R S: from a deformation gradient to a proper rotation and a symmetric stretch.
//!
//! Built on a one-sided Jacobi decomposition of 3 x 3 matrices, so that flat, flipped and zero gradients have an answer too.

use nalgebra::{Matrix3, Vector3};

/// No principal stretch leaves this range: beyond it speaks a degenerate triangle, not the shape.
pub const STRETCH_BOUND: f64 = 10.0;

/// A column counts as zero below this share of the largest: its direction is rounding.
const ZERO_COLUMN: f64 = 1e-14;

/// Sweeps of Jacobi rotations; a 3 x 3 matrix takes four or five.
const SWEEP_LIMIT: usize = 30;

/// `T = R S`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Polar {
    /// R: proper, determinant +1 also where T is a reflection.
    pub rotation: Matrix3<f64>,
    /// S: symmetric; where T flips orientation its smallest principal stretch is negative.
    pub stretch: Matrix3<f64>,
}

impl Polar {
    /// The rotation nearest to `gradient`, and the stretch before it with its principal values held within
    /// [`STRETCH_BOUND`]. Finite for every finite matrix.
    pub fn of(gradient: &Matrix3<f64>) -> Polar {
        let (left, values, right) = signed_singular(gradient);
        let bounded = values.map(|value| value.clamp(-STRETCH_BOUND, STRETCH_BOUND));
        let stretch = right * Matrix3::from_diagonal(&bounded) * right.transpose();
        Polar {
            rotation: left * right.transpose(),
            stretch: (stretch + stretch.transpose()) * 0.5,
        }
    }
}

/// `U diag(values) V^T` with U and V proper rotations, `|values|` falling, only the last possibly negative.
fn signed_singular(matrix: &Matrix3<f64>) -> (Matrix3<f64>, Vector3<f64>, Matrix3<f64>) {
    let mut columns = *matrix;
    let mut right = Matrix3::identity();
    for _ in 0..SWEEP_LIMIT {
        let mut turned = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (alpha, beta) = (columns.column(p).norm_squared(), columns.column(q).norm_squared());
            let gamma = columns.column(p).dot(&columns.column(q));
            if gamma.abs() <= f64::EPSILON * (alpha * beta).sqrt() {
                continue;
            }
            turned = true;
            let zeta = (beta - alpha) / (2.0 * gamma);
            let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
            let sine = cosine * tangent;
            for m in [&mut columns, &mut right] {
                let (a, b) = (m.column(p).clone_owned(), m.column(q).clone_owned());
                m.set_column(p, &(a * cosine - b * sine));
                m.set_column(q, &(a * sine + b * cosine));
            }
        }
        if !turned {
            break;
        }
    }
    let mut order = [0, 1, 2];
    let norms = [0, 1, 2].map(|n| columns.column(n).norm());
    order.sort_by(|&a, &b| norms[b].total_cmp(&norms[a]));
    let columns = Matrix3::from_columns(&order.map(|n| columns.column(n).clone_owned()));
    let mut right = Matrix3::from_columns(&order.map(|n| right.column(n).clone_owned()));
    let mut columns = columns;
    if right.determinant() < 0.0 {
        right.set_column(2, &-right.column(2));
        columns.set_column(2, &-columns.column(2));
    }
    let [first, second, _] = order.map(|n| norms[n]);
    // Missing directions are filled from the right side, so that a zero matrix has the identity as its rotation.
    let u0 = if first > 0.0 {
        columns.column(0) / first
    } else {
        right.column(0).clone_owned()
    };
    let u1 = if second > ZERO_COLUMN * first {
        let along = columns.column(1) / second;
        (along - u0 * u0.dot(&along)).normalize()
    } else {
        perpendicular(u0, right.column(1).clone_owned())
    };
    let u2 = u0.cross(&u1);
    let values = Vector3::new(first, u1.dot(&columns.column(1)), u2.dot(&columns.column(2)));
    (Matrix3::from_columns(&[u0, u1, u2]), values, right)
}

/// A unit vector perpendicular to the unit vector `axis`, as near to `wish` as can be.
fn perpendicular(axis: Vector3<f64>, wish: Vector3<f64>) -> Vector3<f64> {
    let across = wish - axis * axis.dot(&wish);
    if across.norm_squared() > 1e-6 {
        return across.normalize();
    }
    let least = axis.iamin();
    let mut unit = Vector3::zeros();
    unit[least] = 1.0;
    (unit - axis * axis[least]).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// Rounding of products of 3 x 3 matrices of norm about 1.
    const TOLERANCE: f64 = 1e-13;

    fn check(gradient: Matrix3<f64>) -> Polar {
        let polar = Polar::of(&gradient);
        assert!(
            (polar.rotation * polar.stretch - gradient).norm() <= TOLERANCE * gradient.norm().max(1.0),
            "{gradient}"
        );
        assert!((polar.rotation.transpose() * polar.rotation - Matrix3::identity()).norm() < TOLERANCE);
        assert!((polar.rotation.determinant() - 1.0).abs() < TOLERANCE);
        polar
    }

    #[test]
    fn recovers_rotation_and_stretch() {
        let rotation = Rotation3::from_euler_angles(0.4, -1.1, 2.9).into_inner();
        let stretch = Matrix3::new(1.2, 0.1, -0.2, 0.1, 0.8, 0.05, -0.2, 0.05, 1.0);
        let polar = check(rotation * stretch);
        assert!((polar.rotation - rotation).norm() < TOLERANCE);
        assert!((polar.stretch - stretch).norm() < TOLERANCE);
    }

    #[test]
    fn flips_flat_and_zero_gradients_have_an_answer() {
        check(Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -0.3)));
        check(Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0)));
        check(Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0));
        check(Matrix3::from_element(0.7));
        check(Matrix3::new(0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0));
        assert_eq!(check(Matrix3::zeros()).rotation, Matrix3::identity());
        assert_eq!(Polar::of(&Matrix3::identity()).stretch, Matrix3::identity());
    }

    #[test]
    fn stretch_is_bounded() {
        let polar = Polar::of(&Matrix3::from_diagonal(&Vector3::new(1e9, 1.0, 1.0)));
        assert!((polar.stretch[(0, 0)] - STRETCH_BOUND).abs() < TOLERANCE);
    }
}
