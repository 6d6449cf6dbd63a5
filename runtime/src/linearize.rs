//! Linearize: how the positions move when one weight does, exactly, at the workspace's pose. For fitting weights to
//! positions by Gauss-Newton, offline and on dragged vertices.

use sinew_formats::package::Index;

use crate::basis::{Basis, with_index};
use crate::decode::decoder;
use crate::error::{Buffer, FrameError, check_length};
use crate::simd::generic::solve::place;
use crate::solve::solve;
use crate::workspace::Workspace;

/// Derivative of all positions with respect to one component's weight, at the pose of the last [`crate::Frame`] (rest, in
/// a new workspace). The pose stays.
///
/// `dx = (1 - tanh^2(bias + u)) C_k` on the component's support, `dT = [J_l(r) dr]x R S + R dS`, then the same linear solve
/// as the frame's; and what the component adds after it.
#[derive(Debug)]
pub struct Tangent<'j> {
    /// The opened package.
    pub basis: &'j Basis<'j>,
    /// Index of the component.
    pub component: usize,
    /// Output: position units a unit of weight. Shape: `[V]`, source order.
    pub displacement: &'j mut [[f32; 3]],
}

impl Tangent<'_> {
    /// Checks identity, length and index, O(1).
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::NeedsExactTier`], [`FrameError::WrongLength`], [`FrameError::NoSuchComponent`].
    pub fn validate(&self, workspace: &Workspace<'_>) -> Result<(), FrameError> {
        workspace.validate_exact(self.basis)?;
        check_length(self.basis.vertex_count(), Buffer::Displacement, self.displacement.len())?;
        let (component, component_count) = (self.component, self.basis.component_count());
        if component < component_count {
            Ok(())
        } else {
            Err(FrameError::NoSuchComponent {
                component,
                component_count,
            })
        }
    }

    /// Differentiates.
    ///
    /// # Errors
    /// Those of [`Tangent::validate`]; [`FrameError::NotFinite`] when the derivative overflows: then the output is zero.
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<(), FrameError> {
        self.validate(workspace)?;
        let tier = workspace.validate_exact(self.basis)?;
        let decoder = decoder(self.basis, tier.patches, workspace.shares, workspace.blocks);
        let gradients = &mut *workspace.gradients;
        workspace.gradients_are_stale = true;
        workspace.kernels.tangents(&decoder, self.component, gradients);
        let solution = &mut *workspace.solution;
        solve(workspace.kernels, &tier, gradients, solution);
        let (after, components) = (self.basis.after(), self.basis.component_count());
        with_index!(tier.rest.len(), I => {
            let (places, vertices) = (I::of(tier.solve.solver_from_slot), I::of(self.basis.vertex_from_slot()));
            for (slot, (&solver, &v)) in places.iter().zip(vertices).enumerate() {
                let (d, added) = (place(solution, solver), after.derivative(components, self.component, slot));
                let sum: [f32; 3] = core::array::from_fn(|c| d[c] + added[c]);
                if !sum.iter().all(|x| x.is_finite()) {
                    self.displacement.fill([0.0; 3]);
                    return Err(FrameError::NotFinite { vertex: v.at() });
                }
                self.displacement[v.at()] = sum;
            }
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::fixture::{Package, memory_for, open, workspace_in};
    use crate::{Controls, Frame};

    /// Central differences of an f32 frame: rounding 1e-6 / STEP, truncation near STEP^2.
    const STEP: f32 = 5e-3;
    /// Of displacements up to several units.
    const TOLERANCE: f32 = 2e-3;

    fn pose(basis: &Basis<'_>, weights: &[f32], workspace: &mut Workspace<'_>) -> Vec<[f32; 3]> {
        let mut memory = vec![0.0; weights.len()];
        let mut controls = Controls::new(basis, &mut memory).unwrap();
        for (k, &w) in weights.iter().enumerate() {
            controls.set_unclamped(k, w).unwrap();
        }
        let mut positions = vec![[0.0; 3]; basis.vertex_count()];
        Frame {
            basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        }
        .run(workspace)
        .unwrap();
        positions
    }

    #[test]
    fn tangent_equals_the_difference_quotient_of_frames() {
        let package = Package::small(3);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        for weights in [[0.0; Package::COMPONENTS], [0.7, -0.4, 0.9, -0.8, 0.2]] {
            for component in 0..Package::COMPONENTS {
                let shifted = |by: f32| {
                    let mut shifted = weights;
                    shifted[component] += by;
                    shifted
                };
                let ahead = pose(&basis, &shifted(STEP), &mut workspace);
                let behind = pose(&basis, &shifted(-STEP), &mut workspace);
                let here = pose(&basis, &weights, &mut workspace);
                let mut tangent = vec![[f32::NAN; 3]; basis.vertex_count()];
                Tangent {
                    basis: &basis,
                    component,
                    displacement: &mut tangent,
                }
                .run(&mut workspace)
                .unwrap();
                assert!(
                    tangent.as_flattened().iter().any(|x| x.abs() > 0.1),
                    "component {component} moves something"
                );
                for v in 0..basis.vertex_count() {
                    for c in 0..3 {
                        let quotient = (ahead[v][c] - behind[v][c]) / (2.0 * STEP);
                        assert!(
                            (tangent[v][c] - quotient).abs() < TOLERANCE,
                            "component {component}, vertex {v}: {} {quotient}",
                            tangent[v][c]
                        );
                    }
                }
                assert_eq!(pose(&basis, &weights, &mut workspace), here, "the pose stays");
            }
        }
    }

    #[test]
    fn validity() {
        let (package, other) = (Package::small(1), Package::small(2));
        let (basis, foreign) = (open(&package), open(&other));
        let count = basis.vertex_count();
        let (mut memory, mut foreign_memory) = (memory_for(&basis), memory_for(&foreign));
        let mut workspace = workspace_in(&basis, &mut memory);
        let mut foreign_workspace = workspace_in(&foreign, &mut foreign_memory);
        let run = |component, length, workspace: &mut Workspace<'_>| {
            let mut displacement = vec![[9.0; 3]; length];
            let outcome = Tangent {
                basis: &basis,
                component,
                displacement: &mut displacement,
            }
            .run(workspace);
            assert!(
                outcome.is_ok() || displacement.iter().all(|d| *d == [9.0; 3]),
                "nothing was written"
            );
            outcome
        };
        assert_eq!(run(0, count, &mut workspace), Ok(()));
        assert_eq!(run(0, count, &mut foreign_workspace), Err(FrameError::ForeignWorkspace));
        let buffer = Buffer::Displacement;
        let short = FrameError::WrongLength {
            buffer,
            expected: count,
            actual: count - 1,
        };
        assert_eq!(run(0, count - 1, &mut workspace), Err(short));
        let component_count = Package::COMPONENTS;
        let missing = FrameError::NoSuchComponent {
            component: component_count,
            component_count,
        };
        assert_eq!(run(component_count, count, &mut workspace), Err(missing));
    }
}
