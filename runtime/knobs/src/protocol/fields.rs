//! One line of text taken apart: separators, labels, numbers. Before [`super::line`], which says what the fields mean.

use crate::Fault;

/// Fields of a line; more are refused.
pub const FIELDS_MAX: usize = 128;
/// Digits of a number, so that a run of them is refused before it is read.
const NUMBER_BYTES_MAX: usize = 24;

/// A number in a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Number {
    /// Without a point.
    Integer(u16),
    /// With one. Finite, not negative.
    Decimal(f32),
}

/// A field of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Field<'a> {
    /// What stands in front of the `:` or `=`.
    pub label: Option<&'a [u8]>,
    /// Its number.
    pub number: Number,
}

/// Fields in their order. Ends after the first fault.
pub(super) struct Fields<'a> {
    rest: &'a [u8],
    /// The separator; a space stands for any run of spaces.
    separator: u8,
    failed: bool,
}

impl<'a> Fields<'a> {
    /// `line` without its end. The first of `| ; , tab` found separates, spaces if there is none of them.
    pub(super) fn of(line: &'a [u8]) -> Self {
        let found = line.iter().copied().find(|byte| b"|;,\t".contains(byte));
        Self {
            rest: line.trim_ascii(),
            separator: found.unwrap_or(b' '),
            failed: false,
        }
    }

    /// Cuts the next field off. A separator behind the last field is tolerated: loops that print them are common.
    fn cut(&mut self) -> &'a [u8] {
        let end = self.rest.iter().position(|byte| *byte == self.separator);
        if self.separator != b' ' {
            let (field, rest) = end.map_or((self.rest, &[][..]), |at| (&self.rest[..at], &self.rest[at + 1..]));
            self.rest = rest.trim_ascii_start();
            return field;
        }
        // `jaw: 512 brow: 103`: the number belongs to the label before it.
        let mut at = end.unwrap_or(self.rest.len());
        if at > 0 && matches!(self.rest[at - 1], b':' | b'=') {
            let spaces = self.rest[at..].iter().take_while(|byte| **byte == b' ').count();
            let number = self.rest[at + spaces..]
                .iter()
                .take_while(|byte| **byte != b' ')
                .count();
            at += spaces + number;
        }
        let field = &self.rest[..at];
        self.rest = self.rest[at..].trim_ascii_start();
        field
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<Field<'a>, Fault>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed || self.rest.is_empty() {
            return None;
        }
        let field = read(self.cut().trim_ascii());
        self.failed = field.is_err();
        Some(field)
    }
}

fn read(field: &[u8]) -> Result<Field<'_>, Fault> {
    if field.is_empty() {
        return Err(Fault::EmptyField);
    }
    let mark = field.iter().rposition(|byte| matches!(byte, b':' | b'='));
    let (label, number) = match mark {
        Some(at) => (Some(field[..at].trim_ascii()), field[at + 1..].trim_ascii()),
        None => (None, field),
    };
    if label.is_some_and(<[u8]>::is_empty) {
        return Err(Fault::NotNumbers);
    }
    Ok(Field {
        label,
        number: number_of(number)?,
    })
}

fn number_of(text: &[u8]) -> Result<Number, Fault> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        _ => (false, text),
    };
    let points = digits.iter().filter(|byte| **byte == b'.').count();
    let only_digits = digits.iter().all(|byte| byte.is_ascii_digit() || *byte == b'.');
    if !only_digits || points > 1 || digits.len() == points || digits.len() > NUMBER_BYTES_MAX {
        return Err(Fault::NotNumbers);
    }
    if negative {
        return Err(Fault::Negative);
    }
    let text = core::str::from_utf8(digits).map_err(|_| Fault::NotText)?;
    if points == 1 {
        let value: f32 = text.parse().map_err(|_| Fault::NotNumbers)?;
        return Ok(Number::Decimal(value));
    }
    text.parse().map(Number::Integer).map_err(|_| Fault::NumberTooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn integers(line: &str) -> Result<Vec<u16>, Fault> {
        Fields::of(line.as_bytes())
            .map(|field| match field?.number {
                Number::Integer(value) => Ok(value),
                Number::Decimal(value) => panic!("{value} in {line:?}"),
            })
            .collect()
    }

    #[test]
    fn every_separator() {
        for line in [
            "1|22|333",
            "1,22,333",
            "1, 22, 333",
            "1;22;333",
            "1\t22\t333",
            "1 22  333 ",
            "1|22|333|",
            " 1 , 22 ,333,",
        ] {
            assert_eq!(integers(line), Ok([1, 22, 333].to_vec()), "{line:?}");
        }
        assert_eq!(integers("7"), Ok([7].to_vec()));
        assert_eq!(integers(""), Ok(Vec::new()));
        assert_eq!(integers("   "), Ok(Vec::new()));
    }

    #[test]
    fn labels_stand_in_front() {
        for line in [
            "jaw:512,brow:103",
            "jaw:512\tbrow:103",
            "jaw: 512 brow: 103",
            "jaw=512;brow=103",
            "jaw:512 brow:103",
        ] {
            let read: Vec<_> = Fields::of(line.as_bytes()).map(Result::unwrap).collect();
            let expected = [("jaw", 512), ("brow", 103)].map(|(label, value)| Field {
                label: Some(label.as_bytes()),
                number: Number::Integer(value),
            });
            assert_eq!(read, expected, "{line:?}");
        }
    }

    #[test]
    fn each_fault_is_named() {
        for (line, fault) in [
            ("Ready!", Fault::NotNumbers),
            ("loop took 12 ms", Fault::NotNumbers),
            ("1,,2", Fault::EmptyField),
            ("1,70000", Fault::NumberTooLarge),
            ("1,-2", Fault::Negative),
            ("1,.", Fault::NotNumbers),
            ("1,1.2.3", Fault::NotNumbers),
            (":4", Fault::NotNumbers),
            ("jaw:", Fault::NotNumbers),
            ("1,2;3", Fault::NotNumbers),
            ("1111111111111111111111111111111", Fault::NotNumbers),
        ] {
            let read: Result<Vec<_>, _> = Fields::of(line.as_bytes()).collect();
            assert_eq!(read, Err(fault), "{line:?}");
        }
    }
}
