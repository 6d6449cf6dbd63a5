//! From readings that tremble to a position that moves or stands still: a deadband as wide as the measured noise, then a
//! One-Euro filter in seconds, not frames. Between calibration and takeover.
//!
//! Source of the filter: Casiez, Roussel, Vogel, *1 € Filter*, CHI 2012. Its smoothing factor is replaced by the exact one
//! of a first-order low pass, `1 - exp(-2 pi f dt)`, which gives the same curve at every frame rate.

use libm::{expm1f, fabsf};

/// Holds a position still while the reading stays within a band around it. The band is carried along (play, as of a gear),
/// so that a moving knob keeps every step of its converter.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deadband {
    held: f32,
}

impl Deadband {
    /// A deadband around `position`.
    pub fn at(position: f32) -> Self {
        Self { held: position }
    }

    /// The position held.
    pub fn position(&self) -> f32 {
        self.held
    }

    /// Takes a position and returns the one to use: within `band` of it, and **exactly** on 0, 1 and, if `centred`, 0.5
    /// where the position is exactly there. Range: both in `[0, 1]`.
    pub fn update(&mut self, position: f32, band: f32, centred: bool) -> f32 {
        let at_stop = position <= 0.0 || position >= 1.0 || (centred && position == 0.5);
        self.held = if at_stop {
            position
        } else {
            self.held.clamp(position - band, position + band).clamp(0.0, 1.0)
        };
        self.held
    }
}

/// How a knob is smoothed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothing {
    /// Cut-off of a knob that barely moves, Hz: less is calmer and later. Range: `[0.01, 1000]`.
    pub minimum_cutoff_hz: f32,
    /// Hz of cut-off added for each travel a second of speed: more follows a fast hand closer. Range: `[0, 10000]`.
    pub speed_gain: f32,
    /// Cut-off of the speed estimate, Hz. Range: `[0.01, 1000]`.
    pub speed_cutoff_hz: f32,
}

impl Default for Smoothing {
    /// 26 ms of lag when slow, 5 ms at one travel a second.
    fn default() -> Self {
        Self {
            minimum_cutoff_hz: 6.0,
            speed_gain: 25.0,
            speed_cutoff_hz: 2.0,
        }
    }
}

impl Smoothing {
    /// Whether every number is in its range.
    pub fn is_valid(&self) -> bool {
        let cutoff = 0.01..=1000.0;
        cutoff.contains(&self.minimum_cutoff_hz)
            && cutoff.contains(&self.speed_cutoff_hz)
            && (0.0..=10_000.0).contains(&self.speed_gain)
    }
}

/// Closer than this the output is put on the input: half a step of fourteen bits. What would creep for ever rests.
pub const REST_DISTANCE: f32 = 1.0 / 32_768.0;

/// State of a One-Euro filter. Starts at its first input.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OneEuro {
    input: f32,
    output: f32,
    /// Travels a second, smoothed.
    speed: f32,
}

impl OneEuro {
    /// At rest on `position`.
    pub fn at(position: f32) -> Self {
        Self {
            input: position,
            output: position,
            speed: 0.0,
        }
    }

    /// Where it is.
    pub fn output(&self) -> f32 {
        self.output
    }

    /// Moves on by `dt_s` seconds with the input at `input`; returns the output. No time, no move.
    pub fn advance(&mut self, smoothing: &Smoothing, input: f32, dt_s: f32) -> f32 {
        if dt_s <= 0.0 {
            return self.output;
        }
        let speed = (input - self.input) / dt_s;
        self.input = input;
        self.speed += low_pass(smoothing.speed_cutoff_hz, dt_s) * (speed - self.speed);
        let cutoff_hz = smoothing.minimum_cutoff_hz + smoothing.speed_gain * fabsf(self.speed);
        self.output += low_pass(cutoff_hz, dt_s) * (input - self.output);
        if fabsf(input - self.output) <= REST_DISTANCE {
            self.output = input;
        }
        self.output
    }

    /// Moves the origin, so that a turn without end keeps its digits.
    pub(crate) fn shift(&mut self, by: f32) {
        self.input -= by;
        self.output -= by;
    }
}

/// Share of the way that a first-order low pass goes in `dt_s`.
fn low_pass(cutoff_hz: f32, dt_s: f32) -> f32 {
    -expm1f(-core::f32::consts::TAU * cutoff_hz * dt_s)
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::fixture::Noise;

    /// Position of a hand that turns up and back in half a second, twice.
    fn hand(t: f32) -> f32 {
        let phase = if t < 1.0 { t } else { 1.0 };
        0.5 - 0.4 * libm::cosf(phase * 2.0 * core::f32::consts::TAU)
    }

    #[test]
    fn the_same_hand_gives_the_same_curve_at_any_frame_rate() {
        // The curve at 960 frames a second is the yardstick; the input is what a frame sees at its own time.
        let at = |fps: u32| -> Vec<f32> {
            let mut filter = OneEuro::at(hand(0.0));
            let outputs = (1..=fps * 2).map(|n| {
                let t = n as f32 / fps as f32;
                filter.advance(&Smoothing::default(), hand(t), 1.0 / fps as f32)
            });
            let outputs: Vec<f32> = outputs.collect();
            outputs
                .chunks(fps as usize / 30)
                .map(|chunk| *chunk.last().unwrap())
                .collect()
        };
        let yardstick = at(960);
        // The delay of seeing a hand only once a frame: half a frame of one that does five travels a second.
        for (fps, tolerance) in [(30, 0.5 / 30.0 * 5.1), (60, 0.5 / 60.0 * 5.1), (240, 0.5 / 240.0 * 5.1)] {
            let largest = at(fps)
                .iter()
                .zip(&yardstick)
                .map(|(a, b)| fabsf(a - b))
                .fold(0.0, f32::max);
            assert!(largest < tolerance, "{fps} frames a second are {largest} away");
        }
    }

    #[test]
    fn a_step_arrives_without_overshoot_and_exactly() {
        for fps in [24, 30, 60, 144, 240, 1000] {
            let mut filter = OneEuro::at(0.0);
            let mut before = 0.0;
            let mut settled = None;
            for n in 1..=2 * fps {
                let output = filter.advance(&Smoothing::default(), 1.0, 1.0 / fps as f32);
                assert!((before..=1.0).contains(&output), "monotone, no overshoot");
                before = output;
                if output == 1.0 && settled.is_none() {
                    settled = Some(n as f32 / fps as f32);
                }
            }
            assert!(settled.unwrap() < 0.4, "{fps}: {settled:?}");
        }
        // A slow step, one hundredth, gets no speed bonus to speak of: still under half a second.
        let mut filter = OneEuro::at(0.5);
        let frames = (1..).find(|_| filter.advance(&Smoothing::default(), 0.51, 1.0 / 60.0) == 0.51);
        assert!(frames.unwrap() < 30, "{frames:?}");
    }

    #[test]
    fn noise_at_rest_gives_one_value_and_a_turn_keeps_its_steps() {
        let mut noise = Noise::new(3);
        let band = 0.003;
        let (mut deadband, mut filter) = (Deadband::at(0.4), OneEuro::at(0.4));
        let mut outputs = Vec::new();
        for _ in 0..5000 {
            let held = deadband.update(0.4 + 0.002 * noise.next(), band, false);
            outputs.push(filter.advance(&Smoothing::default(), held, 1.0 / 60.0));
        }
        assert!(outputs[1000..].iter().all(|&x| x == outputs[1000]), "not a bit moves");

        // Fourteen bits without noise: each step of a turn shows.
        let mut deadband = Deadband::at(0.25);
        let mut before = deadband.update(0.25, 0.0, false);
        for step in 4097..8192 {
            let held = deadband.update(step as f32 / 16_383.0, 0.0, false);
            assert!(held > before);
            before = held;
        }
        // And with a band, once the play is taken up.
        let mut deadband = Deadband::at(0.25);
        let held = [0.251, 0.252, 0.253, 0.254, 0.255, 0.256].map(|x| deadband.update(x, 0.003, false));
        assert!(held[2] < held[3] && held[3] < held[4] && held[4] < held[5]);
    }

    #[test]
    fn the_filter_alone_calms_what_the_deadband_lets_through() {
        let mut noise = Noise::new(5);
        let mut filter = OneEuro::at(0.5);
        let (mut raw, mut calm) = (0.0, 0.0);
        for _ in 0..6000 {
            let input = 0.5 + 0.002 * noise.next();
            let output = filter.advance(&Smoothing::default(), input, 1.0 / 120.0);
            raw += (input - 0.5) * (input - 0.5);
            calm += (output - 0.5) * (output - 0.5);
        }
        assert!(calm < 0.4 * raw, "variance {calm} of {raw}");
    }

    #[test]
    fn stops_are_exact_and_hold_against_noise() {
        let mut deadband = Deadband::at(0.9);
        assert_eq!(deadband.update(1.0, 0.01, false), 1.0);
        assert_eq!(deadband.update(0.995, 0.01, false), 1.0);
        assert!(deadband.update(0.98, 0.01, false) < 1.0);
        assert_eq!(deadband.update(0.0, 0.01, false), 0.0);
        assert_eq!(deadband.update(0.5, 0.01, true), 0.5);
        assert_eq!(deadband.update(0.509, 0.01, true), 0.5);
        assert_ne!(Deadband::at(0.6).update(0.5, 0.01, false), 0.5);
    }

    #[test]
    fn no_time_no_move() {
        let mut filter = OneEuro::at(0.2);
        assert_eq!(filter.advance(&Smoothing::default(), 0.9, 0.0), 0.2);
        assert!(filter.advance(&Smoothing::default(), 0.9, 0.01) > 0.2);
    }
}
