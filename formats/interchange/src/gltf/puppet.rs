//! Writes a puppet: the mesh, its joints and targets, an animation a clip.

use super::write::{GltfWriter, MESH_NODE};
use crate::puppet::{Keys, Puppet, PuppetClip};
use crate::write::{FrameWriter as _, WriteError};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::Path;

/// See [`crate::write_puppet`].
pub(crate) fn write_puppet(path: &Path, puppet: &Puppet<'_>) -> Result<(), WriteError> {
    let mut writer = GltfWriter::create(path, &puppet.surface)?;
    writer.frame(puppet.rest)?;
    for (_, shape) in &puppet.targets {
        writer.frame(shape)?;
    }
    let names = puppet.targets.iter().map(|(name, _)| name.clone()).collect();
    let play = |writer: &mut GltfWriter| {
        let clips = puppet.clips.iter();
        let animations = clips.map(|clip| animation(writer, clip));
        // An animation without channels is none.
        animations
            .filter(|animation| !matches!(animation, Ok(Value::Null)))
            .collect()
    };
    writer.close(names, play, puppet.extras.clone())
}

fn animation(writer: &mut GltfWriter, clip: &PuppetClip) -> Result<Value, WriteError> {
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    // Tracks with keys at the same frames share one array of times.
    let mut inputs: HashMap<&[u32], usize> = HashMap::new();
    let every: Vec<u32> = (0..clip.frame_count as u32).collect();
    let mut add = |writer: &mut GltfWriter, frames, output: usize, node: usize, path: &str| {
        let input = match inputs.get(frames) {
            Some(&input) => input,
            None => {
                let at = |&frame: &u32| (f64::from(frame) / clip.fps) as f32;
                let input = writer.arrays.times(&Vec::from_iter(<[u32]>::iter(frames).map(at)))?;
                inputs.insert(frames, input);
                input
            }
        };
        channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
        samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
        Ok::<(), WriteError>(())
    };
    for track in &clip.tracks {
        let (output, path) = match &track.keys {
            Keys::Translation(keys) => (writer.arrays.rows("VEC3", keys)?, "translation"),
            Keys::Rotation(keys) => (writer.arrays.rows("VEC4", keys)?, "rotation"),
            Keys::Scale(keys) => (writer.arrays.rows("VEC3", keys)?, "scale"),
        };
        add(writer, &track.frames, output, MESH_NODE + 1 + track.joint, path)?;
    }
    if !clip.weights.is_empty() {
        let flat: Vec<[f32; 1]> = clip.weights.iter().flatten().map(|&weight| [weight]).collect();
        let output = writer.arrays.rows("SCALAR", &flat)?;
        add(writer, &every, output, MESH_NODE, "weights")?;
    }
    if channels.is_empty() {
        return Ok(Value::Null);
    }
    Ok(json!({ "name": clip.name, "samplers": samplers, "channels": channels }))
}
