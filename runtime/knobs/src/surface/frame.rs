//! One frame of a surface: filters, pages, then either the way to rest or every knob's grip on its controls.

use libm::{copysignf, fabsf};

use super::{ControlSurface, FRAME_US_MAX, KnobState, SurfaceError};
use crate::failsafe::Ease;
use crate::map::{Command, Knob};
use crate::takeover::{Grip, Takeover};
use sinew_runtime::Controls;

/// Share of a control's range that rounding may cost a round trip through its curve.
const ROUNDING: f32 = 1e-6;
/// Weights closer to rest are at rest: those that the frame flushes anyway.
const REST_WEIGHT: f32 = 1e-6;

/// A hand that has not moved a knob for this long has let go of it, µs.
const HOLD_US: u64 = 700_000;

impl ControlSurface<'_> {
    /// Moves the controls on to `now_us`. In every takeover but jump, a control goes no further than its knob did, and in
    /// all of them no faster than its slew limit. Time that stands still or runs back moves nothing.
    ///
    /// # Errors
    /// [`SurfaceError::ForeignControls`]; nothing then happened.
    pub fn advance(&mut self, now_us: u64, controls: &mut Controls<'_>) -> Result<(), SurfaceError> {
        if controls.basis().id() != self.map.basis.id() {
            return Err(SurfaceError::ForeignControls);
        }
        let before_us = self.now_us.unwrap_or(now_us);
        let dt_us = now_us.saturating_sub(before_us).min(FRAME_US_MAX);
        let dt_s = dt_us as f32 * 1e-6;
        self.now_us = Some(now_us.max(before_us));
        self.watch_device(now_us);
        for (state, knob) in self.memory.knobs.iter_mut().zip(self.map.knobs) {
            state.confirm(knob, now_us);
            state.advance(knob, now_us, dt_s);
        }
        self.follow_touch(now_us);

        let lost_for = self.lost_since_us.map(|since| now_us.saturating_sub(since));
        let too_long = match (lost_for, self.settings.failsafe.ease_after_us) {
            (Some(lost_for), Some(limit)) => lost_for >= limit,
            _ => false,
        };
        if self.stopping || too_long {
            self.ease_to_rest(now_us, dt_s, controls);
        } else if self.lost_since_us.is_none() {
            self.ease = None;
            self.play(dt_s, controls);
        }
        Ok(())
    }

    fn watch_device(&mut self, now_us: u64) {
        let failsafe = self.settings.failsafe;
        self.status.health.flooding = self.watch.advance(now_us, &failsafe);
        if self.lost_since_us.is_none() && self.watch.is_silent(now_us, &failsafe) {
            self.unplugged(now_us);
            self.status.health.silent = true;
        }
        // Knobs that are known to tremble, on a device that still sends.
        let sends = self
            .watch
            .last_event_us
            .is_some_and(|last| now_us.saturating_sub(last) < 1_000_000);
        self.status.health.frozen = failsafe.frozen_us.is_some_and(|limit| {
            let noisy = |knob: &Knob<'_>| knob.calibration.is_some_and(|c| c.noise >= 2);
            let pairs = self.map.knobs.iter().zip(&*self.memory.knobs);
            let mut trembling = pairs
                .filter(|(knob, state)| noisy(knob) && state.share().is_some())
                .peekable();
            sends
                && trembling.peek().is_some()
                && trembling.all(|(_, state)| now_us.saturating_sub(state.changed_us) >= limit)
        });
    }

    /// A coarse knob that was turned brings its children, unless a hand is on those of another: while a fine knob moves, or the
    /// coarse knob whose children they are, and for [`HOLD_US`] after, they stay as they are.
    fn follow_touch(&mut self, now_us: u64) {
        let Some(tree) = self.map.tree.filter(|tree| tree.follow_touch) else {
            return;
        };
        let (first_knob, first_slot) = (tree.knobs().start, self.map.bindings.len());
        let coarse = usize::from(tree.coarse_knobs);
        let held = |state: &KnobState| state.hand_us.is_some_and(|at| now_us.saturating_sub(at) < HOLD_US);
        let is_held = (0..tree.slot_count()).any(|n| {
            let control = self.memory.slots[first_slot + n].control;
            let is_theirs = n >= coarse || (control.is_some() && control == self.view.focus);
            is_theirs && held(&self.memory.knobs[first_knob + n])
        });
        for n in 0..coarse {
            let state = &mut self.memory.knobs[first_knob + n];
            let in_hand = held(state);
            // A turn that the fine knobs put off counts once they are free, if the hand is still there.
            let touched = (!in_hand || !is_held) && state.touched();
            let control = self.memory.slots[first_slot + n].control;
            if let Some(control) = control.filter(|_| touched && in_hand) {
                self.command(Command::Focus(control));
            }
        }
    }

    /// A stop eases every control, a lost device those that stand where it left them, until it has brought them to rest.
    fn ease_to_rest(&mut self, now_us: u64, dt_s: f32, controls: &mut Controls<'_>) {
        let duration_us = self.settings.failsafe.ease_us;
        let ease = self.ease.get_or_insert(Ease::start(now_us));
        let factor = ease.factor(now_us, duration_us);
        let mut all_rest = ease.is_over();
        for control in 0..self.map.basis.component_count() {
            let weight = controls.weights()[control];
            let is_own = self.stopping || weight == self.memory.left[control];
            if weight == 0.0 || !is_own {
                continue;
            }
            let goal = weight * factor;
            let goal = if fabsf(goal) < REST_WEIGHT { 0.0 } else { goal };
            let moved = (weight - goal).clamp(-self.slew_limit(control) * dt_s, self.slew_limit(control) * dt_s);
            let next = if moved == weight - goal { goal } else { weight - moved };
            // Between its weight and rest every control may stand.
            let taken = controls.set(control, next);
            all_rest &= taken == Ok(0.0);
            self.memory.left[control] = taken.unwrap_or(f32::NAN);
        }
        self.release_slots();
        if all_rest && !self.stop_down && !self.stop_asked {
            self.stopping = false;
        }
    }

    /// Tightest slew limit of a control on any page, a second; [`f32::MAX`] where it has none. For whoever else moves it.
    pub fn slew_limit(&self, control: usize) -> f32 {
        let own = self.map.bindings.iter().filter(|b| usize::from(b.control) == control);
        let limits = own.filter_map(|binding| binding.response.slew);
        let tree = self.map.tree.and_then(|tree| tree.response.slew);
        limits.chain(tree).fold(f32::MAX, f32::min)
    }

    fn play(&mut self, dt_s: f32, controls: &mut Controls<'_>) {
        for index in 0..self.memory.slots.len() {
            let Some(wiring) = self.wiring(index) else { continue };
            let knob = self.memory.knobs[wiring.knob];
            if !knob.heard {
                continue;
            }
            let response = wiring.response;
            let slot = &mut self.memory.slots[index];
            let weight = controls.weights()[wiring.control];
            let place = response.place(knob.position);
            if !slot.armed || weight != slot.weight {
                // Somebody else moved it, or the page changed: take it up where it is.
                let knob_place = if knob.encoder { f32::NAN } else { place };
                slot.grip = Grip::arm(response.place_of(weight), knob_place, slot.grip.wary);
                slot.armed = true;
                slot.weight = weight;
                slot.budget = 0.0;
            }
            let held = slot.grip.held;
            if knob.encoder {
                slot.grip.turn_by(if response.is_inverted() {
                    -knob.moved
                } else {
                    knob.moved
                });
            } else {
                slot.grip.turn_to(wiring.takeover, place);
            }
            let goal = response.weight(slot.grip.held);
            let left = fabsf(goal - weight);
            let rounding = ROUNDING * (response.maximum - response.minimum);
            if slot.grip.held != held {
                let jumps = wiring.takeover == Takeover::Jump && !knob.encoder;
                slot.budget = if jumps {
                    left
                } else {
                    slot.budget + fabsf(goal - response.weight(held)) + rounding
                };
            }
            slot.budget = slot.budget.min(left);
            // A slow way is many small steps, whose rounding must not leave the weight short of the knob.
            if slot.grip.engaged && left - slot.budget <= rounding {
                slot.budget = left;
            }
            // A frame without time has no limit to multiply.
            let fastest = if response.slew.is_finite() {
                response.slew * dt_s
            } else {
                response.slew
            };
            let step = slot.budget.min(fastest);
            if step > 0.0 {
                let next = if step >= left {
                    goal
                } else {
                    weight + copysignf(step, goal - weight)
                };
                if let Ok(taken) = controls.set(wiring.control, next) {
                    slot.weight = taken;
                    slot.budget -= step;
                    self.memory.left[wiring.control] = taken;
                }
            }
        }
    }
}
