//! Values of binary USD, read where they stand: small ones in their rep, arrays loose or packed, names by numbers, samples by times.

use super::crates::Crate;
use super::layer::Raw;
use crate::error::SequenceError;
use half::f16;

/// Arrays shorter than this are never packed.
const PACKED_MIN: u64 = 16;

/// What a rep says of its value.
#[derive(Clone, Copy)]
pub(super) struct Rep {
    kind: u8,
    is_array: bool,
    is_inlined: bool,
    is_packed: bool,
    pub(super) payload: u64,
}

impl Rep {
    pub(super) fn of(rep: u64) -> Rep {
        Rep {
            kind: (rep >> 48) as u8,
            is_array: rep >> 63 & 1 == 1,
            is_inlined: rep >> 62 & 1 == 1,
            is_packed: rep >> 61 & 1 == 1,
            payload: rep & ((1 << 48) - 1),
        }
    }
}

/// Kinds of numbers.
#[derive(Clone, Copy, PartialEq)]
enum Number {
    U8,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Number {
    fn size_bytes(self) -> usize {
        match self {
            Number::U8 => 1,
            Number::F16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::I64 | Number::U64 | Number::F64 => 8,
        }
    }

    fn value(self, raw: &[u8]) -> f64 {
        let mut wide = [0; 8];
        wide[..raw.len()].copy_from_slice(raw);
        let bits = u64::from_le_bytes(wide);
        match self {
            Number::U8 => bits as f64,
            Number::I32 => f64::from(bits as u32 as i32),
            Number::U32 => f64::from(bits as u32),
            Number::I64 => bits as i64 as f64,
            Number::U64 => bits as f64,
            Number::F16 => f16::from_bits(bits as u16).to_f64(),
            Number::F32 => f64::from(f32::from_bits(bits as u32)),
            Number::F64 => f64::from_bits(bits),
        }
    }
}

/// The numbers of a kind of value: which, how many, and whether they are a rotation, whose real part stands last.
fn numbers_of(kind: u8) -> Option<(Number, usize, bool)> {
    Some(match kind {
        1 | 2 => (Number::U8, 1, false),
        3 => (Number::I32, 1, false),
        4 => (Number::U32, 1, false),
        5 => (Number::I64, 1, false),
        6 => (Number::U64, 1, false),
        7 => (Number::F16, 1, false),
        8 => (Number::F32, 1, false),
        9 | 56 => (Number::F64, 1, false),
        13 => (Number::F64, 4, false),
        14 => (Number::F64, 9, false),
        15 => (Number::F64, 16, false),
        16 => (Number::F64, 4, true),
        17 => (Number::F32, 4, true),
        18 => (Number::F16, 4, true),
        19..=30 => {
            let number = [Number::F64, Number::F32, Number::F16, Number::I32][usize::from(kind - 19) % 4];
            (number, 2 + usize::from(kind - 19) / 4, false)
        }
        _ => return None,
    })
}

const STRING: u8 = 10;
const TOKEN: u8 = 11;
const TOKEN_LIST: u8 = 32;
const PATH_LIST: u8 = 34;
const PATHS: u8 = 40;
const TOKENS: u8 = 41;
const TIME_SAMPLES: u8 = 46;
const DOUBLES: u8 = 48;

impl Crate {
    /// Numbers of a value, and whether they are there at all.
    pub(super) fn numbers(&mut self, rep: u64) -> Result<Option<Vec<f64>>, SequenceError> {
        let rep = Rep::of(rep);
        if rep.kind == DOUBLES {
            return self.doubles(rep).map(Some);
        }
        let Some((number, width, is_rotation)) = numbers_of(rep.kind) else {
            return Ok(None);
        };
        let mut values = if rep.is_array {
            self.array(rep, number, width)?
        } else if rep.is_inlined {
            inlined(rep, number, width)
        } else {
            let raw = self.file.vec_at(rep.payload, (width * number.size_bytes()) as u64)?;
            raw.chunks_exact(number.size_bytes())
                .map(|raw| number.value(raw))
                .collect()
        };
        if is_rotation {
            values.as_chunks_mut::<4>().0.iter_mut().for_each(|q| q.rotate_right(1));
        }
        Ok(Some(values))
    }

    fn doubles(&mut self, rep: Rep) -> Result<Vec<f64>, SequenceError> {
        let mut at = rep.payload;
        let count = self.u64_at(&mut at)?;
        let raw = self.file.vec_at(at, count.saturating_mul(8))?;
        Ok(raw.as_chunks().0.iter().map(|&raw| f64::from_le_bytes(raw)).collect())
    }

    /// Where the items of an array begin, and how many there are.
    fn array_start(&mut self, rep: Rep) -> Result<(u64, u64), SequenceError> {
        let mut at = rep.payload;
        if at == 0 {
            return Ok((0, 0));
        }
        if self.minor < 5 {
            at += 4;
        }
        let count = if self.minor < 7 {
            u64::from(self.u32_at(&mut at)?)
        } else {
            self.u64_at(&mut at)?
        };
        Ok((at, count))
    }

    fn array(&mut self, rep: Rep, number: Number, width: usize) -> Result<Vec<f64>, SequenceError> {
        let (mut at, count) = self.array_start(rep)?;
        if !rep.is_packed || count < PACKED_MIN || width > 1 {
            let size = number.size_bytes();
            let raw = self.file.vec_at(at, count.saturating_mul((width * size) as u64))?;
            return Ok(raw.chunks_exact(size).map(|raw| number.value(raw)).collect());
        }
        let of_integer = |n: i64| match number {
            Number::U32 => f64::from(n as u32),
            Number::U64 => n as u64 as f64,
            _ => n as f64,
        };
        match number {
            Number::I32 | Number::U32 | Number::I64 | Number::U64 => {
                let numbers = self.integers(&mut at, count, number.size_bytes() == 8)?;
                Ok(numbers.into_iter().map(of_integer).collect())
            }
            Number::F16 | Number::F32 | Number::F64 => {
                let [code] = self.file.array_at(at)?;
                at += 1;
                if code == b'i' {
                    let numbers = self.integers(&mut at, count, false)?;
                    return Ok(numbers.into_iter().map(|n| n as f64).collect());
                }
                if code != b't' {
                    return Err(self.refuse(at - 1, "packed numbers", &format!("the code {code}")));
                }
                let size = number.size_bytes();
                let table_count = self.u32_at(&mut at)?;
                let raw = self.file.vec_at(at, u64::from(table_count) * size as u64)?;
                at += raw.len() as u64;
                let table: Vec<f64> = raw.chunks_exact(size).map(|raw| number.value(raw)).collect();
                let places = self.integers(&mut at, count, false)?;
                let looked_up = places
                    .into_iter()
                    .map(|place| table.get(place as u32 as usize).copied());
                let values: Option<Vec<f64>> = looked_up.collect();
                values.ok_or_else(|| self.refuse(at, "numbers of a table", "one beyond it"))
            }
            Number::U8 => Ok(Vec::new()),
        }
    }

    fn token(&self, index: u64) -> String {
        self.tokens
            .get(index as usize)
            .map_or(String::new(), |token| token.to_string())
    }

    fn string(&self, index: u64) -> String {
        self.strings
            .get(index as usize)
            .map_or(String::new(), |&token| self.token(u64::from(token)))
    }

    /// Names and strings of a value; paths where it holds such.
    pub(super) fn strings(&mut self, rep: u64) -> Result<Vec<String>, SequenceError> {
        let rep = Rep::of(rep);
        let indices = match rep.kind {
            TOKEN | STRING if rep.is_array => {
                let (mut at, count) = self.array_start(rep)?;
                self.indices(&mut at, count)?
            }
            TOKEN | STRING => vec![rep.payload as u32],
            TOKENS | PATHS => {
                let mut at = rep.payload;
                let count = self.u64_at(&mut at)?;
                self.indices(&mut at, count)?
            }
            TOKEN_LIST | PATH_LIST => {
                let mut at = rep.payload;
                let [bits] = self.file.array_at(at)?;
                at += 1;
                let mut found = Vec::new();
                // Explicit, added, prepended and appended items, then deleted and ordered ones, which add none.
                for bit in [1, 2, 5, 6] {
                    if bits >> bit & 1 == 1 {
                        let count = self.u64_at(&mut at)?;
                        found.extend(self.indices(&mut at, count)?);
                    }
                }
                found
            }
            _ => Vec::new(),
        };
        let named = indices.into_iter().map(|index| match rep.kind {
            STRING => self.string(u64::from(index)),
            PATHS | PATH_LIST => {
                let path = self.paths.get(index as usize);
                path.map_or(String::new(), |path| format!("/{path}"))
            }
            _ => self.token(u64::from(index)),
        });
        Ok(named.collect())
    }

    fn indices(&mut self, at: &mut u64, count: u64) -> Result<Vec<u32>, SequenceError> {
        let raw = self.file.vec_at(*at, count.saturating_mul(4))?;
        *at += raw.len() as u64;
        Ok(raw.as_chunks().0.iter().map(|&raw| u32::from_le_bytes(raw)).collect())
    }

    pub(super) fn samples(&mut self, rep: u64) -> Result<Vec<(f64, Raw)>, SequenceError> {
        let rep = Rep::of(rep);
        if rep.kind != TIME_SAMPLES || rep.is_inlined {
            return Ok(Vec::new());
        }
        // Both the times and the values stand as far on as a number says.
        let mut at = rep.payload;
        let jump = |this: &mut Self, at: u64| -> Result<u64, SequenceError> {
            let offset = i64::from_le_bytes(this.file.array_at(at)?);
            let target = at.checked_add_signed(offset);
            target.ok_or_else(|| this.refuse(at, "an offset inside the file", &offset.to_string()))
        };
        at = jump(self, at)?;
        let times = self.u64_at(&mut at)?;
        let times = self.numbers(times)?.unwrap_or_default();
        at = jump(self, at)?;
        let count = self.u64_at(&mut at)?;
        if count != times.len() as u64 || times.iter().any(|time| !time.is_finite()) {
            return Err(self.refuse(
                at,
                &format!("{} samples at their times", times.len()),
                &count.to_string(),
            ));
        }
        let raw = self.file.vec_at(at, count.saturating_mul(8))?;
        let reps = raw.as_chunks().0.iter().map(|&raw| Raw::Rep(u64::from_le_bytes(raw)));
        let mut samples: Vec<(f64, Raw)> = times.into_iter().zip(reps).collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(samples)
    }
}

/// Small values stand in their rep: numbers of 32 bits, or vectors and diagonals of whole numbers of 8.
fn inlined(rep: Rep, number: Number, width: usize) -> Vec<f64> {
    let bits = rep.payload as u32;
    let bytes = rep.payload.to_le_bytes().map(|byte| f64::from(byte as i8));
    match width {
        1 => vec![match number {
            Number::U8 => f64::from(bits as u8),
            Number::I32 | Number::I64 => f64::from(bits as i32),
            Number::U32 | Number::U64 => f64::from(bits),
            Number::F16 => f16::from_bits(bits as u16).to_f64(),
            Number::F32 | Number::F64 => f64::from(f32::from_bits(bits)),
        }],
        2..=4 if !(13..=15).contains(&rep.kind) => bytes[..width].to_vec(),
        _ => {
            let side = width.isqrt();
            (0..width)
                .map(|i| if i / side == i % side { bytes[i / side] } else { 0.0 })
                .collect()
        }
    }
}
