//! Splits polygons into triangles, once, on the reference; the same split by index then serves every shape.

use super::mesh::PolygonMesh;

/// Corners that may be looked at for each corner of a polygon while its ears are searched. Polygons of up to some 200 corners, and
/// longer ones with few inward corners, never need as many; one made to need more becomes a fan, so that time stays linear.
const LOOKS_PER_CORNER: usize = 256;

/// Triangles of a mesh, and what became of its polygons.
#[derive(Debug, Default)]
pub(super) struct Triangulation {
    /// The corners of each triangle: places in the mesh's `corners`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The face that each triangle is a part of.
    pub(super) faces: Vec<u32>,
    /// Polygons with more than three corners.
    pub(super) polygon_count: usize,
    /// Triangles that those polygons became.
    pub(super) polygon_triangle_count: usize,
    /// Triangles dropped because they name one vertex twice.
    pub(super) collapsed_count: usize,
}

/// Splits every polygon by the geometry of `mesh`. `vertex_of` says which vertex of the result a vertex of the mesh belongs to:
/// triangles that name one twice are dropped.
pub(super) fn triangulate(mesh: &PolygonMesh, vertex_of: impl Fn(u32) -> u32) -> Triangulation {
    let mut result = Triangulation {
        triangles: Vec::with_capacity(mesh.face_count()),
        faces: Vec::with_capacity(mesh.face_count()),
        ..Triangulation::default()
    };
    let mut split = Vec::new();
    for f in 0..mesh.face_count() {
        split.clear();
        let corners = mesh.face(f);
        match *corners {
            [_, _, _] => split.push([0, 1, 2]),
            [a, b, c, d] => split_quad([a, b, c, d].map(|v| position(&mesh.positions, v)), &mut split),
            _ => {
                let points: Vec<[f64; 3]> = corners.iter().map(|&v| position(&mesh.positions, v)).collect();
                Polygon::new(&points).cut_ears(&mut split);
            }
        }
        let first = mesh.corners_of(f).start as u32;
        let before = result.triangles.len();
        for triangle in &split {
            let [a, b, c] = triangle.map(|corner| vertex_of(corners[corner]));
            if a != b && b != c && c != a {
                result.triangles.push(triangle.map(|corner| first + corner as u32));
                result.faces.push(f as u32);
            }
        }
        let kept = result.triangles.len() - before;
        result.collapsed_count += split.len() - kept;
        if corners.len() > 3 {
            result.polygon_count += 1;
            result.polygon_triangle_count += kept;
        }
    }
    result
}

/// Along the diagonal that keeps both halves facing the same way; if both do, along the shorter one.
fn split_quad(p: [[f64; 3]; 4], out: &mut Vec<[usize; 3]>) {
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
        [[0, 1, 3], [1, 2, 3]]
    } else {
        [[0, 1, 2], [0, 2, 3]]
    });
}

/// A polygon laid flat along its mean normal, while ears are cut off it.
struct Polygon {
    flat: Vec<[f64; 2]>,
    /// The corners before and behind each corner that is left: a ring.
    before: Vec<usize>,
    behind: Vec<usize>,
    is_left: Vec<bool>,
    /// Corners that pointed inwards, or straight on, at the beginning: an ear that holds no such corner holds none, and cutting
    /// ears turns no other corner inwards.
    inward: Vec<usize>,
    /// Corners that may still be looked at.
    looks: usize,
}

impl Polygon {
    fn new(points: &[[f64; 3]]) -> Polygon {
        let n = points.len();
        let flat = flatten(points);
        let turn = |i: usize| cross2(flat[(i + n - 1) % n], flat[i], flat[(i + 1) % n]);
        let inward = (0..n).filter(|&i| turn(i) <= 0.0).collect();
        Polygon {
            before: (0..n).map(|i| (i + n - 1) % n).collect(),
            behind: (0..n).map(|i| (i + 1) % n).collect(),
            is_left: vec![true; n],
            inward,
            looks: LOOKS_PER_CORNER * n,
            flat,
        }
    }

    /// Cuts ears; what has no ear (a polygon that crosses itself) becomes a fan.
    fn cut_ears(&mut self, out: &mut Vec<[usize; 3]>) {
        let mut at = 0;
        for n in (4..=self.flat.len()).rev() {
            // Ears that only touch other corners, or are flat, serve where there are no better ones (bridges to holes).
            let Some(i) = self.find_ear(at, n, true).or_else(|| self.find_ear(at, n, false)) else {
                break;
            };
            out.push([self.before[i], i, self.behind[i]]);
            let (before, behind) = (self.before[i], self.behind[i]);
            (self.behind[before], self.before[behind]) = (behind, before);
            self.is_left[i] = false;
            // Begin behind the cut, lest all ears share one corner.
            at = self.behind[behind];
        }
        let left: Vec<usize> = (0..self.flat.len()).filter(|&i| self.is_left[i]).collect();
        for pair in left[1..].windows(2) {
            out.push([left[0], pair[0], pair[1]]);
        }
    }

    /// The first ear from `at` on; `n` corners are left.
    fn find_ear(&mut self, at: usize, n: usize, strict: bool) -> Option<usize> {
        let mut i = at;
        for _ in 0..n {
            if self.looks == 0 {
                return None;
            }
            if self.is_ear([self.before[i], i, self.behind[i]], strict) {
                return Some(i);
            }
            i = self.behind[i];
        }
        None
    }

    fn is_ear(&mut self, ear: [usize; 3], strict: bool) -> bool {
        self.looks -= 1;
        let [a, b, c] = ear.map(|corner| self.flat[corner]);
        let area2 = cross2(a, b, c);
        if area2 < 0.0 || (strict && area2 == 0.0) {
            return false;
        }
        for &corner in &self.inward {
            if self.looks == 0 {
                return false;
            }
            self.looks -= 1;
            let p = self.flat[corner];
            if !self.is_left[corner] || p == a || p == b || p == c {
                continue;
            }
            let sides = [cross2(a, b, p), cross2(b, c, p), cross2(c, a, p)];
            // A strict ear has no other corner even on its border.
            let is_outside = if strict {
                sides.iter().any(|&side| side < 0.0)
            } else {
                sides.iter().any(|&side| side <= 0.0)
            };
            if !is_outside {
                return false;
            }
        }
        true
    }
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
            face_ends: vec![points.len() as u32],
            ..PolygonMesh::default()
        }
    }

    /// Triangles by vertices.
    fn faces(mesh: &PolygonMesh) -> Vec<[u32; 3]> {
        let triangles = triangulate(mesh, |v| v).triangles;
        triangles
            .into_iter()
            .map(|triangle| triangle.map(|corner| mesh.corners[corner as usize]))
            .collect()
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
        (faces(mesh).iter().map(area).collect(), length / 2.0)
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
        assert_eq!(faces(&kite), [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn collapsed_triangles_are_counted() {
        let positions = vec![[0.; 3], [1., 0., 0.], [0., 1., 0.]];
        let corners = vec![0, 1, 1, 0, 1, 2, 0, 1, 2, 0, 1, 2];
        let mesh = PolygonMesh {
            positions,
            corners,
            face_ends: vec![3, 6, 12],
            ..PolygonMesh::default()
        };
        let result = triangulate(&mesh, |v| v);
        assert_eq!(result.triangles.len() + result.collapsed_count, 6);
        assert_eq!(
            (result.polygon_count, faces(&mesh)[0], result.faces[0]),
            (1, [0, 1, 2], 1)
        );
        // Welding the last two vertices leaves nothing.
        assert_eq!(triangulate(&mesh, |v| v.min(1)).triangles.len(), 0);
    }

    /// A comb: every other corner points inwards, and nearly every ear is one only near its own tooth.
    fn comb(tooth_count: usize) -> PolygonMesh {
        let mut points = vec![[tooth_count as f32, -1.0], [0.0, -1.0]];
        for tooth in 0..tooth_count {
            points.push([tooth as f32, 10.0]);
            points.push([tooth as f32 + 0.5, 0.1 * (tooth % 7) as f32]);
        }
        points.push([tooth_count as f32, 10.0]);
        points.reverse();
        mesh(&points, 0.0)
    }

    #[test]
    fn long_combs_are_still_covered_once() {
        let mesh = comb(60);
        let (triangles, whole) = areas(&mesh);
        assert!(triangles.iter().all(|&area| area > -1e-9));
        assert!((triangles.iter().sum::<f64>() - whole).abs() < 1e-6 * whole);
    }

    #[test]
    fn hostile_polygons_are_given_up_before_they_take_more_than_linear_time() {
        let long = comb(10_000);
        let points: Vec<_> = long.face(0).iter().map(|&v| position(&long.positions, v)).collect();
        let mut polygon = Polygon::new(&points);
        polygon.cut_ears(&mut Vec::new());
        assert_eq!(polygon.looks, 0, "this polygon is not hostile");
        // A star that crosses itself everywhere has no ear at all.
        let n = 20_001;
        let at = |i: usize| (i * (n / 2) % n) as f64 * core::f64::consts::TAU / n as f64;
        let corners: Vec<_> = (0..n).map(|i| [at(i).cos() as f32, at(i).sin() as f32]).collect();
        for polygon in [long, mesh(&corners, 0.0)] {
            assert_eq!(faces(&polygon).len(), polygon.corners.len() - 2);
        }
    }
}
