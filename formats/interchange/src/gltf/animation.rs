//! Animations of a glTF file: channels of key frames on nodes and weights.

use super::accessor::Accessors;
use crate::error::SequenceError;
use crate::rig::Pose;
use crate::scene::ClipEntry;
use glam::{DAffine3, DQuat, DVec3};

/// Rates that key frames are tried against, the usual ones first.
const RATES: [f64; 10] = [24.0, 30.0, 25.0, 60.0, 50.0, 48.0, 120.0, 100.0, 12.0, 15.0];
/// Where keys fit no rate.
const FALLBACK_RATE: f64 = 30.0;
/// How far a key may lie beside a frame, in frames: times are 32-bit numbers, and exporters round.
const OFF_FRAME: f64 = 0.01;
/// Frames of a clip at most; times may be nonsense.
const FRAMES_MAX: f64 = 1e6;

/// Translation, rotation and scale of a node.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

impl Placement {
    pub(super) fn transform(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Path {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Interpolation {
    Linear,
    Step,
    Cubic,
}

/// One channel, loaded.
struct Channel {
    node: usize,
    path: Path,
    interpolation: Interpolation,
    times: Vec<f64>,
    /// Numbers of all keys, `width` each; three times as many where they are cubic.
    values: Vec<f64>,
    width: usize,
}

/// One animation, loaded.
pub(super) struct Animation {
    channels: Vec<Channel>,
}

/// What a channel aims at, in words of the document.
fn path_of(name: &str) -> Option<Path> {
    Some(match name {
        "translation" => Path::Translation,
        "rotation" => Path::Rotation,
        "scale" => Path::Scale,
        "weights" => Path::Weights,
        _ => return None,
    })
}

/// Nodes that an animation moves, and nodes whose weights it sets.
pub(super) fn targets(accessors: &Accessors, animation: usize) -> (Vec<usize>, Vec<usize>) {
    let channels = &accessors.store.document.animations[animation].channels;
    let aimed = |weights: bool| {
        let fits = channels.iter().filter(move |channel| {
            path_of(&channel.target.path).is_some_and(|path| (path == Path::Weights) == weights)
        });
        fits.filter_map(|channel| channel.target.node).collect()
    };
    (aimed(false), aimed(true))
}

/// The entry of an animation: its frames where its keys lie, if these fit a rate.
pub(super) fn entry(accessors: &mut Accessors, animation: usize) -> Result<(ClipEntry, bool), SequenceError> {
    let document = &accessors.store.document;
    let own = &document.animations[animation];
    let name = own.name.clone().unwrap_or_else(|| format!("animation {animation}"));
    let mut inputs: Vec<usize> = own
        .channels
        .iter()
        .filter_map(|channel| own.samplers.get(channel.sampler))
        .map(|sampler| sampler.input)
        .collect();
    inputs.sort_unstable();
    inputs.dedup();
    let mut times = Vec::new();
    for input in inputs {
        times.extend(accessors.floats::<1>(input)?.into_iter().map(|[time]| f64::from(time)));
    }
    times.retain(|time| time.is_finite());
    times.sort_by(f64::total_cmp);
    times.dedup();
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return Ok((ClipEntry::timed(name, Vec::new()), true));
    };
    let fits = |rate: &f64| {
        times
            .iter()
            .all(|time| ((time * rate).round() - time * rate).abs() < OFF_FRAME)
    };
    let found = RATES.into_iter().find(fits);
    let rate = found.unwrap_or(FALLBACK_RATE);
    let frames = ((last - first) * rate).round();
    if frames > FRAMES_MAX {
        return Err(accessors
            .store
            .refuse("a clip of some minutes", format!("`{name}` from {first} to {last} s")));
    }
    // Key times themselves, so that no interpolation blurs what the keys say.
    let key_near = |time: f64| {
        let next = times.partition_point(|&key| key < time).min(times.len() - 1);
        let near = [next.saturating_sub(1), next].map(|i| times[i]);
        near.into_iter()
            .find(|key| ((key - time) * rate).abs() < OFF_FRAME)
            .unwrap_or(time)
    };
    let frames = (0..=frames as usize)
        .map(|frame| key_near((first + frame as f64 / rate).min(last)))
        .collect();
    let mut entry = ClipEntry::timed(name, frames);
    entry.fps = Some(rate);
    Ok((entry, found.is_some()))
}

impl Animation {
    /// Reads the key frames of an animation.
    pub(super) fn load(
        accessors: &mut Accessors,
        animation: usize,
        weight_counts: &[usize],
    ) -> Result<Animation, SequenceError> {
        let mut channels = Vec::new();
        for number in 0..accessors.store.document.animations[animation].channels.len() {
            channels.extend(Channel::load(accessors, animation, number, weight_counts)?);
        }
        Ok(Animation { channels })
    }

    /// Puts nodes where they are at a time.
    pub(super) fn pose(
        &self,
        time: f64,
        placements: &mut [Placement],
        node_weights: &mut [Vec<f64>],
        moved: &mut [bool],
    ) {
        for channel in &self.channels {
            let value = |c: usize| channel.at(time, c);
            match channel.path {
                Path::Translation => placements[channel.node].translation = DVec3::new(value(0), value(1), value(2)),
                Path::Scale => placements[channel.node].scale = DVec3::new(value(0), value(1), value(2)),
                Path::Rotation => placements[channel.node].rotation = channel.rotation(time),
                Path::Weights => {
                    let own = &mut node_weights[channel.node];
                    own.iter_mut().enumerate().for_each(|(c, weight)| *weight = value(c));
                }
            }
            moved[channel.node] |= channel.path != Path::Weights;
        }
    }
}

impl Channel {
    /// One channel; none where it aims at something that moves no mesh.
    fn load(
        accessors: &mut Accessors,
        animation: usize,
        number: usize,
        weight_counts: &[usize],
    ) -> Result<Option<Channel>, SequenceError> {
        let document = &accessors.store.document;
        let channel = &document.animations[animation].channels[number];
        let (Some(node), Some(path)) = (channel.target.node, path_of(&channel.target.path)) else {
            return Ok(None);
        };
        if node >= document.nodes.len() {
            return Err(accessors
                .store
                .refuse(format!("one of {} nodes", document.nodes.len()), format!("node {node}")));
        }
        let Some(sampler) = document.animations[animation].samplers.get(channel.sampler) else {
            return Err(accessors
                .store
                .refuse("a sampler of the animation", format!("sampler {}", channel.sampler)));
        };
        let (input, output) = (sampler.input, sampler.output);
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::Cubic,
            Some(other) => {
                let found = format!("`{other}`");
                return Err(accessors
                    .store
                    .refuse("the interpolation LINEAR, STEP or CUBICSPLINE", found));
            }
        };
        let width = match path {
            Path::Translation | Path::Scale => 3,
            Path::Rotation => 4,
            Path::Weights => weight_counts[node],
        };
        if width == 0 {
            return Ok(None);
        }
        let times: Vec<f64> = accessors
            .floats::<1>(input)?
            .into_iter()
            .map(|[time]| f64::from(time))
            .collect();
        let ascends = times.iter().all(|time| time.is_finite()) && times.windows(2).all(|pair| pair[0] <= pair[1]);
        if times.is_empty() || !ascends {
            return Err(accessors
                .store
                .refuse("key frames in the order of their times", format!("accessor {input}")));
        }
        let values: Vec<f64> = match path {
            Path::Translation | Path::Scale => flat(accessors.floats::<3>(output)?),
            Path::Rotation => flat(accessors.floats::<4>(output)?),
            Path::Weights => flat(accessors.floats::<1>(output)?),
        };
        let parts = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        let needed = times.len().saturating_mul(width).saturating_mul(parts);
        if values.len() < needed {
            let found = format!("{}", values.len());
            return Err(accessors
                .store
                .refuse(format!("{needed} numbers for {} key frames", times.len()), found));
        }
        Ok(Some(Channel {
            node,
            path,
            interpolation,
            times,
            values,
            width,
        }))
    }

    /// The keys around a time, seconds between them, and how far it lies towards the second.
    fn around(&self, time: f64) -> (usize, usize, f64, f64) {
        let next = self.times.partition_point(|&at| at <= time);
        if next == 0 {
            return (0, 0, 0.0, 0.0);
        }
        if next == self.times.len() {
            return (next - 1, next - 1, 0.0, 0.0);
        }
        let seconds = self.times[next] - self.times[next - 1];
        (next - 1, next, seconds, (time - self.times[next - 1]) / seconds)
    }

    /// Number `c` of key `key`: its in-tangent, value and out-tangent are parts 0, 1 and 2 where keys are cubic.
    fn value(&self, key: usize, part: usize, c: usize) -> f64 {
        match self.interpolation {
            Interpolation::Cubic => self.values[(3 * key + part) * self.width + c],
            _ => self.values[key * self.width + c],
        }
    }

    fn at(&self, time: f64, c: usize) -> f64 {
        let (from, to, seconds, share) = self.around(time);
        let (a, b) = (self.value(from, 1, c), self.value(to, 1, c));
        match self.interpolation {
            Interpolation::Step => a,
            Interpolation::Linear => a + share * (b - a),
            Interpolation::Cubic if from == to => a,
            Interpolation::Cubic => {
                let (out, into) = (seconds * self.value(from, 2, c), seconds * self.value(to, 0, c));
                let (t, t2, t3) = (share, share * share, share * share * share);
                (2.0 * t3 - 3.0 * t2 + 1.0) * a
                    + (t3 - 2.0 * t2 + t) * out
                    + (3.0 * t2 - 2.0 * t3) * b
                    + (t3 - t2) * into
            }
        }
    }

    fn rotation(&self, time: f64) -> DQuat {
        let (from, to, _, share) = self.around(time);
        let key = |key: usize| {
            let [x, y, z, w] = core::array::from_fn(|c| self.value(key, 1, c));
            normalized(DQuat::from_xyzw(x, y, z, w))
        };
        match self.interpolation {
            Interpolation::Step => key(from),
            Interpolation::Linear => key(from).slerp(key(to), share),
            Interpolation::Cubic => {
                let [x, y, z, w] = core::array::from_fn(|c| self.at(time, c));
                normalized(DQuat::from_xyzw(x, y, z, w))
            }
        }
    }
}

/// A rotation of any length; none at all where there is no direction.
pub(super) fn normalized(q: DQuat) -> DQuat {
    let length = q.length();
    if length > 0.0 && length.is_finite() {
        q / length
    } else {
        DQuat::IDENTITY
    }
}

fn flat<const N: usize>(values: Vec<[f32; N]>) -> Vec<f64> {
    values.into_iter().flatten().map(f64::from).collect()
}

/// Writes the placements of moved nodes into a pose.
pub(super) fn apply(placements: &[Placement], moved: &[bool], pose: &mut Pose) {
    for (node, placement) in placements.iter().enumerate().filter(|&(node, _)| moved[node]) {
        pose.locals[node] = placement.transform();
    }
}
