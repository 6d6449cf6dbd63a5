//! FBX, binary and ASCII, by ufbx: nodes over time, skins, blend shapes with shapes between, point caches beside the file; and a clip
//! from a second file that moves nodes of the same names.
//!
//! ufbx is C, so a build takes it only with the feature `fbx`; without it files are refused with that name. It reads the file; nodes,
//! skins and shapes are evaluated here like those of every other format.

use super::choose::Choice;
use super::error::{Place, SequenceError};
use super::folder::{file_name, read_file};
use super::format::{Format, Reading};
use super::mesh::{CornerTexture, PolygonMesh, UNTEXTURED};
use super::notice::Notice;
use super::rig::{Morph, MorphKey, Node, Pose, RigFile, RigMesh, RigScene, ordered};
use super::scene::{ClipEntry, Contents, MeshEntry, Motion, Scene, UpAxis};
use super::skin::{Joint, Skin};
use glam::{DAffine3, DQuat, DVec3};
use std::collections::{HashMap, HashSet};
use std::path::Path;
use ufbx::{
    AllocatorOpts, CacheChannel, CoordinateAxis, GeometryTransformHandling, InheritModeHandling, LoadOpts, Matrix,
    SceneRoot, SkinningMethod, Transform,
};

pub(super) const FORMAT: Format = Format {
    name: "FBX",
    extensions: &["fbx"],
    reading: Reading::Scene(open),
    writing: None,
};

/// Bytes that ufbx may take for each byte of the file, beyond a fixed sum: packed arrays grow.
const GROWTH_MAX: usize = 64;
const FIXED_BYTES: usize = 64 << 20;
/// Frames of a clip at most; times may be nonsense.
const FRAMES_MAX: f64 = 1e6;
/// Where a file states no rate.
const DEFAULT_RATE: f64 = 24.0;

/// A file, and the file of its clip where that is another.
struct Fbx {
    scene: SceneRoot,
    clips: Option<SceneRoot>,
    /// The node of the file of clips that moves each node.
    movers: Vec<Option<usize>>,
    /// Nodes with meshes.
    meshes: Vec<usize>,
}

fn load(path: &Path) -> Result<SceneRoot, SequenceError> {
    // The file is read here first, so that what the system says of it is said as of other files.
    let length = read_file(path)?.len();
    let Some(name) = path.to_str() else {
        return Err(SequenceError::Unsupported {
            path: path.into(),
            what: "a file whose name is no Unicode text,".into(),
            advice: "rename it".into(),
        });
    };
    let limit = || AllocatorOpts {
        memory_limit: length.saturating_mul(GROWTH_MAX).saturating_add(FIXED_BYTES),
        ..AllocatorOpts::default()
    };
    let options = LoadOpts {
        temp_allocator: limit(),
        result_allocator: limit(),
        load_external_files: true,
        ignore_missing_external_files: true,
        geometry_transform_handling: GeometryTransformHandling::ModifyGeometry,
        inherit_mode_handling: InheritModeHandling::Compensate,
        ..LoadOpts::default()
    };
    ufbx::load_file(name, options).map_err(|error| SequenceError::Parse {
        path: path.into(),
        place: Place::Byte(0),
        expected: "an FBX file".into(),
        found: error.description.to_string(),
    })
}

fn open(path: &Path, choice: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    let scene = load(path)?;
    let beside = choice.clip.as_deref().map(Path::new).filter(|clip| clip.is_file());
    let clips = beside.map(load).transpose()?;
    let nodes: Vec<Node> = scene
        .nodes
        .iter()
        .map(|node| Node {
            parent: node.parent.as_ref().map(|parent| parent.element.typed_id as usize),
            rest: placed(&node.local_transform),
        })
        .collect();
    let parents: Vec<Option<usize>> = nodes.iter().map(|node| node.parent).collect();
    let order = ordered(&parents).ok_or_else(|| SequenceError::Content {
        path: path.into(),
        expected: "a tree of nodes".into(),
        found: "a node above itself".into(),
    })?;
    let movers = match &clips {
        None => (0..nodes.len()).map(Some).collect(),
        Some(clips) => {
            let by_name: HashMap<&str, usize> = clips
                .nodes
                .iter()
                .enumerate()
                .map(|(i, node)| (&*node.element.name, i))
                .collect();
            scene
                .nodes
                .iter()
                .map(|node| by_name.get(&*node.element.name).copied())
                .collect()
        }
    };
    let meshes = (0..nodes.len())
        .filter(|&node| scene.nodes[node].mesh.is_some())
        .collect();
    let file = Fbx {
        scene,
        clips,
        movers,
        meshes,
    };
    let contents = file.contents(&parents, choice, path)?;
    let mesh_nodes = file.meshes.clone();
    let weights = file.meshes.iter().map(|&node| file.rest_weights(node)).collect();
    Ok(Box::new(RigScene::new(
        file, contents, nodes, order, mesh_nodes, weights,
    )))
}

fn placed(transform: &Transform) -> DAffine3 {
    let (t, r, s) = (&transform.translation, &transform.rotation, &transform.scale);
    DAffine3::from_scale_rotation_translation(
        DVec3::new(s.x, s.y, s.z),
        DQuat::from_xyzw(r.x, r.y, r.z, r.w),
        DVec3::new(t.x, t.y, t.z),
    )
}

fn affine(m: &Matrix) -> DAffine3 {
    DAffine3::from_cols_array(&[
        m.m00, m.m10, m.m20, m.m01, m.m11, m.m21, m.m02, m.m12, m.m22, m.m03, m.m13, m.m23,
    ])
}

/// The points that a cache beside the file gives a mesh.
fn cache(mesh: &ufbx::Mesh) -> Option<&CacheChannel> {
    let channels = mesh
        .cache_deformers
        .iter()
        .filter_map(|deformer| deformer.external_channel.as_ref());
    channels
        .map(|channel| &**channel)
        .find(|channel| !channel.frames.is_empty())
}

/// Channels of all blend shapes of a mesh.
fn channels(mesh: &ufbx::Mesh) -> impl Iterator<Item = &ufbx::BlendChannel> {
    mesh.blend_deformers
        .iter()
        .flat_map(|deformer| deformer.channels.iter())
        .map(|channel| &**channel)
}

/// Frames of a clip between two times.
fn clip(name: &str, begin: f64, end: f64, rate: f64, path: &Path) -> Result<ClipEntry, SequenceError> {
    let count = ((end - begin) * rate).round();
    if !(0.0..FRAMES_MAX).contains(&count) {
        return Err(SequenceError::Content {
            path: path.into(),
            expected: "a clip of some minutes".into(),
            found: format!("`{name}` from {begin} to {end} s"),
        });
    }
    let times = (0..=count as usize).map(|n| begin + n as f64 / rate).collect();
    let mut entry = ClipEntry::timed(name, times);
    entry.fps = Some(rate);
    Ok(entry)
}

impl Fbx {
    fn mesh(&self, node: usize) -> Option<&ufbx::Mesh> {
        self.scene.nodes[node].mesh.as_deref()
    }

    fn rest_weights(&self, node: usize) -> Vec<f64> {
        self.mesh(node).map_or(Vec::new(), |mesh| {
            channels(mesh).map(|channel| channel.weight).collect()
        })
    }

    /// The scene whose stacks are the clips.
    fn clip_scene(&self) -> &SceneRoot {
        self.clips.as_ref().unwrap_or(&self.scene)
    }

    fn contents(&self, parents: &[Option<usize>], choice: &Choice, path: &Path) -> Result<Contents, SequenceError> {
        let settings = &self.scene.settings;
        let mut contents = Contents {
            format: FORMAT.name,
            unit_metres: Some(settings.unit_meters).filter(|metres| *metres > 0.0),
            up: match settings.axes.up {
                CoordinateAxis::PositiveX => Some(UpAxis::X),
                CoordinateAxis::PositiveY => Some(UpAxis::Y),
                CoordinateAxis::PositiveZ => Some(UpAxis::Z),
                _ => None,
            },
            ..Contents::default()
        };
        for (count, kind) in [
            (self.scene.line_curves.len() + self.scene.nurbs_curves.len(), "curves"),
            (self.scene.nurbs_surfaces.len(), "NURBS patches"),
        ] {
            if count > 0 {
                contents.others.push((kind.into(), count));
            }
        }
        let source = self.clip_scene();
        let rate = Some(source.settings.frames_per_second).filter(|rate| *rate > 0.0 && rate.is_finite());
        let rate = rate.unwrap_or(DEFAULT_RATE);
        for stack in source
            .anim_stacks
            .iter()
            .filter(|stack| stack.time_end > stack.time_begin)
        {
            contents
                .clips
                .push(clip(&stack.element.name, stack.time_begin, stack.time_end, rate, path)?);
        }
        if let (Some(_), [only], Some(wanted)) = (&self.clips, &mut contents.clips[..], &choice.clip) {
            let text = format!("the clip `{}` comes from {wanted}", only.name);
            contents.notices.push(Notice::Remark(text));
            only.name.clone_from(wanted);
        }
        let moved: HashSet<&str> = source
            .anim_layers
            .iter()
            .flat_map(|layer| layer.anim_props.iter())
            .map(|property| &*property.element.name)
            .collect();
        let moves = |node: usize| {
            core::iter::successors(Some(node), |&node| parents[node])
                .any(|node| moved.contains(&*self.scene.nodes[node].element.name))
        };
        let mut names = HashSet::new();
        for &node in &self.meshes {
            let Some(mesh) = self.mesh(node) else { continue };
            let bones = mesh
                .skin_deformers
                .first()
                .into_iter()
                .flat_map(|skin| skin.clusters.iter());
            let bones: Vec<usize> = bones
                .filter_map(|cluster| cluster.bone_node.as_ref())
                .map(|bone| bone.element.typed_id as usize)
                .collect();
            let is_weighed =
                self.clips.is_none() && channels(mesh).any(|channel| moved.contains(&*channel.element.name));
            let motion = if cache(mesh).is_some() || is_weighed || bones.iter().any(|&bone| moves(bone)) {
                Motion::Deforms
            } else if bones.is_empty() && moves(node) {
                Motion::Whole
            } else {
                Motion::Still
            };
            let mut name = self.scene.nodes[node].element.name.to_string();
            if !names.insert(name.clone()) {
                name = format!("{name} (node {node})");
            }
            contents.meshes.push(MeshEntry {
                name,
                vertex_count: mesh.num_vertices,
                face_count: mesh.num_faces,
                joint_count: bones.len(),
                morphs: channels(mesh).map(|channel| channel.element.name.to_string()).collect(),
                motion,
            });
        }
        Ok(contents)
    }
}

/// Positions, faces and what stands on them.
fn geometry(mesh: &ufbx::Mesh) -> PolygonMesh {
    let mut own = PolygonMesh {
        positions: mesh
            .vertices
            .iter()
            .map(|p| [p.x as f32, p.y as f32, p.z as f32])
            .collect(),
        ..PolygonMesh::default()
    };
    let (uv, color) = (&mesh.vertex_uv, &mesh.vertex_color);
    let mut texture = CornerTexture {
        uvs: uv.values.iter().map(|uv| [uv.x as f32, uv.y as f32]).collect(),
        ..CornerTexture::default()
    };
    let is_textured = uv.exists && texture.uvs.as_flattened().iter().all(|x| x.is_finite());
    if color.exists && color.unique_per_vertex {
        own.dress.colors = vec![[1.0; 4]; own.positions.len()];
    }
    for (f, face) in mesh.faces.iter().enumerate() {
        let corners = face.index_begin as usize..face.index_begin as usize + face.num_indices as usize;
        for corner in corners.clone() {
            let v = mesh.vertex_indices[corner];
            own.corners.push(v);
            if let Some(place) = own.dress.colors.get_mut(v as usize) {
                let c = &color.values[color.indices[corner] as usize];
                *place = [c.x as f32, c.y as f32, c.z as f32, c.w as f32];
            }
        }
        if own.end_face() {
            if is_textured {
                let known = |corner: usize| {
                    if uv.indices[corner] == u32::MAX {
                        UNTEXTURED
                    } else {
                        uv.indices[corner]
                    }
                };
                texture.corners.extend(corners.map(known));
            }
            if !mesh.face_material.is_empty() {
                own.dress.face_materials.push(mesh.face_material[f]);
            }
        }
    }
    own.dress.materials = mesh
        .materials
        .iter()
        .map(|material| material.element.name.to_string())
        .collect();
    let known = own.dress.materials.len() as u32;
    if own.dress.face_materials.iter().any(|&material| material >= known) {
        own.dress.materials.clear();
        own.dress.face_materials.clear();
    }
    own.texture = is_textured.then_some(texture);
    own
}

/// Joints, skin, and how much dual quaternions count.
fn hold(mesh: &ufbx::Mesh, deformer: &ufbx::SkinDeformer) -> RigMesh {
    let mut rig = RigMesh::default();
    let mut skin = Skin::default();
    // Clusters without a bone hold nothing.
    let mut joint_of = vec![None; deformer.clusters.len()];
    for (c, cluster) in deformer.clusters.iter().enumerate() {
        let Some(bone) = cluster.bone_node.as_ref() else {
            continue;
        };
        let to_bone = affine(&cluster.geometry_to_bone);
        joint_of[c] = Some(skin.joints.len() as u32);
        rig.joints.push((bone.element.typed_id as usize, to_bone));
        let bind = to_bone.inverse();
        skin.joints.push(Joint {
            name: bone.element.name.to_string(),
            parent: None,
            bind: [bind.x_axis, bind.y_axis, bind.z_axis, bind.translation].map(|axis| axis.to_array()),
        });
    }
    let places: HashMap<usize, u32> = rig
        .joints
        .iter()
        .enumerate()
        .map(|(j, &(node, _))| (node, j as u32))
        .collect();
    for (cluster, joint) in deformer.clusters.iter().zip(&joint_of) {
        let (Some(joint), Some(bone)) = (joint, cluster.bone_node.as_ref()) else {
            continue;
        };
        let above = core::iter::successors(bone.parent.as_deref(), |node| node.parent.as_deref());
        let mut nodes = above.map(|node| node.element.typed_id as usize);
        skin.joints[*joint as usize].parent = nodes.find_map(|node| places.get(&node).copied());
    }
    for v in 0..mesh.num_vertices {
        if let Some(vertex) = deformer.vertices.get(v) {
            let begin = vertex.weight_begin as usize;
            for weight in deformer.weights.iter().skip(begin).take(vertex.num_weights as usize) {
                if let Some(joint) = joint_of.get(weight.cluster_index as usize).copied().flatten() {
                    skin.influences.push((joint, weight.weight as f32));
                }
            }
        }
        skin.end_vertex();
    }
    rig.dual = match deformer.skinning_method {
        SkinningMethod::DualQuaternion => vec![1.0; mesh.num_vertices],
        SkinningMethod::BlendedDqLinear => deformer.vertices.iter().map(|vertex| vertex.dq_weight as f32).collect(),
        _ => Vec::new(),
    };
    rig.geometry.dress.skin = Some(skin);
    rig
}

fn morph(channel: &ufbx::BlendChannel, vertex_count: usize) -> Morph {
    let mut keys = Vec::new();
    for key in channel
        .keyframes
        .iter()
        .filter(|key| key.target_weight != 0.0 && key.target_weight.is_finite())
    {
        let shape = &key.shape;
        let offsets = shape.offset_vertices.iter().zip(shape.position_offsets.iter());
        let offsets = offsets.filter(|(v, _)| (**v as usize) < vertex_count);
        keys.push(MorphKey {
            weight: key.target_weight,
            offsets: offsets
                .map(|(&v, p)| (v, [p.x as f32, p.y as f32, p.z as f32]))
                .collect(),
        });
    }
    keys.sort_by(|a, b| a.weight.total_cmp(&b.weight));
    keys.dedup_by(|later, kept| later.weight == kept.weight);
    Morph { keys }
}

impl RigFile for Fbx {
    fn load(&mut self, mesh: usize) -> Result<RigMesh, SequenceError> {
        let Some(mesh) = self.mesh(self.meshes[mesh]) else {
            return Ok(RigMesh::default());
        };
        let mut own = geometry(mesh);
        // A cache says where vertices are once all else has moved them.
        let deformer = mesh.skin_deformers.first().filter(|_| cache(mesh).is_none());
        let mut rig = deformer.map_or_else(RigMesh::default, |deformer| hold(mesh, deformer));
        rig.morphs = channels(mesh)
            .map(|channel| morph(channel, mesh.num_vertices))
            .collect();
        if cache(mesh).is_some() {
            rig.morphs.iter_mut().for_each(|morph| morph.keys.clear());
        }
        own.dress.skin = rig.geometry.dress.skin.take();
        rig.geometry = own;
        Ok(rig)
    }

    fn pose(&mut self, clip: usize, time: f64, pose: &mut Pose) -> Result<(), SequenceError> {
        let source = self.clip_scene();
        let mut stacks = source
            .anim_stacks
            .iter()
            .filter(|stack| stack.time_end > stack.time_begin);
        let Some(stack) = stacks.nth(clip) else { return Ok(()) };
        for (local, mover) in pose.locals.iter_mut().zip(&self.movers) {
            if let Some(mover) = *mover {
                *local = placed(&ufbx::evaluate_transform(&stack.anim, &source.nodes[mover], time));
            }
        }
        if self.clips.is_some() {
            return Ok(());
        }
        for (&node, weights) in self.meshes.iter().zip(&mut pose.weights) {
            let Some(mesh) = self.mesh(node) else { continue };
            for (channel, weight) in channels(mesh).zip(weights) {
                *weight = ufbx::evaluate_blend_weight(&stack.anim, channel, time);
            }
        }
        Ok(())
    }

    fn points(&mut self, mesh: usize, _: usize, time: f64) -> Result<Option<Vec<[f32; 3]>>, SequenceError> {
        let Some((mesh, channel)) = self
            .mesh(self.meshes[mesh])
            .and_then(|mesh| cache(mesh).map(|channel| (mesh, channel)))
        else {
            return Ok(None);
        };
        let mut points = vec![ufbx::Vec3::default(); mesh.num_vertices];
        let found =
            ufbx::sample_geometry_cache_vec3(channel, time, &mut points, ufbx::GeometryCacheDataOpts::default());
        if found < points.len() {
            return Err(SequenceError::BadMesh {
                path: file_name(Path::new(&*self.scene.metadata.filename)).into(),
                mesh: mesh.element.name.to_string(),
                expected: format!("{} points in the cache beside the file at {time} s", points.len()),
                found: found.to_string(),
            });
        }
        Ok(Some(
            points.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect(),
        ))
    }
}
