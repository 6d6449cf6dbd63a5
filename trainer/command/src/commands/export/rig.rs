//! Bones as the joints of a skin.

use miette::{IntoDiagnostic, WrapErr};
use sinew_interchange::{Dress, Joint, JointPose, PuppetClip, Skin, skinned};
use sinew_runtime::{
    Basis, BoneMaps, BoneName, BoneOutput, BoneTransform, Controls, Kernels, TierChoice, Workspace, WorkspaceLayout,
};
use sinew_trainer::evaluate::Player;
use sinew_trainer::learn::Reporter;

use super::played::{ClipReport, ClipSettings, Distances, check_stop, distance, joint, report, widened};
use sinew_command::inputs::Failure;

/// Bones as joints.
pub struct Rig {
    /// Shape: `[B]`.
    pub rest: Vec<JointPose>,
    /// Holds the skin.
    pub dress: Dress,
    /// How far from each bone its vertices are at rest. Shape: `[B]`.
    reaches: Vec<f64>,
    positions: Vec<[f32; 3]>,
}

impl Rig {
    /// The bones of a basis, which has some. Shape: `positions` `[V]`, the rest shape.
    pub fn new(basis: &Basis<'_>, positions: &[[f32; 3]]) -> Self {
        let bones = basis.bones().expect("checked by the caller");
        let rest: Vec<JointPose> = (0..bones.count()).map(|b| joint(&bones.rest_transform(b))).collect();
        let influences = bones.influences();
        let mut indices = vec![0; positions.len() * influences];
        let mut weights = vec![0; indices.len()];
        bones.write_skin(&mut indices, &mut weights);
        let mut skin = Skin {
            joints: rest
                .iter()
                .enumerate()
                .map(|(b, pose)| Joint {
                    name: BoneName(b).to_string(),
                    parent: None,
                    bind: pose.bind(),
                })
                .collect(),
            ..Skin::default()
        };
        let mut reaches = vec![0.0; rest.len()];
        for (position, (bones, weights)) in positions
            .iter()
            .zip(indices.chunks_exact(influences).zip(weights.chunks_exact(influences)))
        {
            for (&bone, &weight) in bones.iter().zip(weights).filter(|(_, weight)| **weight > 0) {
                let reach: &mut f64 = &mut reaches[usize::from(bone)];
                *reach = reach.max(distance(position, &rest[usize::from(bone)].translation));
                skin.influences.push((u32::from(bone), f32::from(weight)));
            }
            skin.end_vertex();
        }
        Self {
            rest,
            dress: Dress {
                skin: Some(skin),
                ..Dress::default()
            },
            reaches,
            positions: positions.to_vec(),
        }
    }

    pub fn clip(
        &self,
        name: &str,
        rows: &[Vec<f32>],
        basis: &Basis<'_>,
        player: &mut Player<'_>,
        settings: &ClipSettings<'_>,
    ) -> Result<(PuppetClip, ClipReport), Failure> {
        let layout = WorkspaceLayout::for_tier(basis, TierChoice::Bones).into_diagnostic()?;
        let mut memory = vec![0; layout.unaligned_bytes()];
        let mut workspace =
            Workspace::for_tier(basis, TierChoice::Bones, &mut memory, Kernels::detect()).into_diagnostic()?;
        let mut weights = vec![0.0; basis.component_count()];
        let mut maps = vec![BoneTransform::default(); self.rest.len()];
        let mut poses = Vec::with_capacity(rows.len());
        for (n, row) in rows.iter().enumerate() {
            weights.copy_from_slice(row);
            BoneMaps {
                basis,
                controls: &Controls::resume(basis, &mut weights).into_diagnostic()?,
                maps: BoneOutput::Scaled(&mut maps),
            }
            .run(&mut workspace)
            .into_diagnostic()
            .wrap_err_with(|| format!("frame {n} of clip {name} cannot be played"))?;
            poses.push(maps.iter().map(joint).collect());
        }
        let clip = PuppetClip::of_poses(
            name,
            settings.fps,
            &self.rest,
            &poses,
            &self.reaches,
            settings.tolerance,
        );
        let mut distances = Distances::default();
        for (n, row) in rows.iter().enumerate() {
            check_stop(settings.console, name, n)?;
            let played = skinned(&self.dress, &self.positions, &clip.pose(n, &self.rest));
            distances.add(&played, player.play(&widened(row)).into_diagnostic()?);
            settings.console.advance(n as u64 + 1, "");
        }
        let report = report(name, rows.len(), clip.key_count(), &distances, settings, basis);
        Ok((clip, report))
    }
}
