//! OSC 1.0: messages and bundles, a datagram at a time or in SLIP on a serial line. Packets -> messages -> [`KnobEvent`].
//!
//! rosc, the library of the field, builds its messages on a heap; this core has none, so it reads them in place.
//!
//! The knob is the address in order of appearance. A string in front of a number is part of the name, as VMC does it
//! (`/VMC/Ext/Blend/Val "Joy" 0.5` is `/VMC/Ext/Blend/Val/Joy`); a second number of a message is the knob `ADDRESS#1`, a third
//! `ADDRESS#2`. Messages with more than [`OSC_NUMBERS_MAX`] numbers are poses, not knobs, and are ignored; so are VMC's clock and
//! its other news of the sender. Floats are parts of [`OscRanges`], integers have the full scale of [`FullScale`] (learned from 127 on), booleans are 0 or 1 of 1.

use super::{
    FullScale,
    names::{Name, Names, OSC_NAMES_MAX},
    osc_ranges::OscRanges,
    scale::{SEVEN_BITS, Scales, fraction},
    slip::{END, Packet, Slip},
};
use crate::{Counters, Fault, KnobEvent, Reading};

/// Numbers of a message that is a knob.
pub const OSC_NUMBERS_MAX: usize = 4;
/// Bundles within bundles.
pub const OSC_DEPTH_MAX: u8 = 8;

const BUNDLE: &[u8] = b"#bundle\0";
const TIME_TAG_BYTES: usize = 8;
/// What VMC senders tell of themselves, many times a second: no knobs.
const NEWS: [&[u8]; 6] = [
    b"/VMC/Ext/OK",
    b"/VMC/Ext/T",
    b"/VMC/Ext/Opt",
    b"/VMC/Ext/VRM",
    b"/VMC/Ext/Remote",
    b"/VMC/Ext/Rcv",
];
const SUFFIXES: [&[u8]; OSC_NUMBERS_MAX] = [b"", b"#1", b"#2", b"#3"];

/// Parser of OSC.
#[derive(Debug, Clone)]
pub struct Osc {
    slip: Slip,
    /// A packet ended since the stream began.
    in_step: bool,
    messages: Messages,
}

impl Osc {
    /// At the beginning of a stream.
    pub const fn new(full_scale: FullScale, ranges: OscRanges) -> Self {
        Self {
            slip: Slip::new(),
            in_step: false,
            messages: Messages {
                names: Names::new(),
                ranges,
                scales: Scales::new(full_scale, SEVEN_BITS),
                counters: Counters::NONE,
            },
        }
    }

    /// Reads bytes of a serial line, SLIP, in any chunking.
    pub fn feed(&mut self, bytes: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        self.messages.counters.bytes += bytes.len() as u64;
        for &byte in bytes {
            if byte == END && !self.slip.pending() {
                self.in_step = true; // an end in front of a packet
            }
            let counters = &mut self.messages.counters;
            match self.slip.push(byte) {
                None => {}
                // The first packet may have lost its beginning, and what is left may look whole.
                Some(_) if !self.in_step => {
                    self.in_step = true;
                    counters.partial += 1;
                }
                Some(Packet::Whole(packet)) => self.messages.packet(packet, 0, sink),
                Some(Packet::TooLong) => counters.overflow(Fault::FrameTooLong),
                Some(Packet::Broken) => counters.refuse(Fault::BrokenStuffing),
            }
        }
    }

    /// Reads one datagram.
    pub fn feed_packet(&mut self, packet: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        self.messages.counters.bytes += packet.len() as u64;
        self.messages.packet(packet, 0, sink);
    }

    /// The port was opened again: what is half read is thrown away. Names, scales and counters stay.
    pub fn reset(&mut self) {
        self.messages.counters.partial += u64::from(self.slip.pending());
        self.slip.clear();
        self.in_step = false;
    }

    /// Totals so far; messages are counted one by one, those of bundles too.
    pub fn counters(&self) -> &Counters {
        &self.messages.counters
    }

    pub(super) fn counters_mut(&mut self) -> &mut Counters {
        &mut self.messages.counters
    }

    /// Name of a knob.
    pub fn name_of(&self, knob: u16) -> Option<&str> {
        Some(self.name(knob)?.as_str())
    }

    pub(super) fn name(&self, knob: u16) -> Option<&Name> {
        self.messages.names.get(knob)
    }
}

#[derive(Debug, Clone)]
struct Messages {
    names: Names<OSC_NAMES_MAX>,
    ranges: OscRanges,
    scales: Scales,
    counters: Counters,
}

impl Messages {
    /// A message or a bundle. A bad one inside a bundle does not take its neighbours with it.
    fn packet(&mut self, packet: &[u8], depth: u8, sink: &mut impl FnMut(KnobEvent)) {
        let taken = match packet {
            [b'/', ..] => self.message(packet, sink),
            _ if packet.starts_with(BUNDLE) => self.bundle(&packet[BUNDLE.len()..], depth, sink),
            _ => Err(Fault::NotOsc),
        };
        if let Err(fault) = taken {
            self.counters.refuse(fault);
        }
    }

    fn bundle(&mut self, bundle: &[u8], depth: u8, sink: &mut impl FnMut(KnobEvent)) -> Result<(), Fault> {
        if depth == OSC_DEPTH_MAX {
            return Err(Fault::OscTooDeep);
        }
        let mut rest = bundle.get(TIME_TAG_BYTES..).ok_or(Fault::OscCutShort)?;
        while !rest.is_empty() {
            let size = u32::from_be_bytes(take(&mut rest)?) as usize;
            let (element, after) = rest.split_at_checked(size).ok_or(Fault::OscCutShort)?;
            rest = after;
            self.packet(element, depth + 1, sink);
        }
        Ok(())
    }

    fn message(&mut self, message: &[u8], sink: &mut impl FnMut(KnobEvent)) -> Result<(), Fault> {
        let mut rest = message;
        let address = string(&mut rest)?;
        if !address.iter().all(|byte| (b' '..0x7f).contains(byte)) {
            return Err(Fault::OscBadAddress);
        }
        let [b',', types @ ..] = string(&mut rest).map_err(|_| Fault::OscBadTypes)? else {
            return Err(Fault::OscBadTypes);
        };
        // First all of it is checked, then all of it counts.
        let mut number_count = 0;
        let mut data = rest;
        for kind in types {
            match argument(*kind, &mut data)? {
                Argument::Float(value) if !value.is_finite() => return Err(Fault::NotFinite),
                Argument::Float(_) | Argument::Integer(_) | Argument::Switch(_) => number_count += 1,
                Argument::Text(_) | Argument::Other => {}
            }
        }
        if !data.is_empty() {
            return Err(Fault::OscCutShort);
        }
        if number_count == 0 || number_count > OSC_NUMBERS_MAX || NEWS.contains(&address) {
            self.counters.ignored += 1;
            return Ok(());
        }
        self.counters.good += 1;
        let mut text: Option<&[u8]> = None;
        let mut suffixes = SUFFIXES.iter();
        for kind in types {
            let number = match argument(*kind, &mut rest)? {
                Argument::Text(found) => {
                    text = Some(found);
                    suffixes = SUFFIXES.iter();
                    continue;
                }
                Argument::Other => continue,
                number => number,
            };
            let suffix = suffixes.next().copied().unwrap_or_default();
            let parts: &[&[u8]] = match text {
                Some(text) => &[address, b"/", text, suffix],
                None => &[address, suffix],
            };
            let knob = self.number(parts);
            let reading = self.reading(knob, parts, number);
            self.counters.events += 1;
            sink(KnobEvent { knob, reading });
        }
        Ok(())
    }

    fn number(&mut self, parts: &[&[u8]]) -> u16 {
        let (knob, named) = self.names.number(parts);
        self.counters.unnamed += u64::from(!named);
        knob
    }

    fn reading(&mut self, knob: u16, parts: &[&[u8]], number: Argument<'_>) -> Reading {
        match number {
            Argument::Float(value) => fraction(self.ranges.share(parts, value), &mut self.counters),
            Argument::Integer(value) => {
                let cut = value.clamp(0, i64::from(u16::MAX)) as u16;
                if i64::from(cut) != value {
                    self.counters.clamp();
                }
                self.scales.notice(cut);
                self.scales.read(knob, cut, &mut self.counters)
            }
            Argument::Switch(_) | Argument::Text(_) | Argument::Other => Reading::Position {
                value: u16::from(matches!(number, Argument::Switch(true))),
                full_scale: 1,
            },
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Argument<'a> {
    Float(f32),
    Integer(i64),
    Switch(bool),
    Text(&'a [u8]),
    Other,
}

/// Reads one argument of the kind that its type tag says.
fn argument<'a>(kind: u8, rest: &mut &'a [u8]) -> Result<Argument<'a>, Fault> {
    Ok(match kind {
        b'f' => Argument::Float(f32::from_be_bytes(take(rest)?)),
        b'd' => Argument::Float(f64::from_be_bytes(take(rest)?) as f32),
        b'i' => Argument::Integer(i64::from(i32::from_be_bytes(take(rest)?))),
        b'h' => Argument::Integer(i64::from_be_bytes(take(rest)?)),
        b'T' => Argument::Switch(true),
        b'F' => Argument::Switch(false),
        b's' | b'S' => {
            let text = string(rest)?;
            let printable = core::str::from_utf8(text).is_ok_and(|text| !text.chars().any(char::is_control));
            if printable && !text.is_empty() {
                Argument::Text(text)
            } else {
                Argument::Other
            }
        }
        b'b' => {
            let size = u32::from_be_bytes(take(rest)?) as usize;
            let padded = size.checked_next_multiple_of(4).ok_or(Fault::OscCutShort)?;
            *rest = rest.get(padded..).ok_or(Fault::OscCutShort)?;
            Argument::Other
        }
        b't' => {
            take::<TIME_TAG_BYTES>(rest)?;
            Argument::Other
        }
        b'c' | b'r' | b'm' => {
            take::<4>(rest)?;
            Argument::Other
        }
        b'N' | b'I' | b'[' | b']' => Argument::Other,
        _ => return Err(Fault::OscBadTypes),
    })
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], Fault> {
    let (taken, after) = rest.split_first_chunk().ok_or(Fault::OscCutShort)?;
    *rest = after;
    Ok(*taken)
}

/// Reads a text that ends in one to four zeros, on a multiple of four bytes.
fn string<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], Fault> {
    let length = rest.iter().position(|byte| *byte == 0).ok_or(Fault::OscCutShort)?;
    let text = &rest[..length];
    *rest = rest.get((length + 1).next_multiple_of(4)..).ok_or(Fault::OscCutShort)?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{format, vec, vec::Vec};

    fn text(text: &str) -> Vec<u8> {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize((bytes.len() + 1).next_multiple_of(4), 0);
        bytes
    }

    fn message(address: &str, types: &str, data: &[u8]) -> Vec<u8> {
        [&text(address)[..], &text(types), data].concat()
    }

    fn float(address: &str, value: f32) -> Vec<u8> {
        message(address, ",f", &value.to_be_bytes())
    }

    fn bundle(elements: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = [BUNDLE, &[0, 0, 0, 0, 0, 0, 0, 1]].concat();
        for element in elements {
            bytes.extend((element.len() as u32).to_be_bytes());
            bytes.extend(element);
        }
        bytes
    }

    fn read(osc: &mut Osc, packet: &[u8]) -> Vec<(u16, u16, u16)> {
        let mut events = Vec::new();
        osc.feed_packet(packet, &mut |event: KnobEvent| match event.reading {
            Reading::Position { value, full_scale } => events.push((event.knob, value, full_scale)),
            Reading::Steps(_) => unreachable!("OSC holds positions"),
        });
        events
    }

    #[test]
    fn addresses_are_knobs() {
        let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
        assert_eq!(read(&mut osc, &float("/jaw", 1.0)), [(0, 65535, 65535)]);
        assert_eq!(read(&mut osc, &float("/brow", 0.0)), [(1, 0, 65535)]);
        assert_eq!(read(&mut osc, &message("/i", ",i", &[0, 0, 0, 64])), [(2, 64, 127)]);
        assert_eq!(read(&mut osc, &message("/on", ",TF", &[])), [(3, 1, 1), (4, 0, 1)]);
        assert_eq!((osc.name_of(3), osc.name_of(4)), (Some("/on"), Some("/on#1")));
        let vmc = message(
            "/VMC/Ext/Blend/Val",
            ",sf",
            &[&text("Joy")[..], &0.5_f32.to_be_bytes()].concat(),
        );
        assert_eq!(read(&mut osc, &vmc), [(5, 32768, 65535)]);
        assert_eq!(osc.name_of(5), Some("/VMC/Ext/Blend/Val/Joy"));
        let all = [
            &[0, 0, 0, 5, 1, 2, 3, 4, 5, 0, 0, 0][..],
            &[0; 8],
            &[0; 4],
            &0.25_f64.to_be_bytes(),
            &3_i64.to_be_bytes(),
        ];
        assert_eq!(
            read(&mut osc, &message("/all", ",btc[N]Idh", &all.concat())),
            [(6, 16384, 65535), (7, 3, 127)]
        );
        assert_eq!((osc.counters().good, osc.counters().bad), (6, 0));
        assert_eq!(read(&mut osc, &message("/pose", ",fffffff", &[0; 28])), []);
        assert_eq!(osc.counters().ignored, 1);
    }

    #[test]
    fn a_tracker_of_a_face_is_heard_whole_and_its_clock_is_no_knob() {
        let mut ranges = OscRanges::new();
        assert!(ranges.set("/gaze#1", [-1.0, 1.0]));
        let mut osc = Osc::new(FullScale::Learned, ranges);
        let gaze = message(
            "/gaze",
            ",ff",
            &[0.5_f32.to_be_bytes(), (-0.5_f32).to_be_bytes()].concat(),
        );
        assert_eq!(read(&mut osc, &gaze), [(0, 32768, 65535), (1, 16384, 65535)]);
        for n in 0..100_u32 {
            let time = n as f32 / 60.0;
            assert_eq!(read(&mut osc, &float("/VMC/Ext/T", time)), []);
            assert_eq!(read(&mut osc, &message("/VMC/Ext/OK", ",i", &[0, 0, 0, 1])), []);
        }
        for n in 2..OSC_NAMES_MAX {
            let name = format!("/VMC/Ext/Blend/Val/{n}");
            assert_eq!(read(&mut osc, &float(&name, 1.0)), [(n as u16, 65535, 65535)]);
        }
        let counters = osc.counters();
        assert_eq!((counters.clamped, counters.unnamed, counters.ignored), (0, 0, 200));
    }

    #[test]
    fn values_outside_are_cut_and_counted() {
        let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
        assert_eq!(read(&mut osc, &float("/a", -0.5)), [(0, 0, 65535)]);
        assert_eq!(read(&mut osc, &float("/a", 7.0)), [(0, 65535, 65535)]);
        assert_eq!(
            read(&mut osc, &message("/b", ",i", &(-3_i32).to_be_bytes())),
            [(1, 0, 127)]
        );
        assert_eq!(
            (osc.counters().clamped, osc.counters().last_fault),
            (3, Some(Fault::OutOfRange))
        );
    }

    #[test]
    fn bundles_nest_to_a_depth() {
        let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
        let inner = bundle(&[float("/b", 1.0), b"bad.".to_vec(), float("/a", 0.0)]);
        let events = read(&mut osc, &bundle(&[float("/a", 1.0), inner]));
        assert_eq!(events, [(0, 65535, 65535), (1, 65535, 65535), (0, 0, 65535)]);
        assert_eq!(
            (osc.counters().bad, osc.counters().last_fault),
            (1, Some(Fault::NotOsc))
        );
        let mut packet = float("/a", 1.0);
        for depth in 1..=OSC_DEPTH_MAX + 1 {
            packet = bundle(&[packet]);
            let events = read(&mut osc, &packet);
            assert_eq!(events.len(), usize::from(depth <= OSC_DEPTH_MAX));
        }
        assert_eq!(osc.counters().last_fault, Some(Fault::OscTooDeep));
    }

    #[test]
    fn each_fault_is_named() {
        let nan = float("/a", f32::NAN);
        let whole = float("/a", 1.0);
        let cases = [
            (b"hello".to_vec(), Fault::NotOsc),
            (Vec::new(), Fault::NotOsc),
            (message("/\u{7}", ",f", &[0; 4]), Fault::OscBadAddress),
            (text("/a"), Fault::OscBadTypes),
            (message("/a", "f", &[0; 4]), Fault::OscBadTypes),
            (message("/a", ",?", &[0; 4]), Fault::OscBadTypes),
            (message("/a", ",f", &[0; 3]), Fault::OscCutShort),
            (message("/a", ",f", &[0; 8]), Fault::OscCutShort),
            (message("/a", ",b", &[0xff; 4]), Fault::OscCutShort),
            (nan, Fault::NotFinite),
            ([BUNDLE, &[0; 8], &[0, 0, 0, 99], &whole].concat(), Fault::OscCutShort),
            ([BUNDLE, &[0; 7]].concat(), Fault::OscCutShort),
        ];
        for (packet, fault) in cases {
            let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
            assert_eq!(read(&mut osc, &packet), [], "{fault}");
            assert_eq!((osc.counters().bad, osc.counters().last_fault), (1, Some(fault)));
        }
        for end in 1..whole.len() {
            let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
            assert_eq!(read(&mut osc, &whole[..end]), [], "{end}");
            assert_eq!(osc.counters().bad, 1);
        }
    }

    #[test]
    fn slip_on_a_serial_line() {
        let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
        let packet = float("/a", 1.0);
        let long = vec![b'/'; 2000];
        let stream = [
            &packet[4..],
            b"\xc0",
            &packet,
            b"\xc0",
            b"\xdb\x01\xc0",
            &long,
            b"\xc0\xc0",
            &packet,
            b"\xc0",
        ];
        let mut event_count = 0;
        osc.feed(&stream.concat(), &mut |_| event_count += 1);
        let counters = osc.counters();
        assert_eq!(
            (event_count, counters.partial, counters.bad, counters.dropped),
            (2, 1, 2, 1)
        );
    }
}
