//! One knob of a surface: from its readings to a position, frame by frame.

use libm::fabsf;

use crate::input::calibrate::KnobCalibration;
use crate::input::event::Reading;
use crate::input::filter::{Deadband, OneEuro};
use crate::input::map::Knob;
use crate::input::supply::Witness;

/// A turn this long is meant, parts of the travel.
const TOUCH: f32 = 0.02;

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
    pub(super) witness: Witness,
    /// When its value last changed.
    pub(super) changed_us: u64,
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

    /// Takes a reading; returns whether it is the first since the knob was plugged in, or of another kind than before. A
    /// first reading moves nothing: it says where the knob already stood.
    pub(super) fn read(&mut self, knob: &Knob<'_>, at_us: u64, reading: Reading, supply: f32) -> bool {
        let encoder = matches!(reading, Reading::Steps(_));
        let first = !self.heard || self.encoder != encoder;
        if first {
            *self = Self {
                heard: true,
                encoder,
                held: self.held,
                changed_us: at_us,
                ..Self::default()
            };
        }
        match reading {
            Reading::Steps(steps) => self.goal += f32::from(steps) * knob.step,
            Reading::Position { value, full_scale } => {
                if (value, full_scale) != (self.value, self.full_scale) {
                    self.changed_us = at_us;
                }
                (self.value, self.full_scale) = (value, full_scale);
                if first {
                    let calibration = calibration(knob, full_scale);
                    let position = calibration.position(self.steps(knob, supply));
                    let as_before = |held: &Deadband| fabsf(held.position() - position) <= calibration.deadband();
                    self.deadband = self.held.filter(as_before).unwrap_or(Deadband::at(position));
                }
                self.hold(knob, supply);
                if first {
                    self.position = self.goal;
                    self.filter = OneEuro::at(self.goal);
                }
            }
        }
        first
    }

    /// Share of the full scale that it reads, if it stands at all.
    pub(super) fn share(&self) -> Option<f32> {
        (self.heard && !self.encoder).then(|| f32::from(self.value) / f32::from(self.full_scale.max(1)))
    }

    fn steps(&self, knob: &Knob<'_>, supply: f32) -> f32 {
        let scale = calibration(knob, self.full_scale).full_scale;
        f32::from(self.value) * (f32::from(scale) / f32::from(self.full_scale.max(1))) / supply
    }

    /// Puts the goal where the reading says, outside the deadband.
    pub(super) fn hold(&mut self, knob: &Knob<'_>, supply: f32) {
        let calibration = calibration(knob, self.full_scale);
        let position = calibration.position(self.steps(knob, supply));
        let centred = calibration.centre.is_some();
        self.goal = self.deadband.update(position, calibration.deadband(), centred);
    }

    /// One frame of the filter.
    pub(super) fn advance(&mut self, knob: &Knob<'_>, dt_s: f32) {
        let before = self.filter.output();
        let after = self.filter.advance(&knob.smoothing, self.goal, dt_s);
        self.moved = after - before;
        self.way += self.moved;
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

fn calibration(knob: &Knob<'_>, full_scale: u16) -> KnobCalibration {
    knob.calibration.unwrap_or(KnobCalibration::assumed(full_scale))
}
