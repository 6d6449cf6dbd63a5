//! Frame: the steps in order, from controls to positions and normals. What has not changed is not computed again.

use sinew_formats::package::BonesView;

use crate::basis::{Basis, Tier};
use crate::bones;
use crate::controls::Controls;
use crate::decode::{Decoded, flushed};
use crate::error::{Buffer, FrameError, check_length};
use crate::normals::write_normals;
use crate::positions::scatter;
use crate::solve::{displace, substitute, update_right_hand_side};
use crate::workspace::{TierChoice, Workspace};

/// One frame: deforms the rest shape by the controls, on the tier that the workspace was made for.
#[derive(Debug)]
pub struct Frame<'j> {
    /// The opened package.
    pub basis: &'j Basis<'j>,
    /// Weights of the components.
    pub controls: &'j Controls<'j>,
    /// Output: deformed positions. Shape: `[V]`, source order, units of the source.
    pub positions: &'j mut [[f32; 3]],
    /// Output: unit vertex normals, where wanted. Shape: `[V]`, source order.
    pub normals: Option<&'j mut [[f32; 3]]>,
}

/// What a frame had to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameOutcome {
    /// The controls had moved: decoded and solved.
    Solved,
    /// The controls were those of the last frame: its solution was written out again.
    Unchanged,
}

impl Frame<'_> {
    /// Checks identities and lengths, O(1).
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::ForeignControls`], [`FrameError::WrongLength`].
    pub fn validate(&self, workspace: &Workspace<'_>) -> Result<(), FrameError> {
        workspace.validate(self.basis)?;
        if self.controls.basis().identity() != self.basis.identity() {
            return Err(FrameError::ForeignControls);
        }
        let count = self.basis.vertex_count();
        check_length(count, Buffer::Positions, self.positions.len())?;
        match &self.normals {
            Some(normals) => check_length(count, Buffer::Normals, normals.len()),
            None => Ok(()),
        }
    }

    /// Whether the controls are others than those of the pose that `workspace` holds ([`Workspace::weights`]). If not, buffers in
    /// which its last frame stands are still right, and [`Frame::run`] would only write them again. O(K).
    pub fn would_change(&self, workspace: &Workspace<'_>) -> bool {
        are_others(self.controls, workspace)
    }

    /// Deforms. Afterwards the workspace holds the pose: its features, and what [`crate::Tangent`] differentiates at.
    ///
    /// # Errors
    /// Those of [`Frame::validate`]; [`FrameError::NotFinite`] when the weights are so large that numbers overflow: then the
    /// outputs hold the rest shape and the workspace is at rest.
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<FrameOutcome, FrameError> {
        self.validate(workspace)?;
        let outcome = take_weights(self.controls, workspace);
        match workspace.tier() {
            TierChoice::Exact => {
                let tier = workspace.validate_exact(self.basis)?;
                self.solve(&tier, workspace, outcome)
            }
            TierChoice::Bones => {
                let bones = workspace.validate_bones(self.basis)?;
                self.skin(&bones, workspace, outcome)
            }
        }
    }

    /// The exact tier: decode, solve, normals of the posed surface.
    fn solve(
        self,
        tier: &Tier<'_>,
        workspace: &mut Workspace<'_>,
        outcome: FrameOutcome,
    ) -> Result<FrameOutcome, FrameError> {
        if outcome == FrameOutcome::Solved {
            let decoded = Decoded {
                shares: workspace.shares,
                blocks: workspace.blocks,
                touched: workspace.touched,
                gradients: workspace.gradients,
            };
            let all = workspace.gradients_are_stale;
            decoded.update(self.basis, tier.patches, workspace.kernels, workspace.weights, all);
            workspace.gradients_are_stale = false;
            let (kernels, forces) = (workspace.kernels, &mut *workspace.forces);
            update_right_hand_side(kernels, tier, workspace.gradients, workspace.touched, forces);
            workspace.displacement.copy_from_slice(forces);
            substitute(kernels, tier, workspace.displacement);
            workspace.added.update(&self.basis.after(), workspace.weights);
        }
        displace(tier, workspace.displacement, workspace.posed);
        workspace.added.apply(&self.basis.after(), workspace.posed);
        let (bounds, written) = scatter(self.basis, workspace.posed, self.positions);
        workspace.bounds = bounds;
        if written.is_err() {
            workspace.rest();
        }
        if let Some(normals) = self.normals {
            write_normals(self.basis, workspace.kernels, workspace.posed, normals);
        }
        written.map(|()| outcome)
    }

    /// The bones: their maps, and the vertices that follow them.
    fn skin(
        self,
        bones: &BonesView<'_>,
        workspace: &mut Workspace<'_>,
        outcome: FrameOutcome,
    ) -> Result<FrameOutcome, FrameError> {
        if outcome == FrameOutcome::Solved {
            bones::pose::update(self.basis, bones, workspace);
        }
        let mut normals = self.normals;
        let skin = bones::skin::skin;
        let (mut bounds, skinned) = skin(
            self.basis,
            bones,
            workspace.maps,
            self.positions,
            normals.as_deref_mut(),
        );
        if skinned.is_err() {
            workspace.rest();
            (bounds, _) = skin(self.basis, bones, workspace.maps, self.positions, normals);
        }
        workspace.bounds = bounds;
        skinned.map(|()| outcome)
    }
}

fn are_others(controls: &Controls<'_>, workspace: &Workspace<'_>) -> bool {
    let weights = controls.weights().iter().map(|&w| flushed(w));
    !weights.eq(workspace.weights.iter().copied())
}

/// Gives a workspace the weights of the controls, and says whether they are others than it had.
pub(crate) fn take_weights(controls: &Controls<'_>, workspace: &mut Workspace<'_>) -> FrameOutcome {
    if !are_others(controls, workspace) {
        return FrameOutcome::Unchanged;
    }
    let weights = controls.weights().iter().map(|&w| flushed(w));
    let pairs = workspace.weights.iter_mut().zip(weights);
    pairs.for_each(|(to, from)| *to = from);
    FrameOutcome::Solved
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::FALLBACK_NORMAL;
    use crate::Kernels;
    use crate::WorkspaceLayout;
    use crate::fixture::{Package, memory_for, open, workspace_in};

    /// Neutral controls are exact: every step maps zero to zero.
    const REST_TOLERANCE: f32 = 0.0;
    const WEIGHTS: [f32; Package::COMPONENTS] = [0.8, -0.6, 0.5, -1.2, 0.3];

    type Outcome = (Result<FrameOutcome, FrameError>, Vec<[f32; 3]>, Vec<[f32; 3]>);

    fn frame(basis: &Basis<'_>, weights: &[f32], workspace: &mut Workspace<'_>) -> Outcome {
        let mut memory = vec![0.0; weights.len()];
        let mut controls = Controls::new(basis, &mut memory).unwrap();
        for (k, &w) in weights.iter().enumerate() {
            controls.set_unclamped(k, w).unwrap();
        }
        let mut positions = vec![[f32::NAN; 3]; basis.vertex_count()];
        let mut normals = positions.clone();
        let job = Frame {
            basis,
            controls: &controls,
            positions: &mut positions,
            normals: Some(&mut normals),
        };
        (job.run(workspace), positions, normals)
    }

    fn farthest(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
        a.as_flattened()
            .iter()
            .zip(b.as_flattened())
            .map(|(x, y)| (x - y).abs())
            .fold(0.0, f32::max)
    }

    #[test]
    fn neutral_controls_give_the_rest_mesh() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let rest = &package.rest_in_source_order;
        let neutral = [0.0; Package::COMPONENTS];
        let (outcome, positions, _) = frame(&basis, &neutral, &mut workspace);
        assert_eq!(outcome, Ok(FrameOutcome::Unchanged));
        assert!(farthest(&positions, rest) <= REST_TOLERANCE);

        let (outcome, positions, _) = frame(&basis, &WEIGHTS, &mut workspace);
        assert_eq!(outcome, Ok(FrameOutcome::Solved));
        assert!(farthest(&positions, rest) > 0.1, "the components move the mesh");

        let (outcome, positions, _) = frame(&basis, &neutral, &mut workspace);
        assert_eq!(outcome, Ok(FrameOutcome::Solved), "back to rest by the whole path");
        assert!(farthest(&positions, rest) <= REST_TOLERANCE);
        let tiny = [1e-7; Package::COMPONENTS];
        assert_eq!(
            frame(&basis, &tiny, &mut workspace).0,
            Ok(FrameOutcome::Unchanged),
            "tiny weights are flushed"
        );
    }

    #[test]
    fn a_frame_that_changes_nothing_writes_the_same_bits() {
        let package = Package::small(1);
        let basis = open(&package);
        let (mut one, mut two) = (memory_for(&basis), memory_for(&basis));
        let mut workspace = workspace_in(&basis, &mut one);
        let first = frame(&basis, &WEIGHTS, &mut workspace);
        let again = frame(&basis, &WEIGHTS, &mut workspace);
        assert_eq!(
            (first.0, again.0),
            (Ok(FrameOutcome::Solved), Ok(FrameOutcome::Unchanged))
        );
        assert_eq!((&first.1, &first.2), (&again.1, &again.2));
        let mut nearly = WEIGHTS;
        nearly[2] += 1e-6;
        for (mut weights, is_other) in [(WEIGHTS, false), (nearly, true)] {
            let controls = Controls::resume(&basis, &mut weights).unwrap();
            assert_eq!(are_others(&controls, &workspace), is_other);
        }

        let mut other = workspace_in(&basis, &mut two);
        frame(&basis, &[1.0; Package::COMPONENTS], &mut other).0.unwrap();
        let moved_there = frame(&basis, &WEIGHTS, &mut other);
        assert_eq!(
            (first.1, first.2),
            (moved_there.1, moved_there.2),
            "no trace of the pose before"
        );
    }

    #[test]
    fn normals_are_optional_and_are_those_of_the_positions() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let (_, positions, normals) = frame(&basis, &WEIGHTS, &mut workspace);
        let mut own = vec![[0.0; 3]; basis.vertex_count()];
        crate::Normals {
            basis: &basis,
            positions: &positions,
            normals: &mut own,
        }
        .run(&mut workspace)
        .unwrap();
        assert_eq!(own, normals);
        assert!(own.iter().all(|n| *n != FALLBACK_NORMAL));

        let mut memory = vec![0.0; Package::COMPONENTS];
        let mut controls = Controls::new(&basis, &mut memory).unwrap();
        for (k, &w) in WEIGHTS.iter().enumerate() {
            controls.set_unclamped(k, w).unwrap();
        }
        let mut without = vec![[0.0; 3]; basis.vertex_count()];
        let job = Frame {
            basis: &basis,
            controls: &controls,
            positions: &mut without,
            normals: None,
        };
        job.run(&mut workspace).unwrap();
        assert_eq!(without, positions);
    }

    #[test]
    fn weights_without_measure_saturate() {
        let package = Package::small_with_nothing_added(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        for weights in [
            [f32::MAX, 0.0, 0.0, 0.0, 0.0],
            [f32::MAX, f32::MIN, f32::MAX, f32::MIN, 1.0],
        ] {
            let (outcome, positions, normals) = frame(&basis, &weights, &mut workspace);
            assert_eq!(outcome, Ok(FrameOutcome::Solved));
            let mut numbers = positions.as_flattened().iter().chain(normals.as_flattened());
            assert!(numbers.all(|x| x.is_finite()));
        }
    }

    #[test]
    fn what_is_added_grows_with_weights_until_the_mesh_is_lost() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let mix = &basis.after().mix[..Package::COMPONENTS];
        let weights: Vec<f32> = mix.iter().map(|share| f32::MAX.copysign(*share)).collect();
        let (outcome, positions, _) = frame(&basis, &weights, &mut workspace);
        assert!(matches!(outcome, Err(FrameError::NotFinite { .. })), "{outcome:?}");
        assert_eq!(positions, package.rest_in_source_order);
        let (outcome, positions, _) = frame(&basis, &[0.0; Package::COMPONENTS], &mut workspace);
        assert_eq!(outcome, Ok(FrameOutcome::Unchanged), "the workspace is at rest");
        assert_eq!(positions, package.rest_in_source_order);
    }

    #[test]
    fn a_lost_position_gives_the_rest_mesh_and_leaves_the_workspace_usable() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let before = frame(&basis, &WEIGHTS, &mut workspace).1;
        // As a solve leaves it whose factor grows beyond f32.
        workspace.displacement[0][1][3] = f32::INFINITY;
        let (outcome, positions, normals) = frame(&basis, &WEIGHTS, &mut workspace);
        assert!(matches!(outcome, Err(FrameError::NotFinite { vertex }) if vertex < basis.vertex_count()));
        assert_eq!(positions, package.rest_in_source_order);
        assert!(normals.as_flattened().iter().all(|x| x.is_finite()));
        assert!(workspace.weights().iter().all(|&w| w == 0.0));

        assert_eq!(frame(&basis, &WEIGHTS, &mut workspace).1, before);
    }

    #[test]
    fn bounds_hold_the_positions_tightly() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let (_, positions, _) = frame(&basis, &WEIGHTS, &mut workspace);
        let bounds = workspace.bounds();
        for c in 0..3 {
            let coordinates = || positions.iter().map(|p| p[c]);
            assert_eq!(bounds.minimum[c], coordinates().fold(f32::INFINITY, f32::min));
            assert_eq!(bounds.maximum[c], coordinates().fold(f32::NEG_INFINITY, f32::max));
        }
    }

    #[test]
    fn a_frame_after_other_jobs_is_the_same_frame() {
        let package = Package::small(1);
        let basis = open(&package);
        let (mut one, mut two) = (memory_for(&basis), memory_for(&basis));
        let (mut workspace, mut fresh) = (workspace_in(&basis, &mut one), workspace_in(&basis, &mut two));
        frame(&basis, &WEIGHTS, &mut workspace).0.unwrap();
        let mut displacement = vec![[0.0; 3]; basis.vertex_count()];
        let tangent = crate::Tangent {
            basis: &basis,
            component: 1,
            displacement: &mut displacement,
        };
        tangent.run(&mut workspace).unwrap();
        let mut moved = WEIGHTS;
        moved[3] += 0.25;
        let found = frame(&basis, &moved, &mut workspace);
        assert_eq!(found, frame(&basis, &moved, &mut fresh), "all groups are decoded again");
        moved[3] -= 0.125;
        let (found, mut again) = (frame(&basis, &moved, &mut workspace), memory_for(&basis));
        let mut newest = workspace_in(&basis, &mut again);
        assert_eq!(found, frame(&basis, &moved, &mut newest), "its own groups are");
    }

    #[test]
    fn validity() {
        let (package, other) = (Package::small(1), Package::small(2));
        let (basis, foreign) = (open(&package), open(&other));
        let count = basis.vertex_count();
        let (mut memory, mut foreign_memory) = (memory_for(&basis), memory_for(&foreign));
        let mut workspace = workspace_in(&basis, &mut memory);
        let mut foreign_workspace = workspace_in(&foreign, &mut foreign_memory);
        let (mut weights, mut foreign_weights) = ([0.0; Package::COMPONENTS], [0.0; Package::COMPONENTS]);
        let controls = Controls::new(&basis, &mut weights).unwrap();
        let foreign_controls = Controls::new(&foreign, &mut foreign_weights).unwrap();
        let run = |controls, positions: usize, normals: usize, workspace: &mut Workspace<'_>| {
            let (mut positions, mut normals) = (vec![[9.0; 3]; positions], vec![[9.0; 3]; normals]);
            let job = Frame {
                basis: &basis,
                controls,
                positions: &mut positions,
                normals: Some(&mut normals),
            };
            let checked = job.validate(workspace);
            let outcome = job.run(workspace);
            assert_eq!(outcome.map(|_| ()), checked);
            if outcome.is_err() {
                assert!(
                    positions.iter().chain(&normals).all(|p| *p == [9.0; 3]),
                    "nothing was written"
                );
            }
            outcome.map(|_| ())
        };
        let short = |buffer, actual| {
            Err(FrameError::WrongLength {
                buffer,
                expected: count,
                actual,
            })
        };
        assert_eq!(run(&controls, count, count, &mut workspace), Ok(()));
        assert_eq!(
            run(&controls, count, count, &mut foreign_workspace),
            Err(FrameError::ForeignWorkspace)
        );
        assert_eq!(
            run(&foreign_controls, count, count, &mut workspace),
            Err(FrameError::ForeignControls)
        );
        assert_eq!(
            run(&controls, count - 1, count, &mut workspace),
            short(Buffer::Positions, count - 1)
        );
        assert_eq!(
            run(&controls, count + 1, count, &mut workspace),
            short(Buffer::Positions, count + 1)
        );
        assert_eq!(
            run(&controls, count, count - 1, &mut workspace),
            short(Buffer::Normals, count - 1)
        );
        assert_eq!(run(&controls, count, 0, &mut workspace), short(Buffer::Normals, 0));
    }

    #[test]
    fn jobs_of_the_exact_tier_refuse_a_workspace_of_bones() {
        let package = Package::small_with_bones(1);
        let basis = open(&package);
        let layout = WorkspaceLayout::for_tier(&basis, TierChoice::Bones).unwrap();
        let mut memory = vec![0xff; layout.unaligned_bytes()];
        let mut workspace = Workspace::for_tier(&basis, TierChoice::Bones, &mut memory, Kernels::Scalar).unwrap();
        let mut output = vec![[9.0; 3]; basis.vertex_count()];
        let tangent = crate::Tangent {
            basis: &basis,
            component: 0,
            displacement: &mut output,
        };
        assert_eq!(tangent.run(&mut workspace), Err(FrameError::NeedsExactTier));
        let mut features = vec![[9.0; crate::FEATURE_COUNT]; basis.vertex_count()];
        assert_eq!(
            workspace.features(&basis, &mut features),
            Err(FrameError::NeedsExactTier)
        );
        let reconstruct = crate::Reconstruct {
            basis: &basis,
            features: &features,
            positions: &mut output,
        };
        assert_eq!(reconstruct.run(&mut workspace), Err(FrameError::NeedsExactTier));
        let positions = vec![[0.0; 3]; basis.vertex_count()];
        let normals = crate::Normals {
            basis: &basis,
            positions: &positions,
            normals: &mut output,
        };
        assert_eq!(normals.run(&mut workspace), Err(FrameError::NeedsExactTier));
        assert!(output.iter().all(|p| *p == [9.0; 3]), "nothing was written");
    }
}
