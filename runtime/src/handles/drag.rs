//! Drag: one update of the weights while the user drags. A fixed number of Gauss-Newton steps, coarse components first.

use super::reach::{Likely, Reach};
use super::{HandleError, Handles};
use crate::basis::{Basis, Tier};
use crate::controls::Controls;
use crate::decode::flushed;
use crate::workspace::Workspace;

/// Gauss-Newton steps an update. A drag is many updates, and each begins where the last ended.
const STEPS: usize = 2;
/// How weakly a level of components may act on the handles before it leaves the work to the next: what it moves them over
/// its whole range, squared, in shares of the bounding box' diagonal (3 % of it).
const LEVEL_RIDGE: f64 = 1e-2;
/// The same for all components together, at the end (0.2 % of it): what is left to reach is reached, unless it takes
/// components that have next to nothing to do with it.
const JOINT_RIDGE: f64 = 4e-6;
/// How much weaker the joint pass gets with every further handle, where the package knows its weights: one vertex comes to where it is
/// pulled, however unlikely; of many, what the likely weights leave is noise.
const DOUBT: f64 = 4.0;
/// Handles beyond which that does not matter any more.
const MOST_DOUBTS: usize = 24;
/// How far a step brings a handle at most, as a share of the diagonal: farther than the linear problem is to be believed.
const STRIDE: f64 = 0.04;
/// How many times as strong the ridge is after a step that was worse than none. It lasts: mouse and mesh go on from here.
const CAUTION: f64 = 16.0;
/// How much of that a step that was good takes back.
const TRUST: f64 = 0.25;
/// More caution than this is standing still, and a good step should not take long to return from it.
const CAUTION_MAX: f64 = 65_536.0;

/// Moves the weights so that the held vertices come nearer to their targets.
///
/// Each component's step is measured in its range, and kept to its stops (a control that stands beyond one may stay or come
/// back, never go further). Weights hold to where they are: of all ways to move the handles, the one with the least sum of
/// squared steps. A package that knows the weights of its training shapes goes there as those would first, then as all
/// components can; without, coarse components go as far as they are of use, then finer ones, then all. Pinned components do not
/// move. What no component can reach stays as near as it gets.
///
/// The workspace lends its kernels and keeps its pose; run a [`crate::Frame`] afterwards.
#[derive(Debug)]
pub struct Drag<'j, 'h, 'c> {
    /// The opened package.
    pub basis: &'j Basis<'j>,
    /// The held vertices and their targets.
    pub handles: &'j mut Handles<'h>,
    /// In: the current pose. Out: the pose of the drag.
    pub controls: &'j mut Controls<'c>,
}

/// How an update went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DragReport {
    /// Largest distance of a held vertex from its target afterwards, units of the source; 0 without handles.
    pub misfit: f32,
    /// Steps taken; 0 when none brought the handles nearer, as when they are there.
    pub step_count: u32,
}

impl Drag<'_, '_, '_> {
    /// Checks identities, O(1).
    ///
    /// # Errors
    /// [`HandleError::ForeignHandles`], [`HandleError::ForeignWorkspace`], [`HandleError::NeedsExactTier`],
    /// [`HandleError::ForeignControls`].
    pub fn validate(&self, workspace: &Workspace<'_>) -> Result<(), HandleError> {
        self.handles.check_basis(self.basis)?;
        workspace
            .validate_exact(self.basis)
            .map_err(HandleError::of_workspace)?;
        if self.controls.basis().identity() == self.basis.identity() {
            Ok(())
        } else {
            Err(HandleError::ForeignControls)
        }
    }

    /// Moves the weights.
    ///
    /// # Errors
    /// Those of [`Drag::validate`]; [`HandleError::NotFinite`] when the controls stand so far out that numbers overflow. The
    /// controls then stay.
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<DragReport, HandleError> {
        self.validate(workspace)?;
        let tier = workspace
            .validate_exact(self.basis)
            .map_err(HandleError::of_workspace)?;
        let Self {
            basis,
            handles,
            controls,
        } = self;
        if handles.count == 0 {
            return Ok(DragReport {
                misfit: 0.0,
                step_count: 0,
            });
        }
        handles.begin(basis, &tier, controls.weights(), workspace)?;
        let mut squared = handles.squared_misfit(handles.positions);
        let mut step_count = 0;
        let mut is_linearised = false;
        for _ in 0..STEPS {
            if squared == 0.0 {
                break;
            }
            if !is_linearised {
                handles.linearise(basis, &tier, workspace);
                handles.scale_jacobian(basis);
                is_linearised = true;
            }
            handles.step(basis);
            let is_finite = handles.evaluate(basis, &tier, workspace);
            let trial = handles.squared_misfit(handles.trial_positions);
            // A number that is not one is no improvement.
            if is_finite && trial < squared {
                handles.accept();
                squared = trial;
                handles.caution = (TRUST * handles.caution).max(1.0);
                step_count += 1;
                is_linearised = false;
            } else {
                handles.caution = (CAUTION * handles.caution).min(CAUTION_MAX);
            }
        }
        for (k, &w) in handles.memory.evaluated.iter().enumerate() {
            if w != flushed(controls.weights()[k]) {
                let set = controls.set_unclamped(k, w);
                debug_assert!(set.is_ok(), "weights within limits are finite");
            }
        }
        Ok(DragReport {
            misfit: handles.largest_misfit(),
            step_count,
        })
    }
}

impl Handles<'_> {
    /// Takes `weights` as the start and sees to it that the held vertices are known there.
    fn begin(
        &mut self,
        basis: &Basis<'_>,
        tier: &Tier<'_>,
        weights: &[f32],
        workspace: &Workspace<'_>,
    ) -> Result<(), HandleError> {
        let counts_on = self.is_started && !basis.prior().mean.is_empty();
        for (k, &w) in weights.iter().enumerate() {
            // What a slider moved since the last update is where the user wants it.
            let counted = self.memory.start[k] + (w - self.memory.evaluated[k]);
            self.memory.start[k] = if counts_on && counted.is_finite() { counted } else { w };
        }
        let is_known = self.is_evaluated
            && weights
                .iter()
                .zip(&*self.memory.evaluated)
                .all(|(&w, &e)| flushed(w) == e);
        if !is_known {
            self.memory.trial.copy_from_slice(weights);
            if !self.evaluate(basis, tier, workspace) {
                let is_bad = |p: &[f32; 3]| !p.iter().all(|x| x.is_finite());
                let n = self.trial_positions[..self.count].iter().position(is_bad).unwrap_or(0);
                return Err(HandleError::NotFinite {
                    vertex: self.vertices[n] as usize,
                });
            }
            self.accept();
        }
        for (k, &w) in weights.iter().enumerate() {
            let component = basis.component(k);
            let range = component.maximum - component.minimum;
            let movable = range > 0.0 && self.memory.pinned[k] == 0;
            let start = self.memory.start[k];
            self.memory.inverse_ranges[k] = if range > 0.0 { 1.0 / range } else { 0.0 };
            let share = |stop: f32| if movable { (stop - start) / range } else { 0.0 };
            self.memory.lower[k] = share(component.minimum.min(w)).min(0.0);
            self.memory.upper[k] = share(component.maximum.max(w)).max(0.0);
        }
        self.is_started = true;
        Ok(())
    }

    /// The trial becomes the pose that is known.
    fn accept(&mut self) {
        self.positions.copy_from_slice(self.trial_positions);
        self.memory.evaluated.copy_from_slice(self.memory.trial);
        self.is_evaluated = true;
    }

    /// From units of the source a unit of weight to shares of the diagonal a share of the range.
    fn scale_jacobian(&mut self, basis: &Basis<'_>) {
        let rows = 3 * self.count;
        for (k, component) in basis.components().enumerate() {
            let scale = (f64::from(component.maximum - component.minimum) / self.diagonal) as f32;
            self.memory.jacobian[k * rows..][..rows]
                .iter_mut()
                .for_each(|x| *x *= scale);
        }
    }

    /// Puts into `self.memory.trial` the weights of the linear problem at the known pose, whose ridge holds to the start.
    fn step(&mut self, basis: &Basis<'_>) {
        let rows = 3 * self.count;
        let memory = &mut self.memory;
        let residual = &mut memory.residual[..rows];
        for (n, left) in residual.chunks_exact_mut(3).enumerate() {
            let (target, position) = (&self.targets[n], &self.positions[n]);
            for c in 0..3 {
                left[c] = (f64::from(target[c]) - f64::from(position[c])) / self.diagonal;
            }
            let way = libm::sqrt(left.iter().map(|x| x * x).sum());
            if way > STRIDE {
                left.iter_mut().for_each(|x| *x *= STRIDE / way);
            }
        }
        // The steps are counted from the start, so what the known pose has moved since then is still to be reached.
        for (k, component) in basis.components().enumerate() {
            let range = component.maximum - component.minimum;
            if range > 0.0 {
                let moved = f64::from((memory.evaluated[k] - flushed(memory.start[k])) / range);
                let column = &memory.jacobian[k * rows..][..rows];
                residual
                    .iter_mut()
                    .zip(column)
                    .for_each(|(left, &j)| *left += f64::from(j) * moved);
            }
        }
        memory.offsets.fill(0.0);
        let mut reach = Reach {
            jacobian: &memory.jacobian[..rows * memory.pinned.len()],
            residual,
            offsets: memory.offsets,
            lower: memory.lower,
            upper: memory.upper,
            is_free: memory.is_free,
            gram: &mut memory.gram[..rows * rows],
            multipliers: &mut memory.multipliers[..rows],
            projected: memory.projected,
        };
        let prior = basis.prior();
        // A ridge that holds to where the steps are counted from would pull back there: who counts on goes a part of the way instead.
        let (joint_ridge, share) = if prior.mean.is_empty() {
            (self.caution * JOINT_RIDGE, 1.0)
        } else {
            let others = self.count.saturating_sub(1).min(MOST_DOUBTS);
            let doubt = (0..others).fold(1.0, |doubt, _| DOUBT * doubt);
            (doubt * JOINT_RIDGE, 1.0 / libm::sqrt(self.caution) as f32)
        };
        if prior.mean.is_empty() {
            let levels = basis.components().map(|component| component.level).max().unwrap_or(0);
            for level in 0..=levels {
                reach.pass(self.caution * LEVEL_RIDGE, &Likely::Alike, |k| {
                    basis.component(k).level == level
                });
            }
        } else {
            let likely = Likely::Known {
                prior,
                shares: memory.inverse_ranges,
            };
            reach.pass(f64::from(prior.strength), &likely, |_| true);
        }
        reach.pass(joint_ridge, &Likely::Alike, |_| true);
        for (k, component) in basis.components().enumerate() {
            let (start, range) = (memory.start[k], component.maximum - component.minimum);
            let wanted = match memory.offsets[k] {
                0.0 => start,
                // Once more to the stops: the shares were rounded.
                offset => (start + offset * range).clamp(component.minimum.min(start), component.maximum.max(start)),
            };
            let now = memory.evaluated[k];
            memory.trial[k] = if share < 1.0 {
                now + share * (wanted - now)
            } else {
                wanted
            };
        }
    }

    /// Sum of the squared distances from the targets, shares of the diagonal.
    fn squared_misfit(&self, positions: &[[f32; 3]]) -> f64 {
        let pairs = positions[..self.count].iter().zip(self.targets());
        pairs.map(|(p, t)| self.squared_distance(p, t)).sum()
    }

    fn squared_distance(&self, p: &[f32; 3], t: &[f32; 3]) -> f64 {
        (0..3)
            .map(|c| {
                let share = (f64::from(p[c]) - f64::from(t[c])) / self.diagonal;
                share * share
            })
            .sum()
    }

    fn largest_misfit(&self) -> f32 {
        let pairs = self.positions[..self.count].iter().zip(self.targets());
        let squared = pairs.map(|(p, t)| self.squared_distance(p, t)).fold(0.0, f64::max);
        (libm::sqrt(squared) * self.diagonal) as f32
    }
}
