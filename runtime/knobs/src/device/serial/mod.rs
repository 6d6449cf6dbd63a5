//! Knob boxes on serial ports, USB or not, and on pseudo-terminals: a thread of its own reads the port, looks for it again
//! when it went, and hands over what the box said.
//!
//! Opening a port resets many boards (those that wire DTR to their reset): for a second or two they say nothing or print
//! what their boot loader prints. The decoder expects it, and what the host sends first is sent again until it is answered.

mod ports;
mod reader;

use std::string::ToString;

pub use ports::{SerialError, SerialPort, SerialSelector, UsbIdentity, serial_ports};

use super::feeder::{Device, feeder};
use super::status::DeviceStatus;
use super::worker::Worker;
use super::{Clock, QUEUE_EVENTS};
use crate::protocol::{DecoderSettings, Protocol};
use crate::{ControlSource, SourceEvent};

/// How a serial port is opened and read.
#[derive(Debug, Clone)]
pub struct SerialSettings {
    /// What the box speaks. Default `None`: its bytes decide.
    pub protocol: Option<Protocol>,
    /// What the decoder cannot learn from the bytes.
    pub decoding: DecoderSettings,
    /// Baud rate. Default `None`: the protocol's usual ones are tried in turn, for two seconds each, until bytes make sense
    /// (9600 first for lines and for the unknown, 57,600 for Firmata, 31,250 for MIDI, 115,200 for packets and OSC). Boards with
    /// USB of their own take any.
    pub baud: Option<u32>,
    /// Level of the DTR line. Default `true`: boards with USB of their own stay silent without; it is also what resets an
    /// Arduino Uno and its like when the port opens.
    pub dtr: bool,
    /// Whether to begin without the device and wait for it. Default no: a port that is not there is an error.
    pub wait: bool,
    /// Events that may wait for the frame. Default [`QUEUE_EVENTS`].
    pub queue_events: usize,
}

impl Default for SerialSettings {
    fn default() -> Self {
        Self {
            protocol: None,
            decoding: DecoderSettings::default(),
            baud: None,
            dtr: true,
            wait: false,
            queue_events: QUEUE_EVENTS,
        }
    }
}

/// A knob box on a serial port. Dropping it closes the port and ends its thread, within 10 ms on a healthy system.
///
/// ```no_run
/// use sinew_knobs::ControlSource;
/// use sinew_knobs::device::{Clock, SerialSelector, SerialSettings, SerialSource};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let clock = Clock::start(); // one for all sources of a show
/// let mut knobs = SerialSource::open(SerialSelector::Auto, SerialSettings::default(), clock)?;
/// loop {
///     // each frame; never blocks
///     knobs.poll(clock.now_us(), &mut |at_us, event| println!("{at_us} µs: {event:?}"));
/// #   break;
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SerialSource {
    device: Device,
}

impl SerialSource {
    /// Opens the port and starts to read it; times are those of `clock`.
    ///
    /// # Errors
    /// [`SerialError`], unless [`SerialSettings::wait`] is set: then only [`SerialError::NoThread`], and the status says what
    /// is missing.
    pub fn open(selector: SerialSelector, settings: SerialSettings, clock: Clock) -> Result<Self, SerialError> {
        let (feeder, receiver, board) = feeder(
            settings.protocol,
            settings.decoding,
            clock,
            settings.queue_events,
            selector.to_string(),
        );
        let wait = settings.wait;
        let mut reader = reader::PortReader::new(selector, settings, feeder);
        if let Err(error) = reader.open()
            && !wait
        {
            return Err(error);
        }
        let worker =
            Worker::start("sinew-serial", move |halt| reader.run(&halt)).map_err(|error| SerialError::NoThread {
                reason: error.to_string(),
            })?;
        Ok(Self {
            device: Device::new(receiver, board, worker),
        })
    }

    /// Everything that is known of the device, for people; takes a lock and allocates, so not for the frame.
    pub fn device_status(&self) -> DeviceStatus {
        self.device.status()
    }
}

impl ControlSource for SerialSource {
    fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        self.device.poll(now_us, sink);
    }
}
