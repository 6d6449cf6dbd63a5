//! Where the held vertices are at given weights, and how they move with each: the frame's decode, then sums over the mesh
//! instead of a solve.

use super::Handles;
use crate::basis::{Basis, Tier};
use crate::decode::{decoder, flushed, set_shares};
use crate::simd::generic::adjoint::{Pull, TOGETHER};
use crate::workspace::Workspace;

impl Handles<'_> {
    /// Puts the held vertices at `self.memory.trial` into `self.trial_positions`, and that pose's features where
    /// [`Handles::linearise`] wants them. The workspace lends its kernels. Whether all are finite.
    pub(super) fn evaluate(&mut self, basis: &Basis<'_>, tier: &Tier<'_>, workspace: &Workspace<'_>) -> bool {
        self.is_evaluated = false;
        let trial = &mut *self.memory.trial;
        trial.iter_mut().for_each(|weight| *weight = flushed(*weight));
        set_shares(self.shares, trial);
        let decoder = decoder(basis, tier.patches, self.shares, workspace.blocks);
        let pulls = &self.pulls[..self.count * self.features.len()];
        let sums = &mut self.held_sums[..self.count.div_ceil(TOGETHER)];
        workspace.kernels.held(&decoder, pulls, self.features, sums);
        let after = basis.after();
        for n in 0..self.count {
            let mut moved = total(&self.held_sums[n / TOGETHER][n % TOGETHER]);
            let slot = basis.slot_from_vertex().at(self.vertices[n] as usize) as usize;
            for (k, &weight) in self
                .memory
                .trial
                .iter()
                .enumerate()
                .filter(|(_, weight)| **weight != 0.0)
            {
                let added = after.derivative(self.memory.trial.len(), k, slot);
                for c in 0..3 {
                    moved[c] += f64::from(weight) * f64::from(added[c]);
                }
            }
            let rest = basis.rest_positions()[slot];
            self.trial_positions[n] = core::array::from_fn(|c| (f64::from(rest[c]) + moved[c]) as f32);
        }
        let positions = &self.trial_positions[..self.count];
        positions.as_flattened().iter().all(|x| x.is_finite())
    }

    /// Derivatives of the held vertices by every component that is not pinned, at the pose of the last
    /// [`Handles::evaluate`], into `self.memory.jacobian`: units of the source a unit of weight.
    pub(super) fn linearise(&mut self, basis: &Basis<'_>, tier: &Tier<'_>, workspace: &Workspace<'_>) {
        let (rows, group_count) = (3 * self.count, self.features.len());
        for (share, &pinned) in self.shares.iter_mut().zip(&*self.memory.pinned) {
            share.changed = u32::from(pinned == 0);
        }
        let (decoder, after) = (
            decoder(basis, tier.patches, self.shares, workspace.blocks),
            basis.after(),
        );
        for first in (0..self.count).step_by(TOGETHER) {
            let past = self.count.min(first + TOGETHER);
            let pulls = &self.pulls[first * group_count..past * group_count];
            workspace
                .kernels
                .derivatives(&decoder, pulls, self.features, self.derivative_sums);
            let component_count = self.derivative_sums.len();
            for (k, sums) in self.derivative_sums.iter().enumerate() {
                let is_free = self.memory.pinned[k] == 0;
                for (n, sums) in (first..past).zip(sums) {
                    let moved = total(sums);
                    let slot = basis.slot_from_vertex().at(self.vertices[n] as usize) as usize;
                    let added = if is_free {
                        after.derivative(component_count, k, slot)
                    } else {
                        [0.0; 3]
                    };
                    let out = &mut self.memory.jacobian[k * rows + 3 * n..][..3];
                    for c in 0..3 {
                        out[c] = (moved[c] + f64::from(added[c])) as f32;
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
