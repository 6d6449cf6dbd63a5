//! The full scale of devices that send bare integers: learned from the largest value seen, or set by the caller.
//! Between the parsers of lines, Firmata and OSC and the readings that they give out.

use crate::{Counters, Reading};

/// How a decoder knows the largest value that a device sends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum FullScale {
    /// Learned: 1023 (ten bits; 127 for OSC integers) until a larger value appears, then 4095, 16383 or 65535.
    ///
    /// No knob jumps by this. A knob takes the scale of the device at its first reading, and a larger one only at a
    /// moment when that moves it by less than 1/256 of its range: at its lower end, or at the true upper one. Until
    /// then it stands at its upper end while it reads more than its scale, and that is counted. An 8-bit device stays
    /// at 1023 unless calibrated or told: small values alone do not show that larger ones never come.
    #[default]
    Learned,
    /// Set, 255 for eight bits. Zero counts as one. Larger values are cut and counted.
    Fixed(u16),
}

/// Scales by which devices are built.
const STEPS: [u16; 6] = [127, 255, 1023, 4095, 16383, 65535];
/// First guess for lines and Firmata, 10 bits: index into `STEPS`.
pub(super) const TEN_BITS: u8 = 2;
/// First guess for OSC integers, 7 bits: index into `STEPS`.
pub(super) const SEVEN_BITS: u8 = 0;
/// Knobs that learn one by one. Those beyond share a scale that never grows.
const KNOBS_MAX: usize = 128;
/// A knob not read yet.
const UNREAD: u8 = u8::MAX;
/// A scale is taken over where it moves the knob by less than one part of so many.
const STEADY_PARTS: u64 = 256;

/// Scales of one device: that of the device and those the knobs have taken.
#[derive(Debug, Clone)]
pub(super) struct Scales {
    mode: FullScale,
    first: u8,
    device: u8,
    knobs: [u8; KNOBS_MAX],
    /// All knobs from `KNOBS_MAX` on.
    beyond: u8,
}

impl Scales {
    /// `first` indexes `STEPS`.
    pub(super) const fn new(mode: FullScale, first: u8) -> Self {
        Self {
            mode,
            first,
            device: first,
            knobs: [UNREAD; KNOBS_MAX],
            beyond: UNREAD,
        }
    }

    pub(super) fn clear(&mut self) {
        *self = Self::new(self.mode, self.first);
    }

    /// Takes notice of a value, before any knob of the same message is read.
    pub(super) fn notice(&mut self, value: u16) {
        while value > STEPS[usize::from(self.device)] {
            self.device += 1;
        }
    }

    /// The full scale, where the caller set it.
    pub(super) fn fixed(&self) -> Option<u16> {
        match self.mode {
            FullScale::Learned => None,
            FullScale::Fixed(full_scale) => Some(full_scale.max(1)),
        }
    }

    /// Reads a knob; counts the value if it has to be cut.
    pub(super) fn read(&mut self, knob: u16, value: u16, counters: &mut Counters) -> Reading {
        let full_scale = self.fixed().unwrap_or_else(|| self.learned(knob, value));
        if value > full_scale {
            counters.clamp();
        }
        Reading::Position {
            value: value.min(full_scale),
            full_scale,
        }
    }

    fn learned(&mut self, knob: u16, value: u16) -> u16 {
        let device = self.device;
        let (taken, may_grow) = match self.knobs.get_mut(usize::from(knob)) {
            Some(taken) => (taken, true),
            None => (&mut self.beyond, false),
        };
        if *taken == UNREAD {
            *taken = device;
        } else if may_grow && *taken != device {
            let (old, new) = (
                u64::from(STEPS[usize::from(*taken)]),
                u64::from(STEPS[usize::from(device)]),
            );
            let value = u64::from(value);
            let difference = (value.min(old) * new).abs_diff(value * old);
            if difference * STEADY_PARTS < old * new {
                *taken = device;
            }
        }
        STEPS[usize::from(*taken)]
    }
}

/// A fraction of the full range as a reading. Range: cut to 0..=1 and counted; NaN is the caller's to refuse.
pub(super) fn fraction(value: f32, counters: &mut Counters) -> Reading {
    if !(0.0..=1.0).contains(&value) {
        counters.clamp();
    }
    Reading::Position {
        value: libm::roundf(value.clamp(0.0, 1.0) * 65535.0) as u16,
        full_scale: u16::MAX,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(scales: &mut Scales, knob: u16, value: u16) -> f64 {
        scales.notice(value);
        match scales.read(knob, value, &mut Counters::default()) {
            Reading::Position { value, full_scale } => f64::from(value) / f64::from(full_scale),
            Reading::Steps(_) => unreachable!("scales read positions"),
        }
    }

    #[test]
    fn a_growing_scale_moves_no_knob_by_more_than_its_hand() {
        let mut scales = Scales::new(FullScale::Learned, TEN_BITS);
        // One knob rests at half of ten bits; another sweeps twelve bits up, down, and up again.
        assert_eq!(ratio(&mut scales, 1, 512), 512.0 / 1023.0);
        let sweep = (0..=4095).chain((0..=4095).rev()).chain(0..=4095);
        let mut before = 0.0;
        for value in sweep {
            let now = ratio(&mut scales, 0, value);
            assert!(
                (now - before).abs() < 1.0 / 256.0 + 1.0 / 1023.0,
                "{value}: {before} to {now}"
            );
            before = now;
            assert_eq!(ratio(&mut scales, 1, 512), 512.0 / 1023.0);
        }
        assert_eq!(before, 1.0);
        assert_eq!(
            ratio(&mut scales, 0, 2048),
            2048.0 / 4095.0,
            "the top taught it twelve bits"
        );
        assert_eq!(
            ratio(&mut scales, 2, 2048),
            2048.0 / 4095.0,
            "a knob read later begins with them"
        );
        assert_eq!(ratio(&mut scales, 1, 0), 0.0);
        assert_eq!(
            ratio(&mut scales, 1, 512),
            512.0 / 4095.0,
            "its lower end taught the resting one"
        );
    }

    #[test]
    fn knobs_beyond_the_table_never_jump() {
        let mut scales = Scales::new(FullScale::Learned, TEN_BITS);
        assert_eq!(ratio(&mut scales, 500, 1023), 1.0);
        assert_eq!(ratio(&mut scales, 501, 4095), 1.0);
        assert_eq!(ratio(&mut scales, 500, 0), 0.0);
        assert_eq!(ratio(&mut scales, 500, 1023), 1.0);
    }

    #[test]
    fn what_is_too_large_is_cut_and_counted() {
        let mut counters = Counters::default();
        let mut scales = Scales::new(FullScale::Fixed(255), TEN_BITS);
        let full = Reading::Position {
            value: 255,
            full_scale: 255,
        };
        assert_eq!(scales.read(0, 300, &mut counters), full);
        assert_eq!(counters.clamped, 1);
        let zero = Scales::new(FullScale::Fixed(0), TEN_BITS).read(0, 7, &mut counters);
        assert_eq!(
            zero,
            Reading::Position {
                value: 1,
                full_scale: 1
            }
        );
        let half = fraction(0.5, &mut counters);
        assert_eq!(
            half,
            Reading::Position {
                value: 32768,
                full_scale: 65535
            }
        );
        fraction(-0.1, &mut counters);
        assert_eq!(counters.clamped, 3);
    }
}
