//! Meshes of a glTF file: primitives joined to one mesh, with skin and morph targets.

use super::accessor::Accessors;
use crate::error::{Place, SequenceError};
use crate::mesh::{CornerTexture, PolygonMesh};
use crate::rig::{Morph, MorphKey};
use crate::skin::Skin;
use std::collections::HashMap;

const TRIANGLES: u32 = 4;
const STRIP: u32 = 5;
const FAN: u32 = 6;
/// Sets of four influences that are looked for.
const INFLUENCE_SETS_MAX: usize = 16;

/// Geometry and morph targets of a mesh.
#[derive(Default)]
pub(super) struct Loaded {
    pub(super) geometry: PolygonMesh,
    pub(super) morphs: Vec<Morph>,
}

/// Names of a mesh's morph targets: as custom has it in its extras, else numbers.
pub(super) fn target_names(accessors: &Accessors, mesh: usize) -> Vec<String> {
    let mesh = &accessors.store.document.meshes[mesh];
    let count = mesh
        .primitives
        .iter()
        .map(|primitive| primitive.targets.len())
        .max()
        .unwrap_or(0);
    let name = |i: usize| mesh.extras.target_names.get(i).filter(|name| !name.is_empty()).cloned();
    (0..count)
        .map(|i| name(i).unwrap_or_else(|| format!("target {i}")))
        .collect()
}

/// Vertices and faces of a mesh, without reading them.
pub(super) fn counts(accessors: &Accessors, mesh: usize) -> Result<(usize, usize), SequenceError> {
    let (mut vertices, mut faces) = (0usize, 0usize);
    let mut known: Vec<Vec<(&String, &usize)>> = Vec::new();
    for primitive in &accessors.store.document.meshes[mesh].primitives {
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        let Some(&positions) = primitive
            .attributes
            .get("POSITION")
            .filter(|_| (TRIANGLES..=FAN).contains(&mode))
        else {
            continue;
        };
        let count = accessors.count(positions)?;
        let key = attributes_key(&primitive.attributes);
        if !known.contains(&key) {
            known.push(key);
            vertices = vertices.saturating_add(count);
        }
        let corners = primitive
            .indices
            .map_or(Ok(count), |indices| accessors.count(indices))?;
        faces = faces.saturating_add(if mode == TRIANGLES {
            corners / 3
        } else {
            corners.saturating_sub(2)
        });
    }
    Ok((vertices, faces))
}

fn attributes_key(attributes: &HashMap<String, usize>) -> Vec<(&String, &usize)> {
    let mut key: Vec<_> = attributes.iter().collect();
    key.sort();
    key
}

/// Reads a mesh. `joint_count`: of its skin; 0 for none.
pub(super) fn load(accessors: &mut Accessors, mesh: usize, joint_count: usize) -> Result<Loaded, SequenceError> {
    let mut loader = Loader {
        loaded: Loaded {
            morphs: vec![
                Morph {
                    keys: vec![MorphKey {
                        weight: 1.0,
                        offsets: Vec::new(),
                    }],
                };
                target_names(accessors, mesh).len()
            ],
            ..Loaded::default()
        },
        texture: CornerTexture::default(),
        textured: false,
        skin: Skin::default(),
        joint_count,
        mesh,
        blocks: HashMap::new(),
        materials: HashMap::new(),
    };
    loader.loaded.geometry.is_split = true;
    for primitive in 0..accessors.store.document.meshes[mesh].primitives.len() {
        loader.primitive(accessors, primitive)?;
    }
    accessors.forget();
    let Loader {
        mut loaded,
        mut texture,
        textured,
        skin,
        joint_count,
        ..
    } = loader;
    let geometry = &mut loaded.geometry;
    if textured {
        texture.corners.clone_from(&geometry.corners);
        texture.uvs.resize(geometry.positions.len(), [0.0; 2]);
        geometry.texture = Some(texture);
    }
    if !geometry.dress.colors.is_empty() {
        geometry.dress.colors.resize(geometry.positions.len(), [1.0; 4]);
    }
    if joint_count > 0 {
        geometry.dress.skin = Some(skin);
    }
    Ok(loaded)
}

struct Loader {
    loaded: Loaded,
    texture: CornerTexture,
    textured: bool,
    skin: Skin,
    joint_count: usize,
    mesh: usize,
    /// First vertex of each set of arrays: primitives share vertices.
    blocks: HashMap<Vec<(String, usize)>, u32>,
    materials: HashMap<Option<usize>, u32>,
}

impl Loader {
    fn primitive(&mut self, accessors: &mut Accessors, number: usize) -> Result<(), SequenceError> {
        let primitive = &accessors.store.document.meshes[self.mesh].primitives[number];
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        let Some(&positions) = primitive
            .attributes
            .get("POSITION")
            .filter(|_| (TRIANGLES..=FAN).contains(&mode))
        else {
            self.loaded.geometry.ignored_element_count += 1;
            return Ok(());
        };
        let (indices, material) = (primitive.indices, primitive.material);
        let key: Vec<(String, usize)> = attributes_key(&primitive.attributes)
            .into_iter()
            .map(|(name, &index)| (name.clone(), index))
            .collect();
        let first = match self.blocks.get(&key) {
            Some(&first) => first,
            None => {
                let first = self.vertices(accessors, number, positions)?;
                self.blocks.insert(key, first);
                first
            }
        };
        let count = accessors.count(positions)?;
        let before = self.loaded.geometry.face_count();
        match indices {
            Some(indices) => {
                let indices = accessors.integers::<1>(indices)?;
                self.faces(accessors, indices.into_iter().map(|[index]| index), first, count, mode)?;
            }
            None => self.faces(accessors, 0..count as u32, first, count, mode)?,
        }
        self.material(accessors, material, before);
        Ok(())
    }

    fn faces(
        &mut self,
        accessors: &Accessors,
        indices: impl Iterator<Item = u32>,
        first: u32,
        count: usize,
        mode: u32,
    ) -> Result<(), SequenceError> {
        let geometry = &mut self.loaded.geometry;
        let mut push = |corners: [u32; 3]| -> Result<(), SequenceError> {
            for index in corners {
                if index as usize >= count {
                    return Err(SequenceError::IndexOutOfRange {
                        path: accessors.store.path().into(),
                        place: Place::Face(geometry.face_ends.len()),
                        index: i64::from(index),
                        vertex_count: count,
                    });
                }
                geometry.corners.push(first + index);
            }
            geometry.end_face();
            Ok(())
        };
        let mut corners = [0u32; 3];
        for (i, index) in indices.enumerate() {
            match mode {
                STRIP => {
                    corners = [corners[1], corners[2], index];
                    if i >= 2 {
                        let [a, b, c] = corners;
                        push(if i % 2 == 0 { [a, b, c] } else { [b, a, c] })?;
                    }
                }
                FAN => {
                    corners = if i < 2 {
                        corners
                    } else {
                        [corners[0], corners[2], index]
                    };
                    match i {
                        0 => corners[0] = index,
                        1 => corners[2] = index,
                        _ => push(corners)?,
                    }
                }
                _ => {
                    corners[i % 3] = index;
                    if i % 3 == 2 {
                        push(corners)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Names a material for the faces from `before` on.
    fn material(&mut self, accessors: &Accessors, material: Option<usize>, before: usize) {
        let dress = &mut self.loaded.geometry.dress;
        let next = dress.materials.len() as u32;
        let number = *self.materials.entry(material).or_insert_with(|| {
            let known = material.and_then(|material| accessors.store.document.materials.get(material));
            let name = known.and_then(|known| known.name.clone());
            dress.materials.push(match (name, material) {
                (Some(name), _) => name,
                (None, Some(material)) => format!("material {material}"),
                (None, None) => String::new(),
            });
            next
        });
        dress.face_materials.resize(before, 0);
        dress
            .face_materials
            .resize(self.loaded.geometry.face_ends.len(), number);
    }

    /// Adds the vertices of a primitive; gives the number of the first.
    fn vertices(&mut self, accessors: &mut Accessors, number: usize, positions: usize) -> Result<u32, SequenceError> {
        let points = accessors.floats::<3>(positions)?;
        let geometry = &mut self.loaded.geometry;
        let (first, count) = (geometry.positions.len(), points.len());
        geometry.positions.extend(points);
        PolygonMesh::check_vertex_count(geometry.positions.len(), accessors.store.path())?;
        let primitive = &accessors.store.document.meshes[self.mesh].primitives[number];
        let attributes = primitive.attributes.clone();
        let targets: Vec<Option<usize>> = primitive
            .targets
            .iter()
            .map(|target| target.get("POSITION").copied())
            .collect();
        let same_count = |accessors: &Accessors, index: usize, what: &str| {
            let found = accessors.count(index)?;
            if found == count {
                return Ok(());
            }
            Err(accessors.store.refuse(
                format!("{count} items of {what}, as many as positions"),
                format!("{found}"),
            ))
        };
        for (target, index) in targets.iter().enumerate() {
            let Some(index) = *index else { continue };
            same_count(accessors, index, "a morph target")?;
            let offsets = &mut self.loaded.morphs[target].keys[0].offsets;
            let start = offsets.len();
            accessors.each(index, |i, offset: [f64; 3]| {
                let offset = offset.map(|x| x as f32);
                // A sparse item replaces what stood there.
                let known = offsets[start..].binary_search_by_key(&((first + i) as u32), |&(v, _)| v);
                match known {
                    Ok(at) => offsets[start + at].1 = offset,
                    Err(at) if offset != [0.0; 3] => offsets.insert(start + at, ((first + i) as u32, offset)),
                    Err(_) => {}
                }
                Ok(())
            })?;
        }
        if let Some(&index) = attributes.get("TEXCOORD_0") {
            same_count(accessors, index, "TEXCOORD_0")?;
            let uvs = accessors.floats::<2>(index)?;
            self.texture.uvs.resize(first, [0.0; 2]);
            // In glTF v grows downwards.
            self.texture.uvs.extend(uvs.into_iter().map(|[u, v]| [u, 1.0 - v]));
            self.textured = true;
        }
        if let Some(&index) = attributes.get("COLOR_0") {
            same_count(accessors, index, "COLOR_0")?;
            self.colors(accessors, index, first)?;
        }
        if self.joint_count > 0 {
            self.influences(accessors, &attributes, count)?;
        }
        Ok(first as u32)
    }

    fn colors(&mut self, accessors: &mut Accessors, index: usize, first: usize) -> Result<(), SequenceError> {
        let colors: Vec<[f32; 4]> = match accessors.floats::<4>(index) {
            Ok(colors) => colors,
            Err(_) => accessors
                .floats::<3>(index)?
                .into_iter()
                .map(|[r, g, b]| [r, g, b, 1.0])
                .collect(),
        };
        let own = &mut self.loaded.geometry.dress.colors;
        own.resize(first, [1.0; 4]);
        own.extend(colors);
        Ok(())
    }

    fn influences(
        &mut self,
        accessors: &mut Accessors,
        attributes: &HashMap<String, usize>,
        count: usize,
    ) -> Result<(), SequenceError> {
        let mut sets = Vec::new();
        for set in 0..INFLUENCE_SETS_MAX {
            let pair = (
                attributes.get(&format!("JOINTS_{set}")),
                attributes.get(&format!("WEIGHTS_{set}")),
            );
            let (Some(&joints), Some(&weights)) = pair else { break };
            let (joints, weights) = (accessors.integers::<4>(joints)?, accessors.floats::<4>(weights)?);
            if joints.len() != count || weights.len() != count {
                let found = format!("{} joints and {} weights", joints.len(), weights.len());
                return Err(accessors
                    .store
                    .refuse(format!("{count} influences, as many as positions"), found));
            }
            sets.push((joints, weights));
        }
        for v in 0..count {
            for (joints, weights) in &sets {
                for (&joint, &weight) in joints[v].iter().zip(&weights[v]) {
                    if weight != 0.0 && joint as usize >= self.joint_count {
                        let expected = format!("one of the skin's {} joints on vertex {v}", self.joint_count);
                        return Err(accessors.store.refuse(expected, format!("joint {joint}")));
                    }
                    self.skin.influences.push((joint, weight));
                }
            }
            self.skin.end_vertex();
        }
        Ok(())
    }
}
