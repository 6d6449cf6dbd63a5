//! Writes a glTF file that plays a sequence: the first frame is the mesh, every other one a morph target, and an animation shows one
//! after the other.

use super::arrays::{ARRAY, Arrays, Drawn, ELEMENTS, FLOAT, U8, U16, U32};
use crate::mesh::Dress;
use crate::scene::UpAxis;
use crate::skin::{Joint, Skin};
use crate::write::{FrameWriter, Output, OutputSurface, WriteError, check_length};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Influences of a set.
const SET: usize = 4;
/// The node of the mesh; the one before it is the root, those behind it are the joints, in their order.
pub(super) const MESH_NODE: usize = 1;

/// Writes frames as morph targets while they come.
pub(super) struct GltfWriter {
    path: PathBuf,
    is_binary: bool,
    pub(super) arrays: Arrays,
    name: String,
    fps: f64,
    /// Turns and scales to metres with y up.
    to_metres: DAffine3,
    vertex_count: usize,
    faces: Vec<[u32; 3]>,
    drawn: Drawn,
    dress: Dress,
    /// Positions and normals of the first frame, by render vertices.
    base: Option<(Vec<[f32; 3]>, Vec<[f32; 3]>)>,
    /// Attributes of the base and of each target.
    attributes: Value,
    targets: Vec<Value>,
}

pub(super) fn open(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    Ok(Box::new(GltfWriter::create(path, surface)?))
}

impl GltfWriter {
    pub(super) fn create(path: &Path, surface: &OutputSurface<'_>) -> Result<GltfWriter, WriteError> {
        let turn = match surface.up {
            Some(UpAxis::Z) => DQuat::from_rotation_x(-core::f64::consts::FRAC_PI_2),
            Some(UpAxis::X) => DQuat::from_rotation_z(core::f64::consts::FRAC_PI_2),
            Some(UpAxis::Y) | None => DQuat::IDENTITY,
        };
        let scale = DVec3::splat(surface.unit_metres.unwrap_or(1.0));
        let drawn = Drawn::of(surface);
        Ok(GltfWriter {
            path: path.into(),
            is_binary: path
                .extension()
                .is_some_and(|extension| extension.eq_ignore_ascii_case("glb")),
            arrays: Arrays {
                out: Output::create(path)?,
                views: Vec::new(),
                accessors: Vec::new(),
            },
            name: surface.name.into(),
            fps: surface.fps,
            to_metres: DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ZERO),
            vertex_count: surface.vertex_count,
            faces: surface.faces.to_vec(),
            drawn,
            dress: surface.dress.clone(),
            base: None,
            attributes: json!({}),
            targets: Vec::new(),
        })
    }
}

/// A node that stands where a matrix says: as translation, rotation and scale, which can be animated, where those are all of it.
fn placed(local: &DMat4) -> Value {
    let (scale, rotation, translation) = local.to_scale_rotation_translation();
    let same = DMat4::from_scale_rotation_translation(scale, rotation, translation);
    if !same.abs_diff_eq(*local, 1e-9 * (1.0 + translation.length())) {
        return json!({ "matrix": local.to_cols_array() });
    }
    let mut node = json!({ "translation": translation.to_array(), "rotation": rotation.to_array() });
    // A rotation's matrix gives lengths to the last digit but one.
    if !scale.abs_diff_eq(DVec3::ONE, 1e-6) {
        node["scale"] = json!(scale.to_array());
    }
    node
}

/// Smooth normals: of the faces around each vertex, weighed by their areas.
fn normals(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| DVec3::from(positions[v as usize].map(f64::from)));
        let normal = (b - a).cross(c - a);
        face.iter().for_each(|&v| sums[v as usize] += normal);
    }
    sums.into_iter()
        .map(|sum| sum.normalize_or(DVec3::Z).to_array().map(|x| x as f32))
        .collect()
}

fn difference(to: &[[f32; 3]], from: &[[f32; 3]]) -> Vec<[f32; 3]> {
    to.iter()
        .zip(from)
        .map(|(a, b)| core::array::from_fn(|c| a[c] - b[c]))
        .collect()
}

impl FrameWriter for GltfWriter {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        check_length(&self.path, "a frame", positions.len(), self.vertex_count)?;
        let by_vertex = normals(positions, &self.faces);
        let split =
            |values: &[[f32; 3]]| -> Vec<[f32; 3]> { self.drawn.split.iter().map(|&v| values[v as usize]).collect() };
        let (points, normals) = (split(positions), split(&by_vertex));
        match &self.base {
            None => {
                let position = self.arrays.vectors(&points, true)?;
                let normal = self.arrays.vectors(&normals, false)?;
                self.attributes = json!({ "POSITION": position, "NORMAL": normal });
                self.base = Some((points, normals));
            }
            Some((base, base_normals)) => {
                let (offsets, turns) = (difference(&points, base), difference(&normals, base_normals));
                let position = self.arrays.vectors(&offsets, true)?;
                let normal = self.arrays.vectors(&turns, false)?;
                self.targets.push(json!({ "POSITION": position, "NORMAL": normal }));
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), WriteError> {
        let names = (1..=self.targets.len()).map(|frame| format!("frame {frame}")).collect();
        let play = |writer: &mut GltfWriter| match writer.targets.len() {
            0 => Ok(Vec::new()),
            _ => Ok(vec![writer.animation()?]),
        };
        self.close(names, play, Value::Null)
    }
}

impl GltfWriter {
    /// Writes what stands behind the frames and gives the file its name. `names` are those of the targets, `animations` what plays,
    /// `extras` what the root node carries for other programs, or null.
    pub(super) fn close(
        mut self,
        names: Vec<String>,
        animations: impl FnOnce(&mut GltfWriter) -> Result<Vec<Value>, WriteError>,
        extras: Value,
    ) -> Result<(), WriteError> {
        self.attributes()?;
        let (primitives, materials) = self.primitives()?;
        let mut mesh = json!({ "name": self.name, "primitives": primitives });
        let (scale, rotation, _) = self.to_metres.to_scale_rotation_translation();
        let mut root = json!({ "name": self.name, "children": [MESH_NODE] });
        if scale != DVec3::ONE {
            root["scale"] = json!(scale.to_array());
        }
        if rotation != DQuat::IDENTITY {
            root["rotation"] = json!(rotation.to_array());
        }
        if !extras.is_null() {
            root["extras"] = extras;
        }
        let mut document = json!({
            "asset": { "version": "2.0", "generator": format!("Sinew {}", env!("CARGO_PKG_VERSION")) },
            "scene": 0, "scenes": [{ "nodes": [0] }],
        });
        if !self.targets.is_empty() {
            mesh["weights"] = json!(vec![0; self.targets.len()]);
            mesh["extras"] = json!({ "targetNames": names });
        }
        let animations = animations(&mut self)?;
        if !animations.is_empty() {
            document["animations"] = json!(animations);
        }
        let mut nodes = vec![root, json!({ "name": format!("{} mesh", self.name), "mesh": 0 })];
        if let Some(skin) = self.dress.skin.take().filter(|skin| !skin.joints.is_empty()) {
            document["skins"] = json!([self.skin(&skin, &mut nodes)?]);
            nodes[MESH_NODE]["skin"] = json!(0);
            // What joints move stands where they say: nothing above it counts, so nothing is.
            document["scenes"] = json!([{ "nodes": [0, MESH_NODE] }]);
        }
        document["nodes"] = json!(nodes);
        document["meshes"] = json!([mesh]);
        if !materials.is_empty() {
            document["materials"] = json!(materials);
        }
        self.write(document)
    }

    /// Adds what vertices have besides positions and normals.
    fn attributes(&mut self) -> Result<(), WriteError> {
        let count = self.drawn.split.len();
        if let Some(uvs) = &self.drawn.uvs {
            // In glTF v grows downwards.
            let bytes: Vec<u8> = uvs
                .iter()
                .flat_map(|&[u, v]| [u, 1.0 - v])
                .flat_map(f32::to_le_bytes)
                .collect();
            let index = self
                .arrays
                .add(&bytes, FLOAT, "VEC2", count, json!({ "target": ARRAY }))?;
            self.attributes["TEXCOORD_0"] = json!(index);
        }
        if !self.dress.colors.is_empty() {
            let colors = self.drawn.split.iter().flat_map(|&v| self.dress.colors[v as usize]);
            let bytes: Vec<u8> = colors.flat_map(f32::to_le_bytes).collect();
            let index = self
                .arrays
                .add(&bytes, FLOAT, "VEC4", count, json!({ "target": ARRAY }))?;
            self.attributes["COLOR_0"] = json!(index);
        }
        if let Some(skin) = &self.dress.skin {
            let own = |&v: &u32| skin.of_vertex(v as usize);
            let most = self.drawn.split.iter().map(|v| own(v).len()).max().unwrap_or(0);
            for set in 0..most.div_ceil(SET).max(1) {
                let influence = |v: &u32, i: usize| own(v).get(set * SET + i).copied().unwrap_or((0, 0.0));
                let each = self
                    .drawn
                    .split
                    .iter()
                    .flat_map(|v| (0..SET).map(move |i| influence(v, i)));
                let joints: Vec<u8> = each
                    .clone()
                    .flat_map(|(joint, _)| (joint as u16).to_le_bytes())
                    .collect();
                let weights: Vec<u8> = each.flat_map(|(_, weight)| weight.to_le_bytes()).collect();
                let joints = self
                    .arrays
                    .add(&joints, U16, "VEC4", count, json!({ "target": ARRAY }))?;
                let weights = self
                    .arrays
                    .add(&weights, FLOAT, "VEC4", count, json!({ "target": ARRAY }))?;
                self.attributes[format!("JOINTS_{set}")] = json!(joints);
                self.attributes[format!("WEIGHTS_{set}")] = json!(weights);
            }
        }
        Ok(())
    }

    /// A primitive a material.
    fn primitives(&mut self) -> Result<(Vec<Value>, Vec<Value>), WriteError> {
        let of_face = |f: usize| self.dress.face_materials.get(f).copied().unwrap_or(0);
        let mut groups: Vec<Vec<u32>> = vec![Vec::new(); self.dress.materials.len().max(1)];
        for (f, face) in self.drawn.faces.iter().enumerate() {
            groups[of_face(f) as usize].extend(face);
        }
        let (mut primitives, mut materials) = (Vec::new(), Vec::new());
        for (material, indices) in groups.iter().enumerate().filter(|(_, indices)| !indices.is_empty()) {
            let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
            let index = self
                .arrays
                .add(&bytes, U32, "SCALAR", indices.len(), json!({ "target": ELEMENTS }))?;
            let mut primitive = json!({ "attributes": self.attributes, "indices": index });
            if !self.targets.is_empty() {
                primitive["targets"] = json!(self.targets);
            }
            if let Some(name) = self.dress.materials.get(material).filter(|name| !name.is_empty()) {
                primitive["material"] = json!(materials.len());
                materials.push(json!({ "name": name, "doubleSided": true }));
            }
            primitives.push(primitive);
        }
        Ok((primitives, materials))
    }

    /// One target after the other.
    fn animation(&mut self) -> Result<Value, WriteError> {
        let target_count = self.targets.len();
        let times: Vec<f32> = (0..=target_count)
            .map(|frame| (frame as f64 / self.fps) as f32)
            .collect();
        let input = self.arrays.times(&times)?;
        let mut weights = vec![0u8; times.len() * target_count];
        for frame in 1..=target_count {
            weights[frame * target_count + frame - 1] = 255;
        }
        let output = self
            .arrays
            .add(&weights, U8, "SCALAR", weights.len(), json!({ "normalized": true }))?;
        Ok(json!({
            "name": self.name,
            "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }],
            "channels": [{ "sampler": 0, "target": { "node": MESH_NODE, "path": "weights" } }],
        }))
    }

    /// Joints in the bind pose, in which a skin moves nothing: the frames show what it did, and the weights are kept.
    fn skin(&mut self, skin: &Skin, nodes: &mut Vec<Value>) -> Result<Value, WriteError> {
        let first = nodes.len();
        let binds: Vec<DAffine3> = skin.joints.iter().map(Joint::bind_map).collect();
        for (j, joint) in skin.joints.iter().enumerate() {
            let above = joint.parent.map_or(DAffine3::IDENTITY, |parent| binds[parent as usize]);
            let local = DMat4::from(above.inverse() * binds[j]);
            let children: Vec<usize> = (0..skin.joints.len())
                .filter(|&k| skin.joints[k].parent == Some(j as u32))
                .map(|k| first + k)
                .collect();
            let mut node = placed(&local);
            node["name"] = json!(joint.name);
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            nodes.push(node);
        }
        let roots: Vec<usize> = (0..skin.joints.len())
            .filter(|&j| skin.joints[j].parent.is_none())
            .map(|j| first + j)
            .collect();
        nodes[0]["children"] = json!(roots);
        let matrices = binds
            .iter()
            .flat_map(|bind| DMat4::from(bind.inverse()).to_cols_array());
        let bytes: Vec<u8> = matrices.flat_map(|x| (x as f32).to_le_bytes()).collect();
        let index = self.arrays.add(&bytes, FLOAT, "MAT4", binds.len(), json!({}))?;
        let joints: Vec<usize> = (first..first + binds.len()).collect();
        Ok(json!({ "joints": joints, "inverseBindMatrices": index }))
    }

    /// Puts JSON and arrays into one file, or beside each other.
    fn write(self, mut document: Value) -> Result<(), WriteError> {
        let length = self.arrays.out.length();
        document["accessors"] = json!(self.arrays.accessors);
        document["bufferViews"] = json!(self.arrays.views);
        let too_large = || WriteError::TooLarge {
            path: self.path.clone(),
            format: "binary glTF",
            count: length as usize,
            what: "bytes",
        };
        if !self.is_binary {
            let beside = self.path.with_extension("bin");
            let name = beside.file_name().unwrap_or_default().to_string_lossy().into_owned();
            document["buffers"] = json!([{ "uri": name, "byteLength": length }]);
            let mut buffer = Output::create(&beside)?;
            buffer.append(self.arrays.out)?;
            buffer.commit()?;
            let mut out = Output::create(&self.path)?;
            out.put(document.to_string().as_bytes())?;
            return out.commit();
        }
        document["buffers"] = json!([{ "byteLength": length }]);
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let whole = 12 + 8 + text.len() as u64 + 8 + length;
        let (Ok(whole), Ok(length)) = (u32::try_from(whole), u32::try_from(length)) else {
            return Err(too_large());
        };
        let mut out = Output::create(&self.path)?;
        out.put(b"glTF\x02\0\0\0")?;
        out.put(&whole.to_le_bytes())?;
        out.put(&(text.len() as u32).to_le_bytes())?;
        out.put(b"JSON")?;
        out.put(&text)?;
        out.put(&length.to_le_bytes())?;
        out.put(b"BIN\0")?;
        out.append(self.arrays.out)?;
        out.commit()
    }
}
