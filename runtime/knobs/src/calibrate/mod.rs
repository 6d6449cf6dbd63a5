//! Calibration: what one knob of one device really sends, and the way from its readings to a position that reaches 0 and 1.
//! Measured by a [`Calibrator`] while every knob is turned once; stored by the caller, per device.

mod calibrator;

pub use calibrator::{CalibrationRefusal, CalibrationSettings, Calibrator, KnobProgress, KnobTrial, Progress};

/// What one knob sends. All in steps of `full_scale`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct KnobCalibration {
    /// The largest value that its device can send; readings on another scale are converted.
    pub full_scale: u16,
    /// Reading at the lower stop.
    pub lowest: u16,
    /// Reading at the upper stop.
    pub highest: u16,
    /// Reading where it comes to rest by itself (detent, spring); that becomes position 0.5.
    pub centre: Option<u16>,
    /// Largest deviation of a resting knob from its mean.
    pub noise: u16,
}

/// Parts of the range given up at each stop, so that a stop is reached on a bad day as well.
const STOP_MARGIN: f32 = 1.0 / 400.0;
/// Half width of the centre's flat, parts of the range.
const CENTRE_MARGIN: f32 = 1.0 / 100.0;
/// Deadband over noise: the band must hold the noise on both sides with room to spare.
const BAND_OVER_NOISE: f32 = 1.5;

impl KnobCalibration {
    /// For a knob that nobody calibrated: the whole scale; noise as of the common ten- and twelve-bit converters, none for
    /// the seven bits of a MIDI controller.
    pub const fn assumed(full_scale: u16) -> Self {
        let noise = full_scale / 500;
        Self {
            full_scale,
            lowest: 0,
            highest: full_scale,
            centre: None,
            noise: if noise > 8 { 8 } else { noise },
        }
    }

    /// Whether stops, centre and noise leave a range to turn in: both halves of it, if there is a centre, outside the flats.
    pub fn is_valid(&self) -> bool {
        let [low, high] = self.stops();
        if self.lowest >= self.highest || self.highest > self.full_scale || low >= high {
            return false;
        }
        match self.centre {
            None => true,
            Some(centre) => {
                let zone = self.centre_zone();
                low < f32::from(centre) - zone && f32::from(centre) + zone < high
            }
        }
    }

    fn range(&self) -> f32 {
        f32::from(self.highest) - f32::from(self.lowest)
    }

    /// Readings at and beyond which the position is 0 and 1.
    fn stops(&self) -> [f32; 2] {
        let margin = f32::from(self.noise) + STOP_MARGIN * self.range();
        [f32::from(self.lowest) + margin, f32::from(self.highest) - margin]
    }

    fn centre_zone(&self) -> f32 {
        (2.0 * f32::from(self.noise)).max(CENTRE_MARGIN * self.range())
    }

    /// Position of a reading, in `[0, 1]`: 0 and 1 exactly at the stops, 0.5 exactly at the centre. `steps` counts steps of
    /// `full_scale`, at full supply.
    pub fn position(&self, steps: f32) -> f32 {
        let [low, high] = self.stops();
        let position = match self.centre {
            None => (steps - low) / (high - low),
            Some(centre) => {
                let (zone, centre) = (self.centre_zone(), f32::from(centre));
                if steps < centre - zone {
                    0.5 * (steps - low) / (centre - zone - low)
                } else if steps > centre + zone {
                    0.5 + 0.5 * (steps - centre - zone) / (high - centre - zone)
                } else {
                    0.5
                }
            }
        };
        position.clamp(0.0, 1.0)
    }

    /// Half width of the deadband, in positions; 0 for a knob without noise.
    pub fn deadband(&self) -> f32 {
        let [low, high] = self.stops();
        BAND_OVER_NOISE * f32::from(self.noise) / (high - low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POT: KnobCalibration = KnobCalibration {
        full_scale: 1023,
        lowest: 7,
        highest: 818,
        centre: None,
        noise: 3,
    };

    #[test]
    fn the_stops_are_reached_exactly_in_spite_of_noise() {
        for noise in -3_i32..=3 {
            assert_eq!(POT.position((7 + noise) as f32), 0.0);
            assert_eq!(POT.position((818 + noise) as f32), 1.0);
        }
        assert!(POT.position(500.0) > 0.5);
    }

    #[test]
    fn positions_rise_and_waste_no_step() {
        let fine = KnobCalibration::assumed(16_383);
        let exact = KnobCalibration { noise: 0, ..fine };
        for calibration in [
            POT,
            fine,
            exact,
            KnobCalibration {
                centre: Some(300),
                ..POT
            },
        ] {
            let mut flat = 0;
            let mut before = calibration.position(0.0);
            for step in 1..=calibration.full_scale {
                let position = calibration.position(f32::from(step));
                assert!(position >= before);
                flat += u32::from(position == before && calibration.lowest < step && step < calibration.highest);
                before = position;
            }
            let given_up = 2.0 * STOP_MARGIN + if calibration.centre.is_some() { 0.04 } else { 0.0 };
            let most = given_up * calibration.range() + 2.0 * f32::from(calibration.noise) + 2.0;
            assert!(flat as f32 <= most, "{calibration:?} wastes {flat} steps of {most}");
        }
    }

    #[test]
    fn the_centre_is_exact_wherever_it_lies() {
        let joystick = KnobCalibration {
            centre: Some(300),
            ..POT
        };
        assert!(joystick.is_valid());
        for reading in 295..=305 {
            assert_eq!(joystick.position(reading as f32), 0.5);
        }
        assert!(joystick.position(290.0) < 0.5 && joystick.position(320.0) > 0.5);
        assert_eq!((joystick.position(7.0), joystick.position(818.0)), (0.0, 1.0));
    }

    #[test]
    fn validity() {
        assert!(POT.is_valid());
        for full_scale in [127, 255, 1023, 4095, 16_383, 65_535] {
            assert!(KnobCalibration::assumed(full_scale).is_valid());
        }
        assert!(!KnobCalibration { lowest: 818, ..POT }.is_valid());
        assert!(!KnobCalibration { highest: 1024, ..POT }.is_valid());
        assert!(!KnobCalibration { noise: 500, ..POT }.is_valid());
        assert!(!KnobCalibration { noise: u16::MAX, ..POT }.is_valid());
        assert!(!KnobCalibration { centre: Some(9), ..POT }.is_valid());
        assert!(
            !KnobCalibration {
                centre: Some(816),
                ..POT
            }
            .is_valid()
        );
        assert!(!KnobCalibration::assumed(0).is_valid());
    }
}
