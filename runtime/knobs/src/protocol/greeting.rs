//! When a device is sent its protocol's opening: as soon as the protocol is known, and again each second until the device
//! has answered, for a board that was reset when its port opened does not hear the first.

use super::{Decoder, OPENING_BYTES_MAX, Protocol};

/// Microseconds between greetings.
const EVERY_US: u64 = 1_000_000;
/// A device that answers none of so many wants none.
const GREETINGS_MAX: u32 = 10;

/// Decides when a device is greeted. One for each opening of its port.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Greeting {
    sent: u32,
    last_us: u64,
    /// Events when the port opened; more of them are an answer.
    events_before: u64,
}

impl Greeting {
    /// For a port that was just opened, or opened again, and its decoder.
    pub fn new(decoder: &Decoder) -> Self {
        Self {
            events_before: decoder.counters().events,
            ..Self::default()
        }
    }

    /// What to send now; empty nearly always, and for protocols whose devices talk unasked. Every greeting it returns counts
    /// as sent. `now_us` is of a clock that never runs back.
    pub fn due<'o>(&mut self, decoder: &Decoder, now_us: u64, out: &'o mut [u8; OPENING_BYTES_MAX]) -> &'o [u8] {
        let Some(protocol) = decoder.protocol() else {
            return &[];
        };
        let has_answered = match protocol {
            Protocol::Packets => decoder.knob_count().is_some(),
            _ => decoder.counters().events > self.events_before,
        };
        let waits = self.sent > 0 && (has_answered || now_us.saturating_sub(self.last_us) < EVERY_US);
        if waits || self.sent >= GREETINGS_MAX {
            return &[];
        }
        // The buffer is as long as the longest opening.
        let length = protocol.write_opening(out).unwrap_or(0);
        (self.sent, self.last_us) = (self.sent + 1, now_us);
        &out[..length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{DecoderSettings, HELLO_REQUEST};

    /// Seconds, of twenty, in which something is sent.
    fn seconds(decoder: &mut Decoder, mut each: impl FnMut(u64, &mut Decoder)) -> std::vec::Vec<u64> {
        let mut greeting = Greeting::new(decoder);
        let mut out = [0; OPENING_BYTES_MAX];
        (0..200)
            .filter(|tenth| {
                each(*tenth, decoder);
                !greeting.due(decoder, tenth * 100_000, &mut out).is_empty()
            })
            .map(|tenth| tenth / 10)
            .collect()
    }

    #[test]
    fn a_firmata_board_that_is_found_is_greeted_until_it_reports() {
        let mut decoder = Decoder::new(None, DecoderSettings::default());
        let sent = seconds(&mut decoder, |tenth, decoder| match tenth {
            // What a board says when it boots, again and again, as one with a loose plug.
            20..40 => decoder.feed(b"\xf9\x02\x05\xf0\x79\x02\x05x\0y\0\xf7", &mut |_| ()),
            // Reports of pin 0.
            70..80 => decoder.feed(b"\xe0\x10\x03", &mut |_| ()),
            _ => {}
        });
        assert_eq!(decoder.protocol(), Some(Protocol::Firmata));
        assert!(
            sent[0] >= 2 && sent.windows(2).all(|two| two[1] == two[0] + 1),
            "{sent:?}"
        );
        assert!(sent.last() <= Some(&7), "{sent:?}");
    }

    #[test]
    fn a_device_that_never_answers_is_left_alone_in_the_end() {
        let mut decoder = Decoder::new(Some(Protocol::Packets), DecoderSettings::default());
        let sent = seconds(&mut decoder, |_, _| ());
        assert_eq!(sent, (0..10).collect::<std::vec::Vec<_>>());
        let mut out = [0; OPENING_BYTES_MAX];
        assert_eq!(Greeting::new(&decoder).due(&decoder, 7, &mut out), [HELLO_REQUEST]);
    }

    #[test]
    fn a_box_that_talks_unasked_is_sent_nothing() {
        let mut decoder = Decoder::new(Some(Protocol::Lines), DecoderSettings::default());
        assert!(seconds(&mut decoder, |_, _| ()).is_empty());
    }
}
