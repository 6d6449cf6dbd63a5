//! One npy file: arrays of numbers in C or Fortran order; header and values checked against the bytes that are there.

use crate::bytes::Bytes;
use crate::error::{Place, SequenceError};
use crate::text::{ends_early, quote};
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

/// An array whose values still lie in its file.
#[derive(Debug)]
pub struct NpyArray {
    bytes: Bytes,
    number: Number,
    big_endian: bool,
    shape: Vec<usize>,
    /// Steps along each axis, in values.
    strides: Vec<usize>,
    /// Bytes of the file before the values.
    start: u64,
    /// All values, once they had to be read.
    whole: Option<Values>,
}

/// Values that were read off an array.
#[derive(Debug)]
struct Values {
    number: Number,
    big_endian: bool,
    bytes: Vec<u8>,
}

impl NpyArray {
    /// Reads the header of an array in memory; `path` serves messages only.
    ///
    /// Errors: `Parse` when the header is damaged, the type is no float or integer, or the values do not fill the shape.
    pub fn parse(bytes: Vec<u8>, path: &Path) -> Result<NpyArray, SequenceError> {
        NpyArray::new(Bytes::of_memory(bytes, path))
    }

    /// Reads the header of a file.
    pub(super) fn new(mut bytes: Bytes) -> Result<NpyArray, SequenceError> {
        let head = bytes.head(12 + HEADER_BYTES_MAX as u64)?;
        let path = bytes.path().to_path_buf();
        let refuse = |byte: usize, expected: &str, found: String| SequenceError::Parse {
            path: path.clone(),
            place: Place::Byte(byte),
            expected: expected.into(),
            found,
        };
        let Some(rest) = head.strip_prefix(b"\x93NUMPY") else {
            return Err(refuse(0, "the npy signature", quote(&head[..head.len().min(6)])));
        };
        let (length, text_start) = match rest {
            [1, _, a, b, ..] => (u16::from_le_bytes([*a, *b]) as usize, 10),
            [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12),
            [version, ..] if *version == 0 || *version > 3 => {
                return Err(refuse(6, "npy version 1, 2 or 3", version.to_string()));
            }
            _ => return Err(ends_early(&path, Place::Byte(head.len()), "the npy header")),
        };
        let text = head
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
        let start = (text_start + length) as u64;
        let value_bytes = bytes.len() - start;
        let count = header
            .shape
            .iter()
            .try_fold(1usize, |product, &n| product.checked_mul(n));
        let needed = count.and_then(|count| count.checked_mul(header.number.size_bytes()));
        if needed.map(|needed| needed as u64) != Some(value_bytes) {
            let expected = format!(
                "values for the shape {:?}, {} bytes each",
                header.shape,
                header.number.size_bytes()
            );
            return Err(refuse(start as usize, &expected, format!("{value_bytes} bytes")));
        }
        let Header {
            number,
            big_endian,
            shape,
            fortran_order,
        } = header;
        Ok(NpyArray {
            bytes,
            number,
            big_endian,
            strides: strides(&shape, fortran_order),
            shape,
            start,
            whole: None,
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

    /// All values of a float array `[N][K]`, row by row, and K. Refuses arrays of other shapes and types.
    ///
    /// Errors: `Parse`, `Io`.
    pub fn into_matrix(mut self) -> Result<(Vec<f32>, usize), SequenceError> {
        let fits = matches!(self.shape[..], [n, k] if n > 0 && k > 0);
        self.check(self.is_float() && fits, "a float array [rows][columns]")?;
        let (rows, columns) = (self.shape[0], self.shape[1]);
        let values = self.values(0, rows * columns)?;
        let (by_row, by_column) = (self.strides[0], self.strides[1]);
        let at = |i: usize| values.float(i / columns * by_row + i % columns * by_column);
        Ok(((0..rows * columns).map(at).collect(), columns))
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
        let (path, place) = (self.bytes.path().to_path_buf(), Place::Byte(self.start as usize));
        let found = format!("{kind} of the shape {:?}", self.shape);
        Err(SequenceError::Parse {
            path,
            place,
            expected: expected.into(),
            found,
        })
    }

    /// `count` values from value `first` on.
    fn values(&mut self, first: usize, count: usize) -> Result<Values, SequenceError> {
        let size_bytes = self.number.size_bytes();
        Ok(Values {
            number: self.number,
            big_endian: self.big_endian,
            bytes: self
                .bytes
                .vec_at(self.start + (first * size_bytes) as u64, (count * size_bytes) as u64)?,
        })
    }

    /// Shape `n` of a float array [N][V][3] as f32, into `out`. The caller has checked axes and `n`.
    pub(super) fn positions(&mut self, n: usize, out: &mut Vec<[f32; 3]>) -> Result<(), SequenceError> {
        let vertex_count = self.shape[1];
        let whole = 3 * vertex_count;
        let (first, by_vertex, by_axis) = (n * self.strides[0], self.strides[1], self.strides[2]);
        let at = |v: usize, c: usize| v * by_vertex + c * by_axis;
        out.clear();
        // In C order a shape lies in one piece; in the other its numbers lie all over the array, which is then read once.
        if self.strides[0] >= whole {
            let values = self.values(first, whole)?;
            out.extend((0..vertex_count).map(|v| core::array::from_fn(|c| values.float(at(v, c)))));
            return Ok(());
        }
        if self.whole.is_none() {
            self.whole = Some(self.values(0, self.shape[0] * whole)?);
        }
        if let Some(values) = &self.whole {
            out.extend((0..vertex_count).map(|v| core::array::from_fn(|c| values.float(first + at(v, c)))));
        }
        Ok(())
    }

    /// The triangles of an integer array [F][3], every index < `vertex_count`. The caller has checked axes.
    pub(super) fn triangles(&mut self, vertex_count: usize) -> Result<Vec<[u32; 3]>, SequenceError> {
        let values = self.values(0, 3 * self.shape[0])?;
        let mut faces = Vec::with_capacity(self.shape[0]);
        for f in 0..self.shape[0] {
            let mut face = [0u32; 3];
            for (i, corner) in face.iter_mut().enumerate() {
                let index = values.integer(f * self.strides[0] + i * self.strides[1]);
                if !(0..vertex_count as i64).contains(&index) {
                    return Err(SequenceError::IndexOutOfRange {
                        path: self.bytes.path().to_path_buf(),
                        place: Place::Face(f),
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
}

/// Steps along each axis, in values.
fn strides(shape: &[usize], fortran_order: bool) -> Vec<usize> {
    let mut strides = vec![1usize; shape.len()];
    let mut stride = 1usize;
    for i in 0..shape.len() {
        let axis = if fortran_order { i } else { shape.len() - 1 - i };
        strides[axis] = stride;
        // Another axis may be zero, so that the product says nothing of this one.
        stride = stride.saturating_mul(shape[axis]);
    }
    strides
}

impl Values {
    /// The bytes of value `i`, in little-endian order, zeros behind them.
    fn raw(&self, i: usize, size_bytes: usize) -> [u8; 8] {
        let mut raw = [0u8; 8];
        let value = &self.bytes[i * size_bytes..][..size_bytes];
        raw[..size_bytes].copy_from_slice(value);
        if self.big_endian {
            raw[..size_bytes].reverse();
        }
        raw
    }

    fn float(&self, i: usize) -> f32 {
        match self.number {
            Number::Float(2) => half::f16::from_bits(u64::from_le_bytes(self.raw(i, 2)) as u16).to_f32(),
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
            "f2" => Number::Float(2),
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
}

impl Number {
    fn size_bytes(self) -> usize {
        let (Number::Float(size_bytes) | Number::Signed(size_bytes) | Number::Unsigned(size_bytes)) = self;
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
        assert_eq!(
            second(file("<f4", "False", "(2, 2, 3)", &c_order)),
            [[6., 7., 8.], [9., 10., 11.]]
        );
        let halves: Vec<u8> = values
            .iter()
            .flat_map(|value| half::f16::from_f64(*value).to_le_bytes())
            .collect();
        assert_eq!(
            second(file("<f2", "False", "(2, 2, 3)", &halves)),
            [[6., 7., 8.], [9., 10., 11.]]
        );
        let fortran: Vec<u8> = (0..3)
            .flat_map(|c| (0..2).flat_map(move |v| (0..2).map(move |n| n * 6 + v * 3 + c)))
            .flat_map(|i: usize| values[i].to_be_bytes())
            .collect();
        assert_eq!(
            second(file(">f8", "True", "(2, 2, 3)", &fortran)),
            [[6., 7., 8.], [9., 10., 11.]]
        );
    }

    fn second(bytes: Vec<u8>) -> Vec<[f32; 3]> {
        let mut positions = Vec::new();
        NpyArray::parse(bytes, Path::new("p"))
            .unwrap()
            .positions(1, &mut positions)
            .unwrap();
        positions
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
                let mut array = NpyArray::parse(bytes, Path::new("f")).unwrap();
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
        let mut array = NpyArray::parse(bytes, Path::new("f")).unwrap();
        assert!(matches!(
            array.triangles(3),
            Err(SequenceError::IndexOutOfRange { index: -1, .. })
        ));
    }

    #[test]
    fn refusals() {
        for (descr, order, shape) in [
            ("|O", "False", "(1, 3)"),
            ("<f3", "False", "(1, 3)"),
            ("<f4", "Maybe", "(1, 3)"),
            ("<f4", "False", "(1, 3"),
            ("<f4", "False", "(-1, 3)"),
            ("<f4", "False", "(4000000000, 3)"),
            ("<f4", "False", "(18446744073709551615, 18446744073709551615, 3)"),
            ("<f4", "False", "(2, 3)"),
            ("<f4", "False", "(1, 2)"),
        ] {
            let bytes = file(descr, order, shape, &[0; 12]);
            let result = NpyArray::parse(bytes, Path::new("p"));
            assert!(
                matches!(result, Err(SequenceError::Parse { .. })),
                "{descr} {order} {shape}"
            );
        }
        let bytes = file("<f4", "False", "(1, 3)", &[0; 12]);
        for length in 0..bytes.len() {
            assert!(NpyArray::parse(bytes[..length].to_vec(), Path::new("p")).is_err());
        }
    }
}
