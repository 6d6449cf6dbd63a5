//! Numbers of a PLY body, in either writing.

use super::header::{Encoding, PropertyKind, Scalar};
use crate::error::{Place, SequenceError};
use crate::text::{coordinate, ends_early, integer, unexpected};
use std::path::Path;

/// Reads numbers off the body, in either writing.
pub(super) struct Body<'a> {
    pub(super) path: &'a Path,
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
    /// Bytes of the file before the body.
    pub(super) start: usize,
    /// Line of `at`, if ascii.
    pub(super) line: usize,
    pub(super) encoding: Encoding,
}

impl<'a> Body<'a> {
    /// The place of the next number: its line in text, its item in a binary body.
    pub(super) fn place_of(&mut self, item: Place) -> Place {
        if self.encoding == Encoding::Ascii {
            self.pass_white_space();
            Place::Line(self.line)
        } else {
            item
        }
    }

    pub(super) fn place(&self) -> Place {
        if self.encoding == Encoding::Ascii {
            Place::Line(self.line)
        } else {
            Place::Byte(self.start + self.at)
        }
    }

    pub(super) fn pass_white_space(&mut self) {
        while let Some(byte) = self.bytes.get(self.at).filter(|byte| byte.is_ascii_whitespace()) {
            // A line ends with LF, or with CR unless LF follows.
            let ends_in_cr = *byte == b'\r' && self.bytes.get(self.at + 1) != Some(&b'\n');
            self.line += usize::from(*byte == b'\n' || ends_in_cr);
            self.at += 1;
        }
    }

    pub(super) fn word(&mut self) -> Result<&'a [u8], SequenceError> {
        self.pass_white_space();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        if length == 0 {
            return Err(ends_early(self.path, self.place(), "a number"));
        }
        self.at += length;
        Ok(&rest[..length])
    }

    pub(super) fn raw<const N: usize>(&mut self) -> Result<[u8; N], SequenceError> {
        let Some(raw) = self.bytes[self.at..].first_chunk::<N>() else {
            return Err(ends_early(self.path, self.place(), "a number"));
        };
        self.at += N;
        let mut raw = *raw;
        if self.encoding == Encoding::BinaryBigEndian {
            raw.reverse();
        }
        Ok(raw)
    }

    pub(super) fn coordinate(&mut self, scalar: Scalar, v: usize) -> Result<f32, SequenceError> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return coordinate(Some(word), self.path, self.place());
        }
        let number = match scalar {
            Scalar::F32 => f32::from_le_bytes(self.raw()?),
            Scalar::F64 => f64::from_le_bytes(self.raw()?) as f32,
            _ => self.integer(scalar)? as f32,
        };
        if !number.is_finite() {
            let path = self.path.to_path_buf();
            return Err(SequenceError::NonFinite {
                path,
                place: Place::Vertex(v),
                found: number.to_string(),
            });
        }
        Ok(number)
    }

    pub(super) fn integer(&mut self, scalar: Scalar) -> Result<i64, SequenceError> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return integer(word).ok_or_else(|| unexpected(self.path, self.place(), "a whole number", Some(word)));
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.raw()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.raw()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.raw()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.raw()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.raw()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.raw()?).into(),
            // The header was checked: lists count and index in integers.
            Scalar::F32 | Scalar::F64 => return Err(unexpected(self.path, self.place(), "a whole number", None)),
        })
    }

    /// The length of a list, held against the bytes that are left.
    pub(super) fn list_count(&mut self, count: Scalar, item: Scalar) -> Result<usize, SequenceError> {
        let place = self.place_of(self.place());
        let claimed = self.integer(count)?;
        let Ok(length) = usize::try_from(claimed) else {
            return Err(unexpected(
                self.path,
                place,
                "the length of a list",
                Some(claimed.to_string().as_bytes()),
            ));
        };
        let item_bytes = if self.encoding == Encoding::Ascii {
            2
        } else {
            item.size_bytes()
        };
        if length.saturating_mul(item_bytes) > self.bytes.len() - self.at + 1 {
            return Err(ends_early(self.path, place, &format!("a list of {length} numbers")));
        }
        Ok(length)
    }

    pub(super) fn skip(&mut self, kind: PropertyKind) -> Result<(), SequenceError> {
        let (count, scalar) = match kind {
            PropertyKind::Single(scalar) => (1, scalar),
            PropertyKind::List { count, item } => (self.list_count(count, item)?, item),
        };
        if self.encoding == Encoding::Ascii {
            for _ in 0..count {
                self.word()?;
            }
        } else {
            let length_bytes = count.saturating_mul(scalar.size_bytes());
            if length_bytes > self.bytes.len() - self.at {
                return Err(ends_early(self.path, self.place(), "a number"));
            }
            self.at += length_bytes;
        }
        Ok(())
    }
}
