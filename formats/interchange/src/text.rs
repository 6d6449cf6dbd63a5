//! Reading text by bytes: lines with their numbers, tokens, numbers; no `String` a line.

use super::error::{Place, SequenceError};
use std::borrow::Cow;
use std::path::Path;

/// At most this many bytes of the file are quoted in a message.
const QUOTED_BYTES_MAX: usize = 40;

/// The text of a file as bytes that hold ASCII where ASCII is meant: UTF-16, which some exporters on Windows write, becomes UTF-8.
/// What else stands there stays as it is.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    let (big_endian, rest) = match bytes {
        [0xff, 0xfe, rest @ ..] => (false, rest),
        [0xfe, 0xff, rest @ ..] => (true, rest),
        // Without a mark at the beginning: no text in another encoding has a zero among its first two bytes.
        [0, 1..=127, ..] => (true, bytes),
        [1..=127, 0, ..] => (false, bytes),
        _ => return Cow::Borrowed(bytes),
    };
    let unit = |&pair: &[u8; 2]| {
        if big_endian {
            u16::from_be_bytes(pair)
        } else {
            u16::from_le_bytes(pair)
        }
    };
    let units = rest.as_chunks().0.iter().map(unit);
    let mut text = String::with_capacity(rest.len() / 2);
    text.extend(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)));
    Cow::Owned(text.into_bytes())
}

/// Walks the lines of a text file and counts them. A line ends with LF, CR LF, or CR alone.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number of the line that comes next, from 1.
    next_number: usize,
    /// A line ended with CR alone. Then an LF behind a CR belongs to what follows: the body of a binary PLY may begin with it.
    ends_in_cr: bool,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Lines {
            rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes),
            next_number: 1,
            ends_in_cr: false,
        }
    }

    /// The next line without its end, and its number. Where `continued` says so of the line's beginning, a backslash
    /// before the line's end joins the following line to it.
    pub(super) fn next(&mut self, continued: impl Fn(&[u8]) -> bool) -> Option<(usize, &'a [u8])> {
        if self.rest.is_empty() {
            return None;
        }
        let number = self.next_number;
        let may_continue = continued(self.rest.trim_ascii_start());
        let mut behind = 0;
        let end = loop {
            self.next_number += 1;
            let Some(offset) = memchr::memchr2(b'\n', b'\r', &self.rest[behind..]) else {
                behind = self.rest.len();
                break behind;
            };
            let joins = may_continue && self.rest[..behind + offset].ends_with(b"\\");
            let end = behind + offset;
            behind = end + 1;
            if self.rest[end] == b'\r' {
                if self.rest.get(behind) == Some(&b'\n') && !self.ends_in_cr {
                    behind += 1;
                } else {
                    self.ends_in_cr = true;
                }
            }
            if !joins {
                break end;
            }
        };
        let line = &self.rest[..end];
        self.rest = &self.rest[behind..];
        Some((number, line))
    }

    /// The next line that holds something besides white space and a `#` comment; its number for "end of file" if none.
    pub(super) fn next_filled(&mut self) -> Result<(usize, &'a [u8]), usize> {
        while let Some((number, line)) = self.next(|_| false) {
            if tokens(line).next().is_some() {
                return Ok((number, line));
            }
        }
        Err(self.next_number)
    }

    /// What has not been read yet.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Number of the line that comes next, from 1.
    pub(super) fn next_number(&self) -> usize {
        self.next_number
    }
}

/// The words of a line up to a `#` comment; a backslash before a line's end is white space.
pub(super) fn tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|b| b.is_ascii_whitespace() || *b == 0x0b)
        .map(|word| word.strip_suffix(b"\\").unwrap_or(word))
        .filter(|word| !word.is_empty())
        .take_while(|word| word[0] != b'#')
}

/// A piece of the file for a message: short, in quotes, on one line.
pub(super) fn quote(bytes: &[u8]) -> String {
    let bytes = bytes.trim_ascii();
    let shown = &bytes[..bytes.len().min(QUOTED_BYTES_MAX)];
    let dots = if shown.len() < bytes.len() { "..." } else { "" };
    format!("`{}{dots}`", String::from_utf8_lossy(shown).escape_debug())
}

/// The error for a place that does not follow the format.
pub(super) fn unexpected(path: &Path, place: Place, expected: &str, found: Option<&[u8]>) -> SequenceError {
    let found = found.map_or_else(|| "nothing".into(), quote);
    SequenceError::Parse {
        path: path.to_path_buf(),
        place,
        expected: expected.into(),
        found,
    }
}

/// The error for a file that ends too soon.
pub(super) fn ends_early(path: &Path, place: Place, expected: &str) -> SequenceError {
    SequenceError::Parse {
        path: path.to_path_buf(),
        place,
        expected: expected.into(),
        found: "the end of the file".into(),
    }
}

/// A coordinate: a finite decimal number, rounded once to the nearest f32 so that written f32 text reads back exactly.
pub(super) fn coordinate(token: Option<&[u8]>, path: &Path, place: Place) -> Result<f32, SequenceError> {
    let number = token
        .and_then(|word| core::str::from_utf8(word).ok())
        .and_then(|word| word.parse::<f32>().ok());
    match number {
        Some(number) if number.is_finite() => Ok(number),
        Some(_) => Err(non_finite(token.unwrap_or_default(), path, place)),
        // Other programs' spellings that Rust does not read: `1.#QNAN`, `-1.#IND`, `-nan(ind)`.
        None if token.is_some_and(|word| {
            let lower = word.to_ascii_lowercase();
            [&b"nan"[..], b"#ind", b"inf"]
                .iter()
                .any(|mark| lower.windows(mark.len()).any(|part| part == *mark))
        }) =>
        {
            Err(non_finite(token.unwrap_or_default(), path, place))
        }
        None => Err(unexpected(path, place, "a number", token)),
    }
}

fn non_finite(token: &[u8], path: &Path, place: Place) -> SequenceError {
    let shown = &token[..token.len().min(QUOTED_BYTES_MAX)];
    let found = String::from_utf8_lossy(shown).escape_debug().to_string();
    SequenceError::NonFinite {
        path: path.to_path_buf(),
        place,
        found,
    }
}

/// A whole number with an optional sign; none if it is anything else or does not fit.
pub(super) fn integer(token: &[u8]) -> Option<i64> {
    core::str::from_utf8(token).ok()?.parse().ok()
}

/// A finite decimal number.
pub(super) fn number(token: &[u8]) -> Option<f32> {
    let number: f32 = core::str::from_utf8(token).ok()?.parse().ok()?;
    number.is_finite().then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_lines(text: &str, continued: bool) -> Vec<(usize, String)> {
        let mut lines = Lines::new(text.as_bytes());
        core::iter::from_fn(|| lines.next(|_| continued))
            .map(|(number, line)| {
                let words: Vec<_> = tokens(line)
                    .map(|word| String::from_utf8_lossy(word).into_owned())
                    .collect();
                (number, words.join(" "))
            })
            .collect()
    }

    #[test]
    fn joined_lines_keep_the_number_of_their_first() {
        let lines = all_lines("a \\\r\n b\\\n c\r\nd # e\n\nf", true);
        assert_eq!(
            lines,
            [
                (1, "a b c".into()),
                (4, "d".into()),
                (5, String::new()),
                (6, "f".into())
            ]
        );
        assert_eq!(all_lines("a\\\nb\\", false), [(1, "a".into()), (2, "b".into())]);
        assert_eq!(all_lines("a\\\n", true), [(1, "a".into())]);
    }

    #[test]
    fn lines_that_end_in_carriage_returns_are_lines() {
        let words = ["v 1", "f 2 3 4", "", "p 1"];
        let numbered: Vec<_> = (1..).zip(words.map(String::from)).collect();
        assert_eq!(
            all_lines("v 1\rf 2 \\\r 3 4\r\rp 1", true),
            [
                (1, "v 1".into()),
                (2, "f 2 3 4".into()),
                (4, String::new()),
                (5, "p 1".into())
            ]
        );
        assert_eq!(all_lines("v 1\rf 2 3 4\r\rp 1\r", true), numbered);
        assert_eq!(all_lines("v 1\r\nf 2 3 4\r\n\r\np 1\r\n", true), numbered);
        let mut lines = Lines::new(b"ply\rend_header\r\n7");
        lines.next(|_| false);
        lines.next(|_| false);
        assert_eq!(lines.rest(), b"\n7");
    }

    #[test]
    fn text_of_two_bytes_a_letter_is_text() {
        for (mark, big_endian) in [(true, false), (true, true), (false, false), (false, true)] {
            let units = mark.then_some(0xfeff).into_iter().chain("v \u{e4} 1\n".encode_utf16());
            let bytes: Vec<u8> = units
                .flat_map(|unit: u16| {
                    if big_endian {
                        unit.to_be_bytes()
                    } else {
                        unit.to_le_bytes()
                    }
                })
                .collect();
            assert_eq!(*decoded(&bytes), *"v \u{e4} 1\n".as_bytes());
        }
        assert!(matches!(decoded(b"v 1"), Cow::Borrowed(b"v 1")));
        assert!(matches!(decoded(b"\0\0\0\x04"), Cow::Borrowed(_)));
    }

    #[test]
    fn numbers_in_odd_forms() {
        let path = Path::new("x");
        let read = |word: &str| coordinate(Some(word.as_bytes()), path, Place::Line(1));
        for (word, number) in [
            ("1.", 1.0),
            ("+.5", 0.5),
            ("-1e-3", -1e-3),
            ("1E2", 100.0),
            ("2.e+1", 20.0),
        ] {
            assert_eq!(read(word).ok(), Some(number), "{word}");
        }
        for word in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#INF", "inf", "1e39"] {
            assert!(matches!(read(word), Err(SequenceError::NonFinite { .. })), "{word}");
        }
        for word in ["", "1,5", "3.1+e2", "0x10", "--1", "1e"] {
            assert!(matches!(read(word), Err(SequenceError::Parse { .. })), "{word}");
        }
    }
}
