//! The simplest line protocol of a knob box: positions from 0 to 1023 joined by `|`, ended by a line feed.

use core::fmt;

use sinew_checksum::FULL_SCALE;

/// Knobs a line; more are refused.
const KNOB_LIMIT: usize = 64;

/// The line being received.
pub struct Line {
    knobs: [u16; KNOB_LIMIT],
    /// Knobs that are whole.
    count: usize,
    /// Digits of the knob being received.
    value: Option<u16>,
    fault: Option<Refused>,
}

/// Why a line is none.
#[derive(Clone, Copy)]
pub enum Refused {
    /// This byte has no place there.
    Byte(u8),
    /// Two bars, or a bar and the end, with nothing between them.
    EmptyKnob,
    /// Above 1023.
    TooLarge,
    /// More knobs than the program keeps.
    TooMany,
}

impl Line {
    /// Nothing received yet.
    pub fn new() -> Self {
        Self {
            knobs: [0; KNOB_LIMIT],
            count: 0,
            value: None,
            fault: None,
        }
    }

    /// Takes one byte; at the end of a line, its knobs or why it is refused. Empty lines and carriage returns are skipped.
    pub fn push(&mut self, byte: u8) -> Option<Result<&[u16], Refused>> {
        match byte {
            b'\r' => {}
            b'\n' if self.count == 0 && self.value.is_none() && self.fault.is_none() => {}
            b'\n' => {
                self.end_knob();
                let count = core::mem::take(&mut self.count);
                return Some(match self.fault.take() {
                    Some(fault) => Err(fault),
                    None => Ok(&self.knobs[..count]),
                });
            }
            b'|' => self.end_knob(),
            b'0'..=b'9' => {
                let value = u32::from(self.value.unwrap_or(0)) * 10 + u32::from(byte - b'0');
                let reading = u16::try_from(value).ok().filter(|&value| value <= FULL_SCALE);
                if reading.is_none() {
                    self.refuse(Refused::TooLarge);
                }
                self.value = Some(reading.unwrap_or(0));
            }
            byte => self.refuse(Refused::Byte(byte)),
        }
        None
    }

    fn end_knob(&mut self) {
        match (self.value.take(), self.count) {
            (None, _) => self.refuse(Refused::EmptyKnob),
            (Some(_), KNOB_LIMIT) => self.refuse(Refused::TooMany),
            (Some(value), count) => {
                self.knobs[count] = value;
                self.count += 1;
            }
        }
    }

    /// The first fault of a line is the one reported.
    fn refuse(&mut self, fault: Refused) {
        self.fault.get_or_insert(fault);
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(out, "byte {byte:#04x}"),
            Self::EmptyKnob => out.write_str("a knob without a number"),
            Self::TooLarge => write!(out, "a knob above {FULL_SCALE}"),
            Self::TooMany => write!(out, "more than {KNOB_LIMIT} knobs"),
        }
    }
}
