//! Real serial sources on simulated boxes: every protocol, every fault, through the system's own terminals.

#![cfg(unix)]

mod faults;
mod late;
mod no_jump;
mod protocols;
mod socat;

use core::time::Duration;
use std::path::Path;
use std::thread;
use std::time::Instant;

use sinew_knobs::device::{Clock, SerialSelector, SerialSettings, SerialSource};
use sinew_knobs::{ControlSource, KnobEvent, Protocol, Reading, SourceEvent};
use sinew_simulator::{BoxSettings, Dialect, KnobBox, Port, Running, Script, Simulator};
use tempfile::TempDir;

/// How long a test waits for what must come: a busy machine is no fault of ours.
const PATIENCE: Duration = Duration::from_secs(20);

/// A box, its source, and everything heard so far.
struct Bench {
    clock: Clock,
    source: SerialSource,
    heard: Vec<SourceEvent>,
    // Last: the box is unplugged when the source is gone.
    running: Running,
    _folder: TempDir,
}

fn named(protocol: Protocol) -> SerialSettings {
    SerialSettings {
        protocol: Some(protocol),
        ..SerialSettings::default()
    }
}

fn selector(path: &Path) -> SerialSelector {
    SerialSelector::Path(path.to_string_lossy().into_owned())
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

impl Bench {
    fn new(dialect: Dialect, knob_count: u16, settings: SerialSettings) -> Self {
        let folder = folder();
        let box_settings = BoxSettings {
            dialect,
            knob_count,
            ..BoxSettings::default()
        };
        let port = Port::open(folder.path().join("box")).unwrap();
        let path = port.path().to_owned();
        let running = Simulator::new(KnobBox::new(box_settings).unwrap(), port).spawn();
        let clock = Clock::start();
        let source = SerialSource::open(selector(&path), settings, clock).unwrap();
        // An encoder's steps are counted from where it stands at its first word.
        let begun = Instant::now();
        while running.status().sent_bytes + running.status().lost_bytes == 0 && begun.elapsed() < PATIENCE {
            thread::sleep(Duration::from_millis(1));
        }
        Self {
            clock,
            source,
            heard: Vec::new(),
            running,
            _folder: folder,
        }
    }

    fn script(&self, text: &str) {
        self.running.run_script(Script::parse(text).unwrap());
    }

    /// A frame: polls, and sleeps for a while.
    fn frame(&mut self, length: Duration) {
        let now_us = self.clock.now_us();
        let heard = &mut self.heard;
        self.source.poll(now_us, &mut |at_us, event| {
            assert!(at_us <= now_us);
            // A label goes before its knob; who reads it is of no concern here.
            if !matches!(event, SourceEvent::Named { .. }) {
                heard.push(event);
            }
        });
        thread::sleep(length);
    }

    /// Lets frames pass until something is so.
    fn until(&mut self, what: &str, mut is_so: impl FnMut(&Self) -> bool) {
        let begun = Instant::now();
        while !is_so(self) {
            self.frame(Duration::from_millis(2));
            let status = self.source.device_status();
            assert!(
                begun.elapsed() < PATIENCE,
                "{what} never came: {status:#?}\n{:?}",
                self.running.status()
            );
        }
    }

    /// The last position of a knob, as a part of its scale.
    fn position(&self, address: u16) -> Option<f32> {
        self.heard.iter().rev().find_map(|event| match event {
            SourceEvent::Knob(KnobEvent {
                knob,
                reading: Reading::Position { value, full_scale },
            }) if *knob == address => Some(f32::from(*value) / f32::from(*full_scale)),
            _ => None,
        })
    }

    /// Steps of a knob in all.
    fn turned(&self, address: u16) -> i64 {
        let steps = self.heard.iter().map(|event| match event {
            SourceEvent::Knob(KnobEvent {
                knob,
                reading: Reading::Steps(steps),
            }) if *knob == address => i64::from(*steps),
            _ => 0,
        });
        steps.sum()
    }

    fn links(&self) -> Vec<SourceEvent> {
        let links = self.heard.iter().filter(|event| !matches!(event, SourceEvent::Knob(_)));
        links.copied().collect()
    }

    /// Lets everything arrive that is under way, then checks that every event is accounted for.
    fn settle(&mut self) {
        self.script("silent 1000s");
        let mut before = None;
        self.until("rest", |bench| {
            let status = bench.source.device_status();
            let rests = status.waiting == 0 && before == Some(status.counters.bytes);
            before = Some(status.counters.bytes);
            thread::sleep(Duration::from_millis(30));
            rests
        });
        self.frame(Duration::from_millis(60));
        self.frame(Duration::ZERO);
        let status = self.source.device_status();
        let knobs = self.heard.len() - self.links().len();
        assert_eq!(
            status.counters.events,
            knobs as u64 + status.replaced + status.merged,
            "{status:#?}"
        );
    }
}
