//! One knob of a surface: from its readings to a position, frame by frame.

use libm::fabsf;

use super::CONFIRM_US;
use crate::calibrate::KnobCalibration;
use crate::event::Reading;
use crate::filter::{Deadband, OneEuro, REST_DISTANCE};
use crate::map::Knob;

/// A turn this long is meant, parts of the travel.
const TOUCH: f32 = 0.02;
/// A reading further than this from the last, parts of the full scale, may be a spike.
const SPIKE: f32 = 1.0 / 16.0;
/// Steps a second of an encoder that is turned slowly, and of one that is spun.
const SLOW_STEPS: f32 = 10.0;
const FAST_STEPS: f32 = 100.0;

/// What a surface remembers of one knob.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KnobState {
    pub(super) heard: bool,
    pub(super) encoder: bool,
    value: u16,
    full_scale: u16,
    /// Deadband of before it was unplugged.
    held: Option<Deadband>,
    deadband: Deadband,
    /// Where the filter goes: a position, or for encoders the turn since the last rest.
    goal: f32,
    filter: OneEuro,
    /// Where it is. Range: `[0, 1]`; of no meaning for encoders.
    pub(super) position: f32,
    /// How far the last frame took it, clockwise.
    pub(super) moved: f32,
    /// Way since the last touch.
    way: f32,
    /// When a hand last moved it.
    pub(super) hand_us: Option<u64>,
    /// When its value last changed.
    pub(super) changed_us: u64,
    /// Way from the reading before the last one to the last, parts of the full scale.
    stride: f32,
    /// A second reading agreed with the first.
    confirmed: bool,
    /// A reading far from the last, until another confirms it.
    unconfirmed: Option<Unconfirmed>,
}

/// What a reading was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Heard {
    /// The first since the knob was plugged in, or of another kind than before.
    First,
    /// One like others.
    Again,
    /// One that shows that the reading before it was a spike.
    AfterSpike,
}

/// A reading that waits for another.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Unconfirmed {
    value: u16,
    full_scale: u16,
    at_us: u64,
}

impl Unconfirmed {
    fn share(&self) -> f32 {
        share(self.value, self.full_scale)
    }
}

impl KnobState {
    /// Forgets where it stands, but for the place that it held: a knob found within its deadband of that was not turned.
    pub(super) fn forget(&mut self) {
        *self = Self {
            held: self
                .heard
                .then_some(self.deadband)
                .filter(|_| !self.encoder)
                .or(self.held),
            ..Self::default()
        };
    }

    /// Takes a reading. A first one moves nothing: it says where the knob already stood.
    pub(super) fn read(&mut self, knob: &Knob<'_>, at_us: u64, reading: Reading, guard: bool) -> Heard {
        let encoder = matches!(reading, Reading::Steps(_));
        if !self.heard || self.encoder != encoder {
            *self = Self {
                heard: true,
                encoder,
                held: self.held,
                changed_us: at_us,
                ..Self::default()
            };
            self.accept(knob, at_us, reading, true);
            return Heard::First;
        }
        let Reading::Position { value, full_scale } = reading else {
            self.accept(knob, at_us, reading, false);
            return Heard::Again;
        };
        let waiting = self.unconfirmed.take();
        let share = share(value, full_scale);
        let confirms = waiting.is_some_and(|waiting| self.confirms(waiting, share));
        if !guard || confirms || self.follows(share) {
            self.confirmed = true;
            self.accept(knob, at_us, reading, false);
        } else if !self.confirmed {
            // Where the knob stood was itself a spike, or it is being turned fast: either way it stands here now.
            self.accept(knob, at_us, reading, true);
            return Heard::First;
        } else {
            self.unconfirmed = Some(Unconfirmed {
                value,
                full_scale,
                at_us,
            });
        }
        if waiting.is_some() && !confirms {
            return Heard::AfterSpike;
        }
        Heard::Again
    }

    /// Believes a reading that nothing has contradicted for long enough: the box speaks only when turned.
    pub(super) fn confirm(&mut self, knob: &Knob<'_>, now_us: u64) {
        if let Some(waiting) = self.unconfirmed
            && now_us.saturating_sub(waiting.at_us) >= CONFIRM_US
        {
            self.unconfirmed = None;
            let Unconfirmed { value, full_scale, .. } = waiting;
            self.accept(knob, waiting.at_us, Reading::Position { value, full_scale }, false);
        }
    }

    /// Whether a reading can follow the last one: near it, or on the way of a hand that was about as fast before.
    fn follows(&self, share: f32) -> bool {
        let moved = share - self.share().unwrap_or(share);
        fabsf(moved) <= SPIKE || (moved * self.stride > 0.0 && fabsf(moved) <= 2.0 * fabsf(self.stride))
    }

    /// Whether a reading agrees with the one that waits: near it, or further on the same way.
    fn confirms(&self, waiting: Unconfirmed, share: f32) -> bool {
        let last = self.share().unwrap_or(share);
        let (way, moved) = (waiting.share() - last, share - last);
        fabsf(share - waiting.share()) <= SPIKE || (moved * way > 0.0 && fabsf(moved) > fabsf(way))
    }

    fn accept(&mut self, knob: &Knob<'_>, at_us: u64, reading: Reading, first: bool) {
        match reading {
            Reading::Steps(steps) => {
                let further = if first {
                    1.0
                } else {
                    self.acceleration(knob, at_us, steps)
                };
                self.goal += f32::from(steps) * knob.step * further;
                self.changed_us = at_us;
            }
            Reading::Position { value, full_scale } => {
                if (value, full_scale) != (self.value, self.full_scale) {
                    self.changed_us = at_us;
                }
                let before = self.share();
                (self.value, self.full_scale) = (value, full_scale);
                self.stride = share(value, full_scale) - before.filter(|_| !first).unwrap_or(share(value, full_scale));
                if first {
                    let calibration = calibration(knob, full_scale);
                    let position = calibration.position(self.steps(knob));
                    let as_before = |held: &Deadband| fabsf(held.position() - position) <= calibration.deadband();
                    self.deadband = self.held.filter(as_before).unwrap_or(Deadband::at(position));
                }
                self.hold(knob);
                if first {
                    self.position = self.goal;
                    self.filter = OneEuro::at(self.goal);
                }
            }
        }
    }

    /// How much further a step goes when the steps come fast: 1 up to [`SLOW_STEPS`] a second, the knob's own factor from
    /// [`FAST_STEPS`] on.
    fn acceleration(&self, knob: &Knob<'_>, at_us: u64, steps: i16) -> f32 {
        let passed_us = at_us.saturating_sub(self.changed_us).max(1);
        let rate = f32::from(steps.unsigned_abs()) * 1e6 / passed_us as f32;
        let share = ((rate - SLOW_STEPS) / (FAST_STEPS - SLOW_STEPS)).clamp(0.0, 1.0);
        1.0 + share * (knob.acceleration - 1.0)
    }

    /// Share of the full scale that it reads, if it stands at all.
    pub(super) fn share(&self) -> Option<f32> {
        (self.heard && !self.encoder).then(|| share(self.value, self.full_scale))
    }

    fn steps(&self, knob: &Knob<'_>) -> f32 {
        let scale = calibration(knob, self.full_scale).full_scale;
        f32::from(self.value) * (f32::from(scale) / f32::from(self.full_scale.max(1)))
    }

    /// Puts the goal where the reading says, outside the deadband.
    fn hold(&mut self, knob: &Knob<'_>) {
        let calibration = calibration(knob, self.full_scale);
        let position = calibration.position(self.steps(knob));
        let centred = calibration.centre.is_some();
        self.goal = self.deadband.update(position, calibration.deadband(), centred);
    }

    /// One frame of the filter.
    pub(super) fn advance(&mut self, knob: &Knob<'_>, now_us: u64, dt_s: f32) {
        let before = self.filter.output();
        let after = self.filter.advance(&knob.smoothing, self.goal, dt_s);
        self.moved = after - before;
        self.way += self.moved;
        if fabsf(self.moved) > REST_DISTANCE {
            self.hand_us = Some(now_us);
        }
        if !self.encoder {
            self.position = after;
        } else if after == self.goal {
            self.filter.shift(after);
            self.goal = 0.0;
        }
    }

    /// Whether a hand turned it, since this was last asked with yes for an answer.
    pub(super) fn touched(&mut self) -> bool {
        let touched = fabsf(self.way) > TOUCH;
        if touched {
            self.way = 0.0;
        }
        touched
    }
}

/// Part of the full scale that a reading is.
fn share(value: u16, full_scale: u16) -> f32 {
    f32::from(value) / f32::from(full_scale.max(1))
}

fn calibration(knob: &Knob<'_>, full_scale: u16) -> KnobCalibration {
    knob.calibration.unwrap_or(KnobCalibration::assumed(full_scale))
}
