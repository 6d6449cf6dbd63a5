//! Alembic in the Ogawa container: polygon meshes and subdivision cages, the transforms above them, sample times. Curves, points and
//! cameras are counted and passed over. No crate is fit to read it: those that there are panic on real files.

mod headers;
mod mesh;
mod ogawa;
mod sampling;
mod transform;
mod write;

use super::bytes::Bytes;
use super::cache::{around_by, blend};
use super::choose::Choice;
use super::error::SequenceError;
use super::folder::file_name;
use super::format::{Format, Reading};
use super::mesh::PolygonMesh;
use super::scene::{ClipEntry, Contents, MeshEntry, Moment, Motion, Scene, Space};
use glam::{DAffine3, DVec3};
use headers::{Archive, Kind, Object, Property, value_of};
use mesh::AbcMesh;
use ogawa::Ogawa;
use std::collections::BTreeMap;
use std::path::Path;
use transform::Transform;

pub(super) const FORMAT: Format = Format {
    name: "Alembic",
    extensions: &["abc"],
    reading: Reading::Scene(open),
    writing: Some(write::open),
};

/// Objects inside objects: more are a fault or a trap.
const DEPTH_MAX: usize = 256;

fn open(path: &Path, _: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    let (file, root) = Ogawa::open(Bytes::open(path)?)?;
    let (archive, top) = Archive::open(file, &root)?;
    let mut scene = Alembic {
        archive,
        nodes: Vec::new(),
        meshes: Vec::new(),
        contents: Contents {
            format: FORMAT.name,
            ..Contents::default()
        },
        other: Vec::new(),
    };
    let mut others = BTreeMap::new();
    scene.walk(&top, "", None, &mut others, 0)?;
    scene.contents.others = others.into_iter().collect();
    scene.list(path);
    Ok(Box::new(scene))
}

/// An archive, its transforms and its meshes.
struct Alembic {
    archive: Archive,
    nodes: Vec<Node>,
    meshes: Vec<AbcMesh>,
    contents: Contents,
    /// Points of a sample to blend with.
    other: Vec<[f32; 3]>,
}

/// A transform and the one above it.
struct Node {
    parent: Option<usize>,
    transform: Transform,
}

impl Alembic {
    /// Collects transforms and meshes below an object.
    fn walk(
        &mut self,
        object: &Object,
        path: &str,
        node: Option<usize>,
        others: &mut BTreeMap<String, usize>,
        depth: usize,
    ) -> Result<(), SequenceError> {
        if depth > DEPTH_MAX {
            return Err(self
                .archive
                .file
                .refuse(0, &format!("objects up to {DEPTH_MAX} deep"), "more"));
        }
        for child in self.archive.children(object)? {
            let name = if path.is_empty() {
                child.name.clone()
            } else {
                format!("{path}/{}", child.name)
            };
            let schema = value_of(&child.metadata, "schema").unwrap_or_default().to_owned();
            let kind = schema
                .strip_prefix("AbcGeom_")
                .and_then(|rest| rest.split('_').next())
                .unwrap_or(&schema);
            let mut below = node;
            match kind {
                "Xform" => {
                    let properties = self.archive.properties(&child)?;
                    let transform = Transform::read(&mut self.archive, &properties)?;
                    self.nodes.push(Node {
                        parent: node,
                        transform,
                    });
                    below = Some(self.nodes.len() - 1);
                }
                "PolyMesh" | "SubD" => {
                    let mesh = AbcMesh::read(&mut self.archive, &child, name, node)?;
                    self.meshes.push(mesh);
                    continue;
                }
                "Points" => *others.entry("particle systems".into()).or_default() += 1,
                "Curve" => *others.entry("groups of curves".into()).or_default() += 1,
                "NuPatch" => *others.entry("NURBS patches".into()).or_default() += 1,
                "Camera" => *others.entry("cameras".into()).or_default() += 1,
                "Light" => *others.entry("lights".into()).or_default() += 1,
                _ => {
                    let properties = self.archive.properties(&child)?;
                    if properties.iter().any(|property| property.name == ".instanceSource") {
                        *others.entry("instances".into()).or_default() += 1;
                    }
                }
            }
            self.walk(&child, &name, below, others, depth + 1)?;
        }
        Ok(())
    }

    /// Transforms above a mesh, the nearest first.
    fn above(&self, mesh: usize) -> impl Iterator<Item = &Node> {
        let start = self.meshes[mesh].node;
        core::iter::successors(start, |&node| {
            let node = &self.nodes[node];
            node.parent.filter(|_| node.transform.inherits)
        })
        .map(|node| &self.nodes[node])
    }

    /// Fills in what the file holds.
    fn list(&mut self, path: &Path) {
        let mut times = Vec::new();
        let entries = (0..self.meshes.len()).map(|i| {
            let mesh = &self.meshes[i];
            let varying = self
                .above(i)
                .filter_map(|node| node.transform.values.as_ref())
                .filter(|values| varies(values));
            let varying: Vec<&Property> = varying.collect();
            let motion = if varies(&mesh.points) {
                Motion::Deforms
            } else if varying.is_empty() {
                Motion::Still
            } else {
                Motion::Whole
            };
            let own = [&mesh.points].into_iter().filter(|points| varies(points));
            own.chain(varying)
                .for_each(|property| times.extend(self.times(property)));
            MeshEntry {
                name: mesh.name.clone(),
                vertex_count: mesh.vertex_count,
                face_count: mesh.face_count,
                joint_count: 0,
                morphs: Vec::new(),
                motion,
            }
        });
        self.contents.meshes = entries.collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        if !times.is_empty() {
            self.contents.clips = vec![ClipEntry::timed(file_name(path), times)];
        }
    }

    /// Times of a property's samples.
    fn times(&self, property: &Property) -> Vec<f64> {
        let Kind::Samples(samples) = &property.kind else {
            return Vec::new();
        };
        let sampling = &self.archive.samplings[samples.sampling];
        (0..samples.count).map(|n| sampling.time(n)).collect()
    }

    /// The samples around a moment, and how far it lies towards the second.
    fn samples_at(&self, property: &Property, moment: Moment) -> (usize, usize, f64) {
        match (moment, &property.kind) {
            (Moment::At { time, .. }, Kind::Samples(samples)) if samples.varies() => {
                let sampling = &self.archive.samplings[samples.sampling];
                around_by(samples.count, |n| sampling.time(n), time)
            }
            _ => (0, 0, 0.0),
        }
    }

    fn world_of(&mut self, mesh: usize, moment: Moment) -> Result<DAffine3, SequenceError> {
        let mut whole = DAffine3::IDENTITY;
        let mut node = self.meshes[mesh].node;
        while let Some(current) = node {
            let transform = &self.nodes[current].transform;
            if let Some(values) = transform.values.clone() {
                let (before, behind, share) = self.samples_at(&values, moment);
                let mut numbers = transform::numbers(&mut self.archive, &values, before)?;
                if share > 0.0 {
                    let next = transform::numbers(&mut self.archive, &values, behind)?;
                    numbers.iter_mut().zip(next).for_each(|(a, b)| *a += share * (b - *a));
                }
                let own = self.nodes[current].transform.matrix(&numbers);
                let own = own.ok_or_else(|| {
                    let expected = format!(
                        "as many values as the operations of a transform above `{}`",
                        self.meshes[mesh].name
                    );
                    self.archive
                        .file
                        .refuse(0, &expected, &format!("{} values", numbers.len()))
                })?;
                whole = own * whole;
            }
            let transform = &self.nodes[current];
            node = transform.parent.filter(|_| transform.transform.inherits);
        }
        Ok(whole)
    }
}

/// Whether a property has samples that differ.
fn varies(property: &Property) -> bool {
    matches!(&property.kind, Kind::Samples(samples) if samples.varies())
}

impl Scene for Alembic {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, mesh: usize) -> Result<PolygonMesh, SequenceError> {
        self.meshes[mesh].clone().geometry(&mut self.archive)
    }

    fn positions(
        &mut self,
        mesh: usize,
        moment: Moment,
        space: Space,
        out: &mut Vec<[f32; 3]>,
    ) -> Result<(), SequenceError> {
        if let Moment::At { time, .. } = moment {
            for property in self.meshes[mesh].varying_faces() {
                let (n, _, _) = self.samples_at(&property, moment);
                if self.archive.key(&property, n)? != self.archive.key(&property, 0)? {
                    return Err(SequenceError::TopologyVaries {
                        path: self.archive.file.path().into(),
                        mesh: self.meshes[mesh].name.clone(),
                        time,
                    });
                }
            }
        }
        let points = self.meshes[mesh].points.clone();
        let (before, behind, share) = self.samples_at(&points, moment);
        self.meshes[mesh].positions(&mut self.archive, before, out)?;
        if share > 0.0 {
            self.meshes[mesh].positions(&mut self.archive, behind, &mut self.other)?;
            blend(out, &self.other, share);
        }
        if space == Space::World {
            let to_world = self.world_of(mesh, moment)?;
            if to_world != DAffine3::IDENTITY {
                for p in out {
                    *p = to_world
                        .transform_point3(DVec3::from(p.map(f64::from)))
                        .to_array()
                        .map(|x| x as f32);
                }
            }
        }
        Ok(())
    }

    fn frame_name(&self, clip: usize, frame: usize) -> String {
        format!("{}[{frame}]", self.contents.clips[clip].name)
    }
}
