//! `sinew-stage knobs`: everything about a knob box but playing it.

mod calibrate;
mod learn;
mod list;
mod monitor;
#[cfg(all(unix, feature = "serial"))]
mod simulate;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::Arc;
use std::thread;

use clap::Subcommand;
use miette::Report;
use sinew_knobs::device::{Clock, DeviceStatus};
use sinew_knobs::{KnobEvent, Protocol, SourceEvent};

use super::{Failure, interrupted};
use crate::config::{DeviceChoice, midi_words};
use crate::device::{Device, open};

/// Subcommands of `sinew-stage knobs`.
#[derive(Subcommand)]
pub enum KnobsCommand {
    /// Show the ports that a box may be on
    List,
    /// Show what a box sends, and whether it makes sense
    Monitor(monitor::MonitorArguments),
    /// Assign components to knobs by turning them; writes a knobs.toml
    Learn(learn::LearnArguments),
    /// Measure every knob's true range, centre and noise by turning it once
    Calibrate(calibrate::CalibrateArguments),
    /// Be a knob box without hardware, on a pseudo-terminal, with the faults of real ones
    #[cfg(all(unix, feature = "serial"))]
    Simulate(simulate::SimulateArguments),
}

/// Runs one of them.
///
/// # Errors
/// What was refused, or that Ctrl-C ended it.
pub fn run(command: &KnobsCommand, quiet: bool) -> Result<(), Failure> {
    match command {
        KnobsCommand::List => list::run(),
        KnobsCommand::Monitor(arguments) => monitor::run(arguments),
        KnobsCommand::Learn(arguments) => learn::run(arguments, quiet),
        KnobsCommand::Calibrate(arguments) => calibrate::run(arguments, quiet),
        #[cfg(all(unix, feature = "serial"))]
        KnobsCommand::Simulate(arguments) => simulate::run(arguments, quiet),
    }
}

/// A device that is only listened to, at the rate of a display.
struct Listener {
    clock: Clock,
    device: Box<dyn Device>,
    until_us: Option<u64>,
    entered: Arc<AtomicBool>,
}

impl Listener {
    fn open(choice: &DeviceChoice, time: Option<Duration>) -> Result<Self, Report> {
        let clock = Clock::start();
        let device = open(choice, clock, false)?;
        let until_us = time.map(|time| clock.now_us().saturating_add(time.as_micros() as u64));
        Ok(Self {
            clock,
            device,
            until_us,
            entered: Arc::default(),
        })
    }

    /// From now on an Enter ends it. The end of standard input does not: scripts have none to give.
    fn end_at_enter(&self) {
        let entered = Arc::clone(&self.entered);
        let wait = move || {
            let mut line = String::new();
            if std::io::stdin().read_line(&mut line).is_ok_and(|read| read > 0) {
                entered.store(true, Ordering::SeqCst);
            }
        };
        // Without a thread Ctrl-C still ends it.
        drop(thread::Builder::new().spawn(wait));
    }

    /// Waits a thirtieth of a second and hands over what came. False once the time is up or somebody wants to end.
    fn step(&mut self, mut event: impl FnMut(u64, KnobEvent)) -> bool {
        thread::sleep(Duration::from_millis(33));
        let now_us = self.clock.now_us();
        self.device.poll(now_us, &mut |at_us, source| {
            if let SourceEvent::Knob(knob) = source {
                event(at_us, knob);
            }
        });
        let over = self.until_us.is_some_and(|until| now_us >= until);
        !over && !interrupted() && !self.entered.load(Ordering::SeqCst)
    }
}

/// What a person calls a knob: its name on the device, its MIDI message, or its number.
fn knob_words(status: &DeviceStatus, knob: u16) -> String {
    if let Some(named) = status.names.iter().find(|named| named.knob == knob) {
        return named.name.clone();
    }
    match protocol(status) {
        Some(Protocol::Midi) => midi_words(knob),
        _ => format!("knob {knob}"),
    }
}

fn protocol(status: &DeviceStatus) -> Option<Protocol> {
    use sinew_knobs::protocol::Recognition;
    match status.recognition {
        Recognition::Named(protocol) => Some(protocol),
        Recognition::Found(finding) => Some(finding.protocol),
        _ => None,
    }
}
