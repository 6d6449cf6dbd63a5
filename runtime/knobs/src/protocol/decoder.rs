//! One type for a device whatever it speaks: the parser that was named, or the one that sniffing finds. The port feeds it
//! bytes; [`KnobEvent`]s come out.

use core::fmt;

use super::{
    DecoderSettings, Finding, Name, Protocol,
    firmata::Firmata,
    line::Lines,
    midi::Midi,
    osc::Osc,
    packet::Packets,
    sniff::{Sniffer, Step, confidence},
};
use crate::{Counters, Fault, KnobEvent};

/// Where a decoder stands with its protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Recognition {
    /// The caller named it.
    Named(Protocol),
    /// So few bytes came that nothing is said yet; they wait.
    Listening {
        /// Bytes that wait.
        waiting_bytes: u32,
    },
    /// Many bytes came and no protocol fits them: a wrong baud rate, or a device of another kind. It goes on listening.
    Undecided,
    /// The bytes told.
    Found(Finding),
}

impl fmt::Display for Recognition {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(protocol) => write!(out, "{}, as told", protocol.words()),
            Self::Listening { waiting_bytes } => write!(out, "listening, {waiting_bytes} bytes so far"),
            Self::Undecided => out.write_str("no known protocol fits; is the baud rate right?"),
            Self::Found(finding) => finding.fmt(out),
        }
    }
}

#[allow(
    clippy::large_enum_variant,
    reason = "a heap would even the sizes out; there is none"
)]
enum Parser {
    Sniffing(Sniffer, Counters),
    Lines(Lines),
    Packets(Packets),
    Midi(Midi),
    Firmata(Firmata),
    Osc(Osc),
}

impl Parser {
    fn new(protocol: Protocol, settings: &DecoderSettings) -> Self {
        match protocol {
            Protocol::Lines => Self::Lines(Lines::new(settings.full_scale)),
            Protocol::Packets => Self::Packets(Packets::new()),
            Protocol::Midi => Self::Midi(Midi::new(settings.midi)),
            Protocol::Firmata => Self::Firmata(Firmata::new(settings.full_scale)),
            Protocol::Osc => Self::Osc(Osc::new(settings.full_scale, settings.osc)),
        }
    }

    fn counters(&self) -> &Counters {
        match self {
            Self::Sniffing(_, counters) => counters,
            Self::Lines(lines) => lines.counters(),
            Self::Packets(packets) => packets.counters(),
            Self::Midi(midi) => midi.counters(),
            Self::Firmata(firmata) => firmata.counters(),
            Self::Osc(osc) => osc.counters(),
        }
    }

    fn counters_mut(&mut self) -> &mut Counters {
        match self {
            Self::Sniffing(_, counters) => counters,
            Self::Lines(lines) => &mut lines.counters,
            Self::Packets(packets) => &mut packets.counters,
            Self::Midi(midi) => &mut midi.counters,
            Self::Firmata(firmata) => &mut firmata.counters,
            Self::Osc(osc) => osc.counters_mut(),
        }
    }
}

/// Turns the bytes of one device into events. Under fifteen kilobytes, no heap; making one clears them and does no more.
///
/// ```
/// use sinew_knobs::{Decoder, Protocol, DecoderSettings};
/// let mut decoder = Decoder::new(None, DecoderSettings::default()); // no protocol named: the bytes decide
/// let mut events = 0;
/// for _ in 0..10 {
///     decoder.feed(b"0|240|1023\r\n", &mut |_event| events += 1);
/// }
/// assert_eq!(decoder.protocol(), Some(Protocol::Lines));
/// assert_eq!(events, 27); // all but the first line, which may have been cut
/// ```
pub struct Decoder {
    settings: DecoderSettings,
    parser: Parser,
    recognition: Recognition,
}

impl Decoder {
    /// At the beginning of a stream, in the protocol named or the one that its bytes show.
    pub fn new(protocol: Option<Protocol>, settings: DecoderSettings) -> Self {
        let (parser, recognition) = match protocol {
            Some(protocol) => (Parser::new(protocol, &settings), Recognition::Named(protocol)),
            None => (
                Parser::Sniffing(Sniffer::new(), Counters::NONE),
                Recognition::Listening { waiting_bytes: 0 },
            ),
        };
        Self {
            settings,
            parser,
            recognition,
        }
    }

    /// Reads bytes of a stream in any chunking.
    pub fn feed(&mut self, bytes: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        let mut rest = bytes;
        if let Parser::Sniffing(sniffer, counters) = &mut self.parser {
            loop {
                let Some((&byte, after)) = rest.split_first() else {
                    if !sniffer.undecided {
                        let waiting_bytes = sniffer.waiting().len() as u32;
                        self.recognition = Recognition::Listening { waiting_bytes };
                    }
                    return;
                };
                rest = after;
                counters.bytes += 1;
                match sniffer.push(byte) {
                    Step::Wait => {}
                    Step::Undecided => {
                        counters.refuse(Fault::Undecided);
                        self.recognition = Recognition::Undecided;
                    }
                    Step::Found(finding) => {
                        self.decide(finding, sink);
                        break;
                    }
                }
            }
        }
        match &mut self.parser {
            Parser::Sniffing(..) => {}
            Parser::Lines(lines) => lines.feed(rest, sink),
            Parser::Packets(packets) => packets.feed(rest, sink),
            Parser::Midi(midi) => midi.feed(rest, sink),
            Parser::Firmata(firmata) => firmata.feed(rest, sink),
            Parser::Osc(osc) => osc.feed(rest, sink),
        }
    }

    /// Reads one datagram. OSC is taken as it is, without SLIP, and recognised by the first whole message; for the other
    /// protocols a datagram is a piece of the stream.
    pub fn feed_packet(&mut self, packet: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        if let Parser::Sniffing(..) = self.parser {
            let mut osc = Osc::new(self.settings.full_scale, self.settings.osc);
            osc.feed_packet(packet, &mut |_| ());
            let counters = osc.counters();
            if counters.good > 0 && counters.bad == 0 {
                let finding = Finding {
                    protocol: Protocol::Osc,
                    points: Protocol::Osc.points().saturating_mul(counters.good as u32),
                    bad: 0,
                    bytes: packet.len() as u32,
                };
                if let Parser::Sniffing(sniffer, counters) = &mut self.parser {
                    // Earlier datagrams were something else; a piece of a stream would have been told by now.
                    counters.partial += u64::from(!sniffer.waiting().is_empty());
                    sniffer.clear();
                }
                self.decide(finding, sink);
            }
        }
        match &mut self.parser {
            Parser::Osc(osc) => osc.feed_packet(packet, sink),
            _ => self.feed(packet, sink),
        }
    }

    /// Puts the parser in the sniffer's place and feeds it what waits.
    fn decide(&mut self, finding: Finding, sink: &mut impl FnMut(KnobEvent)) {
        let parser = Parser::new(finding.protocol, &self.settings);
        let Parser::Sniffing(sniffer, counters) = core::mem::replace(&mut self.parser, parser) else {
            return;
        };
        self.recognition = Recognition::Found(finding);
        *self.parser.counters_mut() = counters;
        self.parser.counters_mut().bytes -= sniffer.waiting().len() as u64;
        self.feed(sniffer.waiting(), sink);
    }

    /// The port was opened again: what is half read is thrown away, and the parser finds its step anew. The protocol, once
    /// known, names, scales and counters stay, so that a knob has the same number after a replug.
    pub fn reset(&mut self) {
        match &mut self.parser {
            Parser::Sniffing(sniffer, counters) => {
                counters.partial += u64::from(!sniffer.waiting().is_empty());
                sniffer.clear();
                if !sniffer.undecided {
                    self.recognition = Recognition::Listening { waiting_bytes: 0 };
                }
            }
            Parser::Lines(lines) => lines.reset(),
            Parser::Packets(packets) => packets.reset(),
            Parser::Midi(midi) => midi.reset(),
            Parser::Firmata(firmata) => firmata.reset(),
            Parser::Osc(osc) => osc.reset(),
        }
    }

    /// Totals so far.
    pub fn counters(&self) -> &Counters {
        self.parser.counters()
    }

    /// Where it stands with its protocol; says so in words.
    pub fn recognition(&self) -> Recognition {
        self.recognition
    }

    /// The protocol, named or found.
    pub fn protocol(&self) -> Option<Protocol> {
        match self.recognition {
            Recognition::Named(protocol) => Some(protocol),
            Recognition::Found(finding) => Some(finding.protocol),
            Recognition::Listening { .. } | Recognition::Undecided => None,
        }
    }

    /// How sure the protocol is, in percent: 100 if it was named, 0 if it is not known, else by all messages so far.
    pub fn confidence(&self) -> u8 {
        match self.recognition {
            Recognition::Named(_) => 100,
            Recognition::Listening { .. } | Recognition::Undecided => 0,
            Recognition::Found(finding) => {
                let counters = self.counters();
                let later = counters.good.saturating_mul(u64::from(finding.protocol.points()));
                confidence(later.saturating_add(u64::from(finding.points)), counters.bad)
            }
        }
    }

    /// Name of a knob: label, OSC address, or from a HELLO. MIDI and Firmata have none.
    pub fn name_of(&self, knob: u16) -> Option<&str> {
        Some(self.name(knob)?.as_str())
    }

    /// The same, to keep.
    pub fn name(&self, knob: u16) -> Option<&Name> {
        match &self.parser {
            Parser::Lines(lines) => lines.name(knob),
            Parser::Packets(packets) => packets.name(knob),
            Parser::Osc(osc) => osc.name(knob),
            Parser::Sniffing(..) | Parser::Midi(_) | Parser::Firmata(_) => None,
        }
    }

    /// Lowest and highest reading of a knob's sweep, where a HELLO said so.
    pub fn range_of(&self, knob: u16) -> Option<(u16, u16)> {
        match &self.parser {
            Parser::Packets(packets) => packets.range_of(knob),
            _ => None,
        }
    }

    /// Knobs of the device, where a HELLO said so.
    pub fn knob_count(&self) -> Option<u8> {
        match &self.parser {
            Parser::Packets(packets) => packets.knob_count(),
            _ => None,
        }
    }

    /// What the firmware calls itself, where a HELLO said so.
    pub fn firmware(&self) -> Option<&str> {
        match &self.parser {
            Parser::Packets(packets) => packets.firmware(),
            _ => None,
        }
    }
}
