//! Where the held vertices are at given weights, and how they move with each: the frame's blend and decode, then sums over
//! the mesh instead of a solve.

use libm::tanhf;
use sinew_formats::package::FEATURE_COUNT;

use super::Handles;
use crate::basis::Basis;
use crate::blend::{blend_block, components, flushed};
use crate::decode::decode;
use crate::simd::scalar::adjoint::{adjoints, derivative, displacement};
use crate::simd::scalar::blend::Features;
use crate::workspace::Workspace;

impl Handles<'_> {
    /// Puts the held vertices at `self.memory.trial` into `self.trial_positions`, and features and slopes of that pose where
    /// [`Handles::linearise`] wants them. The workspace lends scratch. Whether all are finite.
    pub(super) fn evaluate(&mut self, basis: &Basis<'_>, workspace: &mut Workspace<'_>) -> bool {
        self.is_evaluated = false;
        self.blend(basis, workspace);
        decode(&basis.exact(), self.features, workspace.gradients);
        let vertex_count = basis.vertex_count();
        for n in 0..self.count {
            let pull = &self.pulls[n * vertex_count..][..vertex_count];
            let moved = displacement(workspace.gradients, pull);
            let rest = basis.rest_positions()[basis.solver_from_vertex()[self.vertices[n] as usize] as usize];
            self.trial_positions[n] = core::array::from_fn(|c| (f64::from(rest[c]) + moved[c]) as f32);
        }
        let positions = &self.trial_positions[..self.count];
        positions.as_flattened().iter().all(|x| x.is_finite())
    }

    fn blend(&mut self, basis: &Basis<'_>, workspace: &mut Workspace<'_>) {
        let weights = &mut self.memory.trial;
        weights.iter_mut().for_each(|w| *w = flushed(*w));
        self.features.fill([0.0; FEATURE_COUNT]);
        let tier = basis.exact();
        let mut remaining = &mut *self.slopes;
        for b in 0..tier.block_count() {
            let (block, support) = (tier.block(b), tier.support(b));
            let rest = block.bias.map(tanhf);
            let slopes;
            (slopes, remaining) = remaining.split_at_mut(support.len());
            if weights[components(&block)].iter().all(|&w| w == 0.0) {
                slopes.fill(rest.map(|y| 1.0 - y * y));
                continue;
            }
            let pre = blend_block(&tier, b, weights, workspace.pre_activations);
            for ((&v, u), slope) in support.iter().zip(pre).zip(slopes) {
                let y: Features = core::array::from_fn(|c| tanhf(block.bias[c] + u[c]));
                let feature = &mut self.features[v as usize];
                for c in 0..FEATURE_COUNT {
                    feature[c] += y[c] - rest[c];
                    slope[c] = 1.0 - y[c] * y[c];
                }
            }
        }
    }

    /// Derivatives of the held vertices by every component that is not pinned, at the pose of the last
    /// [`Handles::evaluate`], into `self.memory.jacobian`: units of the source a unit of weight.
    pub(super) fn linearise(&mut self, basis: &Basis<'_>) {
        let (rows, vertex_count, tier) = (3 * self.count, basis.vertex_count(), basis.exact());
        for n in 0..self.count {
            let pull = &self.pulls[n * vertex_count..][..vertex_count];
            adjoints(tier.scales(), self.features, pull, self.adjoints);
            let mut remaining = &*self.slopes;
            for b in 0..tier.block_count() {
                let support = tier.support(b);
                let slopes;
                (slopes, remaining) = remaining.split_at(support.len());
                for k in components(&tier.block(b)) {
                    let out = &mut self.memory.jacobian[k * rows + 3 * n..][..3];
                    if self.memory.pinned[k] == 1 {
                        out.fill(0.0);
                        continue;
                    }
                    let entries = tier.entries(k);
                    let moved = derivative(entries.slots, entries.values, support, slopes, self.adjoints);
                    out.copy_from_slice(&moved.map(|x| entries.scale * x));
                }
            }
        }
    }
}
