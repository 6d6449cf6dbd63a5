//! Normals: the last step, and a job of its own for positions that come from elsewhere.

use sinew_formats::package::Index;

use crate::basis::{Basis, with_index};
use crate::error::{Buffer, FrameError, check_length};
use crate::simd::Kernels;
use crate::simd::generic::solve::Xyz0;
use crate::workspace::Workspace;

/// Unit vertex normals of the basis' triangles, weighted by area. A vertex without area gets
/// [`FALLBACK_NORMAL`](crate::FALLBACK_NORMAL).
#[derive(Debug)]
pub struct Normals<'j> {
    /// The triangles.
    pub basis: &'j Basis<'j>,
    /// Shape: `[V]`, source order.
    pub positions: &'j [[f32; 3]],
    /// Output. Shape: `[V]`, source order.
    pub normals: &'j mut [[f32; 3]],
}

impl Normals<'_> {
    /// Checks identity and lengths, O(1).
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::NeedsExactTier`], [`FrameError::WrongLength`].
    pub fn validate(&self, workspace: &Workspace<'_>) -> Result<(), FrameError> {
        // A workspace of bones has no scratch for the surface.
        workspace.validate_exact(self.basis)?;
        check_length(self.basis.vertex_count(), Buffer::Positions, self.positions.len())?;
        check_length(self.basis.vertex_count(), Buffer::Normals, self.normals.len())
    }

    /// Computes the normals. The workspace lends its scratch; its pose stays.
    ///
    /// # Errors
    /// Those of [`Normals::validate`].
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
        self.validate(workspace)?;
        with_index!(workspace.posed.len(), I => {
            let vertices = I::of(self.basis.vertex_from_slot());
            for (posed, &v) in workspace.posed.iter_mut().zip(vertices) {
                let [x, y, z] = self.positions[v.at()];
                *posed = [x, y, z, 0.0];
            }
        });
        write_normals(self.basis, workspace.kernels, workspace.posed, self.normals);
        Ok(())
    }
}

/// Normals of positions in slots. Shape: both `[V]`, `normals` in source order.
pub(crate) fn write_normals(basis: &Basis<'_>, kernels: Kernels, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
    with_index!(posed.len(), I => kernels.normals(&basis.around::<I>(), posed, normals));
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;
    use crate::fixture::{Package, memory_for, open, workspace_in};

    #[test]
    fn validity() {
        let (package, other) = (Package::small(1), Package::small(2));
        let (basis, foreign) = (open(&package), open(&other));
        let count = basis.vertex_count();
        let (mut memory, mut foreign_memory) = (memory_for(&basis), memory_for(&foreign));
        let mut workspace = workspace_in(&basis, &mut memory);
        let mut foreign_workspace = workspace_in(&foreign, &mut foreign_memory);
        let run = |positions: usize, normals: usize, workspace: &mut Workspace<'_>| {
            let (positions, mut normals) = (vec![[0.0; 3]; positions], vec![[9.0; 3]; normals]);
            let outcome = Normals {
                basis: &basis,
                positions: &positions,
                normals: &mut normals,
            }
            .run(workspace);
            assert!(
                outcome.is_ok() || normals.iter().all(|n| *n == [9.0; 3]),
                "nothing was written"
            );
            outcome
        };
        assert_eq!(
            run(count, count, &mut foreign_workspace),
            Err(FrameError::ForeignWorkspace)
        );
        let short = |buffer, actual| {
            Err(FrameError::WrongLength {
                buffer,
                expected: count,
                actual,
            })
        };
        assert_eq!(run(count, count, &mut workspace), Ok(()));
        assert_eq!(
            run(count - 1, count, &mut workspace),
            short(Buffer::Positions, count - 1)
        );
        assert_eq!(run(count, count + 1, &mut workspace), short(Buffer::Normals, count + 1));
    }
}
