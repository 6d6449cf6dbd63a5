//! Devices: threads that read serial ports, MIDI ports and sockets, and the sources through which a frame hears them.
//!
//! Path of data: port -> reader thread: [`Decoder`](super::Decoder), time stamp -> hand-off (lock-free, bounded) ->
//! [`ControlSource::poll`](super::ControlSource::poll) on the frame's thread. The only part of the runtime that uses std.

mod clock;
mod feeder;
mod hand_off;
#[cfg(feature = "midi")]
mod midi_port;
#[cfg(feature = "osc")]
mod osc_socket;
#[cfg(feature = "serial")]
mod serial;
mod status;
mod worker;

pub use clock::Clock;
#[cfg(feature = "midi")]
pub use midi_port::{MidiError, MidiPortSettings, MidiSource, midi_ports};
#[cfg(feature = "osc")]
pub use osc_socket::{OscError, OscSettings, OscSource};
#[cfg(feature = "serial")]
pub use serial::{SerialError, SerialPort, SerialSelector, SerialSettings, SerialSource, UsbIdentity, serial_ports};
pub use status::{DeviceStatus, KnobName, Link};

/// Events that wait between a reader thread and the frame, unless the settings say otherwise: 20 ms of the densest flood
/// that a line of 1 Mbaud can carry. When the frame is later than that, the newest value of each knob is kept, and
/// encoder steps add up.
pub const QUEUE_EVENTS: usize = 1024;
