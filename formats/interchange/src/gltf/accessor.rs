//! Typed arrays of a glTF file: strided, quantized, sparse or packed.

use super::document::Store;
use super::meshopt;
use crate::error::SequenceError;
use std::collections::HashMap;
use std::rc::Rc;

/// Bytes that decoded arrays may take for each byte of the file and its buffers, beyond a fixed sum: packed and sparse arrays are
/// larger than what they were read from, but not without end.
const GROWTH_MAX: u64 = 64;
const FIXED_BYTES: u64 = 1 << 20;

/// Reads arrays; keeps what was unpacked.
pub(super) struct Accessors {
    pub(super) store: Store,
    unpacked: HashMap<usize, Rc<Vec<u8>>>,
    /// Bytes that may still be decoded.
    budget: u64,
}

/// The type of an array's numbers.
#[derive(Clone, Copy, PartialEq)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Number {
    fn of_code(code: u32) -> Option<Number> {
        Some(match code {
            5120 => Number::I8,
            5121 => Number::U8,
            5122 => Number::I16,
            5123 => Number::U16,
            5125 => Number::U32,
            5126 => Number::F32,
            _ => return None,
        })
    }

    fn size_bytes(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::U32 | Number::F32 => 4,
        }
    }

    fn value(self, raw: &[u8], normalized: bool) -> f64 {
        let (value, one) = match self {
            Number::I8 => (f64::from(raw[0] as i8), 127.0),
            Number::U8 => (f64::from(raw[0]), 255.0),
            Number::I16 => (f64::from(i16::from_le_bytes([raw[0], raw[1]])), 32767.0),
            Number::U16 => (f64::from(u16::from_le_bytes([raw[0], raw[1]])), 65535.0),
            Number::U32 => (
                f64::from(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]])),
                f64::from(u32::MAX),
            ),
            Number::F32 => return f64::from(f32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]])),
        };
        if normalized { (value / one).max(-1.0) } else { value }
    }
}

fn components(kind: &str) -> Option<usize> {
    Some(match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => return None,
    })
}

/// What an accessor says of itself.
struct Layout {
    view: Option<usize>,
    offset: u64,
    number: Number,
    components: usize,
    normalized: bool,
    count: usize,
}

impl Accessors {
    pub(super) fn new(store: Store) -> Accessors {
        Accessors {
            budget: store.total_bytes.saturating_mul(GROWTH_MAX).saturating_add(FIXED_BYTES),
            store,
            unpacked: HashMap::new(),
        }
    }

    fn refuse(&self, index: usize, found: impl Into<String>) -> SequenceError {
        self.store
            .refuse(format!("accessor {index} to be an array inside its buffer"), found)
    }

    fn spend(&mut self, index: usize, bytes: u64) -> Result<(), SequenceError> {
        let known = self
            .store
            .total_bytes
            .saturating_mul(GROWTH_MAX)
            .saturating_add(FIXED_BYTES);
        // What buffers beside the file added since.
        let spent = known.saturating_sub(self.budget);
        match known.checked_sub(spent.saturating_add(bytes)) {
            Some(left) => {
                self.budget = left;
                Ok(())
            }
            None => Err(self.refuse(index, format!("{bytes} bytes of numbers, which no such file can fill"))),
        }
    }

    fn layout(&self, index: usize) -> Result<Layout, SequenceError> {
        let accessors = &self.store.document.accessors;
        let Some(accessor) = accessors.get(index) else {
            return Err(self.store.refuse(
                format!("one of {} accessors", accessors.len()),
                format!("accessor {index}"),
            ));
        };
        let (number, components) = (Number::of_code(accessor.component_type), components(&accessor.kind));
        match (number, components, usize::try_from(accessor.count)) {
            (Some(number), Some(components), Ok(count)) => Ok(Layout {
                view: accessor.buffer_view,
                offset: accessor.byte_offset,
                number,
                components,
                normalized: accessor.normalized,
                count,
            }),
            _ => Err(self.refuse(index, format!("type {} of {}", accessor.kind, accessor.component_type))),
        }
    }

    /// How many items an array has.
    pub(super) fn count(&self, index: usize) -> Result<usize, SequenceError> {
        self.layout(index).map(|layout| layout.count)
    }

    /// Items of `size` bytes, one after the other, from a view.
    fn items(
        &mut self,
        index: usize,
        view: usize,
        offset: u64,
        count: usize,
        size: usize,
    ) -> Result<Vec<u8>, SequenceError> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let stride = self
            .store
            .document
            .buffer_views
            .get(view)
            .and_then(|view| view.byte_stride);
        let stride = stride.unwrap_or(size as u64);
        let length = stride
            .checked_mul(count as u64 - 1)
            .and_then(|length| length.checked_add(size as u64));
        let Some(length) = length.filter(|_| stride >= size as u64) else {
            return Err(self.refuse(index, format!("{count} items of {size} bytes, {stride} bytes apart")));
        };
        let raw = match self.store.compressed(view) {
            None => self.store.view(view, offset, length)?,
            Some(_) => {
                let whole = self.unpack(view)?;
                let end = offset.checked_add(length).filter(|&end| end <= whole.len() as u64);
                match end {
                    Some(end) => whole[offset as usize..end as usize].to_vec(),
                    None => return Err(self.refuse(index, format!("{} bytes", whole.len()))),
                }
            }
        };
        if stride == size as u64 {
            return Ok(raw);
        }
        Ok(raw
            .chunks(stride as usize)
            .flat_map(|item| &item[..size])
            .copied()
            .collect())
    }

    fn unpack(&mut self, view: usize) -> Result<Rc<Vec<u8>>, SequenceError> {
        if let Some(known) = self.unpacked.get(&view) {
            return Ok(Rc::clone(known));
        }
        let compressed = self.store.compressed(view).unwrap_or_default();
        let packed = self.store.packed(&compressed)?;
        self.spend(view, compressed.count.saturating_mul(compressed.byte_stride))?;
        let bytes = meshopt::unpack(&compressed, &packed);
        let bytes = bytes.map_err(|found| {
            self.store
                .refuse(format!("buffer view {view} packed by meshoptimizer"), found)
        })?;
        let bytes = Rc::new(bytes);
        self.unpacked.insert(view, Rc::clone(&bytes));
        Ok(bytes)
    }

    /// Forgets what was unpacked.
    pub(super) fn forget(&mut self) {
        self.unpacked.clear();
    }

    /// Calls `each` with the index and the numbers of every item that differs from zero by being stored: all of an array, or those
    /// of a sparse one.
    pub(super) fn each<const N: usize>(
        &mut self,
        index: usize,
        mut each: impl FnMut(usize, [f64; N]) -> Result<(), SequenceError>,
    ) -> Result<(), SequenceError> {
        let layout = self.layout(index)?;
        if layout.components != N {
            return Err(self.refuse(
                index,
                format!("{} numbers an item where {N} are needed", layout.components),
            ));
        }
        let size = layout.number.size_bytes();
        let item = |raw: &[u8]| -> [f64; N] {
            core::array::from_fn(|c| layout.number.value(&raw[c * size..], layout.normalized))
        };
        if let Some(view) = layout.view {
            let raw = self.items(index, view, layout.offset, layout.count, N * size)?;
            for (i, raw) in raw.chunks_exact(N * size).enumerate() {
                each(i, item(raw))?;
            }
        }
        let accessor = &self.store.document.accessors[index];
        let Some(sparse) = &accessor.sparse else { return Ok(()) };
        let (count, values) = (
            sparse.count as usize,
            (sparse.values.buffer_view, sparse.values.byte_offset),
        );
        let (view, offset, kind) = (
            sparse.indices.buffer_view,
            sparse.indices.byte_offset,
            sparse.indices.component_type,
        );
        let number = Number::of_code(kind).filter(|number| matches!(number, Number::U8 | Number::U16 | Number::U32));
        let Some(number) = number else {
            return Err(self.refuse(index, "sparse indices of a type that is none of indices"));
        };
        let places = self.items(index, view, offset, count, number.size_bytes())?;
        let raw = self.items(index, values.0, values.1, count, N * size)?;
        for (place, raw) in places.chunks_exact(number.size_bytes()).zip(raw.chunks_exact(N * size)) {
            let place = number.value(place, false) as usize;
            if place >= layout.count {
                return Err(self.refuse(index, format!("sparse item {place} of {}", layout.count)));
            }
            each(place, item(raw))?;
        }
        Ok(())
    }

    /// All items of an array.
    pub(super) fn floats<const N: usize>(&mut self, index: usize) -> Result<Vec<[f32; N]>, SequenceError> {
        let count = self.count(index)?;
        self.spend(index, (count as u64).saturating_mul(4 * N as u64))?;
        let mut items = vec![[0.0; N]; count];
        self.each(index, |i, item: [f64; N]| {
            items[i] = item.map(|x| x as f32);
            Ok(())
        })?;
        Ok(items)
    }

    /// All whole numbers of an array of scalars or of small vectors.
    pub(super) fn integers<const N: usize>(&mut self, index: usize) -> Result<Vec<[u32; N]>, SequenceError> {
        let count = self.count(index)?;
        self.spend(index, (count as u64).saturating_mul(4 * N as u64))?;
        if self.layout(index)?.number == Number::F32 {
            return Err(self.refuse(index, "numbers with fractions where indices are needed"));
        }
        let mut items = vec![[0; N]; count];
        self.each(index, |i, item: [f64; N]| {
            items[i] = item.map(|x| x as u32);
            Ok(())
        })?;
        Ok(items)
    }
}
