//! Meshes that are moved by joints, morph targets and nodes: evaluated to vertices alike for every format that holds such.

use super::error::SequenceError;
use super::mesh::PolygonMesh;
use super::scene::{ClipEntry, Contents, Moment, Scene, Space};
use glam::{DAffine3, DVec3};

/// Name of the clip that shows one morph target a frame.
pub(crate) const TARGETS: &str = "morph targets";

/// A node: what meshes hang from and joints are.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// The one it hangs from.
    pub(crate) parent: Option<usize>,
    /// Its transform where no clip moves it.
    pub(crate) rest: DAffine3,
}

/// A mesh of a rig, loaded.
#[derive(Debug, Clone, Default)]
pub(crate) struct RigMesh {
    /// Faces, dress and positions before anything moves them. Its skin's influences name joints of `joints`.
    pub(crate) geometry: PolygonMesh,
    /// Joints: the node of each, and the map from the mesh to it in the bind pose.
    pub(crate) joints: Vec<(usize, DAffine3)>,
    pub(crate) morphs: Vec<Morph>,
    /// How much of each vertex' skinning is by dual quaternions; empty for none.
    pub(crate) dual: Vec<f32>,
}

/// A morph target, with shapes between where its format has such.
#[derive(Debug, Clone, Default)]
pub(crate) struct Morph {
    /// By ascending weight, none of them 0: what moves, and by how much.
    pub(crate) keys: Vec<MorphKey>,
}

/// One shape of a morph target.
#[derive(Debug, Clone, Default)]
pub(crate) struct MorphKey {
    pub(crate) weight: f64,
    pub(crate) offsets: Vec<(u32, [f32; 3])>,
}

/// Where nodes are and how much morph targets count at one moment.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pose {
    /// Local transforms of nodes.
    pub(crate) locals: Vec<DAffine3>,
    /// Weights of each mesh's morph targets.
    pub(crate) weights: Vec<Vec<f64>>,
}

/// What a format has to say about its rig.
pub(crate) trait RigFile {
    /// Loads a mesh.
    fn load(&mut self, mesh: usize) -> Result<RigMesh, SequenceError>;

    /// Changes a pose at rest to that of a clip at a time in seconds.
    fn pose(&mut self, clip: usize, time: f64, pose: &mut Pose) -> Result<(), SequenceError>;

    /// Points that a mesh has in a clip at a time in seconds before anything else moves them; none where they stay as loaded.
    fn points(&mut self, _mesh: usize, _clip: usize, _time: f64) -> Result<Option<Vec<[f32; 3]>>, SequenceError> {
        Ok(None)
    }
}

/// A rig as a scene.
pub(crate) struct RigScene<F> {
    pub(crate) file: F,
    pub(crate) contents: Contents,
    pub(crate) nodes: Vec<Node>,
    /// Nodes in the order of evaluation.
    order: Vec<usize>,
    /// The node of each mesh.
    pub(crate) mesh_nodes: Vec<usize>,
    /// Weights of morph targets where no clip sets them.
    pub(crate) rest_weights: Vec<Vec<f64>>,
    /// Names of the morph targets of all meshes.
    targets: Vec<String>,
    loaded: Vec<Option<RigMesh>>,
    /// The pose that was asked for last, and world transforms in it.
    posed: Option<Moment>,
    pose: Pose,
    worlds: Vec<DAffine3>,
}

/// The nodes in an order in which parents come first; none where they form a circle.
pub(crate) fn ordered(parents: &[Option<usize>]) -> Option<Vec<usize>> {
    let mut order = Vec::with_capacity(parents.len());
    let mut is_placed = vec![false; parents.len()];
    let mut above = Vec::new();
    for start in 0..parents.len() {
        let mut node = Some(start);
        while let Some(current) = node.filter(|&node| !is_placed[node]) {
            // Placed before it is reached again only if the chain ends.
            if above.len() > parents.len() {
                return None;
            }
            above.push(current);
            node = parents[current];
        }
        while let Some(current) = above.pop() {
            is_placed[current] = true;
            order.push(current);
        }
    }
    Some(order)
}

impl<F: RigFile> RigScene<F> {
    /// Puts a rig together. `order` is that of [`ordered`]. Adds the clip of morph targets where there are some.
    pub(crate) fn new(
        file: F,
        mut contents: Contents,
        nodes: Vec<Node>,
        order: Vec<usize>,
        mesh_nodes: Vec<usize>,
        rest_weights: Vec<Vec<f64>>,
    ) -> RigScene<F> {
        let mut targets: Vec<String> = Vec::new();
        for name in contents.meshes.iter().flat_map(|mesh| &mesh.morphs) {
            if !targets.contains(name) {
                targets.push(name.clone());
            }
        }
        if !targets.is_empty() {
            contents.clips.push(ClipEntry {
                is_targets: true,
                ..ClipEntry::untimed(TARGETS, targets.len() + 1)
            });
        }
        RigScene {
            loaded: vec![None; mesh_nodes.len()],
            file,
            contents,
            nodes,
            order,
            mesh_nodes,
            rest_weights,
            targets,
            posed: None,
            pose: Pose::default(),
            worlds: Vec::new(),
        }
    }

    fn load(&mut self, mesh: usize) -> Result<&RigMesh, SequenceError> {
        if self.loaded[mesh].is_none() {
            self.loaded[mesh] = Some(self.file.load(mesh)?);
        }
        Ok(self.loaded[mesh].get_or_insert_default())
    }

    /// Brings nodes and weights to a moment.
    fn pose(&mut self, moment: Moment) -> Result<(), SequenceError> {
        if self.posed == Some(moment) {
            return Ok(());
        }
        self.posed = None;
        self.pose.locals.clear();
        self.pose.locals.extend(self.nodes.iter().map(|node| node.rest));
        self.pose.weights.clone_from(&self.rest_weights);
        match moment {
            Moment::At { clip, time } if self.contents.clips[clip].is_targets => {
                let wanted = (time as usize).checked_sub(1).map(|target| &self.targets[target]);
                for (mesh, weights) in self.contents.meshes.iter().zip(&mut self.pose.weights) {
                    for (name, weight) in mesh.morphs.iter().zip(weights) {
                        *weight = f64::from(u8::from(Some(name) == wanted));
                    }
                }
            }
            Moment::At { clip, time } => self.file.pose(clip, time, &mut self.pose)?,
            Moment::Rest => {}
        }
        self.worlds.resize(self.nodes.len(), DAffine3::IDENTITY);
        for &node in &self.order {
            let local = self.pose.locals[node];
            self.worlds[node] = self.nodes[node]
                .parent
                .map_or(local, |parent| self.worlds[parent] * local);
        }
        self.posed = Some(moment);
        Ok(())
    }
}

impl<F: RigFile> Scene for RigScene<F> {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn geometry(&mut self, mesh: usize) -> Result<PolygonMesh, SequenceError> {
        Ok(self.load(mesh)?.geometry.clone())
    }

    fn positions(
        &mut self,
        mesh: usize,
        moment: Moment,
        space: Space,
        out: &mut Vec<[f32; 3]>,
    ) -> Result<(), SequenceError> {
        self.load(mesh)?;
        self.pose(moment)?;
        let points = match moment {
            Moment::At { clip, time } if !self.contents.clips[clip].is_targets => self.file.points(mesh, clip, time)?,
            _ => None,
        };
        let Some(rig) = &self.loaded[mesh] else { return Ok(()) };
        let world = self.worlds[self.mesh_nodes[mesh]];
        let points = points.as_deref().unwrap_or(&rig.geometry.positions);
        if points.len() != rig.geometry.positions.len() {
            // Refused where frames are compared.
            out.clear();
            out.extend_from_slice(points);
            return Ok(());
        }
        let mut positions: Vec<DVec3> = points.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
        for (morph, &weight) in rig.morphs.iter().zip(&self.pose.weights[mesh]) {
            morph.add(weight, &mut positions);
        }
        if rig.joints.is_empty() {
            if space == Space::World && world != DAffine3::IDENTITY {
                positions.iter_mut().for_each(|p| *p = world.transform_point3(*p));
            }
        } else {
            let back = if space == Space::World {
                DAffine3::IDENTITY
            } else {
                world.inverse()
            };
            let maps: Vec<DAffine3> = rig
                .joints
                .iter()
                .map(|&(node, bind)| back * self.worlds[node] * bind)
                .collect();
            rig.skin(&maps, back * world, &mut positions);
        }
        out.clear();
        out.extend(positions.iter().map(|p| p.to_array().map(|x| x as f32)));
        Ok(())
    }

    fn frame_name(&self, clip: usize, frame: usize) -> String {
        let entry = &self.contents.clips[clip];
        match frame.checked_sub(1).filter(|_| entry.is_targets) {
            Some(target) => format!("{TARGETS}: {}", self.targets[target]),
            None => format!("{}[{frame}]", entry.name),
        }
    }
}

impl Morph {
    /// Adds what this target does at a weight: along straight lines between the shapes it has, beyond the last one further on.
    fn add(&self, weight: f64, positions: &mut [DVec3]) {
        if weight == 0.0 || self.keys.is_empty() {
            return;
        }
        let mut add = |key: &MorphKey, share: f64| {
            for &(v, offset) in &key.offsets {
                positions[v as usize] += share * DVec3::from(offset.map(f64::from));
            }
        };
        // The shape at weight 0 is none.
        let weights: Vec<f64> = self.keys.iter().map(|key| key.weight).collect();
        let zero = weights.partition_point(|&at| at < 0.0);
        let at = |i: usize| -> (f64, Option<&MorphKey>) {
            match i.cmp(&zero) {
                core::cmp::Ordering::Less => (weights[i], Some(&self.keys[i])),
                core::cmp::Ordering::Equal => (0.0, None),
                core::cmp::Ordering::Greater => (weights[i - 1], Some(&self.keys[i - 1])),
            }
        };
        let count = weights.len() + 1;
        let next = (1..count - 1).find(|&i| weight < at(i).0).unwrap_or(count - 1);
        let ((before, from), (behind, to)) = (at(next - 1), at(next));
        let share = (weight - before) / (behind - before);
        if let Some(key) = from {
            add(key, 1.0 - share);
        }
        if let Some(key) = to {
            add(key, share);
        }
    }
}

impl RigMesh {
    /// Moves vertices by the maps of their joints; those without a joint by `loose`.
    fn skin(&self, maps: &[DAffine3], loose: DAffine3, positions: &mut [DVec3]) {
        let Some(skin) = &self.geometry.dress.skin else { return };
        let duals: Vec<Dual> = if self.dual.is_empty() {
            Vec::new()
        } else {
            maps.iter().map(Dual::of).collect()
        };
        for (v, p) in positions.iter_mut().enumerate() {
            let influences = skin.of_vertex(v);
            if influences.is_empty() {
                *p = loose.transform_point3(*p);
                continue;
            }
            let moved = influences
                .iter()
                .map(|&(joint, weight)| f64::from(weight) * maps[joint as usize].transform_point3(*p));
            let linear: DVec3 = moved.sum();
            let share = self.dual.get(v).map_or(0.0, |&share| f64::from(share));
            *p = if share > 0.0 {
                linear.lerp(Dual::blend(&duals, influences).transform(*p), share)
            } else {
                linear
            };
        }
    }
}

/// A rigid motion as a dual quaternion, and the scale in front of it.
#[derive(Clone, Copy)]
struct Dual {
    real: glam::DQuat,
    dual: glam::DQuat,
    scale: DVec3,
}

impl Dual {
    fn of(map: &DAffine3) -> Dual {
        let (scale, rotation, translation) = map.to_scale_rotation_translation();
        let t = glam::DQuat::from_xyzw(translation.x, translation.y, translation.z, 0.0);
        Dual {
            real: rotation,
            dual: t * rotation * 0.5,
            scale,
        }
    }

    fn blend(duals: &[Dual], influences: &[(u32, f32)]) -> Dual {
        let zero = glam::DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        let mut sum = Dual {
            real: zero,
            dual: zero,
            scale: DVec3::ZERO,
        };
        let pivot = duals[influences[0].0 as usize].real;
        for &(joint, weight) in influences {
            let own = duals[joint as usize];
            // A rotation has two quaternions: those of one side are blended.
            let weight = f64::from(weight);
            let signed = if own.real.dot(pivot) < 0.0 { -weight } else { weight };
            sum.real += own.real * signed;
            sum.dual += own.dual * signed;
            sum.scale += own.scale * weight;
        }
        let length = sum.real.length();
        if length > 0.0 {
            sum.real /= length;
            sum.dual /= length;
        }
        sum
    }

    fn transform(&self, p: DVec3) -> DVec3 {
        let t = self.dual * 2.0 * self.real.conjugate();
        self.real * (p * self.scale) + DVec3::new(t.x, t.y, t.z)
    }
}

#[cfg(test)]
mod tests {
    use super::super::skin::Skin;
    use super::*;

    #[test]
    fn parents_come_first_and_circles_are_found() {
        let order = ordered(&[Some(2), None, Some(1), Some(0)]).unwrap();
        let place = |node: usize| order.iter().position(|&found| found == node);
        assert!(place(1) < place(2) && place(2) < place(0) && place(0) < place(3));
        assert_eq!(ordered(&[Some(1), Some(2), Some(0)]), None);
        assert_eq!(ordered(&[Some(0)]), None);
    }

    #[test]
    fn shapes_between_are_passed_on_the_way() {
        let key = |weight: f64, x: f32| MorphKey {
            weight,
            offsets: vec![(0, [x, 0.0, 0.0])],
        };
        let morph = Morph {
            keys: vec![key(-1.0, -1.0), key(0.5, 4.0), key(1.0, 1.0)],
        };
        let at = |weight: f64| {
            let mut positions = [DVec3::ZERO];
            morph.add(weight, &mut positions);
            positions[0].x
        };
        for (weight, x) in [
            (0.0, 0.0),
            (0.25, 2.0),
            (0.5, 4.0),
            (0.75, 2.5),
            (1.0, 1.0),
            (1.5, -2.0),
            (-0.5, -0.5),
            (-2.0, -2.0),
        ] {
            assert!((at(weight) - x).abs() < 1e-12, "{weight}: {}", at(weight));
        }
    }

    #[test]
    fn dual_quaternions_keep_the_distance_from_the_axis() {
        let half = core::f64::consts::FRAC_PI_2;
        let maps = [
            DAffine3::from_rotation_x(-half),
            DAffine3::from_translation(DVec3::X) * DAffine3::from_rotation_x(half),
        ];
        let mut mesh = RigMesh::default();
        mesh.geometry.dress.skin = Some(Skin {
            joints: Vec::new(),
            ends: vec![2],
            influences: vec![(0, 0.5), (1, 0.5)],
        });
        for (dual, height) in [(vec![], 0.0), (vec![1.0], 1.0)] {
            mesh.dual = dual;
            let mut positions = [DVec3::Y];
            mesh.skin(&maps, DAffine3::IDENTITY, &mut positions);
            assert!(
                (positions[0] - DVec3::new(0.5, height, 0.0)).length() < 1e-12,
                "{}",
                positions[0]
            );
        }
    }
}
