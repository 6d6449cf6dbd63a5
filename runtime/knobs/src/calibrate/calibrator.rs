//! Measures every knob of a device while a person turns each once from stop to stop: range without spikes, noise at rest, the
//! centre of knobs that have one.

use core::fmt;

use libm::{fabsf, roundf};

use super::KnobCalibration;
use crate::{KnobEvent, Reading};

/// How strict the measuring is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationSettings {
    /// Least part of the full scale that a turn must cover. Default 0.2.
    pub least_range: f32,
    /// How long a knob must stand still for its noise to be believed, µs. Default half a second.
    pub rest_us: u64,
    /// Most that a resting knob may deviate from its mean, part of the full scale; more is a hand. Default 0.02.
    pub most_noise: f32,
}

impl Default for CalibrationSettings {
    fn default() -> Self {
        Self {
            least_range: 0.2,
            rest_us: 500_000,
            most_noise: 0.02,
        }
    }
}

/// Fewest readings of a rest, for devices that send all the time; the third largest deviation means little among fewer.
const REST_READINGS: u32 = 24;
/// Readings that settle the mean of a rest before deviations from it count.
const MEAN_READINGS: u32 = 8;

/// How far a knob is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It was heard and has not been turned.
    Untouched,
    /// It is being turned, or has not yet covered enough of its range.
    Turning,
    /// It covered its range and has not yet stood still since.
    Settling,
    /// Measured. Turning it on only improves the result.
    Done,
}

/// One knob's progress, for a display.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KnobProgress {
    /// Address on the device.
    pub knob: u16,
    /// How far it is.
    pub progress: Progress,
    /// Largest value of its device.
    pub full_scale: u16,
    /// Lowest reading so far that was no spike.
    pub lowest: u16,
    /// Highest reading so far that was no spike.
    pub highest: u16,
    /// Noise measured, if it has stood still.
    pub noise: Option<u16>,
}

/// Why there is no calibration of a knob.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CalibrationRefusal {
    /// There is no knob of this index.
    NoSuchKnob,
    /// It is an encoder: it counts steps and has nothing to calibrate.
    Encoder,
    /// It was never turned.
    Untouched,
    /// It was turned, but not far enough.
    RangeTooSmall {
        /// Steps it covered.
        covered: u16,
        /// Steps it should cover.
        needed: u16,
    },
    /// It never stood still for long enough: a loose contact, or a hand that did not let go.
    NeverAtRest,
    /// Its noise leaves no range between the stops.
    TooNoisy {
        /// Noise, steps.
        noise: u16,
    },
}

impl core::error::Error for CalibrationRefusal {}

impl fmt::Display for CalibrationRefusal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSuchKnob => write!(out, "no such knob was heard"),
            Self::Encoder => write!(out, "an encoder needs no calibration"),
            Self::Untouched => write!(out, "it was not turned; turn it from stop to stop"),
            Self::RangeTooSmall { covered, needed } => {
                write!(
                    out,
                    "it covered {covered} steps of at least {needed}; turn it from stop to stop"
                )
            }
            Self::NeverAtRest => write!(out, "it never stood still; let go of it, and check its contacts"),
            Self::TooNoisy { noise } => write!(out, "its readings tremble by {noise} steps, which leaves no range"),
        }
    }
}

/// What the calibrator remembers of one knob.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KnobTrial {
    knob: u16,
    full_scale: u16,
    encoder: bool,
    readings: u32,
    /// The last three, for their median: one spike never is it.
    last: [f32; 3],
    lowest: f32,
    highest: f32,
    rest: Rest,
    /// Mean of the first rest and of the last.
    first_rest: Option<f32>,
    last_rest: Option<f32>,
    noise: f32,
}

/// A stretch of time in which the knob may be standing still.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Rest {
    since_us: u64,
    readings: u32,
    mean: f32,
    /// The mean when it had settled; one that has moved since is a slow hand.
    early_mean: f32,
    /// Largest deviations, descending. The third is the noise: it outlives two spikes.
    deviations: [f32; 3],
}

impl Rest {
    fn start(now_us: u64, value: f32) -> Self {
        Self {
            since_us: now_us,
            readings: 1,
            mean: value,
            early_mean: value,
            deviations: [0.0; 3],
        }
    }

    fn add(&mut self, value: f32) {
        self.readings += 1;
        let off = fabsf(value - self.mean);
        // A spike must not pull the mean; a run of high readings ends the rest anyway.
        if self.readings <= MEAN_READINGS || off <= 1.0 + 2.0 * self.deviations[1] {
            self.mean += (value - self.mean) / self.readings.min(64) as f32;
        }
        if self.readings <= MEAN_READINGS {
            self.early_mean = self.mean;
            return;
        }
        let [a, b, c] = self.deviations;
        self.deviations = match off {
            _ if off > a => [off, a, b],
            _ if off > b => [a, off, b],
            _ if off > c => [a, b, off],
            _ => [a, b, c],
        };
    }

    fn noise(&self) -> f32 {
        self.deviations[2]
    }
}

impl KnobTrial {
    fn span(&self) -> f32 {
        self.highest - self.lowest
    }

    fn covered(&self, settings: &CalibrationSettings) -> bool {
        self.span() >= settings.least_range * f32::from(self.full_scale)
    }

    /// Looked at a tenth of its range, a knob was turned.
    fn touched(&self) -> bool {
        self.span() > 0.05 * f32::from(self.full_scale)
    }

    fn add(&mut self, now_us: u64, value: f32, settings: &CalibrationSettings) {
        self.readings = self.readings.saturating_add(1);
        self.last = [self.last[1], self.last[2], value];
        if self.readings == 1 {
            self.last = [value; 3];
            (self.lowest, self.highest) = (value, value);
            self.rest = Rest::start(now_us, value);
            return;
        }
        let [a, b, c] = self.last;
        let median = a.max(b).min(a.min(b).max(c));
        self.lowest = self.lowest.min(median);
        self.highest = self.highest.max(median);
        self.rest.add(value);
        if self.rest.noise() > settings.most_noise * f32::from(self.full_scale) {
            self.rest = Rest::start(now_us, value);
        } else {
            self.close_rest(now_us, self.rest.readings >= REST_READINGS, settings);
        }
    }

    /// Believes the rest if it is long enough, and starts the next.
    fn close_rest(&mut self, now_us: u64, enough: bool, settings: &CalibrationSettings) {
        if !enough || now_us.saturating_sub(self.rest.since_us) < settings.rest_us {
            return;
        }
        let mean = self.rest.mean;
        if fabsf(mean - self.rest.early_mean) > 1.0 + 0.5 * self.rest.noise() {
            self.rest = Rest::start(now_us, mean);
            return;
        }
        self.noise = self.noise.max(self.rest.noise());
        if self.first_rest.is_none() && !self.touched() {
            self.first_rest = Some(mean);
        }
        if self.covered(settings) {
            self.last_rest = Some(mean);
        }
        self.rest = Rest::start(now_us, mean);
    }

    fn progress(&self, settings: &CalibrationSettings) -> Progress {
        match (self.touched(), self.covered(settings), self.last_rest.is_some()) {
            (false, ..) => Progress::Untouched,
            (true, false, _) => Progress::Turning,
            (true, true, false) => Progress::Settling,
            (true, true, true) => Progress::Done,
        }
    }

    fn result(&self, settings: &CalibrationSettings) -> Result<KnobCalibration, CalibrationRefusal> {
        if self.encoder {
            return Err(CalibrationRefusal::Encoder);
        }
        match self.progress(settings) {
            Progress::Untouched => return Err(CalibrationRefusal::Untouched),
            Progress::Turning => {
                return Err(CalibrationRefusal::RangeTooSmall {
                    covered: steps(self.span()),
                    needed: steps(settings.least_range * f32::from(self.full_scale)),
                });
            }
            Progress::Settling => return Err(CalibrationRefusal::NeverAtRest),
            Progress::Done => {}
        }
        let noise = steps(libm::ceilf(self.noise));
        let mut calibration = KnobCalibration {
            full_scale: self.full_scale,
            lowest: steps(self.lowest),
            highest: steps(self.highest).min(self.full_scale),
            centre: None,
            noise,
        };
        if !calibration.is_valid() {
            return Err(CalibrationRefusal::TooNoisy { noise });
        }
        // It came back to where it stood, near the middle: a spring or a detent brought it there.
        if let (Some(first), Some(last)) = (self.first_rest, self.last_rest) {
            let middle = (last - self.lowest) / self.span();
            let same = fabsf(first - last) <= (2.0 * self.noise).max(0.01 * self.span());
            let centred = KnobCalibration {
                centre: Some(steps(last)),
                ..calibration
            };
            if same && (0.3..=0.7).contains(&middle) && centred.is_valid() {
                calibration = centred;
            }
        }
        Ok(calibration)
    }
}

fn steps(value: f32) -> u16 {
    roundf(value).clamp(0.0, f32::from(u16::MAX)) as u16
}

/// Takes events while a person turns every knob of one device once from stop to stop; says how far each is. Knobs are listed
/// in order of appearance.
#[derive(Debug)]
pub struct Calibrator<'m> {
    trials: &'m mut [KnobTrial],
    count: usize,
    settings: CalibrationSettings,
    unlisted_events: u64,
}

impl<'m> Calibrator<'m> {
    /// Starts anew. Shape: `trials` has room for as many knobs as should be measured.
    pub fn new(trials: &'m mut [KnobTrial], settings: CalibrationSettings) -> Self {
        trials.fill(KnobTrial::default());
        Self {
            trials,
            count: 0,
            settings,
            unlisted_events: 0,
        }
    }

    /// Takes what a knob says. Events of knobs that find no room are counted.
    pub fn event(&mut self, now_us: u64, event: KnobEvent) {
        let listed = self.trials[..self.count]
            .iter()
            .position(|trial| trial.knob == event.knob);
        let index = match listed {
            Some(index) => index,
            None if self.count < self.trials.len() => {
                self.trials[self.count].knob = event.knob;
                self.count += 1;
                self.count - 1
            }
            None => {
                self.unlisted_events += 1;
                return;
            }
        };
        let trial = &mut self.trials[index];
        match event.reading {
            Reading::Steps(_) => trial.encoder = true,
            Reading::Position { value, full_scale } => {
                // A device that turns out to have a wider scale starts over on it.
                if full_scale > trial.full_scale {
                    *trial = KnobTrial {
                        knob: event.knob,
                        full_scale,
                        ..KnobTrial::default()
                    };
                }
                let scale = f32::from(trial.full_scale) / f32::from(full_scale.max(1));
                let value = f32::from(value) * scale;
                trial.add(now_us, value, &self.settings);
            }
        }
    }

    /// Tells the time, about as often as a display is drawn: a knob that sends nothing any more stands still.
    pub fn advance(&mut self, now_us: u64) {
        for trial in &mut self.trials[..self.count] {
            let silent = trial.rest.readings == 1 || trial.rest.noise() == 0.0;
            trial.close_rest(now_us, silent && trial.readings > 0, &self.settings);
        }
    }

    /// Knobs heard.
    pub fn knob_count(&self) -> usize {
        self.count
    }

    /// Events of knobs that found no room.
    pub fn unlisted_events(&self) -> u64 {
        self.unlisted_events
    }

    /// Progress of the knob at `index`, in order of appearance.
    pub fn progress(&self, index: usize) -> Option<KnobProgress> {
        let trial = self.trials[..self.count].get(index)?;
        Some(KnobProgress {
            knob: trial.knob,
            progress: trial.progress(&self.settings),
            full_scale: trial.full_scale,
            lowest: steps(trial.lowest),
            highest: steps(trial.highest).min(trial.full_scale),
            noise: trial
                .last_rest
                .or(trial.first_rest)
                .map(|_| steps(libm::ceilf(trial.noise))),
        })
    }

    /// The measured calibration of the knob at `index`.
    ///
    /// # Errors
    /// A [`CalibrationRefusal`], worded for the person at the knobs.
    pub fn result(&self, index: usize) -> Result<KnobCalibration, CalibrationRefusal> {
        let trial = self.trials[..self.count]
            .get(index)
            .ok_or(CalibrationRefusal::NoSuchKnob)?;
        trial.result(&self.settings)
    }
}

#[cfg(test)]
mod tests;
