//! Linear blend skinning with four influences, positions and normals: what a bone rig costs.

use crate::widest;

/// A rig: rest shape, normals, influences. V vertices.
#[derive(Debug, Clone)]
pub struct Skin {
    rest: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    bones: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
}

/// Rotation and translation of a bone, row-major.
pub type Bone = [[f32; 4]; 3];

impl Skin {
    /// Each vertex follows four of `bone_count` bones, neighbours in number.
    pub fn new(rest: &[[f32; 3]], bone_count: usize) -> Self {
        let bone = |v: usize, n: usize| ((v * bone_count / rest.len() + n) % bone_count) as u16;
        Self {
            rest: rest.to_vec(),
            normals: rest.iter().map(|_| [0.0, 0.6, 0.8]).collect(),
            bones: (0..rest.len()).map(|v| core::array::from_fn(|n| bone(v, n))).collect(),
            weights: vec![[0.4, 0.3, 0.2, 0.1]; rest.len()],
        }
    }

    /// Poses that turn each bone a little.
    pub fn pose(bone_count: usize, turn: f32) -> Vec<Bone> {
        (0..bone_count)
            .map(|b| {
                let (sin, cos) = (turn * (b as f32 + 1.0)).sin_cos();
                [
                    [cos, -sin, 0.0, 0.1 * turn],
                    [sin, cos, 0.0, 0.0],
                    [0.0, 0.0, 1.0, -0.1 * turn],
                ]
            })
            .collect()
    }

    /// Skins. Shapes: `positions` and `normals` `[V]`.
    pub fn run(&self, pose: &[Bone], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) {
        skin(self, pose, positions, normals);
    }
}

#[inline(always)]
fn skin_body(skin: &Skin, pose: &[Bone], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) {
    let outputs = positions.iter_mut().zip(normals);
    for (v, (position, normal)) in outputs.enumerate() {
        let mut blend = [0.0_f32; 12];
        for (&bone, &w) in skin.bones[v].iter().zip(&skin.weights[v]) {
            for (x, b) in blend.iter_mut().zip(pose[bone as usize].as_flattened()) {
                *x = b.mul_add(w, *x);
            }
        }
        let (p, n) = (skin.rest[v], skin.normals[v]);
        let row = |c: usize, q: [f32; 3]| blend[4 * c] * q[0] + blend[4 * c + 1] * q[1] + blend[4 * c + 2] * q[2];
        *position = core::array::from_fn(|c| row(c, p) + blend[4 * c + 3]);
        let turned: [f32; 3] = core::array::from_fn(|c| row(c, n));
        let length = (turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2]).sqrt();
        *normal = turned.map(|x| x / length);
    }
}

widest! {
    /// See [`Skin::run`].
    pub fn skin(rig: &Skin, pose: &[Bone], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) = skin_body
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_pose_is_rest() {
        let rest: Vec<[f32; 3]> = (0..100).map(|v| [v as f32, 1.0, -2.0]).collect();
        let skin = Skin::new(&rest, 20);
        let (mut positions, mut normals) = (vec![[0.0; 3]; 100], vec![[0.0; 3]; 100]);
        skin.run(&Skin::pose(20, 0.0), &mut positions, &mut normals);
        for (p, r) in positions.iter().zip(&rest) {
            assert!((0..3).all(|c| (p[c] - r[c]).abs() < 1e-4));
        }
        skin.run(&Skin::pose(20, 0.1), &mut positions, &mut normals);
        assert!(positions.iter().zip(&rest).any(|(p, r)| (p[0] - r[0]).abs() > 1e-2));
    }
}
