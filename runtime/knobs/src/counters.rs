//! What became of the bytes of a device: how many messages were good, how many were not, and why the last one was not.
//! Every protocol keeps these, so that a puppeteer can see a loose cable before the audience does.

use core::fmt;

/// Totals since the decoder was made; a reset of the stream keeps them.
///
/// Every complete message ends in exactly one of `good`, `ignored`, `bad` and `partial`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes fed.
    pub bytes: u64,
    /// Messages (lines, frames, MIDI messages, OSC messages) understood: each gave its events.
    pub good: u64,
    /// Messages that are sound and say nothing of knobs: MIDI clock, sysex, frames of a kind added later.
    pub ignored: u64,
    /// Messages refused; `last_fault` says why the last of them was.
    pub bad: u64,
    /// Messages cut by the opening of the port or by a reset. Expected, so not bad.
    pub partial: u64,
    /// Messages known to be lost: gaps in the sequence of framed packets, and messages too long to hold.
    pub dropped: u64,
    /// Readings cut to the end of their scale.
    pub clamped: u64,
    /// Readings of knobs that have a name for which the table of names has no room. They work by number.
    pub unnamed: u64,
    /// Events given out.
    pub events: u64,
    /// Why the last message or reading that was not taken as it came was not.
    pub last_fault: Option<Fault>,
}

impl Counters {
    pub(crate) const NONE: Self = Self {
        bytes: 0,
        good: 0,
        ignored: 0,
        bad: 0,
        partial: 0,
        dropped: 0,
        clamped: 0,
        unnamed: 0,
        events: 0,
        last_fault: None,
    };

    /// These and later ones of the same device.
    #[must_use]
    pub fn plus(&self, later: &Self) -> Self {
        Self {
            bytes: self.bytes + later.bytes,
            good: self.good + later.good,
            ignored: self.ignored + later.ignored,
            bad: self.bad + later.bad,
            partial: self.partial + later.partial,
            dropped: self.dropped + later.dropped,
            clamped: self.clamped + later.clamped,
            unnamed: self.unnamed + later.unnamed,
            events: self.events + later.events,
            last_fault: later.last_fault.or(self.last_fault),
        }
    }

    /// One message refused.
    pub(crate) fn refuse(&mut self, fault: Fault) {
        self.bad += 1;
        self.last_fault = Some(fault);
    }

    /// One message refused because it does not fit, and so lost.
    pub(crate) fn overflow(&mut self, fault: Fault) {
        self.dropped += 1;
        self.refuse(fault);
    }

    /// One reading cut to its scale.
    pub(crate) fn clamp(&mut self) {
        self.clamped += 1;
        self.last_fault = Some(Fault::OutOfRange);
    }
}

/// Why a message was not taken, or not as it came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Fault {
    /// Line: bytes that are not text. Usually the wrong baud rate.
    NotText,
    /// Line: a field that is not a number. Usually a debug print.
    NotNumbers,
    /// Line: nothing between two separators.
    EmptyField,
    /// Line: an integer above 65535.
    NumberTooLarge,
    /// Line: a number below zero.
    Negative,
    /// Line: a decimal above 1 while no full scale is set.
    DecimalTooLarge,
    /// Line: some fields have a label and some have none.
    MixedLabels,
    /// Line: labelled among unlabelled ones, or the other way round.
    LabelsChanged,
    /// Line: more fields than are read.
    TooManyFields,
    /// Line: longer than the buffer.
    LineTooLong,
    /// Frame: longer than the buffer.
    FrameTooLong,
    /// Frame: the byte stuffing does not add up.
    BrokenStuffing,
    /// Frame: too few bytes for a header and a checksum.
    FrameTooShort,
    /// Frame: the checksum does not match.
    WrongChecksum,
    /// Frame: of a version that this program does not know.
    UnknownVersion {
        /// The version it claims.
        version: u8,
    },
    /// Frame: its length is not what its own counts ask for.
    WrongLength,
    /// Frame: a value above the full scale that it states, or a full scale of zero.
    ValueAboveFullScale,
    /// Frame: a name or firmware text that is no text.
    BadName,
    /// Frame: the sequence number jumped.
    SequenceGap {
        /// Frames missing.
        missing: u8,
    },
    /// MIDI, Firmata: data bytes that belong to no message.
    StrayData,
    /// MIDI, Firmata: a message broken off by another.
    CutMessage,
    /// Firmata: an extended analog report of the wrong form.
    BadReport,
    /// OSC: neither an address nor a bundle.
    NotOsc,
    /// OSC: the packet ends inside a message, or a length in it is wrong.
    OscCutShort,
    /// OSC: an address that is not printable text.
    OscBadAddress,
    /// OSC: no type tags, or one that is not known.
    OscBadTypes,
    /// OSC: bundles nested too deep.
    OscTooDeep,
    /// OSC: a number that is not finite.
    NotFinite,
    /// A reading outside its scale, cut to it.
    OutOfRange,
    /// Sniffing: many bytes, and no protocol fits them.
    Undecided,
}

impl Fault {
    /// A number for it, never 0, for C: the kind in the low byte, the version or
    /// the count of missing frames in the high one. Numbers do not change.
    pub const fn code(self) -> u16 {
        match self {
            Self::NotText => 1,
            Self::NotNumbers => 2,
            Self::EmptyField => 3,
            Self::NumberTooLarge => 4,
            Self::Negative => 5,
            Self::DecimalTooLarge => 6,
            Self::MixedLabels => 7,
            Self::LabelsChanged => 8,
            Self::TooManyFields => 9,
            Self::LineTooLong => 10,
            Self::FrameTooLong => 11,
            Self::BrokenStuffing => 12,
            Self::FrameTooShort => 13,
            Self::WrongChecksum => 14,
            Self::UnknownVersion { version } => 15 | (version as u16) << 8,
            Self::WrongLength => 16,
            Self::ValueAboveFullScale => 17,
            Self::BadName => 18,
            Self::SequenceGap { missing } => 19 | (missing as u16) << 8,
            Self::StrayData => 20,
            Self::CutMessage => 21,
            Self::BadReport => 22,
            Self::NotOsc => 23,
            Self::OscCutShort => 24,
            Self::OscBadAddress => 25,
            Self::OscBadTypes => 26,
            Self::OscTooDeep => 27,
            Self::NotFinite => 28,
            Self::OutOfRange => 29,
            Self::Undecided => 30,
        }
    }

    /// The fault of a number; `None` for 0 and for numbers that no fault has.
    pub const fn from_code(code: u16) -> Option<Self> {
        let [kind, detail] = code.to_le_bytes();
        let fault = match kind {
            1 => Self::NotText,
            2 => Self::NotNumbers,
            3 => Self::EmptyField,
            4 => Self::NumberTooLarge,
            5 => Self::Negative,
            6 => Self::DecimalTooLarge,
            7 => Self::MixedLabels,
            8 => Self::LabelsChanged,
            9 => Self::TooManyFields,
            10 => Self::LineTooLong,
            11 => Self::FrameTooLong,
            12 => Self::BrokenStuffing,
            13 => Self::FrameTooShort,
            14 => Self::WrongChecksum,
            15 => Self::UnknownVersion { version: detail },
            16 => Self::WrongLength,
            17 => Self::ValueAboveFullScale,
            18 => Self::BadName,
            19 => Self::SequenceGap { missing: detail },
            20 => Self::StrayData,
            21 => Self::CutMessage,
            22 => Self::BadReport,
            23 => Self::NotOsc,
            24 => Self::OscCutShort,
            25 => Self::OscBadAddress,
            26 => Self::OscBadTypes,
            27 => Self::OscTooDeep,
            28 => Self::NotFinite,
            29 => Self::OutOfRange,
            30 => Self::Undecided,
            _ => return None,
        };
        // A detail where the kind has none is no number of ours.
        if fault.code() == code { Some(fault) } else { None }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match *self {
            Self::NotText => "a line holds bytes that are not text (wrong baud rate?)",
            Self::NotNumbers => "a line is not a list of numbers (a debug print?)",
            Self::EmptyField => "a line has nothing between two separators",
            Self::NumberTooLarge => "a line holds a number above 65535",
            Self::Negative => "a line holds a number below zero",
            Self::DecimalTooLarge => "a line holds a decimal above 1; set the full scale to use such numbers",
            Self::MixedLabels => "a line has labels on some of its fields only",
            Self::LabelsChanged => "a line has labels where the others have none, or none where they have some",
            Self::TooManyFields => "a line has too many fields",
            Self::LineTooLong => "a line is too long (no line ends?)",
            Self::FrameTooLong => "a frame is too long",
            Self::BrokenStuffing => "the byte stuffing of a frame does not add up",
            Self::FrameTooShort => "a frame is too short",
            Self::WrongChecksum => "the checksum of a frame does not match",
            Self::UnknownVersion { version } => {
                return write!(out, "a frame has version {version}; this program knows 1");
            }
            Self::WrongLength => "a frame has not the length that its counts ask for",
            Self::ValueAboveFullScale => "a frame holds a value above its own full scale",
            Self::BadName => "a frame holds a name that is no text",
            Self::SequenceGap { missing } => return write!(out, "frames are missing: {missing}"),
            Self::StrayData => "data bytes belong to no message",
            Self::CutMessage => "a message was broken off by another",
            Self::BadReport => "an extended analog report has the wrong form",
            Self::NotOsc => "a packet is neither an OSC message nor a bundle",
            Self::OscCutShort => "an OSC packet ends too early, or a length in it is wrong",
            Self::OscBadAddress => "an OSC address is not printable text",
            Self::OscBadTypes => "an OSC message has no type tags, or an unknown one",
            Self::OscTooDeep => "OSC bundles are nested too deep",
            Self::NotFinite => "an OSC number is not finite",
            Self::OutOfRange => "a reading was outside its scale and was cut to it",
            Self::Undecided => "no known protocol fits the bytes",
        })
    }
}

impl core::error::Error for Fault {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_names_its_fault() {
        let known = (0..=u16::MAX).filter_map(|code| Some((code, Fault::from_code(code)?)));
        let mut count = 0;
        for (code, fault) in known {
            assert_eq!(fault.code(), code);
            count += 1;
        }
        assert_eq!(count, 30 - 2 + 2 * 256, "two kinds have a detail of one byte");
        assert_eq!(Fault::from_code(0), None);
    }
}
