//! What every file is to those who choose from it: meshes and clips, geometry, and positions at a moment. Each format that
//! holds motion makes one [`Scene`] out of its file; what follows (choosing, welding, triangles, checks) is the same for all.

use super::error::SequenceError;
use super::mesh::PolygonMesh;
use super::notice::Notice;
use core::fmt;

/// The table of contents of a file, or of a folder of shapes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// Name of the format.
    pub format: &'static str,
    /// Meshes, in the order of the file.
    pub meshes: Vec<MeshEntry>,
    /// Clips that move them, in the order of the file.
    pub clips: Vec<ClipEntry>,
    /// Length of a unit in metres, where the file says so.
    pub unit_metres: Option<f64>,
    /// The axis that points up, where the file says so.
    pub up: Option<UpAxis>,
    /// Things beside meshes that are no surfaces (curves, points, particles), by kind and count.
    pub others: Vec<(String, usize)>,
    /// What was odd about the file.
    pub notices: Vec<Notice>,
}

/// A mesh of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshEntry {
    /// Its name, with the names of what it hangs from in front where the format has such paths.
    pub name: String,
    /// V as in the file, seams counted as often as the file does.
    pub vertex_count: usize,
    /// F, polygons counted once.
    pub face_count: usize,
    /// Joints that hold it; 0 without a skin.
    pub joint_count: usize,
    /// Names of its morph targets.
    pub morphs: Vec<String>,
    /// How it moves.
    pub motion: Motion,
}

/// How a mesh moves in the clips of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// Not at all.
    Still,
    /// As a whole.
    Whole,
    /// Its vertices move against one another.
    Deforms,
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Motion::Still => "stands still",
            Motion::Whole => "moves as a whole",
            Motion::Deforms => "deforms",
        })
    }
}

/// A clip of a file: frames in order.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipEntry {
    /// Its name.
    pub name: String,
    /// The frames' times in seconds, ascending; where nothing says the time, their numbers from 0.
    pub times: Vec<f64>,
    /// Frames a second, where the file says so or the times do.
    pub fps: Option<f64>,
    /// The times are seconds, so that other moments between them can be asked for.
    pub is_timed: bool,
    /// Morph targets, one a frame, behind the mesh without any: no motion, but shapes all the same. Chosen where a file has no
    /// other clip.
    pub is_targets: bool,
}

/// The axis that points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UpAxis {
    /// The first axis; right-handed coordinates in any case.
    X,
    /// The second axis.
    Y,
    /// The third axis.
    Z,
}

impl fmt::Display for UpAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            UpAxis::X => "x",
            UpAxis::Y => "y",
            UpAxis::Z => "z",
        })
    }
}

/// When positions are wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Moment {
    /// As the file stores the mesh, moved by no clip.
    Rest,
    /// In a clip.
    At {
        clip: usize,
        /// As in the clip's `times`, or between two of them where the clip is timed.
        time: f64,
    },
}

/// In whose coordinates positions are wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Space {
    /// The file's: the transforms of everything that a mesh hangs from are applied.
    #[default]
    World,
    /// The mesh's own.
    Local,
}

/// A file (or a folder of them), open.
pub(crate) trait Scene {
    /// What it holds.
    fn contents(&self) -> &Contents;

    /// Faces, texture and dress of a mesh, with the positions it has at rest, in its own coordinates.
    fn geometry(&mut self, mesh: usize) -> Result<PolygonMesh, SequenceError>;

    /// Positions of a mesh, in the order of its geometry, into `out`, which is emptied first. They need not be finite.
    fn positions(
        &mut self,
        mesh: usize,
        moment: Moment,
        space: Space,
        out: &mut Vec<[f32; 3]>,
    ) -> Result<(), SequenceError>;

    /// What a frame is called in messages.
    fn frame_name(&self, clip: usize, frame: usize) -> String;
}

impl ClipEntry {
    /// Frames without times.
    pub(crate) fn untimed(name: impl Into<String>, frame_count: usize) -> ClipEntry {
        ClipEntry {
            name: name.into(),
            times: (0..frame_count).map(|frame| frame as f64).collect(),
            fps: None,
            is_timed: false,
            is_targets: false,
        }
    }

    /// Frames at these times in seconds; the rate is told from them where they are evenly spaced.
    pub(crate) fn timed(name: impl Into<String>, times: Vec<f64>) -> ClipEntry {
        ClipEntry {
            name: name.into(),
            fps: even_rate(&times),
            times,
            is_timed: true,
            is_targets: false,
        }
    }
}

/// Frames a second of evenly spaced times.
fn even_rate(times: &[f64]) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    let step = (last - first) / (times.len() - 1) as f64;
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= 1e-3 * step;
    // A rate is written with few digits; times may be 32-bit numbers.
    (step > 0.0 && times.windows(2).all(is_even)).then(|| (1e3 / step).round() / 1e3)
}
