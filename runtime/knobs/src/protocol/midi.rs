//! MIDI bytes, from a DIN cable, USB or a plain UART: control changes, pitch bend, notes. Bytes -> messages -> [`KnobEvent`].
//!
//! Numbers of knobs, with channels from 0: control change `channel * 128 + controller`, pitch bend `2048 + channel`, note
//! `2064 + channel * 128 + note`. A note is a button: 127 of 127 while it is held, then 0.
//!
//! **Pairs.** A 14-bit controller sends its upper seven bits as controller `n`, then its lower ones as `n + 32`. Between the
//! halves the true value is not known. The reading given out then is the value nearest to the last one that has the new
//! upper half: it lies between the old and the true value, so no reading ever overshoots, and none waits.
//!
//! Many small boxes number their faders from 0 and their buttons from 32, and so look like pairs whenever a button follows its
//! fader. So a pair is learned from [`PAIR_PROOF`] of them in a row whose lower halves differ and are not all buttons' values, and
//! forgotten when the lower half comes on its own twice in a row. An address that the map names is never a lower half.

use super::midi_settings::{CHANNELS, CONTROLLERS, Coding, MidiSettings, Pairing};
use crate::{Counters, Fault, KnobEvent, Reading};

/// Number of the pitch bend of channel 0.
pub const KNOB_PITCH_BEND: u16 = (CHANNELS * CONTROLLERS) as u16;
/// Number of note 0 of channel 0.
pub const KNOB_NOTE: u16 = KNOB_PITCH_BEND + CHANNELS as u16;

const FULL_7_BIT: u16 = 127;
const FULL_14_BIT: u16 = 16383;
/// Controllers with a lower half.
const PAIRS: u8 = 32;
/// Lower halves right behind their upper ones that prove a pair.
const PAIR_PROOF: u8 = 4;
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

/// A controller below 32 and the one 32 above it.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Last value; seven bits wide ones are shifted up.
    value: u16,
    /// Last lower half.
    lower: u8,
    state: PairState,
}

/// What is known of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PairState {
    /// So many lower halves came right behind their upper halves; `varied` once two of them differed.
    Learning { proofs: u8, varied: bool },
    /// Both are halves; so many lower ones came on their own since.
    Halves { alone: u8 },
    /// The upper one is a knob of its own, and so is this.
    Apart,
}

impl Pair {
    const NEW: Self = Self {
        value: 0,
        lower: 0,
        state: PairState::Learning {
            proofs: 0,
            varied: false,
        },
    };

    /// Takes notice of a lower half, which came right behind its upper one or on its own. Returns what to do with it.
    fn notice(&mut self, data: u8, is_behind: bool) -> Lower {
        let before = core::mem::replace(&mut self.lower, data);
        match &mut self.state {
            PairState::Apart => Lower::Knob,
            PairState::Halves { alone } => {
                *alone = if is_behind { 0 } else { *alone + 1 };
                if *alone < 2 {
                    return Lower::Half;
                }
                self.state = PairState::Apart;
                Lower::Knob
            }
            PairState::Learning { .. } if !is_behind => {
                self.state = PairState::Apart;
                Lower::Knob
            }
            PairState::Learning { proofs, varied } => {
                *varied |= *proofs > 0 && before != data && !(is_button(before) && is_button(data));
                *proofs = (*proofs + 1).min(PAIR_PROOF);
                if *proofs < PAIR_PROOF || !*varied {
                    // A button must act at once; anything else waits for what it turns out to be.
                    return if is_button(data) { Lower::Knob } else { Lower::Wait };
                }
                self.state = PairState::Halves { alone: 0 };
                Lower::Half
            }
        }
    }
}

/// What a controller from 32 to 63 is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lower {
    Half,
    Knob,
    Wait,
}

/// Pressed or released, for a controller that is a button.
const fn is_button(data: u8) -> bool {
    data == 0 || data == 127
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
    /// Controllers that may be the upper half of a pair.
    pairs: [[Pair; PAIRS as usize]; CHANNELS],
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
            pairs: [[Pair::NEW; PAIRS as usize]; CHANNELS],
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
        let n = controller % PAIRS;
        let settings = &self.settings;
        let may_pair = settings.pairing != Pairing::Never
            && settings.coding(knob_of(n)) == Coding::Absolute
            && !settings.is_own(knob_of(n + PAIRS));
        let pair = &mut self.pairs[usize::from(channel)][usize::from(n)];
        let always = settings.pairing == Pairing::Always;
        match controller / PAIRS {
            0 => {
                let lowest = u16::from(data) << 7;
                // Two upper halves in a row: the lower one did not follow, so nothing is proven.
                if let PairState::Learning { proofs, .. } = &mut pair.state
                    && before == Some((channel, n))
                {
                    *proofs = 0;
                }
                if !may_pair || !(always || matches!(pair.state, PairState::Halves { .. })) {
                    pair.value = lowest;
                    return Some(position(knob, u16::from(data), FULL_7_BIT));
                }
                pair.value = pair.value.clamp(lowest, lowest | 0x7f);
                Some(position(knob, pair.value, FULL_14_BIT))
            }
            1 if may_pair => match pair.notice(data, before == Some((channel, n))) {
                lower if always || lower == Lower::Half => {
                    pair.value = pair.value & !0x7f | u16::from(data);
                    Some(position(knob_of(n), pair.value, FULL_14_BIT))
                }
                Lower::Wait => None,
                _ => Some(position(knob, u16::from(data), FULL_7_BIT)),
            },
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn read(midi: &mut Midi, bytes: &[u8]) -> Vec<(u16, u16, u16)> {
        let mut events = Vec::new();
        midi.feed(bytes, &mut |event: KnobEvent| {
            events.push(match event.reading {
                Reading::Position { value, full_scale } => (event.knob, value, full_scale),
                Reading::Steps(steps) => (event.knob, steps.cast_unsigned(), 0),
            });
        });
        events
    }

    fn with(pairing: Pairing) -> Midi {
        let mut settings = MidiSettings::new();
        settings.pairing = pairing;
        Midi::new(settings)
    }

    #[test]
    fn messages_and_their_knobs() {
        let mut midi = with(Pairing::Learned);
        let bytes = b"\xb0\x07\x40\xb1\x07\x7f\xe2\x7f\x7f\x93\x05\x20\x93\x05\x00\x83\x06\x11";
        let expected = [
            (7, 64, 127),
            (135, 127, 127),
            (KNOB_PITCH_BEND + 2, 16383, 16383),
            (KNOB_NOTE + 3 * 128 + 5, 127, 127),
            (KNOB_NOTE + 3 * 128 + 5, 0, 127),
            (KNOB_NOTE + 3 * 128 + 6, 0, 127),
        ];
        assert_eq!(read(&mut midi, bytes), expected);
        assert_eq!((midi.counters().good, midi.counters().bad), (6, 0));
    }

    #[test]
    fn running_status_and_real_time_inside_messages() {
        let mut midi = with(Pairing::Learned);
        assert_eq!(
            read(&mut midi, b"\xb0\x46\xf8\x01\x46\x02\xfe\x47\xf8\x03"),
            [(70, 1, 127), (70, 2, 127), (71, 3, 127)]
        );
        assert_eq!((midi.counters().ignored, midi.counters().bad), (3, 0));
    }

    #[test]
    fn what_is_not_a_knob_is_ignored() {
        let mut midi = with(Pairing::Learned);
        // Sysex with a clock in it, song position, tune request, program change, pressures, all notes off.
        let bytes = b"\xf0\x7e\x01\xf8\x02\xf7\xf2\x01\x02\xf6\xc0\x05\x06\xd0\x07\xa0\x01\x02\xb0\x7b\x00";
        assert_eq!(read(&mut midi, bytes), []);
        assert_eq!((midi.counters().ignored, midi.counters().bad), (9, 0));
    }

    #[test]
    fn each_fault_is_named() {
        for (bytes, fault) in [
            (&b"\xf6\x01\xb0\x01\x02"[..], Fault::StrayData),
            (b"\xb0\x01\xb0\x01\x02", Fault::CutMessage),
            (b"\xf0\x01\xb0\x01\x02", Fault::CutMessage),
            (b"\xf2\x01\xb0\x01\x02", Fault::CutMessage),
        ] {
            let mut midi = with(Pairing::Learned);
            assert_eq!(read(&mut midi, bytes), [(1, 2, 127)]);
            assert_eq!((midi.counters().bad, midi.counters().last_fault), (1, Some(fault)));
        }
        let mut midi = with(Pairing::Learned);
        assert_eq!(read(&mut midi, b"\x05\x06\x07\xb0\x01\x02\xb0\x01"), [(1, 2, 127)]);
        midi.reset();
        assert_eq!(read(&mut midi, b"\x02\xb0\x01\x03"), [(1, 3, 127)]);
        assert_eq!((midi.counters().bad, midi.counters().partial), (0, 3));
    }

    /// A turn of a 14-bit knob that both halves of which are sent: enough to be learned.
    const TURN: &[u8] = b"\xb0\x01\x00\x21\x00\x01\x00\x21\x40\x01\x01\x21\x10\x01\x00\x21\x00";

    #[test]
    fn no_half_of_a_pair_overshoots() {
        for pairing in [Pairing::Learned, Pairing::Always] {
            let mut midi = with(pairing);
            let mut value: u16 = 0;
            read(&mut midi, TURN);
            for step in [
                1_i32, 127, 128, 129, -1, -128, 5000, -300, 9000, -16383, 16383, -2, -12345,
            ] {
                let next = (i32::from(value) + step).clamp(0, 16383) as u16;
                let bytes = [0xb0, 1, (next >> 7) as u8, 0x21, (next & 0x7f) as u8];
                let events = read(&mut midi, &bytes);
                assert_eq!(events.len(), 2);
                for (knob, between, full_scale) in &events {
                    assert_eq!((*knob, *full_scale), (1, 16383));
                    assert!(
                        (value.min(next)..=value.max(next)).contains(between),
                        "{value} {between} {next}"
                    );
                }
                assert_eq!(events[1].1, next);
                value = next;
            }
        }
    }

    #[test]
    fn a_button_behind_its_fader_stays_a_button() {
        // nanoKONTROL2: faders from 0, Solo from 32. Move fader 1, press and release Solo 1, over and over.
        let mut midi = with(Pairing::Learned);
        for n in 0..20 {
            let events = read(&mut midi, &[0xb0, 0, 60 + n, 0x20, 127, 0, 61 + n, 0x20, 0]);
            let n = u16::from(n);
            let expected = [(0, 60 + n, 127), (32, 127, 127), (0, 61 + n, 127), (32, 0, 127)];
            assert_eq!(events, expected);
        }
        assert_eq!(
            read(&mut midi, b"\xb0\x00\x7f"),
            [(0, 127, 127)],
            "the fader reaches its stop"
        );
    }

    #[test]
    fn a_pair_is_learned_from_a_turn_and_unlearned_by_its_lower_half() {
        let mut midi = with(Pairing::Learned);
        assert_eq!(
            read(&mut midi, TURN),
            [
                (1, 0, 127),
                (33, 0, 127),
                (1, 0, 127),
                (1, 1, 127),
                (1, 0, 127),
                (1, 0, 16383)
            ],
            "a lower half that may be a button's is told, another waits"
        );
        assert_eq!(read(&mut midi, b"\x01\x05\x21\x06"), [(1, 640, 16383), (1, 646, 16383)]);
        assert_eq!(read(&mut midi, b"\x21\x07"), [(1, 647, 16383)], "a fine turn");
        assert_eq!(read(&mut midi, b"\x01\x05\x21\x08\x21\x09").len(), 3, "and another");
        assert_eq!(
            read(&mut midi, b"\x21\x0a\x01\x05"),
            [(33, 10, 127), (1, 5, 127)],
            "twice on its own, it is a knob of its own"
        );
        read(&mut midi, TURN);
        assert_eq!(read(&mut midi, b"\xb0\x01\x05"), [(1, 5, 127)], "for good");
    }

    #[test]
    fn knobs_of_their_own_are_left_alone() {
        let mut midi = with(Pairing::Learned);
        assert_eq!(read(&mut midi, b"\xb0\x21\x05"), [(33, 5, 127)], "33 alone is a knob");
        read(&mut midi, TURN);
        assert_eq!(
            read(&mut midi, b"\xb0\x01\x05\x21\x06"),
            [(1, 5, 127), (33, 6, 127)],
            "and stays one"
        );
        let mut settings = MidiSettings::new();
        settings.pairing = Pairing::Always;
        settings.set_own(33);
        let mut mapped = Midi::new(settings);
        assert_eq!(read(&mut mapped, b"\xb0\x01\x05\x21\x06"), [(1, 5, 127), (33, 6, 127)]);
        assert_eq!(read(&mut mapped, b"\xb0\x02\x05\x22\x06").len(), 2);
        let mut never = with(Pairing::Never);
        assert_eq!(read(&mut never, b"\xb0\x01\x05\x21\x06"), [(1, 5, 127), (33, 6, 127)]);
    }

    #[test]
    fn encoders_give_steps() {
        let mut settings = MidiSettings::new();
        settings.set_coding(1, Coding::TwosComplement);
        let mut midi = Midi::new(settings);
        assert_eq!(
            read(&mut midi, b"\xb0\x01\x7f\x01\x02\x21\x03\x01\x00"),
            [(1, (-1_i16).cast_unsigned(), 0), (1, 2, 0), (33, 3, 127)],
            "an encoder has no lower half, and rest is no event"
        );
    }
}
