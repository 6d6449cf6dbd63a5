//! Our own framed packets, for makers who write the firmware: COBS frames with version, kind, sequence number, values and
//! CRC-16. Bytes -> frames -> [`KnobEvent`]; `docs/knob-protocol.md` is the specification.
//!
//! The knob is the index that the device gives it. Nothing of a frame counts before its checksum and all its lengths do.

use super::names::{NAMES_MAX, Name, Names};
use crate::{Counters, Fault, KnobEvent, Reading};

/// Version of the frames that this program reads.
pub const PACKET_VERSION: u8 = 1;
/// Largest frame before stuffing, checksum included. One block of COBS: a device needs no more than 256 bytes for it.
pub const FRAME_BYTES_MAX: usize = 254;
/// Longest text that names the firmware.
pub const FIRMWARE_BYTES_MAX: usize = 32;
/// Longest name of a knob in a HELLO.
pub const HELLO_NAME_BYTES_MAX: usize = 24;
/// What a host writes to ask for a HELLO.
pub const HELLO_REQUEST: u8 = b'?';

/// CRC-16/IBM-3740, also called CCITT-FALSE: polynomial 0x1021, start 0xffff, nothing reflected.
const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);
const HEADER_BYTES: usize = 3;
const CRC_BYTES: usize = 2;
/// HELLO flag: first frame since the device started.
const FLAG_STARTED: u8 = 1;

/// Kinds of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameKind {
    /// Positions of knobs.
    Values,
    /// Steps of encoders.
    Steps,
    /// Names, ranges, firmware.
    Hello,
}

impl FrameKind {
    /// The byte that says so.
    pub const fn code(self) -> u8 {
        match self {
            Self::Values => 1,
            Self::Steps => 2,
            Self::Hello => 3,
        }
    }

    const fn of(code: u8) -> Option<Self> {
        match code {
            1 => Some(Self::Values),
            2 => Some(Self::Steps),
            3 => Some(Self::Hello),
            _ => None,
        }
    }
}

/// Parser of framed packets.
pub struct Packets {
    stuffing: cobs::DecoderState,
    frame: [u8; FRAME_BYTES_MAX],
    length: usize,
    too_long: bool,
    /// Bytes came since the last boundary.
    pending: bool,
    /// A boundary was seen since the stream began.
    in_step: bool,
    /// Sequence number that comes next.
    expected: Option<u8>,
    /// Frames refused since the last one whose checksum held: they leave a gap too, and are counted already.
    refused: u8,
    knob_count: Option<u8>,
    ranges: [Option<(u16, u16)>; NAMES_MAX],
    firmware: [u8; FIRMWARE_BYTES_MAX],
    firmware_bytes: u8,
    names: Names<NAMES_MAX>,
    pub(super) counters: Counters,
}

impl Packets {
    /// At the beginning of a stream.
    pub const fn new() -> Self {
        Self {
            stuffing: cobs::DecoderState::Idle,
            frame: [0; FRAME_BYTES_MAX],
            length: 0,
            too_long: false,
            pending: false,
            in_step: false,
            expected: None,
            refused: 0,
            knob_count: None,
            ranges: [None; NAMES_MAX],
            firmware: [0; FIRMWARE_BYTES_MAX],
            firmware_bytes: 0,
            names: Names::new(),
            counters: Counters::NONE,
        }
    }

    /// Reads bytes in any chunking.
    pub fn feed(&mut self, bytes: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        self.counters.bytes += bytes.len() as u64;
        for &byte in bytes {
            let step = self.stuffing.feed(byte);
            if byte != 0 {
                self.pending = true;
                if let Ok(cobs::DecodeResult::DataContinue(data)) = step {
                    self.push(data);
                }
            } else if self.pending {
                self.end_frame(step.is_ok(), sink);
            } else {
                self.in_step = true;
            }
        }
    }

    /// The port was opened again: what is half read is thrown away, and the sequence begins anew. Names, ranges, firmware
    /// and counters stay.
    pub fn reset(&mut self) {
        self.counters.partial += u64::from(self.pending);
        self.clear_frame();
        (self.in_step, self.expected, self.refused) = (false, None, 0);
    }

    /// Totals so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Name of a knob, from a HELLO.
    pub fn name_of(&self, knob: u16) -> Option<&str> {
        Some(self.name(knob)?.as_str())
    }

    pub(super) fn name(&self, knob: u16) -> Option<&Name> {
        self.names.get(knob)
    }

    /// Lowest and highest reading that a knob's sweep gives, from a HELLO: a first guess for calibration.
    pub fn range_of(&self, knob: u16) -> Option<(u16, u16)> {
        *self.ranges.get(usize::from(knob))?
    }

    /// Knobs of the device, from a HELLO.
    pub fn knob_count(&self) -> Option<u8> {
        self.knob_count
    }

    /// What the firmware calls itself, from a HELLO.
    pub fn firmware(&self) -> Option<&str> {
        let text = &self.firmware[..usize::from(self.firmware_bytes)];
        core::str::from_utf8(text).ok().filter(|text| !text.is_empty())
    }

    fn push(&mut self, byte: u8) {
        match self.frame.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length += 1;
            }
            None => self.too_long = true,
        }
    }

    fn clear_frame(&mut self) {
        self.stuffing = cobs::DecoderState::Idle;
        (self.length, self.too_long, self.pending) = (0, false, false);
    }

    fn end_frame(&mut self, stuffing_sound: bool, sink: &mut impl FnMut(KnobEvent)) {
        let (frame, length, too_long) = (self.frame, self.length, self.too_long);
        self.clear_frame();
        let sound = if too_long {
            Err(Fault::FrameTooLong)
        } else if !stuffing_sound {
            Err(Fault::BrokenStuffing)
        } else {
            checked(&frame[..length])
        };
        let in_step = core::mem::replace(&mut self.in_step, true);
        match sound {
            Ok(content) => {
                if let Err(fault) = self.take(content, sink) {
                    self.counters.refuse(fault);
                }
            }
            // The first frame after opening may be cut; a checksum says so, and a line has none.
            Err(_) if !in_step => self.counters.partial += 1,
            Err(fault) => {
                self.refused = self.refused.saturating_add(1);
                match fault {
                    Fault::FrameTooLong => self.counters.overflow(fault),
                    _ => self.counters.refuse(fault),
                }
            }
        }
    }

    /// A frame whose checksum holds.
    fn take(&mut self, content: &[u8], sink: &mut impl FnMut(KnobEvent)) -> Result<(), Fault> {
        let [version, kind, sequence, payload @ ..] = content else {
            return Err(Fault::FrameTooShort);
        };
        if *version != PACKET_VERSION {
            return Err(Fault::UnknownVersion { version: *version });
        }
        let kind = FrameKind::of(*kind);
        let started = kind == Some(FrameKind::Hello) && payload.first().is_some_and(|flags| flags & FLAG_STARTED != 0);
        let gap = self.expected.map_or(0, |expected| sequence.wrapping_sub(expected));
        let missing = gap.saturating_sub(core::mem::take(&mut self.refused));
        self.expected = Some(sequence.wrapping_add(1));
        if missing != 0 && !started {
            self.counters.dropped += u64::from(missing);
            self.counters.last_fault = Some(Fault::SequenceGap { missing });
        }
        match kind {
            Some(FrameKind::Values) => self.values(payload, sink),
            Some(FrameKind::Steps) => self.steps(payload, sink),
            Some(FrameKind::Hello) => self.hello(payload),
            None => {
                self.counters.ignored += 1;
                Ok(())
            }
        }
    }

    fn values(&mut self, payload: &[u8], sink: &mut impl FnMut(KnobEvent)) -> Result<(), Fault> {
        let [first, count, low, high, values @ ..] = payload else {
            return Err(Fault::WrongLength);
        };
        let full_scale = u16::from_le_bytes([*low, *high]);
        let values = words(values, *count)?;
        if full_scale == 0 || values.clone().any(|value| value > full_scale) {
            return Err(Fault::ValueAboveFullScale);
        }
        for (knob, value) in (u16::from(*first)..).zip(values) {
            self.counters.events += 1;
            sink(KnobEvent {
                knob,
                reading: Reading::Position { value, full_scale },
            });
        }
        self.counters.good += 1;
        Ok(())
    }

    fn steps(&mut self, payload: &[u8], sink: &mut impl FnMut(KnobEvent)) -> Result<(), Fault> {
        let [first, count, steps @ ..] = payload else {
            return Err(Fault::WrongLength);
        };
        for (knob, steps) in (u16::from(*first)..).zip(words(steps, *count)?) {
            let steps = steps.cast_signed();
            if steps != 0 {
                self.counters.events += 1;
                sink(KnobEvent {
                    knob,
                    reading: Reading::Steps(steps),
                });
            }
        }
        self.counters.good += 1;
        Ok(())
    }

    fn hello(&mut self, payload: &[u8]) -> Result<(), Fault> {
        let [_flags, knob_count, first, count, firmware_bytes, rest @ ..] = payload else {
            return Err(Fault::WrongLength);
        };
        let (firmware, knobs) = split(rest, *firmware_bytes, FIRMWARE_BYTES_MAX)?;
        let mut rest = knobs;
        for _ in 0..*count {
            (_, rest) = hello_knob(rest)?;
        }
        if !rest.is_empty() || u16::from(*first) + u16::from(*count) > u16::from(*knob_count) {
            return Err(Fault::WrongLength);
        }
        // All of it is sound: now it counts.
        self.knob_count = Some(*knob_count);
        self.firmware[..firmware.len()].copy_from_slice(firmware);
        self.firmware_bytes = *firmware_bytes;
        rest = knobs;
        for knob in (usize::from(*first)..).take(usize::from(*count)) {
            let (known, after) = hello_knob(rest)?;
            rest = after;
            if let Some(range) = self.ranges.get_mut(knob) {
                *range = Some(known.range);
            }
            self.counters.unnamed += u64::from(!self.names.set(knob, known.name));
        }
        self.counters.good += 1;
        Ok(())
    }
}

impl Default for Packets {
    fn default() -> Self {
        Self::new()
    }
}

struct HelloKnob<'a> {
    range: (u16, u16),
    name: &'a [u8],
}

/// Reads one knob of a HELLO; returns what follows it too.
fn hello_knob(bytes: &[u8]) -> Result<(HelloKnob<'_>, &[u8]), Fault> {
    let [low0, low1, high0, high1, name_bytes, rest @ ..] = bytes else {
        return Err(Fault::WrongLength);
    };
    let range = (u16::from_le_bytes([*low0, *low1]), u16::from_le_bytes([*high0, *high1]));
    let (name, rest) = split(rest, *name_bytes, HELLO_NAME_BYTES_MAX)?;
    Ok((HelloKnob { range, name }, rest))
}

/// Cuts a text of so many bytes off.
fn split(bytes: &[u8], length: u8, length_max: usize) -> Result<(&[u8], &[u8]), Fault> {
    let length = usize::from(length);
    let (text, rest) = bytes.split_at_checked(length).ok_or(Fault::WrongLength)?;
    let printable = core::str::from_utf8(text).is_ok_and(|text| !text.chars().any(char::is_control));
    if length > length_max || !printable {
        return Err(Fault::BadName);
    }
    Ok((text, rest))
}

fn words(bytes: &[u8], count: u8) -> Result<impl Iterator<Item = u16> + Clone + '_, Fault> {
    if bytes.len() != 2 * usize::from(count) {
        return Err(Fault::WrongLength);
    }
    Ok(bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])))
}

/// The frame without its checksum, if that holds.
fn checked(frame: &[u8]) -> Result<&[u8], Fault> {
    if frame.len() < HEADER_BYTES + CRC_BYTES {
        return Err(Fault::FrameTooShort);
    }
    let (content, crc) = frame.split_at(frame.len() - CRC_BYTES);
    if CRC.checksum(content).to_le_bytes() == crc {
        Ok(content)
    } else {
        Err(Fault::WrongChecksum)
    }
}

/// Writes one frame, boundary included: header, payload, checksum, stuffed. For programs that play the device.
///
/// Returns the bytes written, at most 256, or `None` if the payload or the frame does not fit.
pub fn write_frame(kind: FrameKind, sequence: u8, payload: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut frame = [0; FRAME_BYTES_MAX];
    let content_bytes = HEADER_BYTES + payload.len();
    let frame_bytes = content_bytes + CRC_BYTES;
    frame[..HEADER_BYTES].copy_from_slice(&[PACKET_VERSION, kind.code(), sequence]);
    frame.get_mut(HEADER_BYTES..content_bytes)?.copy_from_slice(payload);
    let crc = CRC.checksum(&frame[..content_bytes]);
    frame
        .get_mut(content_bytes..frame_bytes)?
        .copy_from_slice(&crc.to_le_bytes());
    let stuffed_bytes = cobs::try_encode(&frame[..frame_bytes], out).ok()?;
    *out.get_mut(stuffed_bytes)? = 0;
    Some(stuffed_bytes + 1)
}
