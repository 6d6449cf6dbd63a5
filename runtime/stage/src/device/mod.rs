//! The one device of a performance: a serial port, a MIDI port or a socket behind one trait, chosen by the command line, else
//! by `knobs.toml`, else the first USB serial port there is.

mod choice;
mod listen;
mod touch;

use sinew_knobs::ControlSource;
use sinew_knobs::device::DeviceStatus;

pub use choice::{DeviceArguments, identity, open, parse_osc};
pub use listen::listen;
pub use touch::Touch;

/// A source that can tell people about itself.
pub trait Device: ControlSource {
    /// Everything known of it. Allocates: a few times a second at most.
    fn device_status(&self) -> DeviceStatus;
}

#[cfg(feature = "serial")]
impl Device for sinew_knobs::device::SerialSource {
    fn device_status(&self) -> DeviceStatus {
        Self::device_status(self)
    }
}

#[cfg(feature = "midi")]
impl Device for sinew_knobs::device::MidiSource {
    fn device_status(&self) -> DeviceStatus {
        Self::device_status(self)
    }
}

#[cfg(feature = "osc")]
impl Device for sinew_knobs::device::OscSource {
    fn device_status(&self) -> DeviceStatus {
        Self::device_status(self)
    }
}
