//! One frame of a surface: filters, pages, then either the way to rest or every knob's grip on its controls.

use libm::{copysignf, fabsf};

use super::{ControlSurface, FRAME_US_MAX, SurfaceError};
use crate::controls::Controls;
use crate::input::failsafe::Ease;
use crate::input::map::{Command, Knob};
use crate::input::takeover::{Grip, Takeover};

/// Share of a control's range that rounding may cost a round trip through its curve.
const ROUNDING: f32 = 1e-6;
/// Weights closer to rest are at rest: those that the frame flushes anyway.
const REST_WEIGHT: f32 = 1e-6;

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
        self.follow_supply(now_us);
        for (state, knob) in self.knobs.iter_mut().zip(self.map.knobs) {
            state.advance(knob, dt_s);
        }
        self.follow_touch();

        let lost_for = self.lost_since_us.map(|since| now_us.saturating_sub(since));
        let too_long = match (lost_for, self.settings.failsafe.ease_after_us) {
            (Some(lost_for), Some(limit)) => lost_for >= limit,
            _ => false,
        };
        if self.stopping || too_long {
            self.ease_to_rest(now_us, dt_s, controls);
        } else {
            self.ease = None;
            if self.lost_since_us.is_none() {
                self.play(dt_s, controls);
            }
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
            let pairs = self.map.knobs.iter().zip(&*self.knobs);
            let mut trembling = pairs
                .filter(|(knob, state)| noisy(knob) && state.share().is_some())
                .peekable();
            sends
                && trembling.peek().is_some()
                && trembling.all(|(_, state)| now_us.saturating_sub(state.changed_us) >= limit)
        });
    }

    fn follow_supply(&mut self, now_us: u64) {
        if !self.settings.follow_supply {
            return;
        }
        let before = self.supply.factor();
        let shares = self.knobs.iter_mut().filter_map(|knob| {
            let share = knob.share()?;
            Some((&mut knob.witness, share))
        });
        let factor = self.supply.update(now_us, shares);
        self.status.supply = factor;
        if factor != before {
            for (state, knob) in self.knobs.iter_mut().zip(self.map.knobs) {
                if state.share().is_some() {
                    state.hold(knob, factor);
                }
            }
        }
    }

    /// A coarse knob that was turned brings its children.
    fn follow_touch(&mut self) {
        let Some(tree) = self.map.tree else { return };
        let first_slot = self.map.bindings.len();
        for n in 0..usize::from(tree.coarse_knobs) {
            let touched = self.knobs[tree.knobs().start + n].touched();
            if let (true, true, Some(control)) = (touched, tree.follow_touch, self.slots[first_slot + n].control) {
                self.command(Command::Focus(control));
            }
        }
    }

    /// A stop eases every control, a lost device those that it could have moved.
    fn ease_to_rest(&mut self, now_us: u64, dt_s: f32, controls: &mut Controls<'_>) {
        let duration_us = self.settings.failsafe.ease_us;
        let ease = self.ease.get_or_insert(Ease::start(now_us));
        let factor = ease.factor(now_us, duration_us);
        let mut all_rest = ease.is_over();
        for control in 0..self.map.basis.component_count() {
            let weight = controls.weights()[control];
            let own = self.stopping || self.map.tree.is_some() || self.map.is_bound(control);
            if weight == 0.0 || !own {
                continue;
            }
            let goal = weight * factor;
            let goal = if fabsf(goal) < REST_WEIGHT { 0.0 } else { goal };
            let moved = (weight - goal).clamp(-self.slew_of(control) * dt_s, self.slew_of(control) * dt_s);
            let next = if moved == weight - goal { goal } else { weight - moved };
            // Between its weight and rest every control may stand.
            all_rest &= controls.set(control, next) == Ok(0.0);
        }
        self.release_slots();
        if all_rest && !self.stop_down && !self.stop_asked {
            self.stopping = false;
        }
    }

    /// Tightest slew limit of a control on any page.
    fn slew_of(&self, control: usize) -> f32 {
        let own = self.map.bindings.iter().filter(|b| usize::from(b.control) == control);
        let limits = own.filter_map(|binding| binding.response.slew);
        let tree = self.map.tree.and_then(|tree| tree.response.slew);
        limits.chain(tree).fold(f32::MAX, f32::min)
    }

    fn play(&mut self, dt_s: f32, controls: &mut Controls<'_>) {
        for index in 0..self.slots.len() {
            let Some(wiring) = self.wiring(index) else { continue };
            let knob = self.knobs[wiring.knob];
            if !knob.heard {
                continue;
            }
            let response = wiring.response;
            let slot = &mut self.slots[index];
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
                }
            }
        }
    }
}
