//! Where the held vertices are at given weights, and how they move with each: the frame's decode, then sums over the mesh
//! instead of a solve.

use super::Handles;
use crate::basis::Basis;
use crate::decode::{decoder, factor, flushed};
use crate::simd::adjoint::{Pull, TOGETHER};
use crate::simd::decode::Share;
use crate::workspace::Workspace;

impl Handles<'_> {
    /// Puts the held vertices at `self.memory.trial` into `self.trial_positions`, and that pose's features where
    /// [`Handles::linearise`] wants them. The workspace lends its kernels. Whether all are finite.
    pub(super) fn evaluate(&mut self, basis: &Basis<'_>, workspace: &Workspace<'_>) -> bool {
        self.is_evaluated = false;
        let tier = basis.exact();
        for (k, weight) in self.memory.trial.iter_mut().enumerate() {
            *weight = flushed(*weight);
            self.shares[k] = Share {
                factor: factor(&tier, k, *weight),
                changed: u32::from(self.memory.pinned[k] == 0),
            };
        }
        let decoder = decoder(&tier, self.shares, workspace.blocks, true);
        let pulls = &self.pulls[..self.count * self.features.len()];
        let sums = &mut self.held_sums[..self.count.div_ceil(TOGETHER)];
        workspace.kernels.held(&decoder, pulls, self.features, sums);
        for n in 0..self.count {
            let moved = total(&self.held_sums[n / TOGETHER][n % TOGETHER]);
            let rest = basis.rest_positions()[basis.lane_from_vertex()[self.vertices[n] as usize] as usize];
            self.trial_positions[n] = core::array::from_fn(|c| (f64::from(rest[c]) + moved[c]) as f32);
        }
        let positions = &self.trial_positions[..self.count];
        positions.as_flattened().iter().all(|x| x.is_finite())
    }

    /// Derivatives of the held vertices by every component that is not pinned, at the pose of the last
    /// [`Handles::evaluate`], into `self.memory.jacobian`: units of the source a unit of weight.
    pub(super) fn linearise(&mut self, basis: &Basis<'_>, workspace: &Workspace<'_>) {
        let (rows, group_count, tier) = (3 * self.count, self.features.len(), basis.exact());
        for (k, share) in self.shares.iter_mut().enumerate() {
            share.changed = u32::from(self.memory.pinned[k] == 0);
        }
        let decoder = decoder(&tier, self.shares, workspace.blocks, true);
        for first in (0..self.count).step_by(TOGETHER) {
            let past = self.count.min(first + TOGETHER);
            let pulls = &self.pulls[first * group_count..past * group_count];
            workspace
                .kernels
                .derivatives(&decoder, pulls, self.features, self.derivative_sums);
            for (k, sums) in self.derivative_sums.iter().enumerate() {
                let scale = f64::from(tier.value_scale(k));
                for (n, sums) in (first..past).zip(sums) {
                    let moved = total(sums);
                    let out = &mut self.memory.jacobian[k * rows + 3 * n..][..3];
                    for c in 0..3 {
                        out[c] = (scale * moved[c]) as f32;
                    }
                }
            }
        }
    }
}

/// Sum over the lanes.
fn total(sums: &Pull) -> [f64; 3] {
    sums.each_ref().map(|lanes| lanes.iter().copied().map(f64::from).sum())
}
