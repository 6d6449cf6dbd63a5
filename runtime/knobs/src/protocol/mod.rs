//! Protocols of knob boxes: bytes in any chunking -> [`KnobEvent`]s. Between a port, which only moves bytes, and
//! everything that gives a knob its feel.
//!
//! [`Decoder`] is the type for a device; with no [`Protocol`] named it finds out. Every parser holds a bounded state in
//! itself, takes bytes in any chunking to the same events, counts what it could not take and why ([`Counters`]), and has no
//! input that makes it panic.
//!
//! Numbers of knobs, [`KnobEvent::knob`]:
//!
//! | protocol | knob |
//! |---|---|
//! | lines without labels | column, from 0 |
//! | lines with labels, OSC | label or address in order of appearance |
//! | packets | index that the device gives it |
//! | MIDI | control change `channel * 128 + controller`, pitch bend `2048 + channel`, note `2064 + channel * 128 + note`; channels from 0 |
//! | Firmata | analog pin |
//!
//! [`KnobEvent`]: crate::KnobEvent
//! [`KnobEvent::knob`]: crate::KnobEvent::knob
//! [`Counters`]: crate::Counters

mod decoder;
mod fields;
mod firmata;
mod greeting;
mod line;
mod midi;
mod midi_settings;
mod names;
mod osc;
mod osc_ranges;
mod packet;
mod scale;
mod slip;
mod sniff;

use core::fmt;

pub use decoder::{Decoder, Recognition};
pub use fields::FIELDS_MAX;
pub use firmata::{FIRMATA_BAUD, FIRMATA_PINS, Firmata, write_firmata_request};
pub use greeting::Greeting;
pub use line::{LINE_BYTES_MAX, Lines};
pub use midi::{KNOB_NOTE, KNOB_PITCH_BEND, Midi};
pub use midi_settings::{Coding, MidiSettings, Pairing};
pub use names::{NAME_BYTES_MAX, NAMES_MAX, Name, OSC_NAMES_MAX};
pub use osc::{OSC_DEPTH_MAX, OSC_NUMBERS_MAX, Osc};
pub use osc_ranges::{OSC_RANGES_MAX, OscRanges};
pub use packet::{
    FIRMWARE_BYTES_MAX, FRAME_BYTES_MAX, FrameKind, HELLO_NAME_BYTES_MAX, HELLO_REQUEST, PACKET_VERSION, Packets,
    write_frame,
};
pub use scale::FullScale;
pub use slip::SLIP_BYTES_MAX;
pub use sniff::{Finding, SNIFF_BYTES_MAX};

/// Bytes of the longest opening of a protocol, [`Protocol::write_opening`].
pub const OPENING_BYTES_MAX: usize = 37;

/// A protocol of knob boxes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Protocol {
    /// Text lines of numbers: deej, CSV, Serial Plotter.
    Lines,
    /// Our own framed packets, `docs/knob-protocol.md`.
    Packets,
    /// MIDI bytes.
    Midi,
    /// Firmata analog reports.
    Firmata,
    /// OSC, in datagrams or in SLIP.
    Osc,
}

impl Protocol {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Lines, Self::Packets, Self::Midi, Self::Firmata, Self::Osc];

    /// Its name on a command line and in a file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lines => "lines",
            Self::Packets => "packets",
            Self::Midi => "midi",
            Self::Firmata => "firmata",
            Self::Osc => "osc",
        }
    }

    /// The protocol of a name, or of a name people know it by: deej, csv, text, sinew, cobs, slip, vmc. Case does not matter.
    pub fn parse_name(name: &str) -> Option<Self> {
        const NAMES: [(&str, Protocol); 12] = [
            ("lines", Protocol::Lines),
            ("text", Protocol::Lines),
            ("deej", Protocol::Lines),
            ("csv", Protocol::Lines),
            ("packets", Protocol::Packets),
            ("sinew", Protocol::Packets),
            ("cobs", Protocol::Packets),
            ("midi", Protocol::Midi),
            ("firmata", Protocol::Firmata),
            ("osc", Protocol::Osc),
            ("slip", Protocol::Osc),
            ("vmc", Protocol::Osc),
        ];
        let found = NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        found.map(|(_, protocol)| *protocol)
    }

    /// What it is, for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Lines => "text lines",
            Self::Packets => "framed packets",
            Self::Midi => "MIDI",
            Self::Firmata => "Firmata",
            Self::Osc => "OSC",
        }
    }

    /// Writes what a host sends once after opening the port, so that the device begins: the report requests of Firmata (all
    /// pins, every 10 ms), the request for a HELLO of packets, nothing for the others.
    /// [`OPENING_BYTES_MAX`] bytes are enough.
    ///
    /// Returns the bytes written. Errors: `out` is too small; nothing was written.
    pub fn write_opening(self, out: &mut [u8]) -> Result<usize, BufferTooSmall> {
        const INTERVAL_MS: u16 = 10;
        match self {
            Self::Firmata => write_firmata_request(FIRMATA_PINS, INTERVAL_MS, out),
            Self::Packets => {
                *out.first_mut().ok_or(BufferTooSmall {
                    required_bytes: 1,
                    actual_bytes: 0,
                })? = HELLO_REQUEST;
                Ok(1)
            }
            Self::Lines | Self::Midi | Self::Osc => Ok(0),
        }
    }

    /// What one good message says for it in [`sniff`].
    const fn points(self) -> u32 {
        match self {
            Self::Lines => 3,
            Self::Packets => 16,
            Self::Midi => 1,
            Self::Firmata => 1,
            Self::Osc => 8,
        }
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// What a decoder cannot learn from the bytes. The defaults suit most boxes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DecoderSettings {
    /// Full scale of lines, Firmata reports and OSC integers.
    pub full_scale: FullScale,
    /// Encoders and pairs.
    pub midi: MidiSettings,
    /// Ranges of OSC floats.
    pub osc: OscRanges,
}

/// A buffer that the caller gave has too little room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BufferTooSmall {
    /// Bytes needed.
    pub required_bytes: usize,
    /// Bytes it has.
    pub actual_bytes: usize,
}

impl core::error::Error for BufferTooSmall {}

impl fmt::Display for BufferTooSmall {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            required_bytes,
            actual_bytes,
        } = self;
        write!(
            out,
            "{required_bytes} bytes are needed and the buffer has {actual_bytes}"
        )
    }
}
