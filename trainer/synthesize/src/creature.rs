//! A four-legged creature that walks: bones with flesh, meshed as one closed surface, skinned, and moved by a gait.

use super::gait::Gait;
use super::polygonize::polygonize;
use super::skeleton::{bones, field, skin, weights};
use super::{FRAME_SECONDS, Settings, Subject, SynthesizeError, V3, sequence};
use sinew_interchange::MeshSequence;

/// Synthesizes a creature that walks on the spot on y = 0 and looks along +z; shape 0 stands still. Closed and in one piece.
///
/// Errors: counts out of range; no closed mesh near the asked vertex count (none known inside the accepted range).
pub fn creature(settings: &Settings) -> Result<MeshSequence, SynthesizeError> {
    settings.check(Subject::Creature)?;
    let bones = bones();
    let reach = |sign: f64| {
        V3::from_fn(|c, _| {
            let ends = bones
                .iter()
                .flat_map(|bone| [(bone.head[c], bone.radii[0]), (bone.tail[c], bone.radii[1])]);
            sign * ends
                .map(|(end, radius)| sign * end + radius)
                .fold(f64::NEG_INFINITY, f64::max)
                + sign * FLESH
        })
    };
    let surface = polygonize(
        |p, size| field(&bones, p, size),
        reach(-1.0),
        reach(1.0),
        settings.vertices,
    )
    .ok_or(SynthesizeError::NotClosed {
        vertices: settings.vertices,
    })?;
    let weights = weights(&bones, &surface.positions, &surface.rings);
    let gait = Gait::new(settings.seed);
    let mut shapes = vec![surface.positions];
    for m in 1..settings.frames {
        let pose = gait.pose(&bones, m as f64 * FRAME_SECONDS);
        shapes.push(skin(&bones, &pose, &shapes[0], &weights));
    }
    Ok(sequence(Subject::Creature, surface.faces, &shapes))
}

/// How far the soft union may swell past the bones, in metres.
const FLESH: f64 = 0.06;
