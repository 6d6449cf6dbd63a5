//! Reconstruct: features of one's own through the frame's decode and solve, without the network. Measures what the
//! features and the solve lose by themselves.

use crate::basis::Basis;
use crate::error::{Buffer, FrameError, check_length};
use crate::positions::scatter;
use crate::solve::{displace, solve};
use crate::workspace::Workspace;

use sinew_formats::package::{FEATURE_COUNT, GROUP_NODES};

/// Positions of given features, without what a package adds after the solve, which depends on weights. The workspace lends its
/// scratch; its pose stays.
#[derive(Debug)]
pub struct Reconstruct<'j> {
    /// The opened package.
    pub basis: &'j Basis<'j>,
    /// Log-rotation xyz then stretch less identity xx xy xz yy yz zz, divided by the package's two scales (network units).
    /// Shape: `[V]`, **source** order; finite.
    pub features: &'j [[f32; FEATURE_COUNT]],
    /// Output. Shape: `[V]`, source order.
    pub positions: &'j mut [[f32; 3]],
}

impl Reconstruct<'_> {
    /// Checks identity, lengths and numbers, O(V): the features come from outside.
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::NeedsExactTier`], [`FrameError::WrongLength`], [`FrameError::FeatureNotFinite`].
    pub fn validate(&self, workspace: &Workspace<'_>) -> Result<(), FrameError> {
        workspace.validate_exact(self.basis)?;
        let count = self.basis.vertex_count();
        check_length(count, Buffer::Features, self.features.len())?;
        check_length(count, Buffer::Positions, self.positions.len())?;
        match self.features.iter().position(|x| !x.iter().all(|c| c.is_finite())) {
            Some(vertex) => Err(FrameError::FeatureNotFinite { vertex }),
            None => Ok(()),
        }
    }

    /// Decodes and solves.
    ///
    /// # Errors
    /// Those of [`Reconstruct::validate`]; [`FrameError::NotFinite`], and then the output holds the rest shape.
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
        self.validate(workspace)?;
        let (basis, tier) = (self.basis, workspace.validate_exact(self.basis)?);
        workspace.gradients_are_stale = true;
        let mut vertices = basis.vertex_from_slot().iter();
        for gradients in workspace.gradients.chunks_mut(GROUP_NODES) {
            let mut group = [[0.0; GROUP_NODES]; FEATURE_COUNT];
            for (n, v) in vertices.by_ref().take(GROUP_NODES).enumerate() {
                for c in 0..FEATURE_COUNT {
                    group[c][n] = self.features[v as usize][c];
                }
            }
            workspace.kernels.gradients(basis.scales(), &group, gradients);
        }
        solve(workspace.kernels, &tier, workspace.gradients, workspace.solution);
        displace(&tier, workspace.solution, workspace.posed);
        let (bounds, written) = scatter(basis, workspace.posed, self.positions);
        workspace.bounds = bounds;
        written
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;
    use crate::fixture::{Package, memory_for, open, workspace_in};
    use crate::{Controls, Frame};

    #[test]
    fn features_of_a_frame_reconstruct_its_positions_to_the_bit() {
        let package = Package::small_with_nothing_added(1);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let mut weights = [0.0; Package::COMPONENTS];
        let mut controls = Controls::new(&basis, &mut weights).unwrap();
        for k in 0..Package::COMPONENTS {
            controls.set(k, 0.6).unwrap();
        }
        let mut positions = vec![[0.0; 3]; basis.vertex_count()];
        Frame {
            basis: &basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        }
        .run(&mut workspace)
        .unwrap();
        let mut features = vec![[0.0; FEATURE_COUNT]; basis.vertex_count()];
        workspace.features(&basis, &mut features).unwrap();
        let mut again = vec![[0.0; 3]; basis.vertex_count()];
        Reconstruct {
            basis: &basis,
            features: &features,
            positions: &mut again,
        }
        .run(&mut workspace)
        .unwrap();
        assert_eq!(again, positions);
    }

    #[test]
    fn validity() {
        let (package, other) = (Package::small(1), Package::small(2));
        let (basis, foreign) = (open(&package), open(&other));
        let count = basis.vertex_count();
        let (mut memory, mut foreign_memory) = (memory_for(&basis), memory_for(&foreign));
        let mut workspace = workspace_in(&basis, &mut memory);
        let mut foreign_workspace = workspace_in(&foreign, &mut foreign_memory);
        let run = |features: &[[f32; FEATURE_COUNT]], length, workspace: &mut Workspace<'_>| {
            let mut positions = vec![[9.0; 3]; length];
            let outcome = Reconstruct {
                basis: &basis,
                features,
                positions: &mut positions,
            }
            .run(workspace);
            let unwritten = positions.iter().all(|p| *p == [9.0; 3]);
            (outcome, unwritten)
        };
        let mut features = vec![[0.1; FEATURE_COUNT]; count];
        let short = |buffer| {
            Err(FrameError::WrongLength {
                buffer,
                expected: count,
                actual: count - 1,
            })
        };
        assert_eq!(run(&features, count, &mut workspace), (Ok(()), false));
        assert_eq!(
            run(&features, count, &mut foreign_workspace),
            (Err(FrameError::ForeignWorkspace), true)
        );
        assert_eq!(
            run(&features[1..], count, &mut workspace),
            (short(Buffer::Features), true)
        );
        assert_eq!(
            run(&features, count - 1, &mut workspace),
            (short(Buffer::Positions), true)
        );
        features[3][5] = f32::NAN;
        assert_eq!(
            run(&features, count, &mut workspace),
            (Err(FrameError::FeatureNotFinite { vertex: 3 }), true)
        );
        features[3] = [f32::MAX; FEATURE_COUNT];
        let (outcome, _) = run(&features, count, &mut workspace);
        assert!(matches!(outcome, Err(FrameError::NotFinite { .. })));
    }
}
