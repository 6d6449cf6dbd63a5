//! Tangents of a deformed surface: along the texture's u, at right angles to the normal.
//!
//! Each triangle's tangent is the direction in which u grows on it, weighted by the triangle's area; a render vertex takes the
//! sum over its triangles, made perpendicular to its normal. The fourth number is the sign of the bitangent
//! `sign * cross(normal, tangent)`: -1 where most of the area around has a mirrored texture. The convention is that of glTF and of
//! normal maps baked for MikkTSpace; unlike MikkTSpace, weights are areas, not angles, and mirrored triangles share a
//! vertex's tangent where they share its texture coordinate.

use libm::sqrtf;

use crate::basis::Basis;

/// Fills `tangents`. Shape: `positions` and `normals` `[V]`, source order; `tangents` `[R]`. Where a vertex' triangles say nothing
/// (no area, or none in the texture) its tangent is some unit vector perpendicular to the normal.
pub(super) fn tangents(basis: &Basis<'_>, positions: &[[f32; 3]], normals: &[[f32; 3]], tangents: &mut [[f32; 4]]) {
    let surface = basis.surface();
    tangents.fill([0.0; 4]);
    for (face, corners) in basis.faces().iter().zip(surface.drawn_faces().iter()) {
        let p = face.map(|v| positions[v as usize]);
        let uv = corners.map(|r| surface.uvs[r as usize]);
        if let Some(share) = of_triangle(&p, &uv) {
            for r in corners {
                let sum = &mut tangents[r as usize];
                for c in 0..4 {
                    sum[c] += share[c];
                }
            }
        }
    }
    for (tangent, v) in tangents.iter_mut().zip(basis.render_vertices()) {
        *tangent = settled(tangent, &normals[v as usize]);
    }
}

/// Direction in which u grows, times the area; and the area, negative where the texture is mirrored. None where it has no
/// direction.
fn of_triangle(p: &[[f32; 3]; 3], uv: &[[f32; 2]; 3]) -> Option<[f32; 4]> {
    let edge = |n: usize| -> [f32; 3] { core::array::from_fn(|c| p[n][c] - p[0][c]) };
    let (e, f) = (edge(1), edge(2));
    let (du, dv) = (uv[1][0] - uv[0][0], uv[1][1] - uv[0][1]);
    let (fu, fv) = (uv[2][0] - uv[0][0], uv[2][1] - uv[0][1]);
    let mirrored = if du * fv - fu * dv < 0.0 { -1.0 } else { 1.0 };
    let along: [f32; 3] = core::array::from_fn(|c| mirrored * (e[c] * fv - f[c] * dv));
    let (area, length) = (norm(&cross(&e, &f)), norm(&along));
    let flat_texture = du * fv == fu * dv;
    let usable = !flat_texture && area.is_finite() && length.is_finite() && length > 0.0;
    usable.then(|| {
        let weight = area / length;
        [along[0] * weight, along[1] * weight, along[2] * weight, mirrored * area]
    })
}

/// The unit tangent nearest to the sum, and the sign.
fn settled(sum: &[f32; 4], n: &[f32; 3]) -> [f32; 4] {
    let along = n[0] * sum[0] + n[1] * sum[1] + n[2] * sum[2];
    let t = [sum[0] - along * n[0], sum[1] - along * n[1], sum[2] - along * n[2]];
    let sign = if sum[3] < 0.0 { -1.0 } else { 1.0 };
    let [x, y, z] = unit(&t).unwrap_or_else(|| {
        // Across the axis that the normal leans to least.
        let axis = if n[0].abs() <= n[1].abs() && n[0].abs() <= n[2].abs() {
            [1.0, 0.0, 0.0]
        } else if n[1].abs() <= n[2].abs() {
            [0.0, 1.0, 0.0]
        } else {
            [0.0, 0.0, 1.0]
        };
        unit(&cross(n, &axis)).unwrap_or([1.0, 0.0, 0.0])
    });
    [x, y, z, sign]
}

fn unit(t: &[f32; 3]) -> Option<[f32; 3]> {
    // By the largest entry first: squares of small or large areas would leave f32.
    let largest = t[0].abs().max(t[1].abs()).max(t[2].abs());
    let m = t.map(|x| x / largest);
    let length = norm(&m);
    (length.is_finite() && length > 0.0).then(|| m.map(|x| x / length))
}

fn cross(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn norm(a: &[f32; 3]) -> f32 {
    sqrtf(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f32 = 1e-6;

    fn near(a: &[f32], b: &[f32]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < TOLERANCE)
    }

    #[test]
    fn a_triangle_says_where_u_grows_and_whether_it_is_mirrored() {
        let p = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        // u along y, v along -x: turned, not mirrored.
        let turned = of_triangle(&p, &[[0.0, 0.0], [0.0, -1.0], [0.5, 0.0]]).unwrap();
        assert!(near(&turned, &[0.0, 2.0, 0.0, 2.0]), "{turned:?}");
        // u along -x, v along y: mirrored.
        let mirrored = of_triangle(&p, &[[1.0, 0.0], [0.0, 0.0], [1.0, 1.0]]).unwrap();
        assert!(near(&mirrored, &[-2.0, 0.0, 0.0, -2.0]), "{mirrored:?}");
        assert_eq!(of_triangle(&p, &[[1.0, 0.0]; 3]), None);
        assert_eq!(
            of_triangle(&p, &[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]),
            None,
            "a line in the texture"
        );
        assert_eq!(of_triangle(&[[f32::MAX, 0.0, 0.0]; 3], &[[0.0; 2]; 3]), None);
    }

    #[test]
    fn what_is_settled_is_a_unit_vector_across_the_normal() {
        let slant = 0.5_f32.sqrt();
        for n in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, slant, -slant]] {
            for sum in [
                [3.0, -1.0, 2.0, 1.0],
                [0.0; 4],
                [1e-30, 0.0, 1e-30, -1e-30],
                [0.0, 0.0, 5.0, 0.0],
                [f32::INFINITY, 0.0, 0.0, -1.0],
            ] {
                let t = settled(&sum, &n);
                assert!((norm(&[t[0], t[1], t[2]]) - 1.0).abs() < TOLERANCE, "{sum:?} {t:?}");
                assert!(
                    (t[0] * n[0] + t[1] * n[1] + t[2] * n[2]).abs() < TOLERANCE,
                    "{sum:?} {t:?}"
                );
                assert_eq!(t[3], if sum[3] < 0.0 { -1.0 } else { 1.0 });
            }
        }
    }
}
