//! Firmata: analog reports of boards that run StandardFirmata, and the bytes that make such a board report.
//! Bytes -> messages -> [`KnobEvent`]; source: the Firmata protocol 2.x.
//!
//! The knob is the analog pin. The protocol's 14 bits say nothing of the converter's, so the full scale is that of
//! [`super::FullScale`].

use super::{
    BufferTooSmall, FullScale,
    scale::{Scales, TEN_BITS},
};
use crate::{Counters, Fault, KnobEvent};

/// Analog pins that a report can be asked for one by one.
pub const FIRMATA_PINS: u8 = 16;
/// Baud rate of StandardFirmata.
pub const FIRMATA_BAUD: u32 = 57_600;

const SYSEX: u8 = 0xf0;
const SYSEX_END: u8 = 0xf7;
const VERSION_REPORT: u8 = 0xf9;
const EXTENDED_ANALOG: u8 = 0x6f;
const SAMPLING_INTERVAL: u8 = 0x7a;
const REPORT_ANALOG: u8 = 0xc0;
/// Bytes of a sysex that are kept: enough for an extended analog report of 16 bits.
const SYSEX_BYTES: usize = 5;

/// Writes what a host must send before a board reports: the sampling interval and one request for each analog pin. Send
/// it again after each reset of the board.
///
/// Range: `pin_count` at most [`FIRMATA_PINS`], `interval_ms` 1 to 16383, both cut to it. Returns the bytes written.
/// Errors: `out` has less than `5 + 2 * pin_count` bytes; nothing was written.
pub fn write_firmata_request(pin_count: u8, interval_ms: u16, out: &mut [u8]) -> Result<usize, BufferTooSmall> {
    let pin_count = pin_count.min(FIRMATA_PINS);
    let required_bytes = 5 + 2 * usize::from(pin_count);
    let actual_bytes = out.len();
    let out = out.get_mut(..required_bytes).ok_or(BufferTooSmall {
        required_bytes,
        actual_bytes,
    })?;
    let interval_ms = interval_ms.clamp(1, 0x3fff);
    let (low, high) = ((interval_ms & 0x7f) as u8, (interval_ms >> 7) as u8);
    out[..5].copy_from_slice(&[SYSEX, SAMPLING_INTERVAL, low, high, SYSEX_END]);
    for (pin, request) in (0..pin_count).zip(out[5..].chunks_exact_mut(2)) {
        request.copy_from_slice(&[REPORT_ANALOG | pin, 1]);
    }
    Ok(required_bytes)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The message in which the port was opened, if any.
    Opening,
    /// Between messages.
    Idle,
    /// A message of this status; two data bytes in all, so many of them read.
    Message(u8, u8),
    /// A sysex with so many data bytes, those past `SYSEX_BYTES` not kept.
    Sysex(u16),
}

/// Parser of Firmata bytes.
#[derive(Debug, Clone)]
pub struct Firmata {
    stage: Stage,
    data: [u8; SYSEX_BYTES],
    opened_inside: bool,
    scales: Scales,
    pub(super) counters: Counters,
}

impl Firmata {
    /// At the beginning of a stream.
    pub const fn new(full_scale: FullScale) -> Self {
        Self {
            stage: Stage::Opening,
            data: [0; SYSEX_BYTES],
            opened_inside: false,
            scales: Scales::new(full_scale, TEN_BITS),
            counters: Counters::NONE,
        }
    }

    /// Reads bytes in any chunking.
    pub fn feed(&mut self, bytes: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        self.counters.bytes += bytes.len() as u64;
        for &byte in bytes {
            if byte < 0x80 {
                self.data(byte, sink);
            } else {
                self.begin(byte, sink);
            }
        }
    }

    /// The port was opened again: what is half read is thrown away. Scales and counters stay.
    pub fn reset(&mut self) {
        self.counters.partial += u64::from(self.half_read());
        (self.stage, self.opened_inside) = (Stage::Opening, false);
    }

    /// Totals so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    fn half_read(&self) -> bool {
        matches!(self.stage, Stage::Message(..) | Stage::Sysex(_))
    }

    fn begin(&mut self, byte: u8, sink: &mut impl FnMut(KnobEvent)) {
        if let (Stage::Sysex(length), SYSEX_END) = (self.stage, byte) {
            self.stage = Stage::Idle;
            self.sysex(usize::from(length), sink);
            return;
        }
        if self.half_read() {
            self.counters.refuse(Fault::CutMessage);
        }
        self.stage = match byte {
            SYSEX => Stage::Sysex(0),
            // Analog and digital reports and the version have two data bytes; all else has none that matters to us.
            0x90..=0x9f | 0xe0..=0xef | VERSION_REPORT => Stage::Message(byte, 0),
            SYSEX_END if self.stage == Stage::Opening => Stage::Idle,
            _ => {
                self.counters.ignored += 1;
                Stage::Idle
            }
        };
    }

    fn data(&mut self, byte: u8, sink: &mut impl FnMut(KnobEvent)) {
        match self.stage {
            Stage::Opening => {
                self.counters.partial += u64::from(!self.opened_inside);
                self.opened_inside = true;
            }
            Stage::Idle => self.counters.refuse(Fault::StrayData),
            Stage::Message(status, 0) => {
                self.data[0] = byte;
                self.stage = Stage::Message(status, 1);
            }
            Stage::Message(status, _) => {
                self.stage = Stage::Idle;
                if status & 0xf0 == 0xe0 {
                    let value = u16::from(byte) << 7 | u16::from(self.data[0]);
                    self.report(u16::from(status & 0x0f), value, sink);
                } else {
                    self.counters.ignored += 1;
                }
            }
            Stage::Sysex(length) => {
                if let Some(place) = self.data.get_mut(usize::from(length)) {
                    *place = byte;
                }
                self.stage = Stage::Sysex(length.saturating_add(1));
            }
        }
    }

    fn sysex(&mut self, length: usize, sink: &mut impl FnMut(KnobEvent)) {
        if length == 0 || self.data[0] != EXTENDED_ANALOG {
            self.counters.ignored += 1;
            return;
        }
        let groups = self.data.get(2..length).filter(|groups| !groups.is_empty());
        let value = groups.map(|groups| {
            groups
                .iter()
                .rev()
                .fold(0, |value, group| value << 7 | u32::from(*group))
        });
        match value.and_then(|value| u16::try_from(value).ok()) {
            Some(value) => self.report(u16::from(self.data[1]), value, sink),
            None => self.counters.refuse(Fault::BadReport),
        }
    }

    fn report(&mut self, knob: u16, value: u16, sink: &mut impl FnMut(KnobEvent)) {
        self.scales.notice(value);
        let reading = self.scales.read(knob, value, &mut self.counters);
        self.counters.good += 1;
        self.counters.events += 1;
        sink(KnobEvent { knob, reading });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Reading;
    use std::vec::Vec;

    fn read(firmata: &mut Firmata, bytes: &[u8]) -> Vec<(u16, u16, u16)> {
        let mut events = Vec::new();
        firmata.feed(bytes, &mut |event: KnobEvent| match event.reading {
            Reading::Position { value, full_scale } => events.push((event.knob, value, full_scale)),
            Reading::Steps(_) => unreachable!("Firmata reports positions"),
        });
        events
    }

    #[test]
    fn reports_behind_a_greeting() {
        let mut firmata = Firmata::new(FullScale::Learned);
        let greeting = b"\xf9\x02\x05\xf0\x79\x02\x05S\x00k\x00\xf7\x90\x04\x00";
        assert_eq!(read(&mut firmata, greeting), []);
        assert_eq!(firmata.counters().ignored, 3);
        assert_eq!(
            read(&mut firmata, b"\xe0\x00\x04\xe1\x7f\x07"),
            [(0, 512, 1023), (1, 1023, 1023)]
        );
        assert_eq!((firmata.counters().good, firmata.counters().bad), (2, 0));
    }

    #[test]
    fn extended_reports_reach_any_pin() {
        let mut firmata = Firmata::new(FullScale::Fixed(65535));
        assert_eq!(
            read(&mut firmata, b"\xf0\x6f\x14\x7f\x7f\x03\xf7"),
            [(20, 65535, 65535)]
        );
        for bad in [
            &b"\xf0\x6f\xf7"[..],
            b"\xf0\x6f\x14\xf7",
            b"\xf0\x6f\x14\x7f\x7f\x04\xf7",
            b"\xf0\x6f\x14\x01\x01\x01\x01\xf7",
        ] {
            let before = firmata.counters().bad;
            assert_eq!(read(&mut firmata, bad), []);
            assert_eq!(firmata.counters().bad, before + 1);
            assert_eq!(firmata.counters().last_fault, Some(Fault::BadReport));
        }
        let long = [&b"\xf0\x71"[..], &[1; 70_000], b"\xf7\xe0\x01\x00"].concat();
        assert_eq!(
            read(&mut firmata, &long),
            [(0, 1, 65535)],
            "a sysex of any length is skipped"
        );
    }

    #[test]
    fn each_fault_is_named() {
        for (bytes, fault) in [
            (&b"\xe0\x01\x02\x03\xe0\x01\x00"[..], Fault::StrayData),
            (b"\xe0\x01\xe0\x01\x00", Fault::CutMessage),
            (b"\xf0\x79\xe0\x01\x00", Fault::CutMessage),
        ] {
            let mut firmata = Firmata::new(FullScale::Learned);
            assert_eq!(read(&mut firmata, bytes).last(), Some(&(0, 1, 1023)));
            assert_eq!(
                (firmata.counters().bad, firmata.counters().last_fault),
                (1, Some(fault))
            );
        }
    }

    #[test]
    fn the_request_fits_or_says_so() {
        let mut out = [0xaa; 10];
        assert_eq!(write_firmata_request(2, 300, &mut out), Ok(9));
        assert_eq!(out, *b"\xf0\x7a\x2c\x02\xf7\xc0\x01\xc1\x01\xaa");
        let error = BufferTooSmall {
            required_bytes: 37,
            actual_bytes: 10,
        };
        assert_eq!(write_firmata_request(200, 0, &mut out), Err(error));
    }
}
