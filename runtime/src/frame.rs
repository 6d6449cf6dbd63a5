//! Frame: the steps in order, from controls to positions and normals. What has not changed is not computed again.

use crate::basis::Basis;
use crate::controls::Controls;
use crate::decode::{Decoded, flushed};
use crate::error::{Buffer, FrameError};
use crate::normals::{check_length, write_normals};
use crate::solve::{emit, solve};
use crate::workspace::Workspace;

/// One frame: deforms the rest shape by the controls.
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
        if self.controls.basis().id() != self.basis.id() {
            return Err(FrameError::ForeignControls);
        }
        check_length(self.basis, Buffer::Positions, self.positions.len())?;
        match &self.normals {
            Some(normals) => check_length(self.basis, Buffer::Normals, normals.len()),
            None => Ok(()),
        }
    }

    /// Deforms. Afterwards the workspace holds the pose: its features, and what [`crate::Tangent`] differentiates at.
    ///
    /// # Errors
    /// Those of [`Frame::validate`]; [`FrameError::NotFinite`] when the weights are so large that numbers overflow: then the
    /// outputs hold the rest shape and the workspace is at rest.
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<FrameOutcome, FrameError> {
        self.validate(workspace)?;
        let weights = self.controls.weights().iter().map(|&w| flushed(w));
        let outcome = if weights.clone().eq(workspace.weights.iter().copied()) {
            FrameOutcome::Unchanged
        } else {
            workspace
                .weights
                .iter_mut()
                .zip(weights)
                .for_each(|(to, from)| *to = from);
            let tier = self.basis.exact();
            let decoded = Decoded {
                shares: workspace.shares,
                blocks: workspace.blocks,
                gradients: workspace.gradients,
            };
            decoded.update(
                &tier,
                workspace.kernels,
                workspace.weights,
                workspace.gradients_are_stale,
            );
            workspace.gradients_are_stale = false;
            solve(&tier, workspace.gradients, workspace.displacement);
            FrameOutcome::Solved
        };
        let (bounds, emitted) = emit(self.basis, workspace.displacement, workspace.posed, self.positions);
        workspace.bounds = bounds;
        if emitted.is_err() {
            workspace.rest();
        }
        if let Some(normals) = self.normals {
            write_normals(self.basis, workspace.kernels, workspace.posed, normals);
        }
        emitted.map(|()| outcome)
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::fixture::{Package, memory_for, open, workspace_in};
    use crate::simd::scalar::surface::FALLBACK_NORMAL;

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
    fn overflow_gives_the_rest_mesh_and_leaves_the_workspace_usable() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let before = frame(&basis, &WEIGHTS, &mut workspace).1;
        // One overflowing weight saturates tanh, which is finite; two are infinity less infinity.
        let (outcome, positions, normals) = frame(&basis, &[f32::MAX, 0.0, 0.0, 0.0, 0.0], &mut workspace);
        assert_eq!(outcome, Ok(FrameOutcome::Solved));
        assert!(
            positions
                .as_flattened()
                .iter()
                .chain(normals.as_flattened())
                .all(|x| x.is_finite())
        );

        let (outcome, positions, normals) = frame(&basis, &[f32::MAX, f32::MAX, 0.0, 0.0, 0.0], &mut workspace);
        assert!(matches!(outcome, Err(FrameError::NotFinite { vertex }) if vertex < basis.vertex_count()));
        assert_eq!(positions, package.rest_in_source_order);
        assert!(normals.as_flattened().iter().all(|x| x.is_finite()));
        assert!(workspace.weights().iter().all(|&w| w == 0.0));

        assert_eq!(frame(&basis, &WEIGHTS, &mut workspace).1, before);
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
}
