//! Which protocol the first bytes of a device are in. Between the port and the parser: while nothing is decided the bytes
//! wait in [`Sniffer`], and the parser that is chosen gets all of them.
//!
//! Each protocol earns points for what could hardly be chance: 16 for a frame whose checksum holds, 8 for an OSC message, 3
//! for a line of numbers, 1 for a MIDI message (1/4 in running status), 6 for a Firmata greeting, 1 for each analog report in
//! the order of the pins. What does not fit costs a point. Six points and twice those of the next decide.

use super::{FullScale, OscRanges, Protocol, line::Lines, osc::Osc, packet::Packets};
use core::fmt;

/// Bytes looked at before the sniffer says that it cannot tell.
pub const SNIFF_BYTES_MAX: usize = 1024;

/// Points that decide.
const POINTS_ENOUGH: u32 = 6;
/// The runner-up may have one part in so many.
const LEAD: u32 = 2;
/// Bytes between two looks.
const LOOK_EVERY: usize = 16;
/// Looks between those, at bytes that end messages: a board that greets and then waits must be recognised at once. Bounded,
/// because a flood of such bytes must not cost a look each.
const EXTRA_LOOKS_MAX: u8 = 32;

/// What the sniffer found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finding {
    /// The protocol.
    pub protocol: Protocol,
    /// Points for it.
    pub points: u32,
    /// Messages that did not fit.
    pub bad: u32,
    /// Bytes it took to decide.
    pub bytes: u32,
}

impl Finding {
    /// How sure this is, in percent: the share of the points in points, twice the misfits and one. At most 99.
    pub fn confidence(&self) -> u8 {
        confidence(u64::from(self.points), u64::from(self.bad))
    }
}

/// `Text lines, 85 % sure (6 points, 0 misfits in 32 bytes)`.
impl fmt::Display for Finding {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            protocol,
            points,
            bad,
            bytes,
        } = self;
        let sure = self.confidence();
        let words = protocol.words();
        write!(
            out,
            "{words}, {sure} % sure ({points} points, {bad} misfits in {bytes} bytes)"
        )
    }
}

pub(super) fn confidence(points: u64, bad: u64) -> u8 {
    let percent = points.saturating_mul(100) / points.saturating_add(bad.saturating_mul(2)).saturating_add(1);
    percent.min(99) as u8
}

/// Holds the first bytes of a device until they can be told.
#[derive(Debug, Clone)]
pub(super) struct Sniffer {
    buffer: [u8; SNIFF_BYTES_MAX],
    length: usize,
    extra_looks: u8,
    /// A full buffer could not be told, at least once.
    pub undecided: bool,
}

/// What a byte led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    Wait,
    Found(Finding),
    /// The buffer was full. The older half of it is gone, and sniffing goes on.
    Undecided,
}

impl Sniffer {
    pub(super) const fn new() -> Self {
        Self {
            buffer: [0; SNIFF_BYTES_MAX],
            length: 0,
            extra_looks: 0,
            undecided: false,
        }
    }

    /// Bytes that wait.
    pub(super) fn waiting(&self) -> &[u8] {
        &self.buffer[..self.length]
    }

    pub(super) fn clear(&mut self) {
        (self.length, self.extra_looks) = (0, 0);
    }

    /// Takes one byte. What follows depends on the bytes alone, not on their chunking.
    pub(super) fn push(&mut self, byte: u8) -> Step {
        self.buffer[self.length] = byte;
        self.length += 1;
        let ends = matches!(byte, b'\n' | 0 | 0xc0 | 0xf7) && self.extra_looks < EXTRA_LOOKS_MAX;
        if ends || self.length.is_multiple_of(LOOK_EVERY) {
            self.extra_looks += u8::from(ends);
            if let Some(finding) = look(self.waiting()) {
                return Step::Found(finding);
            }
        }
        if self.length < SNIFF_BYTES_MAX {
            return Step::Wait;
        }
        self.buffer.copy_within(SNIFF_BYTES_MAX / 2.., 0);
        self.length = SNIFF_BYTES_MAX / 2;
        self.extra_looks = 0;
        self.undecided = true;
        Step::Undecided
    }
}

/// Weighs all protocols against each other.
fn look(bytes: &[u8]) -> Option<Finding> {
    let mut best: Option<(Protocol, Evidence)> = None;
    let mut next_score = 0;
    for protocol in Protocol::ALL {
        let evidence = evidence(protocol, bytes);
        let best_score = best.map_or(0, |(_, evidence)| evidence.score());
        if evidence.score() > best_score {
            next_score = best_score;
            best = Some((protocol, evidence));
        } else {
            next_score = next_score.max(evidence.score());
        }
    }
    let (protocol, evidence) = best?;
    let enough = evidence.score() >= POINTS_ENOUGH && evidence.score() >= LEAD * next_score;
    enough.then_some(Finding {
        protocol,
        points: evidence.points,
        bad: evidence.bad,
        bytes: bytes.len() as u32,
    })
}

/// What speaks for a protocol and against it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Evidence {
    points: u32,
    bad: u32,
}

impl Evidence {
    fn score(self) -> u32 {
        self.points.saturating_sub(self.bad)
    }
}

fn evidence(protocol: Protocol, bytes: &[u8]) -> Evidence {
    let counters = match protocol {
        Protocol::Lines => {
            let mut lines = Lines::new(FullScale::Learned);
            lines.feed(bytes, &mut |_| ());
            *lines.counters()
        }
        Protocol::Packets => {
            let mut packets = Packets::new();
            packets.feed(bytes, &mut |_| ());
            *packets.counters()
        }
        Protocol::Osc => {
            let mut osc = Osc::new(FullScale::Learned, OscRanges::new());
            osc.feed(bytes, &mut |_| ());
            *osc.counters()
        }
        Protocol::Midi => return midi(bytes),
        Protocol::Firmata => return firmata(bytes),
    };
    Evidence {
        points: protocol.points().saturating_mul(counters.good as u32),
        bad: counters.bad as u32,
    }
}

/// MIDI: each kind of message beyond the first takes two points, because a box speaks few kinds on few channels, and chance
/// many.
fn midi(bytes: &[u8]) -> Evidence {
    let (mut quarters, mut bad) = (0_u32, 0);
    let mut kinds = 0_u128;
    let (mut status, mut explicit, mut data_count, mut bend) = (None, false, 0, None);
    let mut opening = true;
    for &byte in bytes {
        match byte {
            0xf9 | 0xfd => bad += 1, // not defined in MIDI
            0xf8.. => {}
            0x80.. => {
                bad += u32::from(data_count > 0);
                (status, explicit, data_count) = (Some(byte), true, 0);
                opening = false;
            }
            _ => match status {
                None => bad += u32::from(!opening),
                Some(0xf0..) => {}
                Some(kind) => {
                    data_count += 1;
                    if data_count == if matches!(kind & 0xf0, 0xc0 | 0xd0) { 1 } else { 2 } {
                        let counts = match kind & 0xf0 {
                            0x80 | 0x90 | 0xb0 => true,
                            // On ever new channels it is a round of Firmata's pins.
                            0xe0 => bend.replace(kind).is_none_or(|before| before == kind),
                            _ => false,
                        };
                        if counts {
                            quarters += if explicit { 4 } else { 1 };
                        }
                        kinds |= 1 << (kind - 0x80);
                        (explicit, data_count) = (false, 0);
                    }
                }
            },
        }
    }
    let kinds_beyond = kinds.count_ones().saturating_sub(1);
    Evidence {
        points: (quarters / 4).saturating_sub(2 * kinds_beyond),
        bad,
    }
}

/// Firmata: its greeting, or analog reports in the order of the pins, over and over. Alone they look like pitch bend.
fn firmata(bytes: &[u8]) -> Evidence {
    const GREETING_POINTS: u32 = 6;
    let mut evidence = Evidence::default();
    let (mut status, mut data_count, mut opening, mut firmware) = (0_u8, 0_u32, true, false);
    let (mut first_pin, mut last_pin) = (None, None);
    for &byte in bytes {
        if byte >= 0x80 {
            let cut = matches!(status, 0x80..0xf0 | 0xf9);
            evidence.bad += u32::from(cut);
            if byte == 0xf7 && status == 0xf0 {
                evidence.points += if firmware { GREETING_POINTS } else { 0 };
            } else if !matches!(byte, 0x90..=0x9f | 0xe0..=0xef | 0xf0 | 0xf7 | 0xf9) {
                evidence.bad += 1;
            }
            status = if byte == 0xf7 { 0 } else { byte };
            (data_count, opening, firmware) = (0, false, false);
            continue;
        }
        data_count += 1;
        match status {
            0 => evidence.bad += u32::from(!opening),
            0xf0 => firmware |= data_count == 1 && byte == 0x79,
            _ if data_count < 2 => {}
            0xf9 => {
                evidence.points += GREETING_POINTS;
                status = 0;
            }
            0xe0..=0xef => {
                let pin = status & 0x0f;
                let first = *first_pin.get_or_insert(pin);
                let in_order = last_pin.is_some_and(|last| pin == last + 1 || pin == first && pin < last);
                evidence.points += u32::from(in_order);
                last_pin = Some(pin);
                status = 0;
            }
            _ => status = 0,
        }
    }
    evidence
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidence_grows_with_points_and_falls_with_misfits() {
        assert_eq!(confidence(0, 0), 0);
        assert_eq!(confidence(6, 0), 85);
        assert_eq!(confidence(600, 0), 99);
        assert_eq!(confidence(6, 6), 31);
        assert_eq!(confidence(u64::MAX, u64::MAX), 1);
    }

    #[test]
    fn pitch_bend_on_one_channel_is_midi_and_a_round_of_pins_is_firmata() {
        let bend = b"\xe0\x00\x40".repeat(8);
        assert_eq!(look(&bend).unwrap().protocol, Protocol::Midi);
        let pins = b"\xe0\x00\x02\xe1\x10\x03\xe2\x7f\x07\xe3\x00\x00".repeat(4);
        assert_eq!(look(&pins).unwrap().protocol, Protocol::Firmata);
        assert_eq!(
            look(b"\xf9\x02\x05\xf0\x79\x02\x05S\x00\xf7").unwrap().protocol,
            Protocol::Firmata
        );
        assert!(
            look(b"\xf8".repeat(200).as_slice()).is_none(),
            "a clock alone is no knob box"
        );
    }
}
