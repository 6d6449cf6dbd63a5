//! What a device's reader thread tells: numbers as atomics, for the frame, and the rest behind a lock that the frame
//! never takes.

use core::sync::atomic::{AtomicU64, Ordering};
use std::string::String;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::vec::Vec;

use crate::input::protocol::Recognition;
use crate::input::{Counters, Fault, SourceStatus};

/// Whether the port is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// It has not been there yet.
    Waiting,
    /// It is open.
    Open,
    /// It was there and is gone; the thread keeps looking for it.
    Lost,
}

/// A knob as its device names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KnobName {
    /// Address of the knob.
    pub knob: u16,
    /// Label, OSC address, or from a HELLO.
    pub name: String,
    /// Lowest and highest reading of its sweep, where a HELLO said so.
    pub range: Option<(u16, u16)>,
}

/// Everything that is known of a device, for people: for `monitor`, a status line, an error report.
#[derive(Debug, Clone)]
pub struct DeviceStatus {
    /// What every source counts, of this moment. All that follows is at most 50 ms old.
    pub counts: SourceStatus,
    /// Whether the port is there.
    pub link: Link,
    /// The port that is read, or was last: a path, a name of a MIDI port, a socket address.
    pub port: String,
    /// Baud rate of a serial port.
    pub baud: Option<u32>,
    /// Where the decoder stands with the protocol.
    pub recognition: Recognition,
    /// How sure the protocol is, in percent.
    pub confidence: u8,
    /// What the decoder counted.
    pub counters: Counters,
    /// Encoder steps that were added to others because the frame was late. Nothing of them is lost.
    pub merged: u64,
    /// Readings that wait for the frame.
    pub waiting: u64,
    /// What the firmware calls itself.
    pub firmware: Option<String>,
    /// Names of knobs, by address.
    pub names: Vec<KnobName>,
    /// Why the port is not there, or why it went the last time.
    pub last_error: Option<String>,
}

impl DeviceStatus {
    /// Why the last message that was not taken as it came was not.
    pub fn last_fault(&self) -> Option<Fault> {
        self.counters.last_fault
    }
}

/// The part of a status that is text, or that only people read.
#[derive(Debug)]
pub(super) struct Details {
    pub(super) link: Link,
    pub(super) port: String,
    pub(super) baud: Option<u32>,
    pub(super) recognition: Recognition,
    pub(super) confidence: u8,
    pub(super) counters: Counters,
    pub(super) firmware: Option<String>,
    pub(super) names: Vec<KnobName>,
    pub(super) last_error: Option<String>,
}

/// Where the thread writes its status and everybody else reads it.
#[derive(Debug)]
pub(super) struct Board {
    bytes: AtomicU64,
    events: AtomicU64,
    good: AtomicU64,
    bad: AtomicU64,
    last_bad: AtomicU64,
    unplugs: AtomicU64,
    replugs: AtomicU64,
    /// One more than the time; 0 before the first.
    last_value_us: AtomicU64,
    details: Mutex<Details>,
}

impl Board {
    pub(super) fn new(port: String, recognition: Recognition) -> Self {
        let zero = || AtomicU64::new(0);
        Self {
            bytes: zero(),
            events: zero(),
            good: zero(),
            bad: zero(),
            last_bad: zero(),
            unplugs: zero(),
            replugs: zero(),
            last_value_us: zero(),
            details: Mutex::new(Details {
                link: Link::Waiting,
                port,
                baud: None,
                recognition,
                confidence: 0,
                counters: Counters::NONE,
                firmware: None,
                names: Vec::new(),
                last_error: None,
            }),
        }
    }

    /// A panic of another thread leaves numbers and texts as they were: still true.
    pub(super) fn details(&self) -> MutexGuard<'_, Details> {
        self.details.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn count(&self, counters: &Counters) {
        self.bytes.store(counters.bytes, Ordering::Relaxed);
        self.events.store(counters.events, Ordering::Relaxed);
        self.good.store(counters.good, Ordering::Relaxed);
        self.bad.store(counters.bad, Ordering::Relaxed);
        let code = counters.last_fault.map_or(0, Fault::code);
        self.last_bad.store(code.into(), Ordering::Relaxed);
    }

    pub(super) fn value_at(&self, at_us: u64) {
        self.last_value_us.store(at_us + 1, Ordering::Relaxed);
    }

    pub(super) fn unplugged(&self) {
        self.unplugs.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn replugged(&self) {
        self.replugs.fetch_add(1, Ordering::Relaxed);
    }

    /// The numbers; `replaced` are the readings that never reached the frame.
    pub(super) fn counts(&self, replaced: u64) -> SourceStatus {
        let read = |number: &AtomicU64| number.load(Ordering::Relaxed);
        SourceStatus {
            bytes: read(&self.bytes),
            events: read(&self.events),
            good: read(&self.good),
            bad: read(&self.bad),
            last_bad: read(&self.last_bad) as u16,
            dropped: replaced,
            unplugs: read(&self.unplugs),
            replugs: read(&self.replugs),
            last_value_us: read(&self.last_value_us).checked_sub(1),
        }
    }
}
