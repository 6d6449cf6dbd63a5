//! Displacements to what a renderer wants: positions in source order, and vertex normals.

use libm::sqrtf;

use super::gradient::cross;
use super::poisson::Lane;

/// Normal of a vertex without area around it: unused, or all its triangles are degenerate.
pub const FALLBACK_NORMAL: [f32; 3] = [0.0, 0.0, 1.0];

/// `positions[vertex_from_solver[s]] = rest[s] + displacement[s]`. Shape: all `[V]`, `displacement` at least;
/// `positions` in source order.
///
/// Errors: the first vertex, in solver order, whose position is not finite; then `positions` is only partly written.
pub(crate) fn scatter(
    rest: &[[f32; 3]],
    displacement: &[Lane],
    vertex_from_solver: &[u32],
    positions: &mut [[f32; 3]],
) -> Result<(), u32> {
    for ((r, d), &v) in rest.iter().zip(displacement).zip(vertex_from_solver) {
        let p = [r[0] + d[0], r[1] + d[1], r[2] + d[2]];
        if !p.iter().all(|x| x.is_finite()) {
            return Err(v);
        }
        positions[v as usize] = p;
    }
    Ok(())
}

/// Unit vertex normals, the sum of the triangles' normals times their area. Shape: `faces` `[F]`, the rest `[V]`.
///
/// A vertex without area gets [`FALLBACK_NORMAL`].
pub(crate) fn normals(faces: &[[u32; 3]], positions: &[[f32; 3]], normals: &mut [[f32; 3]]) {
    normals.fill([0.0; 3]);
    for face in faces {
        let [p, q, r] = face.map(|v| positions[v as usize]);
        let n = cross(
            &[q[0] - p[0], q[1] - p[1], q[2] - p[2]],
            &[r[0] - p[0], r[1] - p[1], r[2] - p[2]],
        );
        for &v in face {
            let sum = &mut normals[v as usize];
            for c in 0..3 {
                sum[c] += n[c];
            }
        }
    }
    for n in normals {
        *n = unit(n);
    }
}

fn unit(n: &[f32; 3]) -> [f32; 3] {
    // Divide by the largest entry first: the square of a small or a large area would leave f32.
    let largest = n[0].abs().max(n[1].abs()).max(n[2].abs());
    let m = n.map(|x| x / largest);
    let length = sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    // Zero or overflowed area: the quotient above is not a number.
    if length.is_finite() && length > 0.0 {
        m.map(|x| x / length)
    } else {
        FALLBACK_NORMAL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a unit vector.
    const TOLERANCE: f32 = 1e-6;

    #[test]
    fn scatter_follows_the_permutation() {
        let rest = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        let displacement = [[0.0, 0.5, 0.0, 0.0]; 3];
        let mut positions = [[0.0; 3]; 3];
        assert_eq!(scatter(&rest, &displacement, &[2, 0, 1], &mut positions), Ok(()));
        assert_eq!(positions, [[2.0, 0.5, 0.0], [3.0, 0.5, 0.0], [1.0, 0.5, 0.0]]);
    }

    #[test]
    fn scatter_names_the_vertex_that_is_not_finite() {
        for bad in [f32::NAN, f32::INFINITY] {
            let displacement = [[0.0; 4], [0.0, bad, 0.0, 0.0]];
            assert_eq!(
                scatter(&[[0.0; 3]; 2], &displacement, &[1, 0], &mut [[0.0; 3]; 2]),
                Err(0)
            );
        }
    }

    #[test]
    fn normals_are_weighted_by_area() {
        // Two triangles over the edge 0-1: one of area 1 facing +z, one of area 2 facing +y.
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]];
        let mut found = [[0.0; 3]; 4];
        normals(&[[0, 1, 2], [1, 0, 3]], &positions, &mut found);
        let slant = 1.0 / 5.0_f32.sqrt();
        let expected = [
            [0.0, 2.0 * slant, slant],
            [0.0, 2.0 * slant, slant],
            [0.0, 0.0, 1.0],
            [0.0, 1.0, 0.0],
        ];
        for (n, e) in found.iter().zip(&expected) {
            assert!((0..3).all(|c| (n[c] - e[c]).abs() < TOLERANCE), "{n:?} {e:?}");
        }
    }

    #[test]
    fn vertices_without_area_get_the_fallback() {
        let mut found = [[0.0; 3]; 4];
        let line = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0, 5.0, 5.0]];
        normals(&[[0, 1, 2]], &line, &mut found);
        assert_eq!(found, [FALLBACK_NORMAL; 4]);
    }

    #[test]
    fn tiny_and_huge_triangles_have_unit_normals() {
        for scale in [1e-15_f32, 1e9, 1e17] {
            let positions = [[0.0; 3], [scale, 0.0, 0.0], [0.0, scale, scale]];
            let mut found = [[0.0; 3]; 3];
            normals(&[[0, 1, 2]], &positions, &mut found);
            for n in found {
                assert!(
                    (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0).abs() < TOLERANCE,
                    "{scale}: {n:?}"
                );
                assert_ne!(n, FALLBACK_NORMAL);
            }
        }
        let mut found = [[0.0; 3]; 3];
        normals(
            &[[0, 1, 2]],
            &[[0.0; 3], [1e30, 0.0, 0.0], [0.0, 1e30, 1e30]],
            &mut found,
        );
        assert_eq!(found, [FALLBACK_NORMAL; 3]);
    }
}
