//! Text lines: deej (`0|240|1023`), CSV, tabs, spaces, semicolons, labels of the Serial Plotter (`jaw:512,brow:103`).
//! Bytes -> lines -> [`super::fields`] -> [`KnobEvent`].
//!
//! The knob is the column, or for labelled lines the label in order of appearance. A line is taken whole or not at all.
//! Integers have the full scale of [`super::FullScale`]; numbers with a point are parts of one, or device units where the
//! full scale is set. The first line after opening is thrown away: it is nearly always cut, and a cut `1023` is a sound `23`.

use super::{
    FullScale,
    fields::{FIELDS_MAX, Fields, Number},
    names::{NAMES_MAX, Name, Names},
    scale::{Scales, TEN_BITS, fraction},
};
use crate::{Counters, Fault, KnobEvent, Reading};

/// Longest line, without its end.
pub const LINE_BYTES_MAX: usize = 1024;
/// So many lines of the other kind in a row change what is expected. Fewer are prints among the data: a `free_ram:812`
/// must not move column 0.
const CHANGE_AFTER: u8 = 8;

/// Whether the device labels its fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Unknown,
    Columns,
    Labels,
}

/// Parser of text lines.
#[derive(Debug, Clone)]
pub struct Lines {
    buffer: [u8; LINE_BYTES_MAX],
    length: usize,
    /// The line is longer than the buffer; its rest is skipped.
    too_long: bool,
    /// A line end was seen since the stream began.
    in_step: bool,
    kind: Kind,
    /// Lines of the other kind in a row.
    strange: u8,
    names: Names<NAMES_MAX>,
    scales: Scales,
    pub(super) counters: Counters,
}

impl Lines {
    /// At the beginning of a stream.
    pub const fn new(full_scale: FullScale) -> Self {
        Self {
            buffer: [0; LINE_BYTES_MAX],
            length: 0,
            too_long: false,
            in_step: false,
            kind: Kind::Unknown,
            strange: 0,
            names: Names::new(),
            scales: Scales::new(full_scale, TEN_BITS),
            counters: Counters::NONE,
        }
    }

    /// Reads bytes in any chunking.
    pub fn feed(&mut self, bytes: &[u8], sink: &mut impl FnMut(KnobEvent)) {
        self.counters.bytes += bytes.len() as u64;
        for &byte in bytes {
            if byte == b'\n' || byte == b'\r' {
                self.end_line(sink);
            } else if self.length < LINE_BYTES_MAX {
                self.buffer[self.length] = byte;
                self.length += 1;
            } else {
                self.too_long = true;
            }
        }
    }

    /// The port was opened again: what is half read is thrown away. Names, scales and counters stay.
    pub fn reset(&mut self) {
        self.counters.partial += u64::from(self.length > 0);
        (self.length, self.too_long, self.in_step) = (0, false, false);
    }

    /// Totals so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Label of a knob.
    pub fn name_of(&self, knob: u16) -> Option<&str> {
        Some(self.name(knob)?.as_str())
    }

    pub(super) fn name(&self, knob: u16) -> Option<&Name> {
        self.names.get(knob)
    }

    fn end_line(&mut self, sink: &mut impl FnMut(KnobEvent)) {
        let (length, too_long) = (self.length, self.too_long);
        (self.length, self.too_long) = (0, false);
        if !self.in_step {
            self.in_step = true;
            self.counters.partial += u64::from(length > 0);
        } else if too_long {
            self.counters.overflow(Fault::LineTooLong);
        } else if length > 0 {
            match self.check(length) {
                Ok(0) => self.counters.ignored += 1,
                Ok(_) => self.emit(length, sink),
                Err(fault) => self.counters.refuse(fault),
            }
        }
    }

    /// Reads the whole line before any of it counts; returns how many fields it has.
    fn check(&mut self, length: usize) -> Result<usize, Fault> {
        let line = &self.buffer[..length];
        let printable = line.iter().all(|byte| *byte == b'\t' || *byte >= b' ' && *byte != 0x7f);
        if !printable || core::str::from_utf8(line).is_err() {
            return Err(Fault::NotText);
        }
        let (mut field_count, mut label_count) = (0, 0);
        for field in Fields::of(line) {
            let field = field?;
            field_count += 1;
            label_count += usize::from(field.label.is_some());
            if field_count > FIELDS_MAX {
                return Err(Fault::TooManyFields);
            }
            match field.number {
                Number::Decimal(value) if value > 1.0 && self.scales.fixed().is_none() => {
                    return Err(Fault::DecimalTooLarge);
                }
                _ => {}
            }
        }
        if field_count == 0 {
            return Ok(0);
        }
        if label_count != 0 && label_count != field_count {
            return Err(Fault::MixedLabels);
        }
        let kind = if label_count == 0 { Kind::Columns } else { Kind::Labels };
        if kind == self.kind {
            self.strange = 0;
            return Ok(field_count);
        }
        if self.kind != Kind::Unknown {
            self.strange += 1;
            if self.strange < CHANGE_AFTER {
                return Err(Fault::LabelsChanged);
            }
            // Numbers mean other knobs from here on.
            self.names.clear();
            self.scales.clear();
        }
        (self.kind, self.strange) = (kind, 0);
        Ok(field_count)
    }

    fn emit(&mut self, length: usize, sink: &mut impl FnMut(KnobEvent)) {
        self.counters.good += 1;
        let fields = || Fields::of(&self.buffer[..length]).flatten();
        for field in fields() {
            if let Number::Integer(value) = field.number {
                self.scales.notice(value);
            }
        }
        for (column, field) in fields().enumerate() {
            let knob = match field.label {
                None => column as u16,
                Some(label) => {
                    let (knob, named) = self.names.number(&[label]);
                    self.counters.unnamed += u64::from(!named);
                    knob
                }
            };
            let reading = match (field.number, self.scales.fixed()) {
                (Number::Integer(value), _) => self.scales.read(knob, value, &mut self.counters),
                (Number::Decimal(value), None) => fraction(value, &mut self.counters),
                (Number::Decimal(value), Some(full_scale)) => device_units(value, full_scale, &mut self.counters),
            };
            self.counters.events += 1;
            sink(KnobEvent { knob, reading });
        }
    }
}

/// A smoothed value in the units of the converter.
fn device_units(value: f32, full_scale: u16, counters: &mut Counters) -> Reading {
    let rounded = libm::roundf(value);
    if rounded > f32::from(full_scale) {
        counters.clamp();
    }
    Reading::Position {
        value: rounded.min(f32::from(full_scale)) as u16,
        full_scale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{vec, vec::Vec};

    /// `(knob, value, full_scale)` of every event, with the first partial line taken off.
    fn read(lines: &mut Lines, text: &[u8]) -> Vec<(u16, u16, u16)> {
        let mut events = Vec::new();
        lines.feed(text, &mut |event: KnobEvent| match event.reading {
            Reading::Position { value, full_scale } => events.push((event.knob, value, full_scale)),
            Reading::Steps(_) => unreachable!("lines hold positions"),
        });
        events
    }

    fn in_step(full_scale: FullScale) -> Lines {
        let mut lines = Lines::new(full_scale);
        lines.feed(b"\n", &mut |_| ());
        lines
    }

    #[test]
    fn the_line_of_deej() {
        let mut lines = Lines::new(FullScale::Learned);
        let events = read(&mut lines, b"3|1023\r\n0|240|1023\r\n5|6\r\n");
        assert_eq!(
            events,
            [
                (0, 0, 1023),
                (1, 240, 1023),
                (2, 1023, 1023),
                (0, 5, 1023),
                (1, 6, 1023)
            ]
        );
        let counters = *lines.counters();
        assert_eq!(
            (counters.partial, counters.good, counters.bad, counters.events),
            (1, 2, 0, 5)
        );
        lines.feed(b"10|1", &mut |_| ());
        lines.reset();
        assert_eq!(
            read(&mut lines, b"00\n1\n"),
            [(0, 1, 1023)],
            "after a replug the cut line is thrown away"
        );
        assert_eq!(lines.counters().partial, 3);
    }

    #[test]
    fn labels_number_the_knobs() {
        let mut lines = in_step(FullScale::Learned);
        let events = read(&mut lines, b"jaw:512,brow:103\nbrow:1\nlid:2\tjaw:3\n");
        let expected = [(0, 512, 1023), (1, 103, 1023), (1, 1, 1023), (2, 2, 1023), (0, 3, 1023)];
        assert_eq!(events, expected);
        assert_eq!(lines.name_of(1), Some("brow"));
    }

    #[test]
    fn prints_between_the_lines_move_nothing() {
        let mut lines = in_step(FullScale::Learned);
        let text = b"1|2\nReady!\nfree_ram:812\n3|4\n";
        assert_eq!(
            read(&mut lines, text),
            [(0, 1, 1023), (1, 2, 1023), (0, 3, 1023), (1, 4, 1023)]
        );
        assert_eq!(lines.counters().bad, 2);
        assert_eq!(lines.counters().last_fault, Some(Fault::LabelsChanged));
        let labelled = b"jaw:9\n".repeat(usize::from(CHANGE_AFTER));
        assert_eq!(
            read(&mut lines, &labelled),
            [(0, 9, 1023)],
            "a sketch that changed is believed in the end"
        );
    }

    #[test]
    fn decimals_are_parts_of_one_or_device_units() {
        assert_eq!(
            read(&mut in_step(FullScale::Learned), b"0.5 1.0 0.\n"),
            [(0, 32768, 65535), (1, 65535, 65535), (2, 0, 65535)]
        );
        let mut fixed = in_step(FullScale::Fixed(1023));
        assert_eq!(
            read(&mut fixed, b"511.6 2000.0 7\n"),
            [(0, 512, 1023), (1, 1023, 1023), (2, 7, 1023)]
        );
        assert_eq!(fixed.counters().clamped, 1);
    }

    #[test]
    fn each_bad_line_has_its_own_fault() {
        let long = vec![b'1'; LINE_BYTES_MAX + 1];
        let many = b"1,".repeat(FIELDS_MAX + 1);
        let cases: [(&[u8], Fault); 9] = [
            (b"\xff\xfe\x80", Fault::NotText),
            (b"1|\x02|3", Fault::NotText),
            (b"hello", Fault::NotNumbers),
            (b"1||3", Fault::EmptyField),
            (b"1|65536", Fault::NumberTooLarge),
            (b"1|-1", Fault::Negative),
            (b"1.5|0.1", Fault::DecimalTooLarge),
            (b"jaw:1,2", Fault::MixedLabels),
            (&many, Fault::TooManyFields),
        ];
        for (line, fault) in cases {
            let mut lines = in_step(FullScale::Learned);
            assert_eq!(read(&mut lines, &[line, b"\n4\n"].concat()), [(0, 4, 1023)], "{fault}");
            assert_eq!((lines.counters().bad, lines.counters().last_fault), (1, Some(fault)));
        }
        let mut lines = in_step(FullScale::Learned);
        assert_eq!(read(&mut lines, &[&long[..], b"\n4\n"].concat()), [(0, 4, 1023)]);
        assert_eq!(lines.counters().last_fault, Some(Fault::LineTooLong));
        assert_eq!((lines.counters().bad, lines.counters().dropped), (1, 1));
    }

    #[test]
    fn blank_lines_are_no_fault() {
        let mut lines = in_step(FullScale::Learned);
        assert_eq!(read(&mut lines, b"\r\n   \n\n1\n"), [(0, 1, 1023)]);
        assert_eq!((lines.counters().bad, lines.counters().ignored), (0, 1));
    }
}
