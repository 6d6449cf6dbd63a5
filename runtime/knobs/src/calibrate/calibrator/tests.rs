//! A simulated box under a simulated hand: what the calibrator must find, and what it must refuse.

use super::*;
use crate::fixture::Noise;

/// A potentiometer with a stop at either end, noise, and now and then a spike.
struct Pot {
    low: f32,
    high: f32,
    noise: f32,
    spikes: bool,
}

impl Pot {
    fn read(&self, at: f32, n: u32, random: &mut Noise) -> KnobEvent {
        let spike = if self.spikes && n % 97 == 50 { 1023.0 } else { 0.0 };
        let value = (self.low + (self.high - self.low) * at) + self.noise * random.next() + spike;
        reading(0, roundf(value.clamp(0.0, 1023.0)) as u16)
    }
}

fn reading(knob: u16, value: u16) -> KnobEvent {
    KnobEvent {
        knob,
        reading: Reading::Position {
            value,
            full_scale: 1023,
        },
    }
}

/// Rests a second at `start`, turns to both stops in two seconds, comes back and rests a second.
fn hand(start: f32, n: u32) -> f32 {
    match n {
        0..100 => start,
        100..300 => {
            let way = (n - 100) as f32 / 200.0;
            let swing = 0.5 - 0.75 * libm::sinf(way * core::f32::consts::TAU);
            swing.clamp(0.0, 1.0)
        }
        _ => start,
    }
}

fn calibrate(pot: &Pot, start: f32, end: f32) -> Result<KnobCalibration, CalibrationRefusal> {
    let mut trials = [KnobTrial::default(); 1];
    let mut calibrator = Calibrator::new(&mut trials, CalibrationSettings::default());
    let mut random = Noise::new(11);
    for n in 0..450 {
        let now_us = u64::from(n) * 10_000;
        let at = if n < 300 { hand(start, n) } else { end };
        calibrator.event(now_us, pot.read(at, n, &mut random));
        calibrator.advance(now_us);
    }
    calibrator.result(0)
}

#[test]
fn range_and_noise_are_found_in_spite_of_spikes() {
    for spikes in [false, true] {
        let pot = Pot {
            low: 12.0,
            high: 818.0,
            noise: 3.0,
            spikes,
        };
        let found = calibrate(&pot, 0.1, 0.9).unwrap();
        assert!((9..=15).contains(&found.lowest), "{found:?}");
        assert!((815..=821).contains(&found.highest), "{found:?}");
        assert!((2..=5).contains(&found.noise), "{found:?}");
        assert_eq!(found.centre, None);
        assert_eq!(found.full_scale, 1023);
    }
}

#[test]
fn a_knob_that_returns_to_its_middle_has_a_centre() {
    let pot = Pot {
        low: 0.0,
        high: 1000.0,
        noise: 2.0,
        spikes: false,
    };
    let found = calibrate(&pot, 0.45, 0.45).unwrap();
    assert!((446..=454).contains(&found.centre.unwrap()), "{found:?}");
    assert_eq!(calibrate(&pot, 0.45, 0.55).unwrap().centre, None, "left elsewhere");
    assert_eq!(calibrate(&pot, 0.1, 0.1).unwrap().centre, None, "an end is no centre");
}

#[test]
fn a_device_that_speaks_only_when_turned_is_calibrated_too() {
    let mut trials = [KnobTrial::default(); 2];
    let mut calibrator = Calibrator::new(&mut trials, CalibrationSettings::default());
    let fine = |value| KnobEvent {
        knob: 7,
        reading: Reading::Position { value, full_scale: 127 },
    };
    for value in 0..=127 {
        calibrator.event(u64::from(value) * 5_000, fine(value));
        calibrator.advance(u64::from(value) * 5_000);
    }
    assert_eq!(calibrator.progress(0).unwrap().progress, Progress::Settling);
    calibrator.event(700_000, fine(127));
    for n in 0..60 {
        calibrator.advance(700_000 + n * 20_000);
    }
    assert_eq!(calibrator.progress(0).unwrap().progress, Progress::Done);
    let found = calibrator.result(0).unwrap();
    assert_eq!((found.lowest, found.highest), (0, 127));
    assert!(found.noise <= 2, "{found:?}");
}

#[test]
fn refusals_say_what_to_do() {
    let refuse = |at: &dyn Fn(u32) -> f32, noise: f32| {
        let mut trials = [KnobTrial::default(); 1];
        let mut calibrator = Calibrator::new(&mut trials, CalibrationSettings::default());
        let mut random = Noise::new(1);
        let pot = Pot {
            low: 0.0,
            high: 1023.0,
            noise,
            spikes: false,
        };
        for n in 0..300 {
            calibrator.event(u64::from(n) * 10_000, pot.read(at(n), n, &mut random));
            calibrator.advance(u64::from(n) * 10_000);
        }
        calibrator.result(0).unwrap_err()
    };
    assert_eq!(refuse(&|_| 0.5, 2.0), CalibrationRefusal::Untouched);
    let small = refuse(&|n| 0.5 + 0.05 * libm::sinf(n as f32 / 20.0), 2.0);
    assert!(
        matches!(small, CalibrationRefusal::RangeTooSmall { covered, needed: 205 } if covered > 90 && covered < 115)
    );
    let restless = refuse(&|n| 0.5 + 0.5 * libm::sinf(n as f32 / 5.0), 2.0);
    assert_eq!(restless, CalibrationRefusal::NeverAtRest);
    assert_eq!(refuse(&|n| hand(0.2, n), 80.0), CalibrationRefusal::NeverAtRest);

    let mut trials = [KnobTrial::default(); 1];
    let mut calibrator = Calibrator::new(&mut trials, CalibrationSettings::default());
    assert_eq!(calibrator.result(0), Err(CalibrationRefusal::NoSuchKnob));
    let turn = KnobEvent {
        knob: 3,
        reading: Reading::Steps(1),
    };
    calibrator.event(0, turn);
    assert_eq!(calibrator.result(0), Err(CalibrationRefusal::Encoder));
    calibrator.event(0, reading(4, 1));
    assert_eq!((calibrator.knob_count(), calibrator.unlisted_events()), (1, 1));
}

#[test]
fn any_events_at_all_are_survived() {
    for seed in 0..50 {
        let mut random = Noise::new(seed);
        let mut trials = [KnobTrial::default(); 5];
        let mut calibrator = Calibrator::new(&mut trials, CalibrationSettings::default());
        let mut word = || (random.next() * 32_768.0) as i16;
        for _ in 0..500 {
            let now_us = word().unsigned_abs().into();
            let reading = match word() % 3 {
                0 => Reading::Steps(word()),
                _ => Reading::Position {
                    value: word().cast_unsigned(),
                    full_scale: word().cast_unsigned(),
                },
            };
            calibrator.event(
                now_us,
                KnobEvent {
                    knob: word().cast_unsigned() % 8,
                    reading,
                },
            );
            calibrator.advance(now_us);
        }
        for index in 0..6 {
            if let Ok(calibration) = calibrator.result(index) {
                assert!(calibration.is_valid(), "{calibration:?}");
            }
        }
    }
}
