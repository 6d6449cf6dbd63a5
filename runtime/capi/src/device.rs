//! What a decoder is told and what it tells: settings, readings, counters, what it knows of its device.

use core::ffi::c_char;
use core::fmt;

use sinew_knobs::protocol::{Coding, FIRMWARE_BYTES_MAX, MidiSettings, NAME_BYTES_MAX, Pairing, Recognition};
use sinew_knobs::{Counters, Decoder, DecoderSettings, FullScale, KnobEvent, Protocol, Reading};

use crate::fault::Fault;
use crate::number;
use crate::structs::{GrowingStruct, choice};
use crate::text;

/// Bytes of a buffer that holds any knob's name, with the NUL.
pub const SINEW_KNOB_NAME_BYTES: usize = 33;
/// Bytes of a sentence about a decoder, with the NUL.
pub const SINEW_DECODER_TEXT_BYTES: usize = 120;
/// Bytes of what a firmware calls itself, with the NUL.
pub const SINEW_FIRMWARE_BYTES: usize = 40;

const _: () = assert!(SINEW_KNOB_NAME_BYTES == NAME_BYTES_MAX + 1 && SINEW_FIRMWARE_BYTES > FIRMWARE_BYTES_MAX);

/// What a device speaks.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewProtocol {
    /// Not known. As a setting: the first bytes decide.
    Unknown = 0,
    /// Text lines of numbers: deej, CSV, Serial Plotter.
    Lines = 1,
    /// Sinew's own framed packets, `docs/knob-protocol.md`.
    Packets = 2,
    /// MIDI bytes.
    Midi = 3,
    /// Firmata analog reports.
    Firmata = 4,
    /// OSC, in datagrams or in SLIP.
    Osc = 5,
}

impl SinewProtocol {
    fn of(protocol: Option<Protocol>) -> Self {
        match protocol {
            Some(Protocol::Lines) => Self::Lines,
            Some(Protocol::Packets) => Self::Packets,
            Some(Protocol::Midi) => Self::Midi,
            Some(Protocol::Firmata) => Self::Firmata,
            Some(Protocol::Osc) => Self::Osc,
            _ => Self::Unknown,
        }
    }
}

/// How MIDI controllers count.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewMidiCoding {
    /// Positions, 0 to 127.
    Absolute = 0,
    /// Steps in two's complement of seven bits: 1 is one clockwise, 127 one back.
    TwosComplement = 1,
    /// Steps with a sign bit: 1 is one clockwise, 65 one back.
    SignedBit = 2,
    /// Steps around 64: 65 is one clockwise, 63 one back.
    BinaryOffset = 3,
}

/// Whether the MIDI controllers 0 to 31 have their lower seven bits in 32 to 63.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewMidiPairing {
    /// Learned a controller at a time.
    Learned = 0,
    /// All are pairs.
    Always = 1,
    /// None is.
    Never = 2,
}

/// What a decoder cannot learn from the bytes. Zero everywhere suits most boxes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewDecoderSettings {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// What the device speaks.
    pub protocol: number::SinewProtocol,
    /// The largest value of lines, Firmata reports and OSC integers, at most 65535; 0: learned.
    pub full_scale: u32,
    /// Of all controllers.
    pub midi_coding: number::SinewMidiCoding,
    /// Of all channels.
    pub midi_pairing: number::SinewMidiPairing,
}

// SAFETY: `repr(C)`, the size first, integers only.
unsafe impl GrowingStruct for SinewDecoderSettings {
    const NAME: &'static str = "settings";
    const FIRST_BYTES: usize = size_of::<Self>();
}

impl SinewDecoderSettings {
    pub(crate) fn resolve(&self) -> Result<(Option<Protocol>, DecoderSettings), Fault> {
        let [lines, packets, midi, firmata, osc] = Protocol::ALL.map(Some);
        let protocol = choice(
            "settings.protocol",
            self.protocol,
            &[None, lines, packets, midi, firmata, osc],
        )?;
        let codings = [
            Coding::Absolute,
            Coding::TwosComplement,
            Coding::SignedBit,
            Coding::BinaryOffset,
        ];
        let pairings = [Pairing::Learned, Pairing::Always, Pairing::Never];
        let mut midi = MidiSettings::default();
        midi.pairing = choice("settings.midi_pairing", self.midi_pairing, &pairings)?;
        midi.set_all_codings(choice("settings.midi_coding", self.midi_coding, &codings)?);
        let full_scale = match u16::try_from(self.full_scale) {
            Ok(0) => FullScale::Learned,
            Ok(full_scale) => FullScale::Fixed(full_scale),
            Err(_) => {
                return Err(Fault::UnknownChoice {
                    name: "settings.full_scale",
                    value: self.full_scale.try_into().unwrap_or(i32::MAX),
                });
            }
        };
        Ok((
            protocol,
            DecoderSettings {
                full_scale,
                midi,
                ..DecoderSettings::default()
            },
        ))
    }
}

/// What a reading says.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewReadingKind {
    /// Nothing waits.
    None = 0,
    /// The knob stands at `value` of `full_scale`.
    Position = 1,
    /// The knob was turned by `value` steps; clockwise is positive.
    Steps = 2,
}

/// One reading of one knob.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewReading {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// When its bytes came, on your clock, microseconds.
    pub time_us: u64,
    /// What `value` says.
    pub kind: number::SinewReadingKind,
    /// Address of the knob on its device, at most 65535: column of a line, MIDI `channel * 128 + controller`, pin, or the
    /// number of a name in order of appearance.
    pub knob: u32,
    /// Position from 0 to `full_scale`, or steps.
    pub value: i32,
    /// The largest value that this device sends, 1023 for ten bits; 0 for steps.
    pub full_scale: u32,
}

// SAFETY: `repr(C)`, the size first, integers only.
unsafe impl GrowingStruct for SinewReading {
    const NAME: &'static str = "reading";
    const FIRST_BYTES: usize = size_of::<Self>();
}

impl SinewReading {
    /// Nothing waits.
    pub(crate) const NONE: Self = Self {
        struct_bytes: size_of::<Self>(),
        time_us: 0,
        kind: SinewReadingKind::None as i32,
        knob: 0,
        value: 0,
        full_scale: 0,
    };

    pub(crate) fn of(time_us: u64, event: KnobEvent) -> Self {
        let (kind, value, full_scale) = match event.reading {
            Reading::Position { value, full_scale } => (SinewReadingKind::Position, value.into(), full_scale.into()),
            Reading::Steps(steps) => (SinewReadingKind::Steps, steps.into(), 0),
        };
        Self {
            struct_bytes: size_of::<Self>(),
            time_us,
            kind: kind as i32,
            knob: event.knob.into(),
            value,
            full_scale,
        }
    }

    /// The event it stands for.
    pub(crate) fn event(&self) -> Result<KnobEvent, Fault> {
        let Self { value, full_scale, .. } = *self;
        let bad = Fault::BadReading { value, full_scale };
        let reading = if self.kind == SinewReadingKind::Position as i32 {
            match (u16::try_from(value), u16::try_from(full_scale)) {
                (Ok(value), Ok(full_scale)) if value <= full_scale && full_scale > 0 => {
                    Reading::Position { value, full_scale }
                }
                _ => return Err(bad),
            }
        } else if self.kind == SinewReadingKind::Steps as i32 {
            Reading::Steps(i16::try_from(value).map_err(|_| bad)?)
        } else {
            return Err(bad);
        };
        let knob = u16::try_from(self.knob).map_err(|_| bad)?;
        Ok(KnobEvent { knob, reading })
    }
}

/// What became of the bytes. Totals since the decoder was opened.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SinewCounters {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Bytes fed.
    pub bytes: u64,
    /// Messages (lines, frames, MIDI and OSC messages) understood.
    pub good: u64,
    /// Messages that are sound and say nothing of knobs.
    pub ignored: u64,
    /// Messages refused; `last_fault` says why the last of them was.
    pub bad: u64,
    /// Messages cut by the opening of the port or by a replug; expected, so not bad.
    pub partial: u64,
    /// Messages known to be lost, and readings of datagrams that found no room.
    pub dropped: u64,
    /// Readings cut to the end of their scale.
    pub clamped: u64,
    /// Readings of knobs whose names found no room; they work by number.
    pub unnamed: u64,
    /// Readings made.
    pub readings: u64,
    /// Of those: readings that wait.
    pub waiting: u64,
    /// Times that the device was plugged in again.
    pub replugs: u64,
    /// Age of the last reading, microseconds; `UINT64_MAX` before the first.
    pub age_us: u64,
    /// Why the last message was not taken as it came: a number that stays the same in later versions; 0: all were.
    pub last_fault: u32,
    /// The same in words, ended by NUL; empty: all were.
    pub last_fault_text: [c_char; SINEW_DECODER_TEXT_BYTES],
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewCounters {
    const NAME: &'static str = "counters";
    const FIRST_BYTES: usize = size_of::<Self>();
}

impl SinewCounters {
    /// What a decoder counted; the rest is the queue's.
    pub(crate) fn of(counted: &Counters) -> Self {
        let words = |out: &mut fmt::Formatter<'_>| match counted.last_fault {
            Some(fault) => fmt::Display::fmt(&fault, out),
            None => Ok(()),
        };
        Self {
            struct_bytes: size_of::<Self>(),
            bytes: counted.bytes,
            good: counted.good,
            ignored: counted.ignored,
            bad: counted.bad,
            partial: counted.partial,
            dropped: counted.dropped,
            clamped: counted.clamped,
            unnamed: counted.unnamed,
            readings: counted.events,
            waiting: 0,
            replugs: 0,
            age_us: u64::MAX,
            last_fault: counted.last_fault.map_or(0, |fault| fault.code().into()),
            last_fault_text: text::of(fmt::from_fn(words)),
        }
    }
}

/// How a decoder came to its protocol.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewRecognition {
    /// The settings named it.
    Named = 1,
    /// So few bytes came that nothing is said yet.
    Listening = 2,
    /// Many bytes came and no protocol fits: a wrong baud rate, or a device of another kind. It goes on listening.
    Undecided = 3,
    /// The bytes told.
    Found = 4,
}

/// What a decoder knows of its device.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SinewDeviceInfo {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// How it came to the protocol.
    pub recognition: SinewRecognition,
    /// The protocol, named or found.
    pub protocol: SinewProtocol,
    /// How sure that is, percent: 100 if it was named, 0 if it is not known, else by all messages so far.
    pub confidence: u32,
    /// Knobs of the device, where it said so; 0 otherwise.
    pub knob_count: u32,
    /// The same in words, ended by NUL.
    pub text: [c_char; SINEW_DECODER_TEXT_BYTES],
    /// What the firmware calls itself, ended by NUL; empty where it did not say.
    pub firmware: [c_char; SINEW_FIRMWARE_BYTES],
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewDeviceInfo {
    const NAME: &'static str = "info";
    const FIRST_BYTES: usize = size_of::<Self>();
}

impl SinewDeviceInfo {
    pub(crate) fn of(decoder: &Decoder) -> Self {
        Self {
            struct_bytes: size_of::<Self>(),
            recognition: match decoder.recognition() {
                Recognition::Named(_) => SinewRecognition::Named,
                Recognition::Undecided => SinewRecognition::Undecided,
                Recognition::Found(_) => SinewRecognition::Found,
                _ => SinewRecognition::Listening,
            },
            protocol: SinewProtocol::of(decoder.protocol()),
            confidence: decoder.confidence().into(),
            knob_count: decoder.knob_count().map_or(0, u32::from),
            text: text::of(decoder.recognition()),
            firmware: text::of(decoder.firmware().unwrap_or_default()),
        }
    }
}
