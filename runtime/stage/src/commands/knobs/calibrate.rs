//! `sinew-stage knobs calibrate`: measures every knob while a person turns each once from stop to stop.

use core::time::Duration;
use std::path::PathBuf;

use clap::Args;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use miette::miette;
use sinew_knobs::calibrate::{CalibrationRefusal, CalibrationSettings, Calibrator, KnobProgress, KnobTrial, Progress};
use sinew_knobs::device::DeviceStatus;

use super::{Listener, knob_words};
use crate::calibration::{CalibratedKnob, Calibrations, DeviceCalibration, default_path};
use crate::commands::{Failure, catch_interrupts, interrupted, parse_duration, read_choice};
use crate::device::{DeviceArguments, identity};

/// Knobs of a device that are measured at once.
const KNOBS_MAX: usize = 128;
/// How long everything must be done before it ends by itself, µs.
const DONE_US: u64 = 2_000_000;

/// Arguments of `sinew-stage knobs calibrate`.
#[derive(Args)]
#[command(
    after_help = "Turn every knob once from stop to stop, let it go, and leave it for half a second. Knobs with a spring or a detent: \
        let them stand in the middle first, and bring them back there, so that the middle is measured too.

It ends by itself two seconds after every knob that was heard is done, or with Enter; what was measured is kept under the \
        device's identity, knobs that were not turned keep what was measured before. `play` finds it there.

Without a calibration a knob is taken to reach from 0 to its full scale, which few do."
)]
pub struct CalibrateArguments {
    #[command(flatten)]
    device: DeviceArguments,
    /// Take the device that this file names
    #[arg(long, value_name = "FILE")]
    knobs: Option<PathBuf>,
    /// File to write to; without it, the file in the user's settings
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// End after this time
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration)]
    time: Option<Duration>,
}

/// Runs `sinew-stage knobs calibrate`.
pub fn run(arguments: &CalibrateArguments, quiet: bool) -> Result<(), Failure> {
    catch_interrupts();
    let (_, choice) = read_choice(arguments.knobs.as_deref(), &arguments.device)?;
    let path = arguments.calibration.clone().map_or_else(default_path, Ok)?;
    // A file that cannot be read would be written over: better now than after the turning.
    let calibrations = Calibrations::read(&path)?;
    let mut listener = Listener::open(&choice, arguments.time)?;
    listener.end_at_enter();
    if !quiet {
        eprintln!("turn every knob once from stop to stop, and let it go; Enter ends");
    }
    let mut trials = vec![KnobTrial::default(); KNOBS_MAX];
    let mut calibrator = Calibrator::new(&mut trials, CalibrationSettings::default());
    let mut bars = Bars::new(quiet);
    let mut done_since_us = None;
    loop {
        let goes_on = listener.step(|at_us, event| calibrator.event(at_us, event));
        let now_us = listener.clock.now_us();
        calibrator.advance(now_us);
        let status = listener.device.device_status();
        bars.show(&calibrator, &status);
        let measured = |index| matches!(calibrator.result(index), Ok(_) | Err(CalibrationRefusal::Encoder));
        let all = calibrator.knob_count() > 0 && (0..calibrator.knob_count()).all(measured);
        done_since_us = if all { done_since_us.or(Some(now_us)) } else { None };
        if !goes_on || done_since_us.is_some_and(|since| now_us - since >= DONE_US) {
            break;
        }
    }
    bars.end();
    if interrupted() {
        return Err(Failure::Stopped("stopped; nothing was written".to_owned()));
    }
    let status = listener.device.device_status();
    let device = identity(&choice, &status);
    let (measured, refused) = results(&calibrator, &status);
    for line in &refused {
        eprintln!("{line}");
    }
    if measured.is_empty() {
        return Err(miette!(
            help = "`sinew-stage knobs monitor` shows what arrives",
            "no knob of {device} was measured; nothing was written"
        )
        .into());
    }
    let before = calibrations.of(&device).cloned().unwrap_or_default();
    let count = measured.len();
    let mut knobs = measured;
    let kept = before
        .knobs
        .into_iter()
        .filter(|old| !knobs.iter().any(|new| new.address == old.address));
    let kept: Vec<CalibratedKnob> = kept.collect();
    knobs.extend(kept);
    knobs.sort_by_key(|knob| knob.address);
    let calibration = DeviceCalibration {
        device: device.clone(),
        knobs,
    };
    calibrations.store(&path, calibration)?;
    if !quiet {
        eprintln!(
            "{} of {device} measured; written to {}",
            crate::count::count(count as u64, "knob"),
            path.display()
        );
    }
    Ok(())
}

fn results(calibrator: &Calibrator<'_>, status: &DeviceStatus) -> (Vec<CalibratedKnob>, Vec<String>) {
    let (mut measured, mut refused) = (Vec::new(), Vec::new());
    for index in 0..calibrator.knob_count() {
        let Some(progress) = calibrator.progress(index) else {
            continue;
        };
        match calibrator.result(index) {
            Ok(calibration) => measured.push(CalibratedKnob {
                address: progress.knob,
                name: status
                    .names
                    .iter()
                    .find(|named| named.knob == progress.knob)
                    .map_or(String::new(), |named| named.name.clone()),
                calibration,
            }),
            Err(refusal) => refused.push(format!("{}: {refusal}", knob_words(status, progress.knob))),
        }
    }
    if calibrator.unlisted_events() > 0 {
        refused.push(format!("more than {KNOBS_MAX} knobs: those beyond were not measured"));
    }
    (measured, refused)
}

/// One bar a knob, on standard error.
struct Bars {
    all: MultiProgress,
    bars: Vec<ProgressBar>,
}

impl Bars {
    fn new(quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        Self {
            all: MultiProgress::with_draw_target(target),
            bars: Vec::new(),
        }
    }

    fn show(&mut self, calibrator: &Calibrator<'_>, status: &DeviceStatus) {
        for index in 0..calibrator.knob_count() {
            let Some(progress) = calibrator.progress(index) else {
                continue;
            };
            if index == self.bars.len() {
                let bar = self.all.add(ProgressBar::new(u64::from(progress.full_scale.max(1))));
                let style = ProgressStyle::with_template("{prefix:<16} [{bar:24}] {msg}");
                bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
                self.bars.push(bar);
            }
            let bar = &self.bars[index];
            bar.set_prefix(knob_words(status, progress.knob));
            bar.set_length(u64::from(progress.full_scale.max(1)));
            bar.set_position(u64::from(progress.highest.saturating_sub(progress.lowest)));
            bar.set_message(words(&progress, calibrator.result(index).err()));
        }
    }

    fn end(&self) {
        for bar in &self.bars {
            bar.abandon();
        }
    }
}

fn words(progress: &KnobProgress, refusal: Option<CalibrationRefusal>) -> String {
    let range = format!("{} to {}", progress.lowest, progress.highest);
    match (progress.progress, refusal) {
        (_, Some(CalibrationRefusal::Encoder)) => "an encoder: nothing to measure".to_owned(),
        (Progress::Untouched, _) => "turn it".to_owned(),
        (Progress::Turning, _) => format!("{range}; further"),
        (Progress::Settling, _) => format!("{range}; let it go"),
        (Progress::Done, Some(refusal)) => refusal.to_string(),
        (Progress::Done, None) => format!("{range}, noise {}: done", progress.noise.unwrap_or(0)),
    }
}
