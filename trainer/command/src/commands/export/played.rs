//! Clips as the runtime plays them, and how far from it another way to play them is.

use sinew_interchange::JointPose;
use sinew_runtime::{Basis, BoneTransform, TierChoice};
use sinew_trainer::learn::Reporter;

use sinew_command::console::Console;
use sinew_command::inputs::Failure;

/// What all clips of a file share.
pub struct ClipSettings<'a> {
    /// Frames a second.
    pub fps: f64,
    /// What a vertex may be moved by to spare a key, in units of the source.
    pub tolerance: f64,
    /// Of the rest shape's bounding box, in units of the source.
    pub diagonal: f64,
    pub console: &'a Console,
}

pub fn distance(a: &[f32; 3], b: &[f32; 3]) -> f64 {
    let square = |c: usize| f64::from(a[c] - b[c]).powi(2);
    (0..3).map(square).sum::<f64>().sqrt()
}

/// How far one way to play a clip is from the nearest tier of its package.
pub struct ClipReport {
    pub name: String,
    pub frame_count: usize,
    pub key_count: usize,
    /// Root mean square and greatest, in shares of the diagonal.
    pub rms: f64,
    pub max: f64,
    /// What it was measured by.
    pub tier: &'static str,
}

impl ClipReport {
    pub fn describe(&self) -> String {
        format!(
            "clip {}: {} frames, {} keys; from the {} tier {:.3} % of the diagonal (rms), {:.2} % at most",
            self.name,
            self.frame_count,
            self.key_count,
            self.tier,
            100.0 * self.rms,
            100.0 * self.max
        )
    }
}

/// Sums over the vertices of many poses.
#[derive(Default)]
pub struct Distances {
    squares: f64,
    max: f64,
    count: usize,
}

impl Distances {
    pub fn add(&mut self, a: &[[f32; 3]], b: &[[f32; 3]]) {
        for far in a.iter().zip(b).map(|(a, b)| distance(a, b)) {
            self.squares += far * far;
            self.max = self.max.max(far);
        }
        self.count += a.len();
    }
}

/// The tier that clips are measured by: the nearest that the package has.
pub fn tier_name(basis: &Basis<'_>) -> &'static str {
    match basis.nearest_tier() {
        TierChoice::Exact => "exact",
        TierChoice::Bones => "bone",
    }
}

/// A row of a table, as the player takes it.
pub fn widened(row: &[f32]) -> Vec<f64> {
    row.iter().copied().map(f64::from).collect()
}

pub fn joint(bone: &BoneTransform) -> JointPose {
    JointPose {
        translation: bone.translation,
        rotation: bone.rotation,
        scale: bone.scale,
    }
}

pub fn check_stop(console: &Console, clip: &str, n: usize) -> Result<(), Failure> {
    if !console.stop_requested() {
        return Ok(());
    }
    console.finish();
    Err(Failure::Stopped(format!(
        "stopped at frame {n} of clip {clip}; nothing was written"
    )))
}

pub fn report(
    name: &str,
    frame_count: usize,
    key_count: usize,
    distances: &Distances,
    settings: &ClipSettings<'_>,
    basis: &Basis<'_>,
) -> ClipReport {
    ClipReport {
        name: name.into(),
        frame_count,
        key_count,
        rms: (distances.squares / distances.count.max(1) as f64).sqrt() / settings.diagonal,
        max: distances.max / settings.diagonal,
        tier: tier_name(basis),
    }
}
