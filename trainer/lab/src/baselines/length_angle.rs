//! A mesh as the lengths of its edges and the dihedral angles at them, and the way back to positions: what Wang 2017
//! (see [`super::wang`]) decomposes. Nothing here depends on where a shape stands or how it is turned.
//!
//! Back to positions in the paper's two steps. Lengths lay every face flat, and with the angles give the connection map
//! that takes a face's frame to its neighbour's. First all frames: they follow the maps along a tree, then become the
//! ones that disagree least with all maps. The paper solves that linearly in matrices, anew for every pose; here
//! rotations are averaged (Govindu 2004), every round one solve with the same factored Laplacian of the faces, so that
//! frames stay rotations. Then positions: frames and flat faces make gradients, and [`FaceField`] solves for positions.

use std::collections::BTreeMap;

use faer::sparse::Triplet;
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};

use super::face_graph::{Link, spanning_tree, ties};
use super::flat_face::Layout;
use super::gradient_field::{FaceField, GradientField};
use sinew_trainer::features::align::RigidMotion;
use sinew_trainer::mesh::sparse_factor::{FactorError, SparseFactor};

/// Lengths stay above this share of those at rest: blended ones may fall below zero.
const SHORTEST: f64 = 1e-3;
/// Rounds of averaging at most; each leaves a few percent of what the one before did.
const ROUND_LIMIT: usize = 20;
/// The averaging ends when a round lowers the disagreement by less than this share of it.
const LEAST_GAIN: f64 = 1e-3;
/// Mean squared disagreement, in radians, that is rounding.
const AGREED: f64 = 1e-24;
/// An edge of faces with area; where more than two meet, one for each pair of neighbours in the list.
#[derive(Debug, Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    /// Face and corner it starts from, on both sides; the first alone at a boundary.
    sides: [Option<(usize, usize)>; 2],
}

/// Edges, frames and solves of one rest shape. F faces, E edges.
#[derive(Debug)]
pub struct LengthAngleField<'f> {
    field: &'f FaceField,
    edges: Vec<Edge>,
    /// Edge that starts at each corner; `None` for faces without area. Shape: `[F]`.
    edge_of: Vec<Option<[usize; 3]>>,
    /// Length and angle at rest. Shape: `[E]`.
    rest: Vec<[f64; 2]>,
    /// Mean length at rest: the unit of lengths in features.
    unit: f64,
    /// Frames at rest. Shape: `[F]`.
    rest_frames: Vec<UnitQuaternion<f64>>,
    links: Vec<Link>,
    /// Links, and whether they are walked forwards, from the root outwards.
    tree: Vec<(usize, bool)>,
    /// Laplacian over faces, roots anchored.
    laplacian: SparseFactor,
}

/// A pose on the way from features to positions.
struct Posed {
    /// Lengths of all edges.
    lengths: Vec<f64>,
    /// Corners of faces in their planes.
    layouts: Vec<Layout>,
    frames: Vec<UnitQuaternion<f64>>,
    /// Of faces. Shape: `[F]`.
    gradients: Vec<Matrix3<f64>>,
}

impl<'f> LengthAngleField<'f> {
    /// Reads edges off the faces with area of `field`. Errors: a mesh whose faces do not fit into memory.
    pub fn new(field: &'f FaceField) -> Result<Self, FactorError> {
        let (faces, rest) = (field.faces(), field.rest());
        let mut around: BTreeMap<[u32; 2], Vec<(usize, usize)>> = BTreeMap::new();
        for (f, face) in faces.iter().enumerate().filter(|(f, _)| field.has_area(*f)) {
            for n in 0..3 {
                let (a, b) = (face[n], face[(n + 1) % 3]);
                around.entry([a.min(b), a.max(b)]).or_default().push((f, n));
            }
        }
        let mut edge_of = vec![None; faces.len()];
        let mut edges = Vec::new();
        for (ends, sides) in &around {
            for &(f, n) in sides {
                edge_of[f].get_or_insert([0; 3])[n] = edges.len();
            }
            edges.push(Edge {
                ends: *ends,
                sides: [sides.first().copied(), sides.get(1).copied()],
            });
            edges.extend(sides.windows(2).skip(1).map(|pair| Edge {
                ends: *ends,
                sides: [Some(pair[0]), Some(pair[1])],
            }));
        }
        let rest_frames: Vec<UnitQuaternion<f64>> = faces.iter().map(|face| frame_of(face, rest)).collect();
        let mut links: Vec<Link> = Vec::new();
        for (edge, Edge { sides, .. }) in edges.iter().enumerate() {
            if let [Some((f, _)), Some((g, _))] = sides {
                links.push(Link::Hinge { edge, faces: [*f, *g] });
            }
        }
        links.extend(ties(field, &links).into_iter().map(|faces| Link::Tie {
            faces,
            turn: rest_frames[faces[0]].inverse() * rest_frames[faces[1]],
        }));
        let (tree, roots) = spanning_tree(faces.len(), &links);
        let mut lower: Vec<Triplet<usize, usize, f64>> = roots.iter().map(|&f| Triplet::new(f, f, 1.0)).collect();
        for link in &links {
            let [f, g] = link.faces();
            lower.push(Triplet::new(f, f, 1.0));
            lower.push(Triplet::new(g, g, 1.0));
            lower.push(Triplet::new(f.max(g), f.min(g), -1.0));
        }
        let mut own = Self {
            laplacian: SparseFactor::from_lower(faces.len(), &lower)?,
            field,
            edge_of,
            rest: Vec::new(),
            unit: 1.0,
            rest_frames,
            links,
            tree,
            edges,
        };
        own.rest = own.measure(rest);
        let mean = own.rest.iter().map(|[length, _]| length).sum::<f64>() / own.rest.len().max(1) as f64;
        own.unit = if mean > 0.0 { mean } else { 1.0 };
        Ok(own)
    }

    /// E.
    pub fn edge_count(&self) -> usize {
        self.edges.len()
    }

    /// Vertices of edge `e`.
    pub fn ends(&self, e: usize) -> [usize; 2] {
        self.edges[e].ends.map(|v| v as usize)
    }

    /// Areas of the faces at each edge, mean one, kept above a hundredth. Shape: `[E]`.
    pub fn areas(&self) -> Vec<f64> {
        let faces = self.field.areas();
        let sides = |edge: &Edge| edge.sides.iter().flatten().map(|(f, _)| faces[*f]).sum::<f64>();
        let mean = self.edges.iter().map(sides).sum::<f64>() / self.edges.len().max(1) as f64;
        let share = |edge| {
            if mean > 0.0 {
                (sides(edge) / mean).max(0.01)
            } else {
                1.0
            }
        };
        self.edges.iter().map(share).collect()
    }

    /// Lengths, in mean lengths at rest, and dihedral angles, in radians, both less those at rest. Shape: `[E x 2]`.
    pub fn features(&self, shape: &[[f64; 3]]) -> Vec<f64> {
        let edges = self.measure(shape).into_iter().zip(&self.rest);
        let less_rest = edges.flat_map(|([length, angle], rest)| {
            let turned = angle - rest[1];
            let turns = (turned / core::f64::consts::TAU).round();
            [(length - rest[0]) / self.unit, turned - turns * core::f64::consts::TAU]
        });
        less_rest.collect()
    }

    /// Length and dihedral angle of every edge.
    fn measure(&self, shape: &[[f64; 3]]) -> Vec<[f64; 2]> {
        let at = |v: u32| Vector3::from(shape[v as usize]);
        let faces = self.field.faces();
        let normal = |f: usize| {
            let [a, b, c] = faces[f].map(at);
            (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default()
        };
        let of_edge = |edge: &Edge| {
            let [Some((f, n)), second] = edge.sides else {
                return [0.0; 2];
            };
            let along = at(faces[f][(n + 1) % 3]) - at(faces[f][n]);
            let length = along.norm();
            let angle = second.map_or(0.0, |(g, _)| {
                let (left, right) = (normal(f), normal(g));
                let along = along.try_normalize(0.0).unwrap_or_default();
                along.dot(&left.cross(&right)).atan2(left.dot(&right))
            });
            [length, angle]
        };
        self.edges.iter().map(of_edge).collect()
    }

    /// Positions of features (`[E x 2]`), laid onto the rest shape. Shape: `[V]`.
    pub fn positions(&self, features: &[f64]) -> Vec<[f64; 3]> {
        self.place(&self.pose(features))
    }

    /// Derivatives of [`Self::positions`] along `directions` (each `[E x 2]`), as exact as `features` belong to a shape.
    /// Shape: `[directions][V]`.
    pub fn tangents(&self, features: &[f64], directions: &[Vec<f64>]) -> Vec<Vec<[f32; 3]>> {
        use rayon::prelude::*;
        let posed = self.pose(features);
        let positions = self.place(&posed);
        // The pose stands where its frames put it; its tangents are to stand where it was laid.
        let motion = RigidMotion::onto(&positions, &self.unplaced(&posed)).rotation;
        let follow = |direction: &Vec<f64>| {
            let moved = self
                .field
                .displacements(&self.gradient_changes(&posed, features, direction));
            let moved: Vec<Vector3<f64>> = moved.iter().map(|d| motion * Vector3::from(*d)).collect();
            self.laid_changes(&positions, &moved)
        };
        directions.par_iter().map(follow).collect()
    }

    fn pose(&self, features: &[f64]) -> Posed {
        let values = features.as_chunks::<2>().0.iter().zip(&self.rest);
        let (lengths, angles): (Vec<f64>, Vec<f64>) = values
            .map(|(x, rest)| ((rest[0] + self.unit * x[0]).max(SHORTEST * rest[0]), rest[1] + x[1]))
            .unzip();
        let layouts: Vec<Layout> = self
            .edge_of
            .iter()
            .map(|edges| edges.map_or(Layout::FLAT, |edges| Layout::new(edges.map(|e| lengths[e]))))
            .collect();
        let turns: Vec<UnitQuaternion<f64>> = self
            .links
            .iter()
            .map(|link| match link {
                Link::Tie { turn, .. } => *turn,
                Link::Hinge { edge, .. } => {
                    let [from, to] = self.directions(*edge, &layouts);
                    about(Vector3::z(), from) * about(Vector3::x(), angles[*edge]) * about(Vector3::z(), -to)
                }
            })
            .collect();
        let mut frames = self.rest_frames.clone();
        for &(link, forwards) in &self.tree {
            let [f, g] = self.links[link].faces();
            if forwards {
                frames[g] = frames[f] * turns[link];
            } else {
                frames[f] = frames[g] * turns[link].inverse();
            }
        }
        self.average(&turns, &mut frames);
        let gradients = (0..frames.len()).map(|f| match self.field.rest_inverse(f) {
            Some(inverse) => frames[f].to_rotation_matrix() * layouts[f].edges() * inverse,
            None => Matrix3::identity(),
        });
        Posed {
            gradients: gradients.collect(),
            lengths,
            layouts,
            frames,
        }
    }

    /// Turns frames until all links disagree least.
    fn average(&self, turns: &[UnitQuaternion<f64>], frames: &mut Vec<UnitQuaternion<f64>>) {
        let disagreement = |frames: &[UnitQuaternion<f64>]| -> (Vec<Vector3<f64>>, f64) {
            let links = self.links.iter().zip(turns);
            let all: Vec<Vector3<f64>> = links
                .map(|(link, turn)| {
                    let [f, g] = link.faces();
                    (frames[f] * turn * frames[g].inverse()).scaled_axis()
                })
                .collect();
            let sum = all.iter().map(Vector3::norm_squared).sum();
            (all, sum)
        };
        let (mut misfits, mut cost) = disagreement(frames);
        for _ in 0..ROUND_LIMIT {
            if cost <= AGREED * misfits.len() as f64 {
                return;
            }
            let turned = self.spread(&misfits);
            let next: Vec<UnitQuaternion<f64>> = frames
                .iter()
                .zip(&turned)
                .map(|(frame, turn)| UnitQuaternion::from_scaled_axis(Vector3::from(*turn)) * frame)
                .collect();
            let (next_misfits, next_cost) = disagreement(&next);
            if next_cost >= cost {
                return;
            }
            let done = cost - next_cost < LEAST_GAIN * cost;
            *frames = next;
            (misfits, cost) = (next_misfits, next_cost);
            if done {
                return;
            }
        }
    }

    /// Turns of the faces whose differences along links are nearest to `along`.
    fn spread(&self, along: &[Vector3<f64>]) -> Vec<[f64; 3]> {
        let mut values = vec![[0.0; 3]; self.rest_frames.len()];
        for (link, turn) in self.links.iter().zip(along) {
            let [f, g] = link.faces();
            for c in 0..3 {
                values[f][c] -= turn[c];
                values[g][c] += turn[c];
            }
        }
        self.laplacian.solve(&mut values);
        values
    }

    /// Angles of a hinge's direction in the planes of both of its faces.
    fn directions(&self, edge: usize, layouts: &[Layout]) -> [f64; 2] {
        let Edge { sides, .. } = self.edges[edge];
        let [Some((f, n)), Some((g, m))] = sides else {
            return [0.0; 2];
        };
        let faces = self.field.faces();
        let turn = if faces[f][n] == faces[g][m] {
            0.0
        } else {
            core::f64::consts::PI
        };
        [layouts[f].direction(n), layouts[g].direction(m) + turn]
    }

    fn unplaced(&self, posed: &Posed) -> Vec<[f64; 3]> {
        let deviations: Vec<Matrix3<f64>> = posed.gradients.iter().map(|t| t - Matrix3::identity()).collect();
        let mut positions = self.field.displacements(&deviations);
        for (position, rest) in positions.iter_mut().zip(self.field.rest()) {
            *position = core::array::from_fn(|c| position[c] + rest[c]);
        }
        positions
    }

    fn place(&self, posed: &Posed) -> Vec<[f64; 3]> {
        let positions = self.unplaced(posed);
        let motion = RigidMotion::onto(self.field.rest(), &positions);
        positions.into_iter().map(|p| motion.apply(p)).collect()
    }

    /// Derivatives of the gradients along one direction of features.
    fn gradient_changes(&self, posed: &Posed, features: &[f64], direction: &[f64]) -> Vec<Matrix3<f64>> {
        let changes = direction.as_chunks::<2>().0;
        let lengthening = |e: usize| {
            let free = self.rest[e][0] + self.unit * features[2 * e] > SHORTEST * self.rest[e][0];
            if free { self.unit * changes[e][0] } else { 0.0 }
        };
        let layouts: Vec<[Vector2<f64>; 2]> = self
            .edge_of
            .iter()
            .zip(&posed.layouts)
            .map(|(edges, layout)| {
                edges.map_or([Vector2::zeros(); 2], |edges| {
                    layout.change(edges.map(|e| posed.lengths[e]), edges.map(lengthening))
                })
            })
            .collect();
        let along: Vec<Vector3<f64>> = self
            .links
            .iter()
            .map(|link| {
                let Link::Hinge { edge, faces: [f, g] } = *link else {
                    return Vector3::zeros();
                };
                let [Some((_, n)), Some((_, m))] = self.edges[edge].sides else {
                    return Vector3::zeros();
                };
                let (left, right) = (posed.frames[f], posed.frames[g]);
                let axis = left * about(Vector3::z(), posed.layouts[f].direction(n)) * Vector3::x();
                let plane = |f: usize, n: usize| posed.layouts[f].direction_change(n, &layouts[f]);
                left * Vector3::z() * plane(f, n) + axis * changes[edge][1] - right * Vector3::z() * plane(g, m)
            })
            .collect();
        let turned = self.spread(&along);
        (0..turned.len())
            .map(|f| match self.field.rest_inverse(f) {
                Some(inverse) => {
                    let [b, c] = layouts[f];
                    let flat = Matrix3::from_columns(&[b.push(0.0), c.push(0.0), Vector3::zeros()]);
                    let turn = Vector3::from(turned[f]).cross_matrix();
                    turn * posed.gradients[f] + posed.frames[f].to_rotation_matrix() * flat * inverse
                }
                None => Matrix3::zeros(),
            })
            .collect()
    }

    /// What is left of `moved` when the pose is laid onto the rest shape anew.
    fn laid_changes(&self, positions: &[[f64; 3]], moved: &[Vector3<f64>]) -> Vec<[f32; 3]> {
        let rest = self.field.rest();
        let count = rest.len().max(1) as f64;
        let mean = |sum: Vector3<f64>| sum / count;
        let (middle, middle_rest) = (
            mean(positions.iter().map(|p| Vector3::from(*p)).sum()),
            mean(rest.iter().map(|p| Vector3::from(*p)).sum()),
        );
        let drift = mean(moved.iter().sum());
        // Laid on, sum p x r = 0; a small turn w keeps it so: (sum p.r - sum p r^T) w = sum d x r.
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for ((p, r), d) in positions.iter().zip(rest).zip(moved) {
            let (p, r) = (Vector3::from(*p) - middle, Vector3::from(*r) - middle_rest);
            matrix += Matrix3::identity() * p.dot(&r) - p * r.transpose();
            right += (d - drift).cross(&r);
        }
        let turn = matrix
            .try_inverse()
            .map_or_else(Vector3::zeros, |inverse| inverse * right);
        let changes = positions.iter().zip(moved).map(|(p, d)| {
            let change = d - drift + turn.cross(&(Vector3::from(*p) - middle));
            [change.x as f32, change.y as f32, change.z as f32]
        });
        changes.collect()
    }
}

fn about(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::new(axis * angle)
}

/// First edge, across it in the plane, normal.
fn frame_of(face: &[u32; 3], shape: &[[f64; 3]]) -> UnitQuaternion<f64> {
    let [a, b, c] = face.map(|v| Vector3::from(shape[v as usize]));
    let along = (b - a).try_normalize(0.0).unwrap_or_else(Vector3::x);
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
    let normal = normal.unwrap_or_else(|| along.cross(&Vector3::new(along.y, along.z, -along.x)).normalize());
    UnitQuaternion::from_basis_unchecked(&[along, normal.cross(&along), normal])
}
