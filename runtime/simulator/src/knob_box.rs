//! The box itself, without a port: hands and faults in, bytes out. Its time is the caller's, so the same seed and the same
//! commands give the same bytes, however the caller's steps fall.

use core::fmt;
use core::time::Duration;
use std::collections::VecDeque;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::dialect::{Dialect, Speaker};
use crate::script::{Command, Script};

/// What kind of box it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoxSettings {
    /// What it speaks.
    pub dialect: Dialect,
    /// How many knobs it has, from 1 to [`Dialect::knobs_max`].
    pub knob_count: u16,
    /// Reports a second, 1 to 100,000.
    pub rate_hz: u32,
    /// Seed of everything that is random.
    pub seed: u64,
}

impl Default for BoxSettings {
    /// Eight deej sliders that report every 10 ms.
    fn default() -> Self {
        Self {
            dialect: Dialect::Deej,
            knob_count: 8,
            rate_hz: 100,
            seed: 1,
        }
    }
}

/// Why there is no such box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoxError {
    /// It cannot have so many knobs.
    KnobCount {
        /// How many were asked for.
        asked: u16,
        /// The most that its dialect can speak of.
        most: u16,
    },
    /// It cannot report so often.
    Rate {
        /// Reports a second that were asked for.
        asked: u32,
    },
}

impl core::error::Error for BoxError {}

impl fmt::Display for BoxError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::KnobCount { asked, most } => write!(out, "such a box has 1 to {most} knobs, not {asked}"),
            Self::Rate { asked } => write!(out, "a box reports 1 to {RATE_MAX} times a second, not {asked} times"),
        }
    }
}

const RATE_MAX: u32 = 100_000;
/// A wandering knob takes this long from one place to the next, s.
const WANDER_S: core::ops::Range<f32> = 0.8..3.0;

/// What the box does at its port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output<'a> {
    /// It sends.
    Bytes(&'a [u8]),
    /// Its cable is pulled.
    Unplug,
    /// Its cable is back.
    Plug,
}

/// A knob on its way.
#[derive(Debug, Clone, Copy)]
struct Knob {
    from: f32,
    to: f32,
    start_us: u64,
    time_us: u64,
    /// A hand turns evenly; a wandering knob starts and stops softly.
    soft: bool,
}

impl Knob {
    const fn at(position: f32) -> Self {
        Self {
            from: position,
            to: position,
            start_us: 0,
            time_us: 0,
            soft: false,
        }
    }

    fn position(&self, now_us: u64) -> f32 {
        let passed = now_us.saturating_sub(self.start_us);
        if passed >= self.time_us {
            return self.to;
        }
        let t = passed as f32 / self.time_us as f32;
        let t = if self.soft { t * t * (3.0 - 2.0 * t) } else { t };
        self.from + (self.to - self.from) * t
    }

    fn rests(&self, now_us: u64) -> bool {
        now_us >= self.start_us + self.time_us
    }
}

/// A simulated box.
#[derive(Debug)]
pub struct KnobBox {
    settings: BoxSettings,
    random: ChaCha8Rng,
    speaker: Speaker,
    knobs: Vec<Knob>,
    wanders: bool,
    noise: f32,
    supply: f32,
    next_report_us: u64,
    interval_us: f64,
    /// Reports since the rate was set, so that odd rates do not drift.
    rate_since_us: u64,
    rate_reports: u64,
    garbage: u32,
    cut: bool,
    frozen_until_us: u64,
    frozen: Option<Vec<u16>>,
    silent_until_us: u64,
    /// When the cable comes back.
    plug_at_us: Option<u64>,
    powered: bool,
    agenda: VecDeque<(u64, Command)>,
    script: Option<(u64, Script)>,
    bytes: Vec<u8>,
}

fn micros(time: Duration) -> u64 {
    time.as_micros() as u64
}

impl KnobBox {
    /// A box whose knobs all stand in the middle, plugged in at time 0.
    ///
    /// # Errors
    /// [`BoxError`].
    pub fn new(settings: BoxSettings) -> Result<Self, BoxError> {
        let most = settings.dialect.knobs_max();
        if settings.knob_count == 0 || settings.knob_count > most {
            let asked = settings.knob_count;
            return Err(BoxError::KnobCount { asked, most });
        }
        if settings.rate_hz == 0 || settings.rate_hz > RATE_MAX {
            let asked = settings.rate_hz;
            return Err(BoxError::Rate { asked });
        }
        let knob_count = settings.knob_count.into();
        Ok(Self {
            settings,
            random: ChaCha8Rng::seed_from_u64(settings.seed),
            speaker: Speaker::new(settings.dialect, knob_count),
            knobs: vec![Knob::at(0.5); knob_count],
            wanders: false,
            noise: 0.0,
            supply: 1.0,
            next_report_us: 0,
            interval_us: 1e6 / f64::from(settings.rate_hz),
            rate_since_us: 0,
            rate_reports: 0,
            garbage: 0,
            cut: false,
            frozen_until_us: 0,
            frozen: None,
            silent_until_us: 0,
            plug_at_us: None,
            powered: false,
            agenda: VecDeque::new(),
            script: None,
            bytes: Vec::new(),
        })
    }

    /// What it is.
    pub const fn settings(&self) -> &BoxSettings {
        &self.settings
    }

    /// Where a knob stands, in `[0, 1]`, whatever the box says of it.
    pub fn position(&self, knob: u16, now_us: u64) -> Option<f32> {
        Some(self.knobs.get(usize::from(knob))?.position(now_us))
    }

    /// Has a command carried out at a time that has not passed yet, behind those that are due then already.
    pub fn command(&mut self, at_us: u64, command: Command) {
        let place = self.agenda.partition_point(|(due_us, _)| *due_us <= at_us);
        self.agenda.insert(place, (at_us, command));
    }

    /// Runs a script from a time on.
    pub fn run_script(&mut self, from_us: u64, script: Script) {
        for (time, command) in script.steps() {
            self.command(from_us + micros(*time), *command);
        }
        self.script = script.repeats().then(|| (from_us + micros(script.length()), script));
    }

    /// Whether a script still has something to do.
    pub fn has_agenda(&self) -> bool {
        !self.agenda.is_empty() || self.script.is_some()
    }

    /// What the host wrote: requests for a HELLO, Firmata's for reports.
    pub fn heard(&mut self, bytes: &[u8]) {
        if self.powered {
            self.speaker.heard(bytes);
        }
    }

    /// Lets time pass; `sink` gets everything that the box does until then, in order.
    pub fn advance(&mut self, now_us: u64, sink: &mut impl FnMut(Output<'_>)) {
        loop {
            if let Some((end_us, _)) = self.script
                && end_us <= now_us
                && self.agenda.front().is_none_or(|(due_us, _)| *due_us >= end_us)
                && let Some((end_us, script)) = self.script.take()
            {
                self.run_script(end_us, script);
            }
            let command_us = self.agenda.front().map_or(u64::MAX, |(due_us, _)| *due_us);
            let plug_us = self.plug_at_us.unwrap_or(u64::MAX);
            let next_us = command_us.min(plug_us).min(self.next_report_us);
            if next_us > now_us {
                return;
            }
            if command_us == next_us {
                if let Some((at_us, command)) = self.agenda.pop_front() {
                    self.obey(at_us, command, sink);
                }
            } else if plug_us == next_us {
                self.plug_at_us = None;
                sink(Output::Plug);
            } else {
                self.rate_reports += 1;
                self.next_report_us = self.rate_since_us + (self.rate_reports as f64 * self.interval_us) as u64;
                self.report(next_us, sink);
            }
        }
    }

    fn obey(&mut self, at_us: u64, command: Command, sink: &mut impl FnMut(Output<'_>)) {
        match command {
            Command::Turn { knob, from, to, time } => {
                // A knob that the box does not have: nobody can turn it.
                if let Some(knob) = self.knobs.get_mut(usize::from(knob)) {
                    *knob = Knob {
                        from,
                        to,
                        start_us: at_us,
                        time_us: micros(time),
                        soft: false,
                    };
                }
            }
            Command::Set { knob, to } => {
                if let Some(knob) = self.knobs.get_mut(usize::from(knob)) {
                    *knob = Knob::at(to);
                }
            }
            Command::Wander(on) => {
                self.wanders = on;
                if !on {
                    self.knobs
                        .iter_mut()
                        .for_each(|knob| *knob = Knob::at(knob.position(at_us)));
                }
            }
            Command::Noise(steps) => self.noise = steps,
            Command::Sag(supply) => self.supply = supply,
            Command::Rate(hertz) => {
                self.interval_us = 1e6 / f64::from(hertz.clamp(1, RATE_MAX));
                (self.rate_since_us, self.rate_reports) = (at_us, 0);
                self.next_report_us = at_us;
            }
            Command::Burst(count) => (0..count).for_each(|_| self.report(at_us, sink)),
            Command::Garbage(count) => self.garbage = self.garbage.saturating_add(count),
            Command::Cut => self.cut = true,
            Command::Freeze(time) => self.frozen_until_us = at_us + micros(time),
            Command::Silent(time) => self.silent_until_us = at_us + micros(time),
            Command::Unplug(time) => {
                if self.plug_at_us.is_none() {
                    sink(Output::Unplug);
                }
                self.plug_at_us = Some(at_us + micros(time));
                self.powered = false;
            }
        }
    }

    fn report(&mut self, now_us: u64, sink: &mut impl FnMut(Output<'_>)) {
        self.wander(now_us);
        let readings = self.readings(now_us);
        if self.plug_at_us.is_some() || now_us < self.silent_until_us {
            return;
        }
        let mut bytes = core::mem::take(&mut self.bytes);
        bytes.clear();
        if !self.powered {
            self.powered = true;
            self.speaker.power_up(&mut bytes);
        }
        for _ in 0..core::mem::take(&mut self.garbage) {
            bytes.push(self.random.random());
        }
        let start = bytes.len();
        self.speaker.report(&readings, &mut bytes);
        if self.cut && bytes.len() > start + 1 {
            self.cut = false;
            bytes.truncate(self.random.random_range(start + 1..bytes.len()));
        }
        if !bytes.is_empty() {
            sink(Output::Bytes(&bytes));
        }
        self.bytes = bytes;
    }

    fn wander(&mut self, now_us: u64) {
        for knob in self.knobs.iter_mut().filter(|knob| self.wanders && knob.rests(now_us)) {
            *knob = Knob {
                from: knob.to,
                to: self.random.random_range(0.0..=1.0),
                start_us: now_us,
                time_us: (self.random.random_range(WANDER_S) * 1e6) as u64,
                soft: true,
            };
        }
    }

    fn readings(&mut self, now_us: u64) -> Vec<u16> {
        if now_us >= self.frozen_until_us {
            self.frozen = None;
        } else if let Some(frozen) = &self.frozen {
            return frozen.clone();
        }
        let full_scale = f32::from(self.settings.dialect.full_scale());
        let deviation = self.noise * full_scale / 1023.0;
        let random = &mut self.random;
        let readings: Vec<u16> = self
            .knobs
            .iter()
            .map(|knob| {
                // Twelve even numbers make a normal one of deviation 1.
                let normal = (0..12).map(|_| random.random::<f32>()).sum::<f32>() - 6.0;
                let reading = knob.position(now_us) * self.supply * full_scale + deviation * normal;
                reading.round().clamp(0.0, full_scale) as u16
            })
            .collect();
        if now_us < self.frozen_until_us {
            self.frozen = Some(readings.clone());
        }
        readings
    }
}

#[cfg(test)]
mod tests;
