//! Options that choose from a file what a sequence is made of: meshes, clip, frames, reference. Every command that reads a sequence has
//! them, so that each can read it as another did.

use std::path::PathBuf;

use clap::Args;
use sinew_interchange::{Choice, FrameRange, Pose, Space};

/// What to take of a file. Where it holds one mesh and one clip, nothing need be said.
#[derive(Args, Debug, Clone)]
#[command(next_help_heading = "What to take of a file")]
pub struct ChoiceArguments {
    /// A mesh, as `sinew inspect FILE` calls it; may be repeated, and `all` takes every one, joined as pieces
    #[arg(long, value_name = "NAME")]
    mesh: Vec<String>,
    /// The clip; of FBX also a second file, whose only clip moves nodes of the same names
    #[arg(long, value_name = "NAME")]
    clip: Option<String>,
    /// Frames of the clip, counted from 0, both ends included: 10..49, 10.. or 0..99:2 for every second one [default: all]
    #[arg(long, value_name = "FROM..TO[:STEP]")]
    frames: Option<FrameRange>,
    /// Frames a second at which a clip with times is sampled anew [default: those of the file]
    #[arg(long, value_name = "RATE")]
    fps: Option<f64>,
    /// The reference, which is put first: the `first` frame, the mesh at `rest`, or a frame's number
    #[arg(long, value_name = "WHICH", default_value = "first")]
    pose: Pose,
    /// Leave out the transforms of what a mesh hangs from
    #[arg(long)]
    local: bool,
    /// The mesh that a point cache moves, with the same vertices in the same order [default: the mesh file beside the cache]
    #[arg(long, value_name = "FILE")]
    surface: Option<PathBuf>,
}

impl ChoiceArguments {
    /// What a reader is told.
    pub fn choice(&self) -> Choice {
        Choice {
            meshes: self.mesh.clone(),
            clip: self.clip.clone(),
            frames: self.frames,
            fps: self.fps,
            pose: self.pose,
            space: if self.local { Space::Local } else { Space::World },
            surface: self.surface.clone(),
            keep_split: false,
        }
    }
}
