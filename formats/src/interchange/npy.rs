//! NumPy's npy: arrays of numbers in C or Fortran order; header and values checked against the bytes that are there.

use super::error::{Place, SequenceError};
use super::text::{ends_early, quote};
use std::path::Path;

/// Longest header text that is read; numpy writes 128 bytes for what we read.
const HEADER_BYTES_MAX: usize = 4096;
/// Most dimensions an array may have.
const RANK_MAX: usize = 8;

/// A number's type: kind letter and bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    Float(usize),
    Signed(usize),
    Unsigned(usize),
}

/// An array whose values still lie in the file's bytes.
#[derive(Debug)]
pub struct NpyArray<'a> {
    path: &'a Path,
    number: Number,
    big_endian: bool,
    shape: Vec<usize>,
    /// Steps along each axis, in values.
    strides: Vec<usize>,
    values: &'a [u8],
    /// Bytes of the file before the values.
    start: usize,
}

impl<'a> NpyArray<'a> {
    /// Reads the header; `path` serves messages only.
    ///
    /// Errors: `Parse` when the header is damaged, the type is no float or integer, or the values do not fill the shape.
    pub fn parse(bytes: &'a [u8], path: &'a Path) -> Result<NpyArray<'a>, SequenceError> {
        let refuse = |byte: usize, expected: &str, found: String| {
            let (path, place) = (path.to_path_buf(), Place::Byte(byte));
            SequenceError::Parse {
                path,
                place,
                expected: expected.into(),
                found,
            }
        };
        let Some(rest) = bytes.strip_prefix(b"\x93NUMPY") else {
            return Err(refuse(0, "the npy signature", quote(&bytes[..bytes.len().min(6)])));
        };
        let (length, text_start) = match rest {
            [1, _, a, b, ..] => (u16::from_le_bytes([*a, *b]) as usize, 10),
            [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12),
            [version, ..] if *version == 0 || *version > 3 => {
                return Err(refuse(6, "npy version 1, 2 or 3", version.to_string()));
            }
            _ => return Err(ends_early(path, Place::Byte(bytes.len()), "the npy header")),
        };
        let text = bytes
            .get(text_start..)
            .and_then(|rest| rest.get(..length))
            .filter(|_| length <= HEADER_BYTES_MAX);
        let Some(text) = text else {
            return Err(refuse(
                text_start,
                "a short npy header",
                format!("{length} bytes claimed"),
            ));
        };
        let Some(header) = Header::parse(text) else {
            let expected = "a header with 'descr' (a float or integer type), 'fortran_order' and 'shape'";
            return Err(refuse(text_start, expected, quote(text)));
        };
        let start = text_start + length;
        let values = &bytes[start..];
        let count = header
            .shape
            .iter()
            .try_fold(1usize, |product, &n| product.checked_mul(n));
        let needed = count.and_then(|count| count.checked_mul(header.size_bytes()));
        if needed != Some(values.len()) {
            let expected = format!(
                "values for the shape {:?}, {} bytes each",
                header.shape,
                header.size_bytes()
            );
            return Err(refuse(start, &expected, format!("{} bytes", values.len())));
        }
        let mut strides = vec![1usize; header.shape.len()];
        let mut stride = 1usize;
        for i in 0..header.shape.len() {
            let axis = if header.fortran_order {
                i
            } else {
                header.shape.len() - 1 - i
            };
            strides[axis] = stride;
            // Another axis may be zero, so that the product says nothing of this one.
            stride = stride.saturating_mul(header.shape[axis]);
        }
        let Header {
            number,
            big_endian,
            shape,
            ..
        } = header;
        Ok(NpyArray {
            path,
            number,
            big_endian,
            shape,
            strides,
            values,
            start,
        })
    }

    /// The lengths of the axes.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Whether the values are floats.
    pub fn is_float(&self) -> bool {
        matches!(self.number, Number::Float(_))
    }

    /// Refuses what is no float array [N][V][3] with N and V above zero.
    pub(super) fn check_float_positions(&self) -> Result<(), SequenceError> {
        let fits = matches!(self.shape[..], [n, v, 3] if n > 0 && v > 0);
        self.check(
            self.is_float() && fits,
            "positions: a float array [shapes][vertices][3]",
        )
    }

    /// Refuses what is no integer array [F][3].
    pub(super) fn check_triangles(&self) -> Result<(), SequenceError> {
        self.check(
            !self.is_float() && matches!(self.shape[..], [_, 3]),
            "triangles: an integer array [faces][3]",
        )
    }

    fn check(&self, fits: bool, expected: &str) -> Result<(), SequenceError> {
        if fits {
            return Ok(());
        }
        let kind = if self.is_float() { "floats" } else { "integers" };
        let (path, place) = (self.path.to_path_buf(), Place::Byte(self.start));
        let found = format!("{kind} of the shape {:?}", self.shape);
        Err(SequenceError::Parse {
            path,
            place,
            expected: expected.into(),
            found,
        })
    }

    /// Shape `n` of a float array [N][V][3] as f32. The caller has checked axes and `n`.
    pub(super) fn positions(&self, n: usize) -> Result<Vec<[f32; 3]>, SequenceError> {
        let vertex_count = self.shape[1];
        let mut positions = Vec::with_capacity(vertex_count);
        for v in 0..vertex_count {
            let mut position = [0.0f32; 3];
            for (c, value) in position.iter_mut().enumerate() {
                *value = self.float(n * self.strides[0] + v * self.strides[1] + c * self.strides[2]);
                if !value.is_finite() {
                    let (path, place) = (self.path.to_path_buf(), Place::ShapeVertex { shape: n, vertex: v });
                    return Err(SequenceError::NonFinite {
                        path,
                        place,
                        found: value.to_string(),
                    });
                }
            }
            positions.push(position);
        }
        Ok(positions)
    }

    /// The triangles of an integer array [F][3], every index < `vertex_count`. The caller has checked axes.
    pub(super) fn triangles(&self, vertex_count: usize) -> Result<Vec<[u32; 3]>, SequenceError> {
        let mut faces = Vec::with_capacity(self.shape[0]);
        for f in 0..self.shape[0] {
            let mut face = [0u32; 3];
            for (i, corner) in face.iter_mut().enumerate() {
                let index = self.integer(f * self.strides[0] + i * self.strides[1]);
                if !(0..vertex_count as i64).contains(&index) {
                    let (path, place) = (self.path.to_path_buf(), Place::Face(f));
                    return Err(SequenceError::IndexOutOfRange {
                        path,
                        place,
                        index,
                        vertex_count,
                    });
                }
                *corner = index as u32;
            }
            faces.push(face);
        }
        Ok(faces)
    }

    /// The bytes of value `i`, in little-endian order, zeros behind them.
    fn raw(&self, i: usize, size_bytes: usize) -> [u8; 8] {
        let mut raw = [0u8; 8];
        let value = &self.values[i * size_bytes..][..size_bytes];
        raw[..size_bytes].copy_from_slice(value);
        if self.big_endian {
            raw[..size_bytes].reverse();
        }
        raw
    }

    fn float(&self, i: usize) -> f32 {
        match self.number {
            Number::Float(4) => f32::from_bits(u64::from_le_bytes(self.raw(i, 4)) as u32),
            Number::Float(_) => f64::from_le_bytes(self.raw(i, 8)) as f32,
            _ => self.integer(i) as f32,
        }
    }

    fn integer(&self, i: usize) -> i64 {
        match self.number {
            Number::Signed(size_bytes) => {
                let unused_bits = 64 - 8 * size_bytes as u32;
                i64::from_le_bytes(self.raw(i, size_bytes)) << unused_bits >> unused_bits
            }
            Number::Unsigned(size_bytes) => {
                i64::try_from(u64::from_le_bytes(self.raw(i, size_bytes))).unwrap_or(i64::MAX)
            }
            Number::Float(_) => self.float(i) as i64,
        }
    }
}

/// The dictionary in the header.
struct Header {
    number: Number,
    big_endian: bool,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl Header {
    /// Reads `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`, keys in any order; none if it is anything else.
    fn parse(text: &[u8]) -> Option<Header> {
        let text = core::str::from_utf8(text).ok()?.trim();
        let mut rest = text.strip_prefix('{')?.trim_start();
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        while !rest.starts_with('}') {
            let (key, after) = quoted(rest)?;
            rest = after.trim_start().strip_prefix(':')?.trim_start();
            match key {
                "descr" => {
                    let (value, after) = quoted(rest)?;
                    (descr, rest) = (Some(value), after);
                }
                "fortran_order" => {
                    let after_false = rest.strip_prefix("False").map(|after| (false, after));
                    let (value, after) =
                        after_false.or_else(|| rest.strip_prefix("True").map(|after| (true, after)))?;
                    (fortran_order, rest) = (Some(value), after);
                }
                "shape" => {
                    let (value, after) = rest.strip_prefix('(')?.split_once(')')?;
                    let lengths = value.split(',').map(str::trim).filter(|length| !length.is_empty());
                    let lengths: Option<Vec<usize>> = lengths.map(|length| length.parse().ok()).collect();
                    (shape, rest) = (Some(lengths?), after);
                }
                _ => return None,
            }
            rest = rest.trim_start();
            rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        }
        let descr = descr?;
        let big_endian = descr.starts_with('>');
        let number = match descr.trim_start_matches(['<', '>', '|', '=']) {
            "f4" => Number::Float(4),
            "f8" => Number::Float(8),
            "i1" => Number::Signed(1),
            "i2" => Number::Signed(2),
            "i4" => Number::Signed(4),
            "i8" => Number::Signed(8),
            "u1" => Number::Unsigned(1),
            "u2" => Number::Unsigned(2),
            "u4" => Number::Unsigned(4),
            "u8" => Number::Unsigned(8),
            _ => return None,
        };
        let shape = shape.filter(|shape| shape.len() <= RANK_MAX)?;
        Some(Header {
            number,
            big_endian,
            fortran_order: fortran_order?,
            shape,
        })
    }

    fn size_bytes(&self) -> usize {
        let (Number::Float(size_bytes) | Number::Signed(size_bytes) | Number::Unsigned(size_bytes)) = self.number;
        size_bytes
    }
}

/// A Python string literal without escapes at the start of `text`, and what follows it.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let mark = text.chars().next().filter(|mark| matches!(mark, '\'' | '"'))?;
    text[1..].split_once(mark)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(descr: &str, fortran: &str, shape: &str, values: &[u8]) -> Vec<u8> {
        let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let length = (text.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes(), values].concat()
    }

    #[test]
    fn both_orders_and_both_byte_orders_and_sizes() {
        let values: Vec<f64> = (0..12).map(f64::from).collect();
        let c_order: Vec<u8> = values.iter().flat_map(|value| (*value as f32).to_le_bytes()).collect();
        let bytes = file("<f4", "False", "(2, 2, 3)", &c_order);
        let array = NpyArray::parse(&bytes, Path::new("p")).unwrap();
        assert_eq!(array.positions(1).unwrap(), [[6., 7., 8.], [9., 10., 11.]]);
        let fortran: Vec<u8> = (0..3)
            .flat_map(|c| (0..2).flat_map(move |v| (0..2).map(move |n| n * 6 + v * 3 + c)))
            .flat_map(|i: usize| values[i].to_be_bytes())
            .collect();
        let bytes = file(">f8", "True", "(2, 2, 3)", &fortran);
        let array = NpyArray::parse(&bytes, Path::new("p")).unwrap();
        assert_eq!(array.positions(1).unwrap(), [[6., 7., 8.], [9., 10., 11.]]);
    }

    #[test]
    fn integers_of_every_size() {
        let numbers = [0i64, 1, 2];
        for size_bytes in [1usize, 2, 4, 8] {
            for letter in ["i", "u"] {
                let little: Vec<u8> = numbers
                    .iter()
                    .flat_map(|n| n.to_le_bytes()[..size_bytes].to_vec())
                    .collect();
                let bytes = file(&format!("<{letter}{size_bytes}"), "False", "(1, 3)", &little);
                let array = NpyArray::parse(&bytes, Path::new("f")).unwrap();
                assert_eq!(array.triangles(3).unwrap(), [[0, 1, 2]]);
                let outside = array.triangles(2);
                assert!(matches!(
                    outside,
                    Err(SequenceError::IndexOutOfRange {
                        index: 2,
                        place: Place::Face(0),
                        ..
                    })
                ));
            }
        }
        let bytes = file("<i2", "False", "(1, 3)", &[0, 0, 1, 0, 255, 255]);
        let array = NpyArray::parse(&bytes, Path::new("f")).unwrap();
        assert!(matches!(
            array.triangles(3),
            Err(SequenceError::IndexOutOfRange { index: -1, .. })
        ));
    }

    #[test]
    fn refusals() {
        for (descr, order, shape) in [
            ("|O", "False", "(1, 3)"),
            ("<f2", "False", "(1, 3)"),
            ("<f4", "Maybe", "(1, 3)"),
            ("<f4", "False", "(1, 3"),
            ("<f4", "False", "(-1, 3)"),
            ("<f4", "False", "(4000000000, 3)"),
            ("<f4", "False", "(18446744073709551615, 18446744073709551615, 3)"),
            ("<f4", "False", "(2, 3)"),
            ("<f4", "False", "(1, 2)"),
        ] {
            let bytes = file(descr, order, shape, &[0; 12]);
            let result = NpyArray::parse(&bytes, Path::new("p"));
            assert!(
                matches!(result, Err(SequenceError::Parse { .. })),
                "{descr} {order} {shape}"
            );
        }
        let bytes = file("<f4", "False", "(1, 3)", &[0; 12]);
        for length in 0..bytes.len() {
            assert!(NpyArray::parse(&bytes[..length], Path::new("p")).is_err());
        }
    }
}
