//! Splits polygons into triangles, once, on the reference; the same split by index then serves every shape.

use super::mesh::PolygonMesh;

/// Longest polygon that ears are cut from (their search may grow with the cube of it); longer ones become a fan.
const EAR_CORNERS_MAX: usize = 1024;

/// Triangles of a mesh, and what became of its polygons.
#[derive(Debug, Default)]
pub(super) struct Triangulation {
    pub(super) faces: Vec<[u32; 3]>,
    /// Polygons with more than three corners.
    pub(super) polygon_count: usize,
    /// Triangles that those polygons became.
    pub(super) polygon_triangle_count: usize,
    /// Triangles dropped because they name one vertex twice.
    pub(super) collapsed_count: usize,
}

/// Splits every polygon by the geometry of `mesh`.
pub(super) fn triangulate(mesh: &PolygonMesh) -> Triangulation {
    let mut result = Triangulation {
        faces: Vec::with_capacity(mesh.face_count()),
        ..Triangulation::default()
    };
    let mut split = Vec::new();
    for f in 0..mesh.face_count() {
        split.clear();
        match mesh.face(f) {
            &[a, b, c] => split.push([a, b, c]),
            &[a, b, c, d] => split_quad([a, b, c, d], &mesh.positions, &mut split),
            corners => cut_ears(corners, &mesh.positions, &mut split),
        }
        let kept = result.faces.len();
        result
            .faces
            .extend(split.iter().filter(|[a, b, c]| a != b && b != c && c != a));
        let kept = result.faces.len() - kept;
        result.collapsed_count += split.len() - kept;
        if mesh.face(f).len() > 3 {
            result.polygon_count += 1;
            result.polygon_triangle_count += kept;
        }
    }
    result
}

/// Along the diagonal that keeps both halves facing the same way; if both do, along the shorter one.
fn split_quad(corners: [u32; 4], positions: &[[f32; 3]], out: &mut Vec<[u32; 3]>) {
    let [a, b, c, d] = corners;
    let p = corners.map(|v| position(positions, v));
    let normal = newell_normal(&p);
    let faces = |i: usize, j: usize, k: usize| dot(cross(sub(p[j], p[i]), sub(p[k], p[i])), normal) > 0.0;
    let along_ac = faces(0, 1, 2) && faces(0, 2, 3);
    let along_bd = faces(0, 1, 3) && faces(1, 2, 3);
    let length2 = |i: usize, j: usize| dot(sub(p[j], p[i]), sub(p[j], p[i]));
    let use_bd = if along_ac == along_bd {
        length2(1, 3) < length2(0, 2)
    } else {
        along_bd
    };
    out.extend(if use_bd {
        [[a, b, d], [b, c, d]]
    } else {
        [[a, b, c], [a, c, d]]
    });
}

/// Cuts ears off the polygon, flattened along its mean normal; what has no ear (a polygon that crosses itself) becomes a fan.
fn cut_ears(corners: &[u32], positions: &[[f32; 3]], out: &mut Vec<[u32; 3]>) {
    let points: Vec<[f64; 3]> = corners.iter().map(|&v| position(positions, v)).collect();
    let flat = flatten(&points);
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut at = 0;
    while left.len() > 3 && corners.len() <= EAR_CORNERS_MAX {
        let n = left.len();
        let ear_at = |strict: bool| {
            (0..n).map(|step| (at + step) % n).find(|&i| {
                let ear = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
                is_ear(ear, &left, &flat, strict)
            })
        };
        // Ears that only touch other corners, or are flat, serve where there are no better ones (bridges to holes).
        let Some(i) = ear_at(true).or_else(|| ear_at(false)) else {
            break;
        };
        out.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]].map(|corner| corners[corner]));
        left.remove(i);
        // Begin behind the cut, lest all ears share one corner.
        at = (i + 1) % left.len();
    }
    for pair in left[1..].windows(2) {
        out.push([left[0], pair[0], pair[1]].map(|corner| corners[corner]));
    }
}

fn is_ear(ear: [usize; 3], left: &[usize], flat: &[[f64; 2]], strict: bool) -> bool {
    let [a, b, c] = ear.map(|corner| flat[corner]);
    let area2 = cross2(a, b, c);
    if area2 < 0.0 || (strict && area2 == 0.0) {
        return false;
    }
    left.iter()
        .map(|&corner| flat[corner])
        .filter(|&p| p != a && p != b && p != c)
        .all(|p| {
            let sides = [cross2(a, b, p), cross2(b, c, p), cross2(c, a, p)];
            // A strict ear has no other corner even on its border.
            if strict {
                sides.iter().any(|&side| side < 0.0)
            } else {
                sides.iter().any(|&side| side <= 0.0)
            }
        })
}

/// Drops the axis that the polygon's normal leans to most, keeping counter-clockwise order.
fn flatten(points: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let normal = newell_normal(points);
    let axis = (0..3)
        .max_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs()))
        .unwrap_or(2);
    let (mut u, mut w) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        core::mem::swap(&mut u, &mut w);
    }
    points.iter().map(|p| [p[u], p[w]]).collect()
}

/// Twice the polygon's area along its mean normal (Newell).
fn newell_normal(points: &[[f64; 3]]) -> [f64; 3] {
    let mut normal = [0.0; 3];
    for i in 0..points.len() {
        // From the first corner, so that far-off meshes lose no digits.
        let turn = cross(
            sub(points[i], points[0]),
            sub(points[(i + 1) % points.len()], points[0]),
        );
        (0..3).for_each(|c| normal[c] += turn[c]);
    }
    normal
}

fn position(positions: &[[f32; 3]], v: u32) -> [f64; 3] {
    positions[v as usize].map(f64::from)
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Twice the signed area of a flat triangle.
fn cross2(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(points: &[[f32; 2]], z_of_x: f32) -> PolygonMesh {
        let positions = points.iter().map(|&[x, y]| [x, y, z_of_x * x]).collect();
        let corners = (0..points.len() as u32).collect();
        PolygonMesh {
            positions,
            corners,
            face_ends: vec![points.len()],
            ignored_element_count: 0,
        }
    }

    /// Areas of the triangles along the polygon's normal, and of the polygon.
    fn areas(mesh: &PolygonMesh) -> (Vec<f64>, f64) {
        let points: Vec<_> = mesh.face(0).iter().map(|&v| position(&mesh.positions, v)).collect();
        let normal = newell_normal(&points);
        let length = dot(normal, normal).sqrt();
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| position(&mesh.positions, v));
            dot(cross(sub(b, a), sub(c, a)), normal) / length / 2.0
        };
        (triangulate(mesh).faces.iter().map(area).collect(), length / 2.0)
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let arrow = [[0., 0.], [2., 1.], [0., 2.], [0.5, 1.]];
        let comb = [
            [0., 0.],
            [5., 0.],
            [5., 2.],
            [4., 2.],
            [4., 0.5],
            [3., 2.],
            [2., 0.5],
            [1., 2.],
            [1., 0.5],
            [0., 2.],
        ];
        // A square with a square hole, joined by a bridge that is walked twice.
        let ring = [
            [0., 0.],
            [4., 0.],
            [4., 4.],
            [0., 4.],
            [0., 0.],
            [1., 1.],
            [1., 3.],
            [3., 3.],
            [3., 1.],
            [1., 1.],
        ];
        for points in [&arrow[..], &comb, &ring] {
            for turned in 0..points.len() {
                let mut points = points.to_vec();
                points.rotate_left(turned);
                for (slope, mirrored) in [(0.0, false), (3.0, false), (0.0, true)] {
                    let mut mesh = mesh(&points, slope);
                    if mirrored {
                        mesh.corners.reverse();
                    }
                    let (triangles, whole) = areas(&mesh);
                    assert_eq!(triangles.len(), points.len() - 2);
                    assert!(triangles.iter().all(|&area| area > -1e-9), "{triangles:?}");
                    assert!((triangles.iter().sum::<f64>() - whole).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn convex_quads_take_the_shorter_diagonal() {
        let kite = mesh(&[[0., 0.], [1., -0.2], [3., 0.], [1., 0.2]], 0.0);
        assert_eq!(triangulate(&kite).faces, [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn collapsed_triangles_are_counted() {
        let positions = vec![[0.; 3], [1., 0., 0.], [0., 1., 0.]];
        let corners = vec![0, 1, 1, 0, 1, 2, 0, 1, 2, 0, 1, 2];
        let mesh = PolygonMesh {
            positions,
            corners,
            face_ends: vec![3, 6, 12],
            ignored_element_count: 0,
        };
        let result = triangulate(&mesh);
        assert_eq!(result.faces.len() + result.collapsed_count, 6);
        assert_eq!((result.polygon_count, result.faces[0]), (1, [0, 1, 2]));
    }
}
