//! The mirror plane of the rest shape, and which components are each other's mirror image. Fields (`fields`) and rest
//! surface -> [`MirrorPlane`] -> [`mirror_images`] -> labels and `sinew inspect`.
//!
//! Symmetry is that of the rest shape in space: a reference that stands in the middle of a stride has none.

use nalgebra::{Matrix3, Vector3};
use sinew_formats::package::FEATURE_COUNT;

use super::fields::Field;
use crate::mesh::nearest::NearestVertices;
use crate::mesh::topology::Topology;

/// Share of the surface that must meet the surface again behind the mirror. The gallop horse, remeshed without symmetry,
/// reaches 0.97; other planes of animals, people, clothes and plants hardly reach 0.65.
pub const LEAST_SHARE: f64 = 0.9;
/// How near counts as met: this share of the bounding box's diagonal, and what lies between vertices.
const NEARNESS: f64 = 0.005;
/// A point of a triangle is within this many edge lengths of a corner (0.577 in an equilateral one).
const BETWEEN_VERTICES: f64 = 0.6;
/// How far the surface may bulge between vertices, in edge lengths: a coarse mesh hides a few steps along it, but not off it.
const BULGE: f64 = 0.15;
/// A shape thinner than this share of its diagonal along the normal is a sheet in the plane, which says nothing of sides.
const LEAST_DEPTH: f64 = 0.05;
/// Vertices that a plane is tried with, about.
const SAMPLES: usize = 2000;
/// Rounds of matching and fitting.
const ROUNDS: usize = 10;
/// Best part of the matches that a plane is fitted to: an ear that is bent should not turn it.
const FITTED_SHARE: f64 = 0.7;
/// What a later candidate must have more than an earlier one: a bar has many planes, and should keep the plainest.
const CLEARLY_BETTER: f64 = 0.02;
/// Cosine of a field and a mirrored one from which they belong together.
pub const MIRROR_COSINE: f64 = 0.6;

/// The plane `normal . p = offset`, and what lies behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct MirrorPlane {
    /// Unit; its largest coordinate is above zero.
    pub normal: [f64; 3],
    /// Units of the source.
    pub offset: f64,
    /// Share of the surface that meets the surface again, from [`LEAST_SHARE`] to 1.
    pub share: f64,
    /// The vertex nearest to each vertex's mirror image. Shape: `[V]`.
    pub mirrored: Vec<u32>,
}

struct Matcher<'s> {
    rest: &'s [[f64; 3]],
    areas: &'s [f64],
    /// Mean length of the edges at each vertex.
    edges: Vec<f64>,
    /// Unit; zero where a vertex has no face with an area.
    normals: Vec<Vector3<f64>>,
    /// [`NEARNESS`], units of the source.
    nearness: f64,
    tree: NearestVertices<'s>,
    samples: Vec<usize>,
}

/// A vertex, the one nearest to its mirror image, and how far that is beyond what counts as met.
struct Match {
    v: usize,
    other: usize,
    beyond: f64,
}

impl MirrorPlane {
    /// Looks for a plane: through the centroid, across a coordinate axis or a principal one, then fitted. `None` where no plane
    /// mirrors [`LEAST_SHARE`] of the surface onto the surface. `rest`, `areas`: `[V]`, of `topology`.
    pub fn find(rest: &[[f64; 3]], areas: &[f64], topology: &Topology) -> Option<Self> {
        let total: f64 = areas.iter().sum();
        if rest.is_empty() || total <= 0.0 {
            return None;
        }
        let centroid = rest
            .iter()
            .zip(areas)
            .fold(Vector3::zeros(), |sum, (p, a)| sum + Vector3::from(*p) * (a / total));
        let covariance = rest.iter().zip(areas).fold(Matrix3::zeros(), |sum, (p, a)| {
            let d = Vector3::from(*p) - centroid;
            sum + d * d.transpose() * (a / total)
        });
        let diagonal = (0..3).map(|c| extent(rest, unit(c)).powi(2)).sum::<f64>().sqrt();
        let everyone: Vec<u32> = (0..rest.len() as u32).collect();
        let matcher = Matcher {
            rest,
            areas,
            edges: (0..rest.len()).map(|v| mean_edge(rest, topology, v)).collect(),
            normals: normals(rest, &topology.faces),
            nearness: NEARNESS * diagonal,
            tree: NearestVertices::new(rest, &everyone, &vec![0; rest.len()]),
            samples: (0..rest.len()).step_by(1 + rest.len() / SAMPLES).collect(),
        };
        let principal = covariance.symmetric_eigen().eigenvectors;
        // Sideways first: of several planes the one that parts left from right is meant.
        let candidates = [unit(0), unit(2), unit(1)].into_iter();
        let candidates = candidates.chain((0..3).map(|i| principal.column(i).into_owned()));
        let mut best: Option<(f64, Vector3<f64>, f64)> = None;
        for normal in candidates {
            let (share, normal, offset) = matcher.fit(normal, normal.dot(&centroid));
            let deep = extent(rest, normal) >= LEAST_DEPTH * diagonal;
            if deep && share >= LEAST_SHARE && best.is_none_or(|(least, ..)| share > least + CLEARLY_BETTER) {
                best = Some((share, normal, offset));
            }
        }
        let (share, normal, offset) = best?;
        let sign = if normal[normal.iamax()] < 0.0 { -1.0 } else { 1.0 };
        Some(Self {
            normal: (sign * normal).into(),
            offset: sign * offset,
            share,
            mirrored: (0..rest.len())
                .map(|v| matcher.mirrored(v, normal, offset).map_or(v, |m| m.other) as u32)
                .collect(),
        })
    }

    /// How far `point` lies on the side that the normal points to; units of the source.
    pub fn side(&self, point: [f64; 3]) -> f64 {
        Vector3::from(self.normal).dot(&Vector3::from(point)) - self.offset
    }

    /// The field of the mirrored movement: that of vertex v is read at the vertex behind the mirror. A rotation's axis is a
    /// pseudovector, so it keeps its part along the normal and turns the rest round; a stretch is mirrored on both sides.
    fn image(&self, field: &Field) -> Field {
        let mut place = vec![u32::MAX; self.mirrored.len()];
        for (i, &v) in field.vertices.iter().enumerate() {
            place[v as usize] = i as u32;
        }
        let met = self.mirrored.iter().zip(0_u32..);
        let (vertices, values) = met
            .filter_map(|(&other, v)| {
                let values = field.values.get(place[other as usize] as usize)?;
                Some((v, mirrored_features(values, Vector3::from(self.normal))))
            })
            .unzip();
        Field {
            vertices,
            values,
            ..*field
        }
    }
}

/// The feature of the mirrored movement at the vertex behind the mirror.
pub fn mirrored_features(x: &[f64; FEATURE_COUNT], normal: Vector3<f64>) -> [f64; FEATURE_COUNT] {
    let mirror = Matrix3::identity() - 2.0 * normal * normal.transpose();
    let r = -(mirror * Vector3::new(x[0], x[1], x[2]));
    let s = mirror * Matrix3::new(x[3], x[4], x[5], x[4], x[6], x[7], x[5], x[7], x[8]) * mirror;
    [r.x, r.y, r.z, s.m11, s.m12, s.m13, s.m22, s.m23, s.m33]
}

impl Matcher<'_> {
    /// Vertex nearest to the mirror image of `v`, and how much too far it is from there, along the surface or off it.
    fn mirrored(&self, v: usize, normal: Vector3<f64>, offset: f64) -> Option<Match> {
        let p = Vector3::from(self.rest[v]);
        let image = p - 2.0 * (normal.dot(&p) - offset) * normal;
        let other = self.tree.nearest(image.into(), None, 1).first()?.0 as usize;
        let step = image - Vector3::from(self.rest[other]);
        let off = self.normals[other].dot(&step).abs();
        let (along_beyond, off_beyond) = (
            step.norm() - BETWEEN_VERTICES * self.edges[other],
            off - BULGE * self.edges[other],
        );
        let beyond = along_beyond.max(off_beyond) - self.nearness;
        Some(Match { v, other, beyond })
    }

    fn matches(&self, normal: Vector3<f64>, offset: f64) -> Vec<Match> {
        let samples = self.samples.iter();
        samples.filter_map(|&v| self.mirrored(v, normal, offset)).collect()
    }

    fn share(&self, matches: &[Match]) -> f64 {
        let area = |matches: &mut dyn Iterator<Item = &Match>| matches.map(|m| self.areas[m.v]).sum::<f64>();
        area(&mut matches.iter().filter(|m| m.beyond <= 0.0)) / area(&mut matches.iter()).max(f64::MIN_POSITIVE)
    }

    /// Matches and fits in turn, and keeps the plane of the greatest share.
    fn fit(&self, normal: Vector3<f64>, offset: f64) -> (f64, Vector3<f64>, f64) {
        let mut plane = (normal, offset);
        let mut best = (-1.0, normal, offset);
        for _ in 0..=ROUNDS {
            let mut matches = self.matches(plane.0, plane.1);
            let share = self.share(&matches);
            if share > best.0 {
                best = (share, plane.0, plane.1);
            }
            matches.sort_by(|a, b| a.beyond.total_cmp(&b.beyond).then(a.v.cmp(&b.v)));
            matches.truncate((FITTED_SHARE * matches.len() as f64).ceil() as usize);
            match self.plane_of(&matches) {
                Some(next) => plane = next,
                None => break,
            }
        }
        best
    }

    /// The plane that mirrors `v` nearest to `other`, in the least-squares sense: with p and q about their centroids,
    /// `sum |p - 2 n (n . p) - q|^2` is least where n is the eigenvector of `sum p q^T`, made symmetric, of the least value.
    fn plane_of(&self, matches: &[Match]) -> Option<(Vector3<f64>, f64)> {
        let total: f64 = matches.iter().map(|m| self.areas[m.v]).sum();
        if total <= 0.0 {
            return None;
        }
        let point = |v: usize| Vector3::from(self.rest[v]);
        let mean = |of: &dyn Fn(&Match) -> usize| {
            let weighted = |m| point(of(m)) * (self.areas[m.v] / total);
            matches.iter().map(weighted).sum::<Vector3<f64>>()
        };
        let (from, to) = (mean(&|m| m.v), mean(&|m| m.other));
        let products = matches.iter().fold(Matrix3::zeros(), |sum, m| {
            sum + (point(m.v) - from) * (point(m.other) - to).transpose() * self.areas[m.v]
        });
        let eigen = (products + products.transpose()).symmetric_eigen();
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        Some((normal, normal.dot(&(from + to)) / 2.0))
    }
}

fn unit(c: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| f64::from(u8::from(i == c)))
}

fn extent(rest: &[[f64; 3]], axis: Vector3<f64>) -> f64 {
    let along = rest.iter().map(|p| axis.dot(&Vector3::from(*p)));
    along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
}

fn mean_edge(rest: &[[f64; 3]], topology: &Topology, v: usize) -> f64 {
    let ring = topology.ring_of(v);
    let length = |j: u32| (Vector3::from(rest[v]) - Vector3::from(rest[j as usize])).norm();
    ring.iter().map(|&j| length(j)).sum::<f64>() / ring.len().max(1) as f64
}

fn normals(rest: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); rest.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| Vector3::from(rest[v as usize]));
        let normal = (b - a).cross(&(c - a));
        for &v in face {
            normals[v as usize] += normal;
        }
    }
    normals
        .iter()
        .map(|normal| normal.try_normalize(0.0).unwrap_or_default())
        .collect()
}

/// What a component is on the other side of the mirror.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MirrorImage {
    /// The component that does there what this one does here; itself where it does the same on both sides.
    pub component: usize,
    /// Of the mirrored field and that component's, at least [`MIRROR_COSINE`] either way.
    pub cosine: f64,
    /// Whether the controls turn opposite ways: weight w here is like a weight below zero there.
    pub reversed: bool,
}

/// Pairs components of one level, the most alike first, each at most once. Shape: `[K]`; `areas`: `[V]`.
pub fn mirror_images(fields: &[Field], areas: &[f64], plane: &MirrorPlane) -> Vec<Option<MirrorImage>> {
    let mut candidates = Vec::new();
    for (k, field) in fields.iter().enumerate() {
        let image = plane.image(field);
        for (other, candidate) in fields.iter().enumerate().skip(k) {
            if candidate.level == field.level {
                let cosine = image.cosine(candidate, areas);
                if cosine.abs() >= MIRROR_COSINE {
                    candidates.push((cosine, k, other));
                }
            }
        }
    }
    candidates.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut images = vec![None; fields.len()];
    for (cosine, k, other) in candidates {
        if images[k].is_none() && images[other].is_none() {
            let reversed = (fields[k].stop < 0.0) != (fields[other].stop < 0.0);
            let image = |component| {
                Some(MirrorImage {
                    component,
                    cosine,
                    reversed: reversed != (cosine < 0.0),
                })
            };
            images[k] = image(other);
            images[other] = image(k);
        }
    }
    images
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::widened;
    use crate::synthesize::{Settings, creature};
    use nalgebra::Rotation3;

    /// An egg of rings, open at its poles; pushed about until nothing mirrors it if `lopsided`.
    fn ball(lopsided: bool) -> (Vec<[f64; 3]>, Topology) {
        let (rows, columns) = (20_u32, 30_u32);
        let rest: Vec<[f64; 3]> = (0..rows * columns)
            .map(|v| {
                let polar = core::f64::consts::PI * (f64::from(v / columns) + 0.5) / f64::from(rows);
                let around = core::f64::consts::TAU * f64::from(v % columns) / f64::from(columns);
                let p = [
                    polar.sin() * around.cos(),
                    0.7 * polar.sin() * around.sin(),
                    1.3 * polar.cos(),
                ];
                let radius = 1.0 + 0.3 * (2.0 * p[0] + 1.0).sin() * (3.0 * p[1] + 0.4).sin() + 0.25 * p[2] * p[0]
                    - 0.2 * p[1] * p[2];
                if lopsided { p.map(|x| x * radius) } else { p }
            })
            .collect();
        let faces: Vec<[u32; 3]> = (0..(rows - 1) * columns)
            .flat_map(|a| {
                let next = a - a % columns + (a + 1) % columns;
                [[a, a + columns, next], [next, a + columns, next + columns]]
            })
            .collect();
        let topology = Topology::new(&faces, &rest);
        (rest, topology)
    }

    fn find(rest: &[[f64; 3]], topology: &Topology) -> Option<MirrorPlane> {
        MirrorPlane::find(rest, &topology.vertex_areas(rest), topology)
    }

    #[test]
    fn a_creature_has_a_left_and_a_right_wherever_it_stands() {
        let settings = Settings {
            frames: 2,
            vertices: 900,
            seed: 0,
        };
        let sequence = creature(&settings).unwrap();
        let rest = widened(&sequence.shapes[0]);
        let topology = Topology::new(&sequence.faces, &rest);
        let plane = find(&rest, &topology).unwrap();
        assert!(plane.normal[0] > 0.999 && plane.offset.abs() < 0.01, "{plane:?}");
        let turned: Vec<[f64; 3]> = rest
            .iter()
            .map(|p| {
                let turned = Rotation3::from_euler_angles(0.5, 0.9, -0.3) * Vector3::from(*p);
                (turned + Vector3::new(5.0, -3.0, 2.0)).into()
            })
            .collect();
        let expected = Rotation3::from_euler_angles(0.5, 0.9, -0.3) * unit(0);
        let plane = find(&turned, &topology).unwrap();
        assert!(
            Vector3::from(plane.normal).dot(&expected).abs() > 0.999,
            "{:?}",
            plane.normal
        );
        for (v, &other) in plane.mirrored.iter().enumerate() {
            let sum = plane.side(turned[v]) + plane.side(turned[other as usize]);
            assert!(sum.abs() < 0.1, "vertex {v} and {other}");
        }
    }

    #[test]
    fn a_lopsided_thing_has_none_and_a_sheet_is_not_its_own() {
        let (rest, topology) = ball(true);
        assert_eq!(find(&rest, &topology), None);
        let flat: Vec<[f64; 3]> = rest.iter().map(|p| [p[0], p[1], 0.0]).collect();
        assert!(find(&flat, &topology).is_none_or(|plane| plane.normal[2] < 0.1));
    }

    /// A field around a centre: rotation about `axis` and a stretch along it, fading with the distance.
    fn bump(rest: &[[f64; 3]], centre: [f64; 3], axis: [f64; 3], level: u32) -> Field {
        let at = |p: &[f64; 3]| (-4.0 * (Vector3::from(*p) - Vector3::from(centre)).norm_squared()).exp();
        Field {
            level,
            stop: 1.0,
            vertices: (0..rest.len() as u32).collect(),
            values: rest
                .iter()
                .map(|p| {
                    let [x, y, z] = axis.map(|a| a * at(p));
                    [
                        x,
                        y,
                        z,
                        0.1 * x * x,
                        0.1 * x * y,
                        0.1 * x * z,
                        0.1 * y * y,
                        0.1 * y * z,
                        0.1 * z * z,
                    ]
                })
                .collect(),
        }
    }

    #[test]
    fn components_find_their_mirror_images() {
        let (rest, topology) = ball(false);
        let areas = topology.vertex_areas(&rest);
        let plane = find(&rest, &topology).unwrap();
        assert!(plane.normal[0] > 0.999, "sideways first: {:?}", plane.normal);
        let mut backwards = bump(&rest, [-0.9, 0.0, 0.5], [0.5, -1.0, 0.4], 0);
        backwards.stop = -1.0;
        let fields = [
            // An arm on either side: axes keep x and turn y and z.
            bump(&rest, [0.9, 0.0, 0.5], [0.5, 1.0, -0.4], 0),
            backwards,
            // Nods and turns of the middle: the same, and the opposite, on the other side.
            bump(&rest, [0.0, 0.0, 1.3], [1.0, 0.0, 0.0], 0),
            bump(&rest, [0.0, 0.0, -1.3], [0.0, 1.0, 0.0], 0),
            // Alone on its side; its like is of another level.
            bump(&rest, [0.5, 0.5, 0.0], [0.0, 0.0, 1.0], 0),
            bump(&rest, [-0.5, 0.5, 0.0], [0.0, 0.0, -1.0], 1),
        ];
        let images = mirror_images(&fields, &areas, &plane);
        let seen: Vec<Option<(usize, bool)>> = images.iter().map(|i| i.map(|i| (i.component, i.reversed))).collect();
        let expected = [
            Some((1, true)),
            Some((0, true)),
            Some((2, false)),
            Some((3, true)),
            None,
            None,
        ];
        assert_eq!(seen, expected, "{images:?}");
        assert!(images[0].unwrap().cosine > 0.99 && images[3].unwrap().cosine < -0.8);
    }
}
