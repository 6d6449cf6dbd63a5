//! Built-in sequences: a flag in the wind, a bar that bends and twists, a creature that walks.
//!
//! They stand at the head of the path of data, in the place of a folder of meshes: `settings -> MeshSequence`. All of it is
//! computed from [`Settings`] in f64 on one thread, so the same settings give the same bits. Axes: y up, metres, seconds.

mod bar;
mod creature;
mod flag;
mod gait;
mod polygonize;
mod signal;
mod skeleton;

pub use bar::bar;
pub use creature::creature;
pub use flag::flag;

use core::ops::RangeInclusive;
use nalgebra::Vector3;
use sinew_interchange::MeshSequence;

type V3 = Vector3<f64>;

/// Frames accepted by every subject. Two shapes are the least a sequence can have.
pub const FRAME_RANGE: RangeInclusive<usize> = 2..=20_000;
/// Time between two frames, in seconds.
pub const FRAME_SECONDS: f64 = 1.0 / 30.0;

/// What to synthesize.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// Cloth in gusty wind, left edge pinned.
    Flag,
    /// A closed bar that bends, twists past half a turn, and does both.
    Bar,
    /// A four-legged creature that walks, looks around and wags its tail.
    Creature,
}

impl Subject {
    /// All subjects, in the order they are documented.
    pub const ALL: [Self; 3] = [Self::Flag, Self::Bar, Self::Creature];

    /// The word for it on the command line and the name of its sequence.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flag => "flag",
            Self::Bar => "bar",
            Self::Creature => "creature",
        }
    }

    /// Vertex counts accepted. The creature needs some to have legs at all.
    pub fn vertex_range(self) -> RangeInclusive<usize> {
        match self {
            Self::Flag | Self::Bar => 100..=20_000,
            Self::Creature => 800..=20_000,
        }
    }

    /// The defaults: 60 frames, and as many vertices as the subject needs to look good.
    pub fn default_settings(self) -> Settings {
        let vertices = match self {
            Self::Flag => 1600,
            Self::Bar => 1200,
            Self::Creature => 2500,
        };
        Settings {
            frames: 60,
            vertices,
            seed: 0,
        }
    }

    /// Synthesizes the sequence. Errors: as [`Settings::check`].
    pub fn synthesize(self, settings: &Settings) -> Result<MeshSequence, SynthesizeError> {
        match self {
            Self::Flag => flag(settings),
            Self::Bar => bar(settings),
            Self::Creature => creature(settings),
        }
    }
}

/// How much to synthesize.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Shapes in the sequence, the rest pose (shape 0) included. Range: [`FRAME_RANGE`].
    pub frames: usize,
    /// Vertices asked for; the result has the nearest count the subject can be meshed with. Range: [`Subject::vertex_range`].
    pub vertices: usize,
    /// Seed of the wind, the gestures and the gait. Same settings, same bits.
    pub seed: u64,
}

impl Settings {
    /// Refuses counts out of range. Errors: [`SynthesizeError`], naming the count and the accepted range.
    pub fn check(&self, subject: Subject) -> Result<(), SynthesizeError> {
        let vertex_range = subject.vertex_range();
        if !FRAME_RANGE.contains(&self.frames) {
            return Err(SynthesizeError::FrameCount {
                frames: self.frames,
                least: *FRAME_RANGE.start(),
                most: *FRAME_RANGE.end(),
            });
        }
        if !vertex_range.contains(&self.vertices) {
            return Err(SynthesizeError::VertexCount {
                subject: subject.name(),
                vertices: self.vertices,
                least: *vertex_range.start(),
                most: *vertex_range.end(),
            });
        }
        Ok(())
    }
}

/// Why a sequence was not synthesized.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SynthesizeError {
    /// The number of frames is out of range.
    #[error("{frames} frames asked for; choose from {least} to {most}")]
    FrameCount {
        /// Frames asked for.
        frames: usize,
        /// Fewest accepted.
        least: usize,
        /// Most accepted.
        most: usize,
    },
    /// The number of vertices is out of range.
    #[error("a {subject} of {vertices} vertices was asked for; choose from {least} to {most}")]
    VertexCount {
        /// Which subject.
        subject: &'static str,
        /// Vertices asked for.
        vertices: usize,
        /// Fewest accepted.
        least: usize,
        /// Most accepted.
        most: usize,
    },
    /// No cell size near the asked count gave a closed surface in one piece.
    #[error(
        "the creature could not be meshed in one closed piece near {vertices} vertices; ask for a few more or fewer"
    )]
    NotClosed {
        /// Vertices asked for.
        vertices: usize,
    },
}

/// Packs the shapes of a subject, and rounds them to what files and the trainer hold.
fn sequence(subject: Subject, faces: Vec<[u32; 3]>, shapes: &[Vec<V3>]) -> MeshSequence {
    MeshSequence {
        name: subject.name().to_owned(),
        faces,
        shapes: shapes
            .iter()
            .map(|shape| shape.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect())
            .collect(),
        shape_names: (0..shapes.len()).map(|m| format!("{}[{m}]", subject.name())).collect(),
        ..MeshSequence::default()
    }
}

/// 0 at `from` and before, 1 at `to` and after, smooth between.
fn smoothstep(from: f64, to: f64, x: f64) -> f64 {
    let u = ((x - from) / (to - from)).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

#[cfg(test)]
mod tests;
