//! glTF 2.0, as text (`.gltf`) or binary (`.glb`, and `.vrm` avatars): primitives joined to meshes, skins, morph targets, key frames on
//! nodes and weights; quantized, sparse and meshoptimizer-packed arrays. Draco is refused by name.
//!
//! The document is read by types of our own, and arrays by checks of our own: the `gltf` crate's validation refuses what needs
//! packed buffers, and refuses a shape for a fault of a material.

mod accessor;
mod animation;
mod arrays;
mod document;
mod meshopt;
mod primitive;
mod puppet;
mod write;

pub(crate) use puppet::write_puppet;

use super::choose::Choice;
use super::error::SequenceError;
use super::format::{Format, Reading};
use super::notice::Notice;
use super::rig::{Node, Pose, RigFile, RigMesh, RigScene, ordered};
use super::scene::{Contents, MeshEntry, Motion, Scene, UpAxis};
use super::skin::Joint;
use accessor::Accessors;
use animation::{Animation, Placement, normalized};
use document::Store;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use std::collections::HashSet;
use std::path::Path;

pub(super) const FORMAT: Format = Format {
    name: "glTF",
    extensions: &["gltf", "glb", "vrm"],
    reading: Reading::Scene(open),
    writing: Some(write::open),
};

/// A file, its arrays, and what of it was loaded.
struct Gltf {
    accessors: Accessors,
    /// Mesh, skin and node of each mesh of the scene.
    meshes: Vec<Instance>,
    placements: Vec<Placement>,
    /// How many weights the mesh of each node has.
    weight_counts: Vec<usize>,
    parents: Vec<Option<usize>>,
    animation: Option<(usize, Animation)>,
}

#[derive(Clone, Copy)]
struct Instance {
    mesh: usize,
    skin: Option<usize>,
    node: usize,
}

fn open(path: &Path, _: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    let mut accessors = Accessors::new(Store::open(path)?);
    let document = &accessors.store.document;
    let parents = parents(&accessors.store)?;
    let order = ordered(&parents).ok_or_else(|| accessors.store.refuse("a tree of nodes", "a node above itself"))?;
    let mut meshes = Vec::new();
    for (node, entry) in document.nodes.iter().enumerate() {
        let Some(mesh) = entry.mesh else { continue };
        let known = mesh < document.meshes.len() && entry.skin.is_none_or(|skin| skin < document.skins.len());
        if !known {
            return Err(accessors
                .store
                .refuse("meshes and skins that there are", format!("others on node {node}")));
        }
        meshes.push(Instance {
            mesh,
            skin: entry.skin,
            node,
        });
    }
    let nodes: Vec<Node> = (0..document.nodes.len())
        .map(|node| Node {
            parent: parents[node],
            rest: rest(&document.nodes[node]),
        })
        .collect();
    let placements = document.nodes.iter().map(placement).collect();
    let mut weight_counts = vec![0; document.nodes.len()];
    let mut rest_weights = Vec::with_capacity(meshes.len());
    for instance in &meshes {
        let mesh = &document.meshes[instance.mesh];
        let count = primitive::target_names(&accessors, instance.mesh).len();
        weight_counts[instance.node] = count;
        let own = &document.nodes[instance.node].weights;
        let mut weights = if own.is_empty() {
            mesh.weights.clone()
        } else {
            own.clone()
        };
        weights.resize(count, 0.0);
        rest_weights.push(weights);
    }
    let contents = contents(&mut accessors, &meshes, &parents)?;
    let mesh_nodes = meshes.iter().map(|instance| instance.node).collect();
    let file = Gltf {
        accessors,
        meshes,
        placements,
        weight_counts,
        parents,
        animation: None,
    };
    Ok(Box::new(RigScene::new(
        file,
        contents,
        nodes,
        order,
        mesh_nodes,
        rest_weights,
    )))
}

/// The node above each.
fn parents(store: &Store) -> Result<Vec<Option<usize>>, SequenceError> {
    let nodes = &store.document.nodes;
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            let place = parents.get_mut(child);
            let place =
                place.ok_or_else(|| store.refuse(format!("one of {} nodes", nodes.len()), format!("node {child}")))?;
            if place.replace(parent).is_some() {
                return Err(store.refuse("a tree of nodes", format!("node {child} below two others")));
            }
        }
    }
    Ok(parents)
}

fn node_name(store: &Store, node: usize) -> String {
    let entry = &store.document.nodes[node];
    let of_mesh = || {
        entry
            .mesh
            .and_then(|mesh| store.document.meshes.get(mesh))
            .and_then(|mesh| mesh.name.clone())
    };
    entry
        .name
        .clone()
        .or_else(of_mesh)
        .unwrap_or_else(|| format!("node {node}"))
}

fn placement(node: &document::Node) -> Placement {
    let translation = DVec3::from(node.translation.unwrap_or([0.0; 3]));
    let rotation = normalized(DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])));
    let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
    Placement {
        translation,
        rotation,
        scale,
    }
}

fn rest(node: &document::Node) -> DAffine3 {
    match &node.matrix {
        Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array(matrix)),
        None => placement(node).transform(),
    }
}

/// What the file holds.
fn contents(
    accessors: &mut Accessors,
    meshes: &[Instance],
    parents: &[Option<usize>],
) -> Result<Contents, SequenceError> {
    let (mut moved, mut weighted) = (HashSet::new(), HashSet::new());
    let mut contents = Contents {
        format: FORMAT.name,
        // By the specification.
        unit_metres: Some(1.0),
        up: Some(UpAxis::Y),
        ..Contents::default()
    };
    let mut guessed = Vec::new();
    for animation in 0..accessors.store.document.animations.len() {
        let (clip, is_even) = animation::entry(accessors, animation)?;
        if !is_even {
            guessed.push(clip.name.clone());
        }
        contents.clips.push(clip);
        let (nodes, weights) = animation::targets(accessors, animation);
        moved.extend(nodes);
        weighted.extend(weights);
    }
    if let Some(example) = guessed.first() {
        let text = format!(
            "glTF states no frame rate, and the key frames of {} clips (the first is `{example}`) fit none: they are sampled at 30 \
             frames a second; --fps says another rate",
            guessed.len()
        );
        contents.notices.push(Notice::Remark(text));
    }
    let moves =
        |node: usize| core::iter::successors(Some(node), |&node| parents[node]).any(|node| moved.contains(&node));
    let mut names = HashSet::new();
    for instance in meshes {
        let document = &accessors.store.document;
        let joints = instance.skin.map_or(&[][..], |skin| &document.skins[skin].joints);
        let joint_moves = joints.iter().any(|&joint| joint < parents.len() && moves(joint));
        let morphs = primitive::target_names(accessors, instance.mesh);
        let (vertex_count, face_count) = primitive::counts(accessors, instance.mesh)?;
        let only_targets = contents.clips.is_empty() && !morphs.is_empty();
        let motion = if joint_moves || weighted.contains(&instance.node) || only_targets {
            Motion::Deforms
        } else if joints.is_empty() && moves(instance.node) {
            Motion::Whole
        } else {
            Motion::Still
        };
        let mut name = node_name(&accessors.store, instance.node);
        if !names.insert(name.clone()) {
            name = format!("{name} (node {})", instance.node);
        }
        contents.meshes.push(MeshEntry {
            name,
            vertex_count,
            face_count,
            joint_count: joints.len(),
            morphs,
            motion,
        });
    }
    Ok(contents)
}

impl RigFile for Gltf {
    fn load(&mut self, mesh: usize) -> Result<RigMesh, SequenceError> {
        let instance = self.meshes[mesh];
        let document = &self.accessors.store.document;
        let (mut joints, mut matrices) = (Vec::new(), None);
        if let Some(skin) = instance.skin {
            joints.clone_from(&document.skins[skin].joints);
            matrices = document.skins[skin].inverse_bind_matrices;
        }
        if let Some(&stray) = joints.iter().find(|&&joint| joint >= document.nodes.len()) {
            return Err(self.accessors.store.refuse(
                format!("one of {} nodes", document.nodes.len()),
                format!("joint {stray}"),
            ));
        }
        let loaded = primitive::load(&mut self.accessors, instance.mesh, joints.len())?;
        let binds: Vec<DAffine3> = match matrices {
            None => vec![DAffine3::IDENTITY; joints.len()],
            Some(index) => {
                let matrices = self.accessors.floats::<16>(index)?;
                matrices
                    .iter()
                    .map(|m| DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from))))
                    .collect()
            }
        };
        if binds.len() < joints.len() {
            let expected = format!("{} inverse bind matrices, one a joint", joints.len());
            return Err(self.accessors.store.refuse(expected, format!("{}", binds.len())));
        }
        let mut geometry = loaded.geometry;
        if let Some(skin) = &mut geometry.dress.skin {
            let place = |node: usize| joints.iter().position(|&joint| joint == node).map(|place| place as u32);
            for (&node, bind) in joints.iter().zip(&binds) {
                let above = core::iter::successors(self.parents[node], |&node| self.parents[node]);
                let bind = bind.inverse();
                skin.joints.push(Joint {
                    name: node_name(&self.accessors.store, node),
                    parent: above.into_iter().find_map(place),
                    bind: [bind.x_axis, bind.y_axis, bind.z_axis, bind.translation].map(|axis| axis.to_array()),
                });
            }
        }
        Ok(RigMesh {
            geometry,
            joints: joints.into_iter().zip(binds).collect(),
            morphs: loaded.morphs,
            dual: Vec::new(),
        })
    }

    fn pose(&mut self, clip: usize, time: f64, pose: &mut Pose) -> Result<(), SequenceError> {
        let loaded = match self.animation.take().filter(|(loaded, _)| *loaded == clip) {
            Some((_, loaded)) => loaded,
            None => {
                let loaded = Animation::load(&mut self.accessors, clip, &self.weight_counts)?;
                self.accessors.forget();
                loaded
            }
        };
        let mut placements = self.placements.clone();
        let mut moved = vec![false; placements.len()];
        let mut weights: Vec<Vec<f64>> = vec![Vec::new(); placements.len()];
        for (instance, own) in self.meshes.iter().zip(&pose.weights) {
            weights[instance.node].clone_from(own);
        }
        loaded.pose(time, &mut placements, &mut weights, &mut moved);
        animation::apply(&placements, &moved, pose);
        for (instance, own) in self.meshes.iter().zip(&mut pose.weights) {
            own.clone_from(&weights[instance.node]);
        }
        self.animation = Some((clip, loaded));
        Ok(())
    }
}
