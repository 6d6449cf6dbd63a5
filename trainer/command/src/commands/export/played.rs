//! Clips as the runtime plays them, and how far from it another way to play them is.

use miette::{IntoDiagnostic, Report};
use sinew_interchange::JointPose;
use sinew_runtime::{
    Basis, BoneMaps, BoneOutput, BoneTransform, Controls, Frame, Kernels, TierChoice, Workspace, WorkspaceLayout,
};
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

pub fn diagonal(rest: &[[f32; 3]]) -> f64 {
    let edge = |c: usize| {
        let range = rest
            .iter()
            .fold((f32::MAX, f32::MIN), |(low, high), p| (low.min(p[c]), high.max(p[c])));
        f64::from(range.1 - range.0)
    };
    (0..3).map(edge).map(|x| x * x).sum::<f64>().sqrt()
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

/// The runtime, posed by rows of weights.
pub struct Player<'a> {
    basis: Basis<'a>,
    weights: Vec<f32>,
    tier: TierChoice,
    nearest: Vec<u8>,
    bones: Vec<u8>,
}

impl<'a> Player<'a> {
    pub fn new(basis: Basis<'a>) -> Result<Self, Report> {
        let tier = basis.nearest_tier();
        let memory = |tier| -> Result<Vec<u8>, Report> {
            let layout = WorkspaceLayout::for_tier(&basis, tier).into_diagnostic()?;
            Ok(vec![0; layout.unaligned_bytes()])
        };
        Ok(Self {
            basis,
            weights: vec![0.0; basis.component_count()],
            tier,
            nearest: memory(tier)?,
            bones: match basis.bones() {
                Some(_) => memory(TierChoice::Bones)?,
                None => Vec::new(),
            },
        })
    }

    pub fn tier_name(&self) -> &'static str {
        match self.tier {
            TierChoice::Exact => "exact",
            _ => "bone",
        }
    }

    /// The rest shape, source order.
    pub fn rest(&self) -> Vec<[f32; 3]> {
        let slots = self.basis.slot_from_vertex();
        let positions = self.basis.rest_positions();
        slots.iter().map(|slot| positions[slot as usize]).collect()
    }

    /// Positions by the nearest tier.
    pub fn positions(&mut self, row: &[f32]) -> Result<Vec<[f32; 3]>, Report> {
        let mut controls = Controls::new(&self.basis, &mut self.weights).into_diagnostic()?;
        for (k, &weight) in row.iter().enumerate() {
            controls.set_unclamped(k, weight).into_diagnostic()?;
        }
        let mut workspace =
            Workspace::for_tier(&self.basis, self.tier, &mut self.nearest, Kernels::detect()).into_diagnostic()?;
        let mut positions = vec![[0.0; 3]; self.basis.vertex_count()];
        Frame {
            basis: &self.basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        }
        .run(&mut workspace)
        .into_diagnostic()?;
        Ok(positions)
    }

    /// Bones.
    pub fn joints(&mut self, row: &[f32], count: usize) -> Result<Vec<JointPose>, Report> {
        let mut controls = Controls::new(&self.basis, &mut self.weights).into_diagnostic()?;
        for (k, &weight) in row.iter().enumerate() {
            controls.set_unclamped(k, weight).into_diagnostic()?;
        }
        let mut workspace = Workspace::for_tier(&self.basis, TierChoice::Bones, &mut self.bones, Kernels::detect())
            .into_diagnostic()?;
        let mut maps = vec![BoneTransform::default(); count];
        BoneMaps {
            basis: &self.basis,
            controls: &controls,
            maps: BoneOutput::Scaled(&mut maps),
        }
        .run(&mut workspace)
        .into_diagnostic()?;
        Ok(maps.iter().map(joint).collect())
    }
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
    player: &Player<'_>,
) -> ClipReport {
    ClipReport {
        name: name.into(),
        frame_count,
        key_count,
        rms: (distances.squares / distances.count.max(1) as f64).sqrt() / settings.diagonal,
        max: distances.max / settings.diagonal,
        tier: player.tier_name(),
    }
}
