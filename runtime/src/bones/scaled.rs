//! Affine maps to translation, rotation and scale, for engines that animate joints by these three.

use sinew_formats::package::BonesView;

use super::pose::{Map, centre};

/// A joint in the space of the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct BoneTransform {
    /// Units of the source.
    pub translation: [f32; 3],
    /// Unit quaternion x y z w; w is not negative.
    pub rotation: [f32; 4],
    /// Along the joint's own axes.
    pub scale: [f32; 3],
}

/// Steps of the polar decomposition: each doubles the digits once the matrix is near a rotation.
const POLAR_STEPS: usize = 8;
/// A linear part of less determinant has been turned inside out or flat: it has no rotation, and the rest's is given.
const LEAST_DETERMINANT: f32 = 1e-9;

/// Column-major.
type Matrix = [[f32; 3]; 3];

/// Bone `b` of a map.
pub(super) fn scaled(bones: &BonesView<'_>, b: usize, [x, y, z, offset]: &Map) -> BoneTransform {
    let mut linear: Matrix = [x, y, z].map(|column| [column[0], column[1], column[2]]);
    let (place, centre) = (&bones.rest_places[b], centre(bones));
    let arm: [f32; 3] = core::array::from_fn(|c| place[c] - centre[c]);
    let translation = core::array::from_fn(|c| {
        place[c] + (offset[c] + linear[0][c] * arm[0] + linear[1][c] * arm[1] + linear[2][c] * arm[2])
    });
    for c in 0..3 {
        linear[c][c] += 1.0;
    }
    let rotation = rotation_of(&linear);
    let axes = of_quaternion(&bones.axes[b]);
    // A stretch S = R^T T along each axis a: a . S a = R a . T a.
    let scale = axes.map(|axis| dot(&times(&rotation, &axis), &times(&linear, &axis)));
    let joint = axes.map(|axis| times(&rotation, &axis));
    BoneTransform {
        translation,
        rotation: quaternion(&joint),
        scale,
    }
}

/// A bone at rest.
pub(super) fn at_rest(bones: &BonesView<'_>, b: usize) -> BoneTransform {
    BoneTransform {
        translation: bones.rest_places[b],
        rotation: positive(bones.axes[b]),
        scale: [1.0; 3],
    }
}

/// The rotation nearest to a matrix, by the iteration `R <- (R + R^-T) / 2`.
fn rotation_of(linear: &Matrix) -> Matrix {
    let mut r = *linear;
    for _ in 0..POLAR_STEPS {
        let cofactors = cofactors(&r);
        let determinant = dot(&r[0], &cofactors[0]);
        if determinant.is_nan() || determinant < LEAST_DETERMINANT {
            return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        }
        // R^-T is the cofactors over the determinant.
        let share = 0.5 / determinant;
        for (column, cofactors) in r.iter_mut().zip(&cofactors) {
            for (x, cofactor) in column.iter_mut().zip(cofactors) {
                *x = 0.5 * *x + share * cofactor;
            }
        }
    }
    r
}

/// Column c is the cross product of the other two: how areas turn and grow.
pub(super) fn cofactors([x, y, z]: &Matrix) -> Matrix {
    [cross(y, z), cross(z, x), cross(x, y)]
}

pub(super) fn cross(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    core::array::from_fn(|n| {
        let (i, j) = ((n + 1) % 3, (n + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

pub(super) fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn times([x, y, z]: &Matrix, v: &[f32; 3]) -> [f32; 3] {
    core::array::from_fn(|c| x[c] * v[0] + y[c] * v[1] + z[c] * v[2])
}

fn of_quaternion(&[x, y, z, w]: &[f32; 4]) -> Matrix {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + w * z),
            2.0 * (x * z - w * y),
        ],
        [
            2.0 * (x * y - w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + w * x),
        ],
        [
            2.0 * (x * z + w * y),
            2.0 * (y * z - w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// Of a rotation; divides by the greatest of the four numbers, so that none is lost.
fn quaternion([x, y, z]: &Matrix) -> [f32; 4] {
    let [xx, yy, zz] = [x[0], y[1], z[2]];
    let squares = [
        1.0 + xx - yy - zz,
        1.0 - xx + yy - zz,
        1.0 - xx - yy + zz,
        1.0 + xx + yy + zz,
    ];
    let greatest = (0..4).fold(0, |best, n| if squares[n] > squares[best] { n } else { best });
    let (a, b, c) = (y[2] - z[1], z[0] - x[2], x[1] - y[0]);
    let (d, e, f) = (x[1] + y[0], z[0] + x[2], y[2] + z[1]);
    let row = match greatest {
        0 => [squares[0], d, e, a],
        1 => [d, squares[1], f, b],
        2 => [e, f, squares[2], c],
        _ => [a, b, c, squares[3]],
    };
    let length = libm::sqrtf(row.iter().map(|x| x * x).sum());
    positive(row.map(|x| x / length))
}

/// Of the two that are one rotation, the one whose w is not negative.
fn positive(q: [f32; 4]) -> [f32; 4] {
    if q[3] < 0.0 { q.map(|x| -x) } else { q }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Roundings of a few products.
    const TOLERANCE: f32 = 2e-6;

    fn far(a: &Matrix, b: &Matrix) -> f32 {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn quaternions_and_matrices_are_one_rotation() {
        for q in [
            [0.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.6, 0.8, 0.0],
            [0.5, -0.5, 0.5, 0.5],
            [0.1, 0.7, -0.1, 0.7],
        ] {
            let matrix = of_quaternion(&q);
            let length = libm::sqrtf(q.iter().map(|x| x * x).sum());
            let found = quaternion(&matrix);
            if (length - 1.0).abs() < 1e-6 {
                let same = |sign: f32| q.iter().zip(&found).all(|(a, b)| (a - sign * b).abs() < TOLERANCE);
                assert!(same(1.0) || same(-1.0), "{q:?} {found:?}");
                assert!(found[3] >= 0.0);
            }
        }
    }

    #[test]
    fn the_nearest_rotation_of_a_stretched_one_is_found_and_none_of_a_mirror() {
        let rotation = of_quaternion(&[0.5, -0.5, 0.5, 0.5]);
        let stretch: Matrix = [[1.5, 0.2, 0.0], [0.2, 0.7, -0.1], [0.0, -0.1, 1.1]];
        let stretched = stretch.map(|column| times(&rotation, &column));
        assert!(far(&rotation_of(&stretched), &rotation) < TOLERANCE);
        let mirror: Matrix = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let identity = of_quaternion(&[0.0, 0.0, 0.0, 1.0]);
        assert_eq!(rotation_of(&mirror), identity);
        assert_eq!(rotation_of(&[[f32::NAN; 3]; 3]), identity);
        assert_eq!(rotation_of(&[[0.0; 3]; 3]), identity);
    }
}
