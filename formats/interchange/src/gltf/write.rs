//! Writes a glTF file that plays a sequence: the first frame is the mesh, every other one a morph target, and an animation shows one
//! after the other.

use crate::mesh::Dress;
use crate::scene::UpAxis;
use crate::skin::Skin;
use crate::write::{FrameWriter, Output, OutputSurface, WriteError, check_length};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const FLOAT: u32 = 5126;
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
/// What viewers bind vertices and indices to.
const ARRAY: u32 = 34962;
const ELEMENTS: u32 = 34963;
/// Influences of a set.
const SET: usize = 4;

/// Arrays as they are written, and what the JSON says of them.
struct Arrays {
    out: Output,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Arrays {
    /// Adds an array; gives its number.
    fn add(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
        more: Value,
    ) -> Result<usize, WriteError> {
        let at = self.out.length();
        self.out.put(bytes)?;
        // Every array begins at a multiple of four bytes.
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        self.out.put(&[0; 4][..padding])?;
        let mut view = json!({ "buffer": 0, "byteOffset": at, "byteLength": bytes.len() });
        let mut accessor = json!({
            "bufferView": self.views.len(), "componentType": component, "type": kind, "count": count,
        });
        if let (Some(view), Some(accessor), Value::Object(more)) =
            (view.as_object_mut(), accessor.as_object_mut(), more)
        {
            for (key, value) in more {
                if key == "target" {
                    view.insert(key, value)
                } else {
                    accessor.insert(key, value)
                };
            }
        }
        self.views.push(view);
        self.accessors.push(accessor);
        Ok(self.accessors.len() - 1)
    }

    /// Adds vectors of vertices, with the range that the specification wants of positions.
    fn vectors(&mut self, vectors: &[[f32; 3]], with_range: bool) -> Result<usize, WriteError> {
        let bytes: Vec<u8> = vectors.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let edge = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
            (0..3).map(|c| vectors.iter().map(|p| p[c]).fold(start, pick)).collect()
        };
        let more = if with_range && !vectors.is_empty() {
            json!({ "target": ARRAY, "min": edge(f32::min, f32::MAX), "max": edge(f32::max, f32::MIN) })
        } else {
            json!({ "target": ARRAY })
        };
        self.add(&bytes, FLOAT, "VEC3", vectors.len(), more)
    }
}

/// What is drawn: render vertices, the first of each vertex in the order of the vertices, then the others. So those who weld seams again
/// find the vertices in their order.
struct Drawn {
    /// The vertex that each stands for.
    split: Vec<u32>,
    faces: Vec<[u32; 3]>,
    /// None where all are alike: then they only keep seams of normals.
    uvs: Option<Vec<[f32; 2]>>,
}

impl Drawn {
    fn of(surface: &OutputSurface<'_>) -> Drawn {
        let mut drawn = Drawn {
            split: (0..surface.vertex_count as u32).collect(),
            faces: surface.faces.to_vec(),
            uvs: None,
        };
        let Some(render) = surface.render else { return drawn };
        let mut uvs = vec![[0.0; 2]; drawn.split.len()];
        let mut is_taken = vec![false; drawn.split.len()];
        let mut places = Vec::with_capacity(render.vertices.len());
        for (&v, &uv) in render.vertices.iter().zip(&render.uvs) {
            if core::mem::replace(&mut is_taken[v as usize], true) {
                places.push(drawn.split.len() as u32);
                drawn.split.push(v);
                uvs.push(uv);
            } else {
                places.push(v);
                uvs[v as usize] = uv;
            }
        }
        drawn.faces = render
            .faces
            .iter()
            .map(|face| face.map(|r| places[r as usize]))
            .collect();
        drawn.uvs = render.uvs.iter().any(|uv| *uv != render.uvs[0]).then_some(uvs);
        drawn
    }
}

/// Writes frames as morph targets while they come.
struct GltfWriter {
    path: PathBuf,
    is_binary: bool,
    arrays: Arrays,
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
    let turn = match surface.up {
        Some(UpAxis::Z) => DQuat::from_rotation_x(-core::f64::consts::FRAC_PI_2),
        Some(UpAxis::X) => DQuat::from_rotation_z(core::f64::consts::FRAC_PI_2),
        Some(UpAxis::Y) | None => DQuat::IDENTITY,
    };
    let scale = DVec3::splat(surface.unit_metres.unwrap_or(1.0));
    let drawn = Drawn::of(surface);
    Ok(Box::new(GltfWriter {
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
    }))
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

    fn finish(mut self: Box<Self>) -> Result<(), WriteError> {
        self.attributes()?;
        let (primitives, materials) = self.primitives()?;
        let mut mesh = json!({ "name": self.name, "primitives": primitives });
        let (scale, rotation, _) = self.to_metres.to_scale_rotation_translation();
        let mut root = json!({ "name": self.name, "children": [1] });
        if scale != DVec3::ONE {
            root["scale"] = json!(scale.to_array());
        }
        if rotation != DQuat::IDENTITY {
            root["rotation"] = json!(rotation.to_array());
        }
        let mut document = json!({
            "asset": { "version": "2.0", "generator": format!("Sinew {}", env!("CARGO_PKG_VERSION")) },
            "scene": 0, "scenes": [{ "nodes": [0] }],
        });
        if !self.targets.is_empty() {
            let names: Vec<String> = (1..=self.targets.len()).map(|frame| format!("frame {frame}")).collect();
            mesh["weights"] = json!(vec![0; self.targets.len()]);
            mesh["extras"] = json!({ "targetNames": names });
            document["animations"] = json!([self.animation()?]);
        }
        let mut nodes = vec![root, json!({ "name": format!("{} mesh", self.name), "mesh": 0 })];
        if let Some(skin) = self.dress.skin.take().filter(|skin| !skin.joints.is_empty()) {
            document["skins"] = json!([self.skin(&skin, &mut nodes)?]);
            nodes[1]["skin"] = json!(0);
        }
        document["nodes"] = json!(nodes);
        document["meshes"] = json!([mesh]);
        if !materials.is_empty() {
            document["materials"] = json!(materials);
        }
        self.write(document)
    }
}

impl GltfWriter {
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
        let bytes: Vec<u8> = times.iter().flat_map(|time| time.to_le_bytes()).collect();
        let range = json!({ "min": [0.0], "max": [times[target_count]] });
        let input = self.arrays.add(&bytes, FLOAT, "SCALAR", times.len(), range)?;
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
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "weights" } }],
        }))
    }

    /// Joints in the bind pose, in which a skin moves nothing: the frames show what it did, and the weights are kept.
    fn skin(&mut self, skin: &Skin, nodes: &mut Vec<Value>) -> Result<Value, WriteError> {
        let first = nodes.len();
        let binds: Vec<DAffine3> = skin
            .joints
            .iter()
            .map(|joint| {
                let [x, y, z, origin] = joint.bind.map(DVec3::from);
                DAffine3::from_mat3_translation(glam::DMat3::from_cols(x, y, z), origin)
            })
            .collect();
        for (j, joint) in skin.joints.iter().enumerate() {
            let above = joint.parent.map_or(DAffine3::IDENTITY, |parent| binds[parent as usize]);
            let local = DMat4::from(above.inverse() * binds[j]);
            let children: Vec<usize> = (0..skin.joints.len())
                .filter(|&k| skin.joints[k].parent == Some(j as u32))
                .map(|k| first + k)
                .collect();
            let mut node = json!({ "name": joint.name, "matrix": local.to_cols_array() });
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            nodes.push(node);
        }
        let roots = (0..skin.joints.len())
            .filter(|&j| skin.joints[j].parent.is_none())
            .map(|j| first + j);
        let children: Vec<usize> = core::iter::once(1).chain(roots).collect();
        nodes[0]["children"] = json!(children);
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
