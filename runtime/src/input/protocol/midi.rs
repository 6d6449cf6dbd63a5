//! MIDI bytes, from a DIN cable, USB or a plain UART: control changes, pitch bend, notes. Bytes -> messages -> [`KnobEvent`].
//!
//! Numbers of knobs, with channels from 0: control change `channel * 128 + controller`, pitch bend `2048 + channel`, note
//! `2064 + channel * 128 + note`. A note is a button: 127 of 127 while it is held, then 0.
//!
//! **Pairs.** A 14-bit controller sends its upper seven bits as controller `n`, then its lower ones as `n + 32`. Between the
//! halves the true value is not known. The reading given out then is the value nearest to the last one that has the new
//! upper half: it lies between the old and the true value, so no reading ever overshoots, and none waits.

use super::encoder::{CHANNELS, CONTROLLERS, Coding, MidiSettings, Pairing};
use crate::input::{Counters, Fault, KnobEvent, Reading};

/// Number of the pitch bend of channel 0.
pub const KNOB_PITCH_BEND: u16 = (CHANNELS * CONTROLLERS) as u16;
/// Number of note 0 of channel 0.
pub const KNOB_NOTE: u16 = KNOB_PITCH_BEND + CHANNELS as u16;

const FULL_7_BIT: u16 = 127;
const FULL_14_BIT: u16 = 16383;
/// Controllers with a lower half.
const PAIRS: u8 = 32;
/// From here on control changes are commands, such as all notes off.
const CONTROLLERS_END: u8 = 120;

/// What the data bytes that follow belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Status {
    /// Nothing: they are stray.
    None,
    /// A channel message. It stays for further data: running status.
    Channel(u8),
    /// A system message with so many data bytes to come, then nothing.
    System(u8),
    Sysex,
    /// The message in which the port was opened: its beginning was never seen.
    Opening,
}

/// Parser of MIDI bytes.
#[derive(Debug, Clone)]
pub struct Midi {
    settings: MidiSettings,
    status: Status,
    /// First data byte of a message with two.
    first: Option<u8>,
    /// Data bytes came before the first status byte of the stream.
    opened_inside: bool,
    /// The last channel message, if it was a control change: channel and controller.
    last: Option<(u8, u8)>,
    /// Last value of the controllers that may be pairs.
    values: [[u16; PAIRS as usize]; CHANNELS],
    /// Bit `n`: controller `n` has a lower half.
    paired: [u32; CHANNELS],
    /// Bit `n`: controller `n + 32` was seen on its own.
    alone: [u32; CHANNELS],
    pub(super) counters: Counters,
}

impl Midi {
    /// At the beginning of a stream.
    pub const fn new(settings: MidiSettings) -> Self {
        Self {
            settings,
            status: Status::Opening,
            first: None,
            opened_inside: false,
            last: None,
            values: [[0; PAIRS as usize]; CHANNELS],
            paired: [0; CHANNELS],
            alone: [0; CHANNELS],
            counters: Counters::NONE,
        }
    }

    /// Reads bytes in any chunking.
    pub fn feed(&mut self, bytes: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        self.counters.bytes += bytes.len() as u64;
        for &byte in bytes {
            match byte {
                0xf8.. => self.counters.ignored += 1, // real time, anywhere, even inside a message
                0x80..0xf8 => self.begin(byte),
                _ => self.data(byte, sink),
            }
        }
    }

    /// The port was opened again: what is half read is thrown away. Pairs and counters stay.
    pub fn reset(&mut self) {
        self.counters.partial += u64::from(self.half_read());
        (self.status, self.first, self.last, self.opened_inside) = (Status::Opening, None, None, false);
    }

    /// Totals so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    fn half_read(&self) -> bool {
        self.first.is_some() || matches!(self.status, Status::System(_) | Status::Sysex)
    }

    fn begin(&mut self, byte: u8) {
        // 0xf7 closes a sysex; so does any other status byte, and then the sysex was cut.
        let closes = self.status == Status::Sysex && byte == 0xf7;
        if self.half_read() && !closes {
            self.counters.refuse(Fault::CutMessage);
        }
        self.first = None;
        self.status = match byte {
            0xf0 => Status::Sysex,
            0xf1 | 0xf3 => Status::System(1),
            0xf2 => Status::System(2),
            0xf4..0xf8 => {
                // A lone 0xf7 in the first bytes closes the sysex in which the port was opened.
                self.counters.ignored += 1;
                Status::None
            }
            _ => Status::Channel(byte),
        };
    }

    fn data(&mut self, byte: u8, sink: &mut impl FnMut(KnobEvent)) {
        match self.status {
            Status::None => self.counters.refuse(Fault::StrayData),
            Status::Sysex => {}
            Status::Opening => {
                self.counters.partial += u64::from(!self.opened_inside);
                self.opened_inside = true;
            }
            Status::System(left) => {
                self.status = if left > 1 {
                    Status::System(left - 1)
                } else {
                    Status::None
                };
                self.counters.ignored += u64::from(left <= 1);
            }
            Status::Channel(status) => match (status & 0xf0, self.first.take()) {
                (0xc0 | 0xd0, _) => self.counters.ignored += 1,
                (_, None) => self.first = Some(byte),
                (_, Some(first)) => self.message(status, first, byte, sink),
            },
        }
    }

    fn message(&mut self, status: u8, first: u8, second: u8, sink: &mut impl FnMut(KnobEvent)) {
        let channel = status & 0x0f;
        let before = self.last.take();
        let event = match status & 0xf0 {
            0x80 | 0x90 => {
                let held = status & 0xf0 == 0x90 && second > 0;
                let knob = KNOB_NOTE + u16::from(channel) * CONTROLLERS as u16 + u16::from(first);
                Some(position(knob, if held { FULL_7_BIT } else { 0 }, FULL_7_BIT))
            }
            0xe0 => {
                let value = u16::from(second) << 7 | u16::from(first);
                Some(position(KNOB_PITCH_BEND + u16::from(channel), value, FULL_14_BIT))
            }
            0xb0 if first < CONTROLLERS_END => {
                self.last = Some((channel, first));
                self.control_change(channel, first, second, before)
            }
            _ => None,
        };
        match event {
            Some(event) => {
                self.counters.good += 1;
                self.counters.events += 1;
                sink(event);
            }
            None => self.counters.ignored += 1,
        }
    }

    fn control_change(&mut self, channel: u8, controller: u8, data: u8, before: Option<(u8, u8)>) -> Option<KnobEvent> {
        let knob_of = |controller: u8| u16::from(channel) * CONTROLLERS as u16 + u16::from(controller);
        let knob = knob_of(controller);
        if let Some(steps) = self.settings.coding(knob).steps(data) {
            return (steps != 0).then_some(KnobEvent {
                knob,
                reading: Reading::Steps(steps),
            });
        }
        let (row, n) = (usize::from(channel), controller % PAIRS);
        let may_pair = self.settings.pairing != Pairing::Never && self.settings.coding(knob_of(n)) == Coding::Absolute;
        let bit = 1 << n;
        match controller / PAIRS {
            0 => {
                let paired = may_pair && (self.paired[row] & bit != 0 || self.settings.pairing == Pairing::Always);
                let value = &mut self.values[row][usize::from(n)];
                let lowest = u16::from(data) << 7;
                if !paired {
                    *value = lowest;
                    return Some(position(knob, u16::from(data), FULL_7_BIT));
                }
                *value = (*value).clamp(lowest, lowest | 0x7f);
                Some(position(knob, *value, FULL_14_BIT))
            }
            1 => {
                let learned = before == Some((channel, n)) && self.alone[row] & bit == 0;
                if may_pair && (self.paired[row] & bit != 0 || self.settings.pairing == Pairing::Always || learned) {
                    self.paired[row] |= bit;
                    let value = &mut self.values[row][usize::from(n)];
                    *value = *value & !0x7f | u16::from(data);
                    return Some(position(knob_of(n), *value, FULL_14_BIT));
                }
                self.alone[row] |= bit;
                Some(position(knob, u16::from(data), FULL_7_BIT))
            }
            _ => Some(position(knob, u16::from(data), FULL_7_BIT)),
        }
    }
}

fn position(knob: u16, value: u16, full_scale: u16) -> KnobEvent {
    KnobEvent {
        knob,
        reading: Reading::Position { value, full_scale },
    }
}
