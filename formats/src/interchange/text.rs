//! Reading text by bytes: lines with their numbers, tokens, numbers; no `String` a line.

use super::error::{Place, SequenceError};
use std::path::Path;

/// At most this many bytes of the file are quoted in a message.
const QUOTED_BYTES_MAX: usize = 40;

/// Walks the lines of a text file and counts them.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number of the line that comes next, from 1.
    next_number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Lines {
            rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes),
            next_number: 1,
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
        let mut end = 0;
        loop {
            let line_end = self.rest[end..]
                .iter()
                .position(|&b| b == b'\n')
                .map(|offset| end + offset);
            self.next_number += 1;
            let Some(line_end) = line_end else {
                end = self.rest.len();
                break;
            };
            let joined = may_continue && {
                let line = &self.rest[..line_end];
                line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
            };
            if !joined {
                end = line_end;
                break;
            }
            end = line_end + 1;
        }
        let line = &self.rest[..end];
        self.rest = &self.rest[(end + 1).min(self.rest.len())..];
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
