//! A mesh that joints move, with its clips and sliders: what an engine plays without any code of ours.
//!
//! Path of data: the runtime's bones and components, posed frame by frame -> [`Puppet`], its clips with the keys that are needed ->
//! `gltf/puppet.rs` -> a glTF file.

use super::mesh::Dress;
use super::write::{OutputSurface, WriteError};
use glam::{DMat4, DQuat, DVec3};
use std::path::Path;

/// A joint in the space of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointPose {
    /// Units of the source.
    pub translation: [f32; 3],
    /// Unit quaternion x y z w.
    pub rotation: [f32; 4],
    /// Along the joint's own axes.
    pub scale: [f32; 3],
}

/// What is written.
#[derive(Debug)]
pub struct Puppet<'a> {
    /// The mesh. The skin of its dress holds the joints, none below another, in their bind pose, which is their rest.
    pub surface: OutputSurface<'a>,
    /// Shape: `[V]`.
    pub rest: &'a [[f32; 3]],
    /// Morph targets: a name, and the mesh as it is at weight 1. Shape of each: `[V]`.
    pub targets: Vec<(String, Vec<[f32; 3]>)>,
    /// What plays.
    pub clips: Vec<PuppetClip>,
    /// What the file carries for programs that know it.
    pub extras: serde_json::Value,
}

/// Movement over time.
#[derive(Debug, Clone)]
pub struct PuppetClip {
    /// Name.
    pub name: String,
    /// Frames a second.
    pub fps: f64,
    /// N.
    pub frame_count: usize,
    /// What moves; what does not is not here.
    pub tracks: Vec<Track>,
    /// Weights of the targets. Shape: `[N][targets]`, or empty where none moves.
    pub weights: Vec<Vec<f32>>,
}

/// One part of one joint's movement: keys, and straight lines between them (great circles, of rotations). Before the first key and
/// behind the last one it rests there.
#[derive(Debug, Clone)]
pub struct Track {
    /// Index of the joint.
    pub joint: usize,
    /// Frames of the keys, rising.
    pub frames: Vec<u32>,
    /// As many as `frames`.
    pub keys: Keys,
}

/// Keys of one kind.
#[derive(Debug, Clone)]
pub enum Keys {
    /// [`JointPose::translation`].
    Translation(Vec<[f32; 3]>),
    /// [`JointPose::rotation`], each on the side of the one before.
    Rotation(Vec<[f32; 4]>),
    /// [`JointPose::scale`].
    Scale(Vec<[f32; 3]>),
}

/// No line between two keys is longer, so that the search for keys stays linear in the frames.
const LONGEST_LINE: usize = 64;

impl PuppetClip {
    /// The clip of joints that stand as `poses` says (shape `[N][J]`, `rest` `[J]`), with as few keys as keep every vertex within
    /// `tolerance` of where all keys would have it. `reaches` `[J]`: how far from each joint a vertex that follows it may be. Both in
    /// units of the source.
    pub fn of_poses(
        name: &str,
        fps: f64,
        rest: &[JointPose],
        poses: &[Vec<JointPose>],
        reaches: &[f64],
        tolerance: f64,
    ) -> Self {
        // Weights of a vertex sum to one, so what it moves by is at most what one joint moves it by: a third for each part.
        let share = tolerance / 3.0;
        let mut tracks = Vec::new();
        for (j, (rest, &reach)) in rest.iter().zip(reaches).enumerate() {
            let translations: Vec<_> = poses.iter().map(|pose| pose[j].translation).collect();
            let far = |a: [f32; 3], b: [f32; 3]| vector(a).distance(vector(b));
            push(
                &mut tracks,
                j,
                rest.translation,
                &translations,
                &far,
                share,
                &line,
                Keys::Translation,
            );
            let scales: Vec<_> = poses.iter().map(|pose| pose[j].scale).collect();
            let widest = scales
                .as_flattened()
                .iter()
                .fold(1.0, |most: f32, &x| most.max(x.abs()));
            let mut rotations: Vec<_> = poses.iter().map(|pose| pose[j].rotation).collect();
            for n in 1..rotations.len() {
                if quaternion(rotations[n - 1]).dot(quaternion(rotations[n])) < 0.0 {
                    rotations[n] = rotations[n].map(|x| -x);
                }
            }
            let arm = reach * f64::from(widest);
            let turned = |a: [f32; 4], b: [f32; 4]| {
                // Twice the sine of half the angle: the chord of a point one unit away.
                let turn = quaternion(a).conjugate() * quaternion(b);
                2.0 * turn.xyz().length() * arm
            };
            push(
                &mut tracks,
                j,
                rest.rotation,
                &rotations,
                &turned,
                share,
                &great_circle,
                Keys::Rotation,
            );
            let stretched = |a: [f32; 3], b: [f32; 3]| (vector(a) - vector(b)).abs().max_element() * reach;
            push(
                &mut tracks,
                j,
                rest.scale,
                &scales,
                &stretched,
                share,
                &line,
                Keys::Scale,
            );
        }
        Self {
            name: name.into(),
            fps,
            frame_count: poses.len(),
            tracks,
            weights: Vec::new(),
        }
    }

    /// The joints at a frame, as a player of the keys has them. Shape: `rest` and the answer `[J]`.
    pub fn pose(&self, frame: usize, rest: &[JointPose]) -> Vec<JointPose> {
        let mut pose = rest.to_vec();
        for track in &self.tracks {
            let joint = &mut pose[track.joint];
            match &track.keys {
                Keys::Translation(keys) => joint.translation = sample(&track.frames, keys, frame, &line),
                Keys::Rotation(keys) => joint.rotation = sample(&track.frames, keys, frame, &great_circle),
                Keys::Scale(keys) => joint.scale = sample(&track.frames, keys, frame, &line),
            }
        }
        pose
    }

    /// Keys of all tracks.
    pub fn key_count(&self) -> usize {
        self.tracks.iter().map(|track| track.frames.len()).sum()
    }
}

/// Where a skin puts the vertices of `rest` when its joints stand so: linear blend skinning. Shapes: `rest` and the answer `[V]`, `pose`
/// `[J]`. The skin has V vertices and J joints.
pub fn skinned(dress: &Dress, rest: &[[f32; 3]], pose: &[JointPose]) -> Vec<[f32; 3]> {
    let Some(skin) = &dress.skin else {
        return rest.to_vec();
    };
    let maps: Vec<DMat4> = skin
        .joints
        .iter()
        .zip(pose)
        .map(|(joint, pose)| matrix(pose) * DMat4::from(joint.bind_map().inverse()))
        .collect();
    let place = |(v, &point): (usize, &[f32; 3])| {
        let own = skin.of_vertex(v).iter();
        let sum: DVec3 = own
            .map(|&(joint, weight)| f64::from(weight) * maps[joint as usize].transform_point3(vector(point)))
            .sum();
        sum.to_array().map(|x| x as f32)
    };
    rest.iter().enumerate().map(place).collect()
}

/// Writes a puppet, as the ending of the name says: `.glb` or `.gltf`.
///
/// Errors: `NotGltf` for another ending, `LengthDiffers`, `Io`, `TooLarge`.
pub fn write_puppet(path: &Path, puppet: &Puppet<'_>) -> Result<(), WriteError> {
    let extension = path.extension().and_then(|text| text.to_str()).unwrap_or("");
    if !["glb", "gltf"].contains(&extension.to_ascii_lowercase().as_str()) {
        return Err(WriteError::NotGltf { path: path.into() });
    }
    super::gltf::write_puppet(path, puppet)
}

/// Adds a track unless it rests all the time.
#[expect(clippy::too_many_arguments, reason = "one place for three kinds of keys")]
fn push<const N: usize>(
    tracks: &mut Vec<Track>,
    joint: usize,
    rest: [f32; N],
    values: &[[f32; N]],
    far: &dyn Fn([f32; N], [f32; N]) -> f64,
    tolerance: f64,
    between: &dyn Fn([f32; N], [f32; N], f64) -> [f32; N],
    keys: impl Fn(Vec<[f32; N]>) -> Keys,
) {
    if values.iter().all(|&value| far(value, rest) <= tolerance) {
        return;
    }
    let frames = needed(values, far, tolerance, between);
    let kept = frames.iter().map(|&n| values[n as usize]).collect();
    tracks.push(Track {
        joint,
        frames,
        keys: keys(kept),
    });
}

/// Frames whose values, joined by lines, come within the tolerance of all others.
fn needed<const N: usize>(
    values: &[[f32; N]],
    far: &dyn Fn([f32; N], [f32; N]) -> f64,
    tolerance: f64,
    between: &dyn Fn([f32; N], [f32; N], f64) -> [f32; N],
) -> Vec<u32> {
    let last = values.len() - 1;
    if values.iter().all(|&value| far(value, values[0]) <= tolerance) {
        return vec![0];
    }
    let mut frames = vec![0_u32];
    let mut from = 0;
    while from < last {
        let reaches = |to: usize| {
            (from + 1..to).all(|n| {
                let share = (n - from) as f64 / (to - from) as f64;
                far(between(values[from], values[to], share), values[n]) <= tolerance
            })
        };
        let mut to = from + 1;
        while to < last && to < from + LONGEST_LINE && reaches(to + 1) {
            to += 1;
        }
        frames.push(to as u32);
        from = to;
    }
    frames
}

fn sample<const N: usize>(
    frames: &[u32],
    keys: &[[f32; N]],
    frame: usize,
    between: &dyn Fn([f32; N], [f32; N], f64) -> [f32; N],
) -> [f32; N] {
    let above = frames.partition_point(|&key| (key as usize) < frame);
    if above == 0 || above == frames.len() {
        return keys[above.min(keys.len() - 1)];
    }
    let (from, to) = (frames[above - 1] as f64, frames[above] as f64);
    between(keys[above - 1], keys[above], (frame as f64 - from) / (to - from))
}

fn line(a: [f32; 3], b: [f32; 3], share: f64) -> [f32; 3] {
    vector(a).lerp(vector(b), share).to_array().map(|x| x as f32)
}

fn great_circle(a: [f32; 4], b: [f32; 4], share: f64) -> [f32; 4] {
    quaternion(a).slerp(quaternion(b), share).to_array().map(|x| x as f32)
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

fn quaternion(q: [f32; 4]) -> DQuat {
    DQuat::from_array(q.map(f64::from)).normalize()
}

/// From joint to mesh.
fn matrix(pose: &JointPose) -> DMat4 {
    DMat4::from_scale_rotation_translation(vector(pose.scale), quaternion(pose.rotation), vector(pose.translation))
}

impl JointPose {
    /// From joint to mesh, as [`crate::Joint::bind`] has it.
    pub fn bind(&self) -> [[f64; 3]; 4] {
        let matrix = matrix(self);
        [matrix.x_axis, matrix.y_axis, matrix.z_axis, matrix.w_axis].map(|axis| axis.truncate().to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REST: JointPose = JointPose {
        translation: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: [1.0; 3],
    };

    fn turned(angle: f32, x: f32) -> JointPose {
        JointPose {
            translation: [x, 0.0, 0.0],
            rotation: [0.0, 0.0, (0.5 * angle).sin(), (0.5 * angle).cos()],
            scale: [1.0; 3],
        }
    }

    #[test]
    fn a_straight_movement_needs_two_keys_a_line_and_a_rest_none() {
        let poses: Vec<_> = (0..40)
            .map(|n| vec![turned(0.05 * n as f32, 0.5 * n as f32), REST])
            .collect();
        let clip = PuppetClip::of_poses("walk", 24.0, &[REST; 2], &poses, &[1.0; 2], 1e-3);
        assert!(clip.tracks.iter().all(|track| track.joint == 0));
        let lengths: Vec<_> = clip.tracks.iter().map(|track| track.frames.clone()).collect();
        assert_eq!(lengths, [vec![0, 39], vec![0, 39]], "translation and rotation");
    }

    #[test]
    fn kept_keys_hold_the_tolerance_at_every_frame() {
        let at = |n: usize| {
            let t = n as f32 / 40.0;
            JointPose {
                scale: [1.0 + 0.2 * t.sin(), 1.0, 1.0],
                ..turned((1.3 * t).sin() * 4.0, t.cos() * 3.0)
            }
        };
        let poses: Vec<_> = (0..200).map(|n| vec![at(n)]).collect();
        let (reach, tolerance) = (2.0, 0.02);
        let clip = PuppetClip::of_poses("swing", 30.0, &[REST], &poses, &[reach], tolerance);
        assert!(clip.key_count() < 300, "{} of 600 keys", clip.key_count());
        for (n, pose) in poses.iter().enumerate() {
            let played = matrix(&clip.pose(n, &[REST])[0]);
            for point in [DVec3::X, DVec3::Y, DVec3::NEG_X].map(|axis| axis * reach) {
                let far = played
                    .transform_point3(point)
                    .distance(matrix(&pose[0]).transform_point3(point));
                assert!(far <= tolerance, "frame {n}: {far}");
            }
        }
    }

    #[test]
    fn a_clip_of_one_frame_is_a_pose() {
        let clip = PuppetClip::of_poses("pose", 24.0, &[REST], &[vec![turned(0.5, 2.0)]], &[1.0], 0.0);
        assert_eq!(clip.pose(0, &[REST])[0].translation, [2.0, 0.0, 0.0]);
        assert_eq!(clip.key_count(), 2);
    }
}
