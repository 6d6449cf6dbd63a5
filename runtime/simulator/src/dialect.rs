//! What the simulated box speaks: readings -> the bytes of one report, in each of the languages that knob boxes have.

use core::fmt;

use sinew_knobs::Protocol;
use sinew_knobs::protocol::{FrameKind, write_frame};

/// A way of speaking a protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dialect {
    /// `0|240|1023` and a line end, ten bits.
    Deej,
    /// `512,103,77`, ten bits.
    Csv,
    /// `knob0:512,knob1:103`, as the Serial Plotter likes it, ten bits.
    Labels,
    /// Framed packets of positions, twelve bits, with a HELLO that names the knobs.
    Packets,
    /// Framed packets of encoder steps, 96 steps from end to end.
    Encoders,
    /// Control changes 70 and up on channel 1, sent when they change.
    Midi,
    /// Control changes 0 and up with their lower halves, 14 bits, sent when they change.
    Midi14,
    /// StandardFirmata: analog reports of the pins that the host asks for, ten bits.
    Firmata,
    /// `/knob/0 0.5` in SLIP.
    Osc,
}

/// The first controller of [`Dialect::Midi`], above those that come in pairs.
const FIRST_CONTROLLER: u16 = 70;
const CONTROL_CHANGE: u8 = 0xb0;
const FIRMATA_ANALOG: u8 = 0xe0;
const SLIP_END: u8 = 0xc0;
const SLIP_ESCAPE: u8 = 0xdb;

impl Dialect {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Deej,
        Self::Csv,
        Self::Labels,
        Self::Packets,
        Self::Encoders,
        Self::Midi,
        Self::Midi14,
        Self::Firmata,
        Self::Osc,
    ];

    /// Its name on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Deej => "deej",
            Self::Csv => "csv",
            Self::Labels => "labels",
            Self::Packets => "packets",
            Self::Encoders => "encoders",
            Self::Midi => "midi",
            Self::Midi14 => "midi14",
            Self::Firmata => "firmata",
            Self::Osc => "osc",
        }
    }

    /// The dialect of a name; case does not matter.
    pub fn parse_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|dialect| dialect.name().eq_ignore_ascii_case(name))
    }

    /// The protocol that a host must know.
    pub const fn protocol(self) -> Protocol {
        match self {
            Self::Deej | Self::Csv | Self::Labels => Protocol::Lines,
            Self::Packets | Self::Encoders => Protocol::Packets,
            Self::Midi | Self::Midi14 => Protocol::Midi,
            Self::Firmata => Protocol::Firmata,
            Self::Osc => Protocol::Osc,
        }
    }

    /// The largest reading of its converter.
    pub const fn full_scale(self) -> u16 {
        match self {
            Self::Deej | Self::Csv | Self::Labels | Self::Firmata => 1023,
            Self::Packets | Self::Osc => 4095,
            Self::Encoders => 96,
            Self::Midi => 127,
            Self::Midi14 => 16_383,
        }
    }

    /// The most knobs that a box of this kind can have.
    pub const fn knobs_max(self) -> u16 {
        match self {
            Self::Firmata => 16,
            Self::Midi14 => 32,
            Self::Midi => 50,
            _ => 64,
        }
    }

    /// The address under which a host hears a knob; see [`sinew_knobs::protocol`].
    pub const fn address(self, knob: u16) -> u16 {
        match self {
            Self::Midi => FIRST_CONTROLLER + knob,
            _ => knob,
        }
    }
}

impl fmt::Display for Dialect {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// Writes reports. What it remembers is what the device would: sequence numbers, what was sent, what the host asked for.
#[derive(Debug)]
pub(crate) struct Speaker {
    dialect: Dialect,
    sequence: u8,
    /// Readings as last sent; `None`: not since the box was plugged in.
    sent: Vec<Option<u16>>,
    /// Firmata pins asked for.
    asked_pins: u16,
    /// A HELLO is due.
    hello: bool,
    started: bool,
    half_request: Option<u8>,
}

impl Speaker {
    pub(crate) fn new(dialect: Dialect, knob_count: usize) -> Self {
        Self {
            dialect,
            sequence: 0,
            sent: vec![None; knob_count],
            asked_pins: 0,
            hello: true,
            started: true,
            half_request: None,
        }
    }

    /// The box has just got its power.
    pub(crate) fn power_up(&mut self, out: &mut Vec<u8>) {
        *self = Self::new(self.dialect, self.sent.len());
        match self.dialect {
            Dialect::Packets | Dialect::Encoders => out.push(0),
            // Protocol version 2.5, then the name of the firmware, two bytes a character.
            Dialect::Firmata => {
                out.extend([0xf9, 2, 5, 0xf0, 0x79, 2, 5]);
                out.extend(b"Simulated".iter().flat_map(|letter| [letter & 0x7f, letter >> 7]));
                out.push(0xf7);
            }
            _ => {}
        }
    }

    /// What the host wrote.
    pub(crate) fn heard(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            match (self.dialect, self.half_request.take()) {
                (Dialect::Packets | Dialect::Encoders, _) => self.hello |= byte == b'?',
                (Dialect::Firmata, Some(pin)) if byte < 0x80 => {
                    self.asked_pins = self.asked_pins & !(1 << pin) | u16::from(byte != 0) << pin;
                }
                (Dialect::Firmata, _) if byte & 0xf0 == 0xc0 => self.half_request = Some(byte & 0x0f),
                _ => {}
            }
        }
    }

    /// One report of all readings, or of those that changed where boxes of this kind do so.
    pub(crate) fn report(&mut self, readings: &[u16], out: &mut Vec<u8>) {
        let joined = |separator: &str| readings.iter().map(u16::to_string).collect::<Vec<_>>().join(separator);
        match self.dialect {
            Dialect::Deej => out.extend(format!("{}\r\n", joined("|")).bytes()),
            Dialect::Csv => out.extend(format!("{}\n", joined(",")).bytes()),
            Dialect::Labels => {
                let fields = readings
                    .iter()
                    .enumerate()
                    .map(|(knob, reading)| format!("knob{knob}:{reading}"));
                out.extend(format!("{}\n", fields.collect::<Vec<_>>().join(",")).bytes());
            }
            Dialect::Packets | Dialect::Encoders => self.packets(readings, out),
            Dialect::Midi | Dialect::Midi14 => self.midi(readings, out),
            Dialect::Firmata => {
                for (pin, reading) in (0u8..16).zip(readings) {
                    if self.asked_pins & 1 << pin != 0 {
                        out.extend([FIRMATA_ANALOG | pin, (reading & 0x7f) as u8, (reading >> 7) as u8]);
                    }
                }
            }
            Dialect::Osc => {
                for (knob, reading) in readings.iter().enumerate() {
                    osc_message(knob, f32::from(*reading) / f32::from(self.dialect.full_scale()), out);
                }
            }
        }
        for (sent, reading) in self.sent.iter_mut().zip(readings) {
            *sent = Some(*reading);
        }
    }

    fn packets(&mut self, readings: &[u16], out: &mut Vec<u8>) {
        if core::mem::take(&mut self.hello) {
            // Few enough knobs a frame that their names fit.
            for first in (0..readings.len()).step_by(12) {
                self.hello_frame(first, (readings.len() - first).min(12), readings.len(), out);
            }
        }
        let mut payload = vec![0, readings.len() as u8];
        if self.dialect == Dialect::Packets {
            payload.extend(self.dialect.full_scale().to_le_bytes());
            payload.extend(readings.iter().flat_map(|reading| reading.to_le_bytes()));
            self.frame(FrameKind::Values, &payload, out);
        } else {
            for (reading, sent) in readings.iter().zip(&self.sent) {
                let steps = *reading as i16 - sent.unwrap_or(*reading) as i16;
                payload.extend(steps.to_le_bytes());
            }
            self.frame(FrameKind::Steps, &payload, out);
        }
    }

    fn hello_frame(&mut self, first: usize, count: usize, knob_count: usize, out: &mut Vec<u8>) {
        const FIRMWARE: &str = "simulated 1";
        let started = u8::from(core::mem::take(&mut self.started));
        let mut payload = vec![
            started,
            knob_count as u8,
            first as u8,
            count as u8,
            FIRMWARE.len() as u8,
        ];
        payload.extend(FIRMWARE.bytes());
        for knob in first..first + count {
            let name = format!("knob{knob}");
            payload.extend(0u16.to_le_bytes());
            payload.extend(self.dialect.full_scale().to_le_bytes());
            payload.push(name.len() as u8);
            payload.extend(name.bytes());
        }
        self.frame(FrameKind::Hello, &payload, out);
    }

    fn frame(&mut self, kind: FrameKind, payload: &[u8], out: &mut Vec<u8>) {
        let mut frame = [0; 256];
        let length = write_frame(kind, self.sequence, payload, &mut frame).expect("64 knobs fit a frame");
        out.extend_from_slice(&frame[..length]);
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn midi(&mut self, readings: &[u16], out: &mut Vec<u8>) {
        let mut status = false;
        for (knob, (reading, sent)) in readings.iter().zip(&self.sent).enumerate() {
            if Some(*reading) == *sent {
                continue;
            }
            if !status {
                out.push(CONTROL_CHANGE); // running status covers the rest of the report
                status = true;
            }
            let knob = knob as u8;
            if self.dialect == Dialect::Midi {
                out.extend([FIRST_CONTROLLER as u8 + knob, *reading as u8]);
            } else {
                out.extend([knob, (reading >> 7) as u8, knob + 32, (reading & 0x7f) as u8]);
            }
        }
    }
}

fn osc_message(knob: usize, value: f32, out: &mut Vec<u8>) {
    let mut message = format!("/knob/{knob}").into_bytes();
    message.resize(message.len() / 4 * 4 + 4, 0); // at least one zero
    message.extend(b",f\0\0");
    message.extend(value.to_be_bytes());
    out.push(SLIP_END);
    for byte in message {
        match byte {
            SLIP_END => out.extend([SLIP_ESCAPE, 0xdc]),
            SLIP_ESCAPE => out.extend([SLIP_ESCAPE, 0xdd]),
            byte => out.push(byte),
        }
    }
    out.push(SLIP_END);
}
