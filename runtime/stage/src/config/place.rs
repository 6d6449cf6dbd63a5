//! How a file names a knob: by its number, by its MIDI message, or by what the device itself calls it.

use sinew_knobs::protocol::{KNOB_NOTE, KNOB_PITCH_BEND};

use super::keys::WholeOrText;

/// Which knob of a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// Its address, as the protocol counts.
    Number(u16),
    /// Label, OSC address, or name from a HELLO.
    Name(String),
}

impl Place {
    /// Reads a place.
    ///
    /// # Errors
    /// What a person should write.
    pub fn of(written: WholeOrText<'_>) -> Result<Self, String> {
        match written {
            // The last addresses are the program's own.
            WholeOrText::Whole(number) => match u16::try_from(number) {
                Ok(address) if address < Self::OWN_ADDRESSES => Ok(Self::Number(address)),
                _ => Err(format!(
                    "there is no knob {number}: addresses go from 0 to {}",
                    Self::OWN_ADDRESSES - 1
                )),
            },
            WholeOrText::Text(text) => match midi_address(text) {
                Some(address) => address.map(Self::Number),
                None if text.is_empty() => Err("a knob's name cannot be empty".to_owned()),
                None => Ok(Self::Name(text.to_owned())),
            },
        }
    }

    /// Addresses from here on are given by the program to knobs that have none of their own.
    pub const OWN_ADDRESSES: u16 = 60_000;
}

impl core::fmt::Display for Place {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Number(address) => write!(out, "{address}"),
            Self::Name(name) => write!(out, "{name}"),
        }
    }
}

/// How a file names the MIDI knob of an address: the inverse of what [`Place::of`] reads.
pub fn midi_words(address: u16) -> String {
    let (kind, rest) = match address {
        KNOB_NOTE.. => ("note", address - KNOB_NOTE),
        KNOB_PITCH_BEND.. => return format!("bend channel {}", address - KNOB_PITCH_BEND + 1),
        _ => ("cc", address),
    };
    match rest / 128 {
        0 => format!("{kind} {}", rest % 128),
        channel => format!("{kind} {} channel {}", rest % 128, channel + 1),
    }
}

/// `cc 21`, `cc 21 channel 2`, `bend channel 1`, `note 36`; channels from 1, and 1 if left out. `None`: not meant as MIDI.
fn midi_address(text: &str) -> Option<Result<u16, String>> {
    let mut words = text.split_whitespace();
    let kind = words.next()?;
    if !["cc", "bend", "note"].contains(&kind) {
        return None;
    }
    let rest: Vec<&str> = words.collect();
    let (number, channel) = match (kind, rest.as_slice()) {
        ("bend", []) => (Some(0), Some(1)),
        ("bend", ["channel", channel]) => (Some(0), channel.parse().ok()),
        ("cc" | "note", [number]) => (number.parse().ok(), Some(1)),
        ("cc" | "note", [number, "channel", channel]) => (number.parse().ok(), channel.parse().ok()),
        _ => (None, None),
    };
    let (Some(number @ 0..=127), Some(channel @ 1..=16)) = (number, channel) else {
        return Some(Err(format!(
            "`{text}` is no MIDI knob: write \"cc 21\", \"cc 21 channel 2\", \"note 36\" or \"bend channel 1\""
        )));
    };
    let channel: u16 = channel - 1;
    Some(Ok(match kind {
        "cc" => channel * 128 + number,
        "note" => KNOB_NOTE + channel * 128 + number,
        _ => KNOB_PITCH_BEND + channel,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Result<Place, String> {
        Place::of(WholeOrText::Text(text))
    }

    #[test]
    fn midi_messages_have_the_addresses_of_the_protocol() {
        assert_eq!(text("cc 21"), Ok(Place::Number(21)));
        assert_eq!(text("cc 21 channel 2"), Ok(Place::Number(149)));
        assert_eq!(text("bend"), Ok(Place::Number(2048)));
        assert_eq!(text("bend channel 16"), Ok(Place::Number(2063)));
        assert_eq!(text("note 36 channel 10"), Ok(Place::Number(2064 + 9 * 128 + 36)));
        for address in 0..KNOB_NOTE + 2048 {
            assert_eq!(text(&midi_words(address)), Ok(Place::Number(address)));
        }
        for wrong in ["cc", "cc 128", "cc 1 channel 0", "cc 1 channel 17", "note x", "bend 3"] {
            assert!(text(wrong).unwrap_err().contains(wrong), "{wrong}");
        }
    }

    #[test]
    fn other_text_is_a_name_and_numbers_are_addresses() {
        assert_eq!(text("jaw"), Ok(Place::Name("jaw".to_owned())));
        assert_eq!(text("/1/fader1"), Ok(Place::Name("/1/fader1".to_owned())));
        assert!(text("").is_err());
        assert_eq!(Place::of(WholeOrText::Whole(7)), Ok(Place::Number(7)));
        for wrong in [-1, 60_000, 70_000] {
            assert!(Place::of(WholeOrText::Whole(wrong)).is_err());
        }
    }
}
