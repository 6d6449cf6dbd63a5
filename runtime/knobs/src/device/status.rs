//! What a device's reader thread tells people, behind a lock that the frame never takes.

use std::string::String;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::vec::Vec;

use crate::Counters;
use crate::protocol::Recognition;

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
    /// Whether the port is there.
    pub link: Link,
    /// The port that is read, or was last: a path, a name of a MIDI port, a socket address.
    pub port: String,
    /// Baud rate of a serial port.
    pub baud: Option<u32>,
    /// Times the device went.
    pub unplugs: u64,
    /// Times it came back.
    pub replugs: u64,
    /// Why the port is not there, or why it went the last time.
    pub last_error: Option<String>,
    /// What the decoder counted.
    pub counters: Counters,
    /// When the last value arrived, µs; `None` before the first.
    pub last_value_us: Option<u64>,
    /// Readings that never reached the frame: a newer one of their knob did, or the device went.
    pub replaced: u64,
    /// Encoder steps that were added to others because the frame was late. Nothing of them is lost.
    pub merged: u64,
    /// Readings that wait for the frame.
    pub waiting: u64,
    /// Where the decoder stands with the protocol.
    pub recognition: Recognition,
    /// How sure the protocol is, in percent.
    pub confidence: u8,
    /// What the firmware calls itself.
    pub firmware: Option<String>,
    /// Names of knobs, by address.
    pub names: Vec<KnobName>,
}

impl DeviceStatus {
    /// Of a device that has not been heard.
    pub fn new(port: String, recognition: Recognition) -> Self {
        Self {
            link: Link::Waiting,
            port,
            baud: None,
            unplugs: 0,
            replugs: 0,
            last_error: None,
            counters: Counters::NONE,
            last_value_us: None,
            replaced: 0,
            merged: 0,
            waiting: 0,
            recognition,
            confidence: 0,
            firmware: None,
            names: Vec::new(),
        }
    }

    /// Age of the last value, µs; `None` before the first.
    pub fn age_us(&self, now_us: u64) -> Option<u64> {
        self.last_value_us.map(|last| now_us.saturating_sub(last))
    }
}

/// A status that the thread writes and others read.
#[derive(Debug, Clone)]
pub(super) struct SharedStatus(Arc<Mutex<DeviceStatus>>);

impl SharedStatus {
    pub(super) fn new(status: DeviceStatus) -> Self {
        Self(Arc::new(Mutex::new(status)))
    }

    /// A panic of another thread leaves numbers and texts as they were: still true.
    pub(super) fn lock(&self) -> MutexGuard<'_, DeviceStatus> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
