//! Firmata: analog reports of boards that run StandardFirmata, and the bytes that make such a board report.
//! Bytes -> messages -> [`KnobEvent`]; source: the Firmata protocol 2.x.
//!
//! The knob is the analog pin. The protocol's 14 bits say nothing of the converter's, so the full scale is that of
//! [`super::FullScale`].

use super::{
    BufferTooSmall, FullScale,
    scale::{Scales, TEN_BITS},
};
use crate::input::{Counters, Fault, KnobEvent};

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
