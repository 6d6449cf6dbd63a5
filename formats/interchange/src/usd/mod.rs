//! USD, as text (`.usda`), binary (`.usdc`) or in a package (`.usdz`): meshes with points over time, UsdSkel skeletons and blend shapes,
//! transforms over time. One layer is read as it stands: what it refers to in other layers, and its variants, are named and not
//! followed.
//!
//! The reader is one of our own of this subset: the crates that read USD want a newer compiler, or trust the counts of a file.

mod crates;
mod layer;
mod mesh;
mod packed;
mod skel;
mod stage;
mod text;
mod values;
mod write;

use super::bytes::Bytes;
use super::choose::Choice;
use super::error::{Place, SequenceError};
use super::folder::{file_name, read_file};
use super::format::{Format, Reading};
use super::notice::Notice;
use super::rig::{Node, Pose, RigFile, RigMesh, RigScene, ordered};
use super::scene::{Contents, MeshEntry, Motion, Scene, UpAxis};
use super::text::unexpected;
use glam::DAffine3;
use layer::{Attribute, Layer, Source};
use skel::{Binding, Skeleton};
use stage::{Clock, Operations};
use std::collections::{BTreeMap, HashSet};
use std::fs::File;
use std::path::Path;
use zip::{CompressionMethod, ZipArchive};

pub(super) const FORMAT: Format = Format {
    name: "USD",
    extensions: &["usda", "usd", "usdc", "usdz"],
    reading: Reading::Scene(open),
    writing: Some(write::open),
};

/// Kinds of prims that are shapes and no meshes.
const SHAPES: [(&str, &str); 10] = [
    ("BasisCurves", "groups of curves"),
    ("NurbsCurves", "groups of curves"),
    ("Points", "particle systems"),
    ("PointInstancer", "particle systems"),
    ("NurbsPatch", "NURBS patches"),
    ("Sphere", "spheres, cubes and the like"),
    ("Cube", "spheres, cubes and the like"),
    ("Cylinder", "spheres, cubes and the like"),
    ("Cone", "spheres, cubes and the like"),
    ("Capsule", "spheres, cubes and the like"),
];

/// A layer and what of it moves.
struct Usd {
    source: Source,
    layer: Layer,
    clock: Clock,
    meshes: Vec<Mesh>,
    skeletons: Vec<Skeleton>,
    /// Prims that move, and how.
    moving: Vec<(usize, Operations)>,
}

/// Time codes of samples, each attribute taken once.
#[derive(Default)]
struct Samples {
    codes: Vec<f64>,
    taken: HashSet<*const Attribute>,
}

impl Samples {
    /// Adds those of an attribute; whether it varies.
    fn add(&mut self, attribute: &Attribute) -> bool {
        if attribute.varies() && self.taken.insert(core::ptr::from_ref(attribute)) {
            self.codes.extend(attribute.samples.iter().map(|&(code, _)| code));
        }
        attribute.varies()
    }
}

struct Mesh {
    prim: usize,
    binding: Binding,
}

/// Opens whatever the first bytes say that the file is.
fn load(path: &Path) -> Result<(Source, Layer), SequenceError> {
    let mut file = Bytes::open(path)?;
    let head = file.head(8)?;
    if head.starts_with(b"PK") {
        file = packaged(path)?;
    }
    let head = file.head(8)?;
    if head.starts_with(crates::SIGNATURE) {
        let (source, layer) = crates::read(file)?;
        return Ok((Source::Crate(Box::new(source)), layer));
    }
    if !head.starts_with(text::SIGNATURE) {
        return Err(unexpected(
            path,
            Place::Byte(0),
            "`#usda 1.0` or `PXR-USDC`, the beginning of a USD file",
            Some(&head),
        ));
    }
    // A text on its own is read at once; one in a package as a part.
    let bytes = if file.path() == path {
        read_file(path)?
    } else {
        file.head(u64::MAX)?
    };
    let (source, layer) = text::read(bytes, path)?;
    Ok((Source::Text(source), layer))
}

/// The first layer of a package.
fn packaged(path: &Path) -> Result<Bytes, SequenceError> {
    let refuse = |found: &str| SequenceError::Parse {
        path: path.into(),
        place: Place::Byte(0),
        expected: "a package of USD, whose first file is a layer that is not compressed".into(),
        found: found.into(),
    };
    let file = File::open(path).map_err(|source| SequenceError::Io {
        path: path.into(),
        source,
    })?;
    let mut archive = ZipArchive::new(std::io::BufReader::new(file)).map_err(|error| refuse(&error.to_string()))?;
    let first = archive.by_index(0).map_err(|error| refuse(&error.to_string()))?;
    let start = first.data_start().ok_or_else(|| refuse("no beginning of it"))?;
    let (name, size, method) = (
        first.name().unwrap_or_default().into_owned(),
        first.size(),
        first.compression(),
    );
    let whole = Bytes::open(path)?;
    let is_inside = start.checked_add(size).is_some_and(|end| end <= whole.len());
    if method != CompressionMethod::Stored || !is_inside || !name.contains(".usd") {
        return Err(refuse(&format!("`{name}`")));
    }
    Ok(whole.part(start, size, path.join(name)))
}

fn open(path: &Path, _: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    let (mut source, mut layer) = load(path)?;
    layer.link();
    let clock = Clock::read(&mut source, &layer)?;
    let mut nodes = Vec::with_capacity(layer.prims.len());
    let mut moving = Vec::new();
    for prim in 0..layer.prims.len() {
        let operations = Operations::read(&mut source, &layer, prim)?;
        nodes.push(Node {
            parent: layer.prims[prim].parent.filter(|_| !operations.is_reset),
            rest: operations.transform(&mut source, &layer, prim, None)?,
        });
        if operations.attributes(&layer, prim).any(Attribute::varies) {
            moving.push((prim, operations));
        }
    }
    let mut skeletons = Vec::new();
    for prim in (0..layer.prims.len()).filter(|&prim| layer.prims[prim].type_name == "Skeleton") {
        let skeleton = Skeleton::read(&mut source, &layer, prim, nodes.len())?;
        nodes.extend(skeleton.nodes());
        skeletons.push(skeleton);
    }
    let mut meshes = Vec::new();
    for prim in (0..layer.prims.len()).filter(|&prim| layer.prims[prim].type_name == "Mesh") {
        let binding = Binding::read(&mut source, &layer, prim, &skeletons)?;
        meshes.push(Mesh { prim, binding });
    }
    let parents: Vec<Option<usize>> = nodes.iter().map(|node| node.parent).collect();
    let order = ordered(&parents).ok_or_else(|| source.refuse("", "a tree of prims", "a prim above itself"))?;
    let mut file = Usd {
        source,
        layer,
        clock,
        meshes,
        skeletons,
        moving,
    };
    let contents = file.contents(&parents, path)?;
    let mesh_nodes = file.meshes.iter().map(|mesh| mesh.prim).collect();
    let weights = file
        .meshes
        .iter()
        .map(|mesh| vec![0.0; mesh.binding.shapes.len()])
        .collect();
    Ok(Box::new(RigScene::new(
        file, contents, nodes, order, mesh_nodes, weights,
    )))
}

impl Usd {
    fn contents(&mut self, parents: &[Option<usize>], path: &Path) -> Result<Contents, SequenceError> {
        let mut contents = Contents {
            format: FORMAT.name,
            ..Contents::default()
        };
        if let Some(&raw) = self.layer.metadata.get("metersPerUnit") {
            let metres = self.source.numbers(raw)?.and_then(|values| values.first().copied());
            contents.unit_metres = metres.filter(|metres| *metres > 0.0 && metres.is_finite());
        }
        if let Some(&raw) = self.layer.metadata.get("upAxis") {
            contents.up = match self.source.strings(raw)?.first().map(String::as_str) {
                Some("X") => Some(UpAxis::X),
                Some("Y") => Some(UpAxis::Y),
                Some("Z") => Some(UpAxis::Z),
                _ => None,
            };
        }
        let mut others = BTreeMap::new();
        for prim in &self.layer.prims {
            if let Some((_, kind)) = SHAPES.iter().find(|(name, _)| *name == prim.type_name) {
                *others.entry((*kind).to_string()).or_default() += 1;
            }
        }
        for (count, what) in [
            (
                self.layer.reference_count,
                "references, which are not followed: write one file with `usdcat --flatten`",
            ),
            (
                self.layer.variant_count,
                "variants, which are not chosen from: write one file with `usdcat --flatten`",
            ),
        ] {
            if count > 0 {
                others.insert(what.into(), count);
                contents.notices.push(Notice::Remark(format!("{count} {what}")));
            }
        }
        contents.others = others.into_iter().collect();
        let mut samples = Samples::default();
        for mesh in &self.meshes {
            contents.meshes.push(self.entry(mesh, parents, &mut samples));
        }
        let codes = samples.codes;
        for (entry, mesh) in contents.meshes.iter_mut().zip(&self.meshes) {
            let size = |source: &mut Source, name: &str| -> Result<usize, SequenceError> {
                Ok(source
                    .still(&self.layer, mesh.prim, name)?
                    .map_or(0, |values| values.len()))
            };
            entry.vertex_count = size(&mut self.source, "points")? / 3;
            entry.face_count = size(&mut self.source, "faceVertexCounts")?;
        }
        if !codes.is_empty() {
            contents.clips.push(self.clock.clip(file_name(path), codes, path)?);
        }
        Ok(contents)
    }

    /// What is known of a mesh without its sizes; adds the time codes at which it moves.
    fn entry(&self, mesh: &Mesh, parents: &[Option<usize>], samples: &mut Samples) -> MeshEntry {
        let prim = &self.layer.prims[mesh.prim];
        let skeleton = mesh.binding.skeleton.map(|skeleton| &self.skeletons[skeleton]);
        let animation = skeleton.and_then(|skeleton| skeleton.animation.as_ref());
        let mut deforms = prim.attributes.get("points").is_some_and(|points| samples.add(points));
        if let (Some(animation), true) = (animation, mesh.binding.is_skinned) {
            for attribute in animation.attributes(&self.layer) {
                deforms |= samples.add(attribute);
            }
        }
        let weights = animation.and_then(|animation| animation.weights(&self.layer));
        if let Some(weights) = weights.filter(|_| !mesh.binding.shapes.is_empty()) {
            deforms |= samples.add(weights);
        }
        let mut moves = false;
        for node in core::iter::successors(Some(mesh.prim), |&node| parents[node]) {
            let Ok(place) = self.moving.binary_search_by_key(&node, |&(prim, _)| prim) else {
                continue;
            };
            let (prim, operations) = &self.moving[place];
            for attribute in operations.attributes(&self.layer, *prim) {
                moves |= samples.add(attribute);
            }
        }
        let motion = match (deforms, moves) {
            (true, _) => Motion::Deforms,
            (false, true) => Motion::Whole,
            (false, false) => Motion::Still,
        };
        MeshEntry {
            name: prim.path.clone(),
            vertex_count: 0,
            face_count: 0,
            joint_count: mesh.binding.joint_count,
            morphs: mesh.binding.shapes.iter().map(|(name, _)| name.clone()).collect(),
            motion,
        }
    }

    /// Refuses faces that are not those at rest.
    fn check_faces(&mut self, prim: usize, time: f64) -> Result<(), SequenceError> {
        for name in ["faceVertexCounts", "faceVertexIndices"] {
            let Some(attribute) = self.layer.prims[prim]
                .attributes
                .get(name)
                .filter(|attribute| attribute.varies())
            else {
                continue;
            };
            let now = self
                .source
                .around(attribute, Some(time * self.clock.codes))?
                .map(|around| around.before);
            if now != self.source.at(attribute, None)? {
                return Err(SequenceError::TopologyVaries {
                    path: self.source.path().into(),
                    mesh: self.layer.prims[prim].path.clone(),
                    time,
                });
            }
        }
        Ok(())
    }
}

impl RigFile for Usd {
    fn load(&mut self, mesh: usize) -> Result<RigMesh, SequenceError> {
        let Mesh { prim, binding } = &self.meshes[mesh];
        let mut geometry = mesh::geometry(&mut self.source, &self.layer, *prim)?;
        let vertex_count = geometry.positions.len();
        let mut rig = RigMesh::default();
        if let Some(skeleton) = binding.skeleton.filter(|_| binding.is_skinned) {
            let skeleton = &self.skeletons[skeleton];
            let (joints, skin, dual) = skel::hold(&mut self.source, &self.layer, *prim, skeleton, vertex_count)?;
            geometry.dress.skin = Some(skin);
            (rig.joints, rig.dual) = (joints, dual);
        }
        for &(_, shape) in &binding.shapes {
            rig.morphs
                .push(skel::morph(&mut self.source, &self.layer, shape, vertex_count)?);
        }
        rig.geometry = geometry;
        Ok(rig)
    }

    fn pose(&mut self, _: usize, time: f64, pose: &mut Pose) -> Result<(), SequenceError> {
        let code = time * self.clock.codes;
        for (prim, operations) in &self.moving {
            let moved: DAffine3 = operations.transform(&mut self.source, &self.layer, *prim, Some(code))?;
            pose.locals[*prim] = moved;
        }
        for skeleton in &self.skeletons {
            skeleton.pose(&mut self.source, &self.layer, code, &mut pose.locals)?;
        }
        for (mesh, weights) in self.meshes.iter().zip(&mut pose.weights) {
            let skeleton = mesh.binding.skeleton.map(|skeleton| &self.skeletons[skeleton]);
            let Some(animation) = skeleton.and_then(|skeleton| skeleton.animation.as_ref()) else {
                continue;
            };
            let Some(attribute) = animation.weights(&self.layer) else {
                continue;
            };
            let values = self.source.at(attribute, Some(code))?.unwrap_or_default();
            for ((name, _), weight) in mesh.binding.shapes.iter().zip(weights) {
                let place = animation.shapes.iter().position(|shape| shape == name);
                *weight = place.and_then(|place| values.get(place)).copied().unwrap_or(0.0);
            }
        }
        Ok(())
    }

    fn points(&mut self, mesh: usize, _: usize, time: f64) -> Result<Option<Vec<[f32; 3]>>, SequenceError> {
        let prim = self.meshes[mesh].prim;
        self.check_faces(prim, time)?;
        let points = self.layer.prims[prim]
            .attributes
            .get("points")
            .filter(|attribute| attribute.varies());
        let Some(attribute) = points else { return Ok(None) };
        let values = self.source.at(attribute, Some(time * self.clock.codes))?;
        Ok(values.map(|values| mesh::points(&values)))
    }
}
