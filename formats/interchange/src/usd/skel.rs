//! Skeletons of USD (UsdSkel): joints, what moves them, and blend shapes with shapes between.

use super::layer::{Attribute, Layer, Source, resolved};
use super::stage::{Around, matrix, rotation};
use crate::error::SequenceError;
use crate::rig::{Morph, MorphKey, Node};
use crate::skin::{Joint, Skin};
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

/// A skeleton, and where its joints stand among the nodes.
pub(super) struct Skeleton {
    pub(super) prim: usize,
    /// Paths of joints within the skeleton.
    joints: Vec<String>,
    parents: Vec<Option<usize>>,
    /// From joint to skeleton in the bind pose.
    binds: Vec<DAffine3>,
    rests: Vec<DAffine3>,
    pub(super) first_node: usize,
    pub(super) animation: Option<Animation>,
}

/// What moves a skeleton.
pub(super) struct Animation {
    pub(super) prim: usize,
    /// The joint that each of its own is.
    joints: Vec<Option<usize>>,
    /// Names of blend shapes.
    pub(super) shapes: Vec<String>,
}

/// What of an animation moves joints.
const MOVING: [&str; 3] = ["translations", "rotations", "scales"];

/// The prim that a relationship of a prim, or of one above it, names.
fn inherited(layer: &Layer, prim: usize, name: &str) -> Option<usize> {
    layer.above(prim).find_map(|prim| {
        let targets = layer.prims[prim].relationships.get(name)?;
        layer.find(&resolved(&layer.prims[prim].path, targets.first()?))
    })
}

fn matrices(values: Option<Vec<f64>>) -> Vec<DAffine3> {
    values
        .unwrap_or_default()
        .as_chunks::<16>()
        .0
        .iter()
        .map(matrix)
        .collect()
}

/// Paths above one of a joint, the nearest first.
fn above(joint: &str) -> impl Iterator<Item = &str> {
    let next = |path: &str| -> Option<usize> { path.rfind('/') };
    core::iter::successors(next(joint).map(|end| &joint[..end]), move |&path| {
        next(path).map(|end| &joint[..end])
    })
}

impl Skeleton {
    /// Reads a skeleton whose joints become nodes from `first_node` on.
    ///
    /// Errors: `BadMesh` where joints and their transforms differ in number.
    pub(super) fn read(
        source: &mut Source,
        layer: &Layer,
        prim: usize,
        first_node: usize,
    ) -> Result<Skeleton, SequenceError> {
        let joints = source.names(layer, prim, "joints")?;
        let binds = matrices(source.still(layer, prim, "bindTransforms")?);
        let mut rests = matrices(source.still(layer, prim, "restTransforms")?);
        if binds.len() != joints.len() {
            let (expected, found) = (
                format!("{} bind transforms, one a joint", joints.len()),
                binds.len().to_string(),
            );
            return Err(source.refuse(&layer.prims[prim].path, expected, found));
        }
        let places: HashMap<&str, usize> = joints.iter().enumerate().map(|(j, name)| (name.as_str(), j)).collect();
        let parent = |name: &String| above(name).find_map(|above| places.get(above).copied());
        let parents: Vec<Option<usize>> = joints.iter().map(parent).collect();
        if rests.len() != joints.len() {
            let own = |j: usize| parents[j].map_or(binds[j], |parent| binds[parent].inverse() * binds[j]);
            rests = (0..joints.len()).map(own).collect();
        }
        let animation = inherited(layer, prim, "skel:animationSource").map(|prim| {
            let own = source.names(layer, prim, "joints")?;
            Ok::<_, SequenceError>(Animation {
                prim,
                joints: own.iter().map(|name| places.get(name.as_str()).copied()).collect(),
                shapes: source.names(layer, prim, "blendShapes")?,
            })
        });
        Ok(Skeleton {
            prim,
            animation: animation.transpose()?,
            joints,
            parents,
            binds,
            rests,
            first_node,
        })
    }

    /// Joints as nodes below that of the skeleton.
    pub(super) fn nodes(&self) -> impl Iterator<Item = Node> {
        self.parents.iter().zip(&self.rests).map(|(parent, rest)| Node {
            parent: Some(parent.map_or(self.prim, |parent| self.first_node + parent)),
            rest: *rest,
        })
    }

    /// Places joints at a time code.
    pub(super) fn pose(
        &self,
        source: &mut Source,
        layer: &Layer,
        time: f64,
        locals: &mut [DAffine3],
    ) -> Result<(), SequenceError> {
        let Some(animation) = &self.animation else {
            return Ok(());
        };
        let mut around = |name: &str| -> Result<Option<Around>, SequenceError> {
            let attribute = layer.prims[animation.prim].attributes.get(name);
            attribute.map_or(Ok(None), |attribute| source.around(attribute, Some(time)))
        };
        let [translations, rotations, scales] = [around(MOVING[0])?, around(MOVING[1])?, around(MOVING[2])?];
        let (Some(translations), Some(rotations), Some(scales)) = (translations, rotations, scales) else {
            return Ok(());
        };
        let (translations, scales) = (translations.blended(), scales.blended());
        let vector = |values: &[f64], i: usize| values.as_chunks::<3>().0.get(i).map(|&v| DVec3::from(v));
        let turn = |values: &[f64], i: usize| values.as_chunks::<4>().0.get(i).map(|q| rotation(q));
        for (i, joint) in animation.joints.iter().enumerate() {
            let placed = (vector(&translations, i), turn(&rotations.before, i), vector(&scales, i));
            let (Some(joint), (Some(translation), Some(mut rotation), Some(scale))) = (joint, placed) else {
                continue;
            };
            if let Some((behind, share)) = &rotations.behind {
                rotation = turn(behind, i).map_or(rotation, |next| rotation.slerp(next, *share));
            }
            locals[self.first_node + joint] = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        }
        Ok(())
    }
}

impl Animation {
    /// What moves joints.
    pub(super) fn attributes<'a>(&self, layer: &'a Layer) -> impl Iterator<Item = &'a Attribute> {
        let own = &layer.prims[self.prim].attributes;
        MOVING.into_iter().filter_map(move |name| own.get(name))
    }

    /// What weighs blend shapes.
    pub(super) fn weights<'a>(&self, layer: &'a Layer) -> Option<&'a Attribute> {
        layer.prims[self.prim].attributes.get("blendShapeWeights")
    }
}

/// How a mesh hangs on skeletons.
#[derive(Debug, Clone, Default)]
pub(super) struct Binding {
    /// Which of the skeletons.
    pub(super) skeleton: Option<usize>,
    pub(super) is_skinned: bool,
    pub(super) joint_count: usize,
    /// Names of blend shapes and their prims.
    pub(super) shapes: Vec<(String, usize)>,
}

impl Binding {
    pub(super) fn read(
        source: &mut Source,
        layer: &Layer,
        prim: usize,
        skeletons: &[Skeleton],
    ) -> Result<Binding, SequenceError> {
        // Outside of a root of skeletons bindings say nothing: so are meshes left whose skinning was baked.
        let is_inside = layer.above(prim).any(|prim| layer.prims[prim].type_name == "SkelRoot");
        let found = inherited(layer, prim, "skel:skeleton").filter(|_| is_inside);
        let skeleton = found.and_then(|prim| skeletons.iter().position(|skeleton| skeleton.prim == prim));
        let own = &layer.prims[prim];
        let is_skinned = skeleton.is_some() && own.attributes.contains_key("primvars:skel:jointIndices");
        let names = source.names(layer, prim, "skel:blendShapes")?;
        let targets = own
            .relationships
            .get("skel:blendShapeTargets")
            .cloned()
            .unwrap_or_default();
        let shape =
            |(name, target): (String, String)| layer.find(&resolved(&own.path, &target)).map(|prim| (name, prim));
        Ok(Binding {
            skeleton,
            is_skinned,
            joint_count: skeleton
                .filter(|_| is_skinned)
                .map_or(0, |skeleton| skeletons[skeleton].joints.len()),
            shapes: names.into_iter().zip(targets).filter_map(shape).collect(),
        })
    }
}

/// Joints of a mesh (the node of each, and the map from the mesh to it), its skin, and how much dual quaternions count.
pub(super) type Hold = (Vec<(usize, DAffine3)>, Skin, Vec<f32>);

/// Reads what a skeleton holds of a mesh of `vertex_count` vertices.
///
/// Errors: `BadMesh` where influences do not fit.
pub(super) fn hold(
    source: &mut Source,
    layer: &Layer,
    prim: usize,
    skeleton: &Skeleton,
    vertex_count: usize,
) -> Result<Hold, SequenceError> {
    const INDICES: &str = "primvars:skel:jointIndices";
    let path = &layer.prims[prim].path;
    let indices = source.still(layer, prim, INDICES)?.unwrap_or_default();
    let weights = source
        .still(layer, prim, "primvars:skel:jointWeights")?
        .unwrap_or_default();
    let attribute = &layer.prims[prim].attributes[INDICES];
    let is_rigid = attribute.interpolation.as_deref().unwrap_or("constant") == "constant";
    let size = match attribute.element_size {
        Some(raw) => source
            .numbers(raw)?
            .and_then(|values| values.first().copied())
            .unwrap_or(1.0) as usize,
        None if is_rigid => indices.len(),
        None => 1,
    };
    let needed = if is_rigid {
        size
    } else {
        size.saturating_mul(vertex_count)
    };
    if indices.len() != weights.len() || indices.len() != needed || size == 0 {
        let found = format!("{} joints and {} weights", indices.len(), weights.len());
        return Err(source.refuse(path, format!("{needed} influences on {vertex_count} vertices"), found));
    }
    let own = source.names(layer, prim, "skel:joints")?;
    // Where a mesh names joints of its own, its influences count those.
    let order: Vec<Option<usize>> = if own.is_empty() {
        (0..skeleton.joints.len()).map(Some).collect()
    } else {
        own.iter()
            .map(|name| skeleton.joints.iter().position(|joint| joint == name))
            .collect()
    };
    let mut skin = Skin::default();
    for v in 0..vertex_count {
        let start = if is_rigid { 0 } else { v * size };
        for i in start..start + size {
            let joint = order
                .get(indices[i] as usize)
                .copied()
                .flatten()
                .filter(|_| indices[i] >= 0.0);
            match joint {
                Some(joint) => skin.influences.push((joint as u32, weights[i] as f32)),
                None if weights[i] == 0.0 => {}
                None => {
                    let expected = format!("one of the skeleton's {} joints on vertex {v}", skeleton.joints.len());
                    return Err(source.refuse(path, expected, format!("joint {}", indices[i])));
                }
            }
        }
        skin.end_vertex();
    }
    let geometry = source.still(layer, prim, "primvars:skel:geomBindTransform")?;
    let geometry = matrices(geometry).first().copied().unwrap_or(DAffine3::IDENTITY);
    let to_mesh = geometry.inverse();
    let mut joints = Vec::with_capacity(skeleton.joints.len());
    for (j, bind) in skeleton.binds.iter().enumerate() {
        joints.push((skeleton.first_node + j, bind.inverse() * geometry));
        let in_mesh = to_mesh * *bind;
        skin.joints.push(Joint {
            name: skeleton.joints[j].rsplit('/').next().unwrap_or_default().into(),
            parent: skeleton.parents[j].map(|parent| parent as u32),
            bind: [in_mesh.x_axis, in_mesh.y_axis, in_mesh.z_axis, in_mesh.translation].map(|axis| axis.to_array()),
        });
    }
    let methods = source.names(layer, prim, "primvars:skel:skinningMethod")?;
    let is_dual = methods.iter().any(|name| name == "dualQuaternion");
    Ok((joints, skin, if is_dual { vec![1.0; vertex_count] } else { Vec::new() }))
}

/// Reads a blend shape and the shapes between on its way.
///
/// Errors: `BadMesh` where it moves vertices that there are not.
pub(super) fn morph(
    source: &mut Source,
    layer: &Layer,
    prim: usize,
    vertex_count: usize,
) -> Result<Morph, SequenceError> {
    let own = &layer.prims[prim];
    let places = source.still(layer, prim, "pointIndices")?.unwrap_or_default();
    let mut keys = Vec::new();
    let mut names: Vec<&String> = own.attributes.keys().collect();
    names.sort();
    for name in names {
        let between = name.strip_prefix("inbetweens:").filter(|rest| !rest.contains(':'));
        if name != "offsets" && between.is_none() {
            continue;
        }
        let weight = match (between, own.attributes[name].weight) {
            (None, _) => 1.0,
            (Some(_), Some(raw)) => source
                .numbers(raw)?
                .and_then(|values| values.first().copied())
                .unwrap_or(0.0),
            (Some(_), None) => 0.0,
        };
        if weight == 0.0 || !weight.is_finite() {
            continue;
        }
        let values = source.still(layer, prim, name)?.unwrap_or_default();
        let mut offsets = Vec::new();
        for (i, offset) in values.as_chunks::<3>().0.iter().enumerate() {
            let v = if places.is_empty() {
                i as f64
            } else {
                places.get(i).copied().unwrap_or(-1.0)
            };
            if !(0.0..vertex_count as f64).contains(&v) {
                return Err(source.refuse(
                    &own.path,
                    format!("one of {vertex_count} vertices"),
                    format!("vertex {v}"),
                ));
            }
            if *offset != [0.0; 3] {
                offsets.push((v as u32, offset.map(|x| x as f32)));
            }
        }
        keys.push(MorphKey { weight, offsets });
    }
    keys.sort_by(|a, b| a.weight.total_cmp(&b.weight));
    keys.dedup_by(|later, kept| later.weight == kept.weight);
    Ok(Morph { keys })
}
