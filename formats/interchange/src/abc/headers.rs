//! Objects, properties and time samplings of an Alembic archive: packed lists of names, types and counts.

use super::ogawa::{Data, Group, Ogawa};
use super::sampling::Sampling;
use crate::error::SequenceError;
use std::rc::Rc;

/// Bytes of the checksum behind object headers.
const OBJECT_HASH_BYTES: usize = 32;
/// Bytes of the checksum before a sample.
pub(super) const SAMPLE_KEY_BYTES: u64 = 16;
/// Samples that may equal one that is stored: whoever holds still for longer counts wrongly.
const HELD_MAX: usize = 1 << 16;
/// Says that metadata stands in place, not in the list.
const INLINE_METADATA: usize = 0xff;

/// What stands in an archive once.
pub(super) struct Archive {
    pub(super) file: Ogawa,
    pub(super) samplings: Vec<Sampling>,
    /// Metadata that headers name by number; number 0 is empty.
    metadata: Vec<Rc<str>>,
}

/// An object: its name, its metadata, where its children and properties lie.
pub(super) struct Object {
    pub(super) name: String,
    pub(super) metadata: Rc<str>,
    pub(super) group: Group,
}

/// The kind of numbers of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pod {
    Bool,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
    String,
    Wide,
}

impl Pod {
    const ALL: [Pod; 14] = [
        Pod::Bool,
        Pod::U8,
        Pod::I8,
        Pod::U16,
        Pod::I16,
        Pod::U32,
        Pod::I32,
        Pod::U64,
        Pod::I64,
        Pod::F16,
        Pod::F32,
        Pod::F64,
        Pod::String,
        Pod::Wide,
    ];
}

/// A property of an object.
#[derive(Debug, Clone)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) metadata: Rc<str>,
    pub(super) group: Group,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    /// Holds properties.
    Compound,
    /// Holds samples.
    Samples(Samples),
}

/// Samples of a property.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Samples {
    pub(super) pod: Pod,
    /// Numbers an item.
    pub(super) extent: usize,
    is_array: bool,
    pub(super) count: usize,
    /// Samples before `first_changed` equal sample 0, those behind `last_changed` equal it.
    first_changed: usize,
    last_changed: usize,
    pub(super) sampling: usize,
}

impl Samples {
    /// Which of the stored samples is sample `n`.
    fn stored(&self, n: usize) -> usize {
        if self.last_changed == 0 || n < self.first_changed {
            0
        } else {
            n.min(self.last_changed) - self.first_changed + 1
        }
    }

    /// Whether the parts of a group cannot be these samples.
    fn exceeds(&self, part_count: usize) -> bool {
        let Some(last) = self.count.checked_sub(1) else {
            return false;
        };
        let stored = self.stored(last);
        let needed = if self.is_array { 2 * stored } else { stored };
        needed >= part_count || last - stored > HELD_MAX
    }

    /// Whether samples differ.
    pub(super) fn varies(&self) -> bool {
        self.count > 1 && self.last_changed > 0
    }
}

/// Reads numbers off a packed list.
struct Packed<'a> {
    archive: &'a Ogawa,
    bytes: &'a [u8],
    /// Where the list lies in the file.
    start: u64,
    at: usize,
}

impl Packed<'_> {
    fn take(&mut self, count: usize) -> Result<&[u8], SequenceError> {
        match self.bytes.get(self.at..).and_then(|rest| rest.get(..count)) {
            Some(taken) => {
                self.at += count;
                Ok(taken)
            }
            None => Err(self.refuse(&format!("{count} more bytes of a list of headers"), "its end")),
        }
    }

    fn refuse(&self, expected: &str, found: &str) -> SequenceError {
        self.archive.refuse(self.start + self.at as u64, expected, found)
    }

    fn number(&mut self, size_bytes: usize) -> Result<usize, SequenceError> {
        let mut raw = [0; 8];
        raw[..size_bytes].copy_from_slice(self.take(size_bytes)?);
        Ok(u64::from_le_bytes(raw) as usize)
    }

    fn float(&mut self) -> Result<f64, SequenceError> {
        Ok(f64::from_bits(self.number(8)? as u64))
    }

    fn text(&mut self, length: usize) -> Result<String, SequenceError> {
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    fn is_done(&self) -> bool {
        self.at >= self.bytes.len()
    }
}

impl Archive {
    /// Reads what stands in the root group; gives the top object.
    pub(super) fn open(mut file: Ogawa, root: &Group) -> Result<(Archive, Object), SequenceError> {
        // Versions of container and library, top object, metadata of the archive, samplings, list of metadata.
        let top = file.group(root, 2)?;
        let samplings = file.data(root, 4)?;
        let listed = file.data(root, 5)?;
        let mut archive = Archive {
            samplings: read_samplings(&mut file, samplings)?,
            metadata: read_metadata(&mut file, listed)?,
            file,
        };
        if archive.samplings.is_empty() {
            archive.samplings.push(Sampling {
                cycle: 1.0,
                times: vec![0.0],
            });
        }
        let top = Object {
            name: String::new(),
            metadata: "".into(),
            group: top,
        };
        Ok((archive, top))
    }

    fn metadata(&self, packed: &mut Packed<'_>, index: usize, size_bytes: usize) -> Result<Rc<str>, SequenceError> {
        if index == INLINE_METADATA {
            let length = packed.number(size_bytes)?;
            return packed.text(length).map(Rc::from);
        }
        let known = self.metadata.get(index).cloned();
        known.ok_or_else(|| packed.refuse("the number of known metadata", &index.to_string()))
    }

    /// Children of an object.
    pub(super) fn children(&mut self, object: &Object) -> Result<Vec<Object>, SequenceError> {
        // Properties, a group each child, headers of the children.
        if object.group.len() < 2 {
            return Ok(Vec::new());
        }
        let headers = self.file.data(&object.group, object.group.len() - 1)?;
        let mut bytes = self.file.read(headers)?;
        bytes.truncate(bytes.len().saturating_sub(OBJECT_HASH_BYTES));
        let mut found = Vec::new();
        let mut packed = Packed {
            archive: &self.file,
            bytes: &bytes,
            start: headers.at,
            at: 0,
        };
        while !packed.is_done() {
            let length = packed.number(4)?;
            let name = packed.text(length)?;
            let index = packed.number(1)?;
            let metadata = self.metadata(&mut packed, index, 4)?;
            found.push((name, metadata));
        }
        let mut children = Vec::with_capacity(found.len());
        for (i, (name, metadata)) in found.into_iter().enumerate() {
            let group = self.file.group(&object.group, i + 1)?;
            children.push(Object { name, metadata, group });
        }
        Ok(children)
    }

    /// Properties of an object.
    pub(super) fn properties(&mut self, object: &Object) -> Result<Vec<Property>, SequenceError> {
        if object.group.len() == 0 {
            return Ok(Vec::new());
        }
        let group = self.file.group(&object.group, 0)?;
        self.properties_in(&group)
    }

    /// Properties of a compound property.
    pub(super) fn inside(&mut self, compound: &Property) -> Result<Vec<Property>, SequenceError> {
        match compound.kind {
            Kind::Compound => self.properties_in(&compound.group),
            Kind::Samples(_) => Ok(Vec::new()),
        }
    }

    fn properties_in(&mut self, group: &Group) -> Result<Vec<Property>, SequenceError> {
        if group.len() == 0 {
            return Ok(Vec::new());
        }
        let headers = self.file.data(group, group.len() - 1)?;
        let bytes = self.file.read(headers)?;
        let mut found = Vec::new();
        let mut packed = Packed {
            archive: &self.file,
            bytes: &bytes,
            start: headers.at,
            at: 0,
        };
        while !packed.is_done() {
            found.push(self.property(&mut packed)?);
        }
        let mut properties = Vec::with_capacity(found.len());
        for (i, (name, metadata, kind)) in found.into_iter().enumerate() {
            let group = self.file.group(group, i)?;
            if let Kind::Samples(samples) = &kind
                && samples.exceeds(group.len())
            {
                let expected = format!("as many samples of `{name}` as are counted, {}", samples.count);
                return Err(self
                    .file
                    .refuse(headers.at, &expected, &format!("{} parts", group.len())));
            }
            properties.push(Property {
                name,
                metadata,
                group,
                kind,
            });
        }
        Ok(properties)
    }

    /// One property's header. Bits of its first number: 0-1 kind, 2-3 bytes of the numbers that follow, 4-7 type, 8 has a time
    /// sampling, 9 has its first and last changed sample, 11 is constant, 12-19 extent, 20-27 metadata.
    fn property(&self, packed: &mut Packed<'_>) -> Result<(String, Rc<str>, Kind), SequenceError> {
        let bits = packed.number(4)?;
        let size_bytes = match bits >> 2 & 3 {
            0 => 1,
            1 => 2,
            2 => 4,
            _ => return Err(packed.refuse("the size of a property's numbers", "3")),
        };
        let mut kind = Kind::Compound;
        if bits & 3 != 0 {
            let code = bits >> 4 & 15;
            let Some(&pod) = Pod::ALL.get(code) else {
                return Err(packed.refuse("the type of a property", &code.to_string()));
            };
            let count = packed.number(size_bytes)?;
            let (first_changed, last_changed) = if bits & 0x200 != 0 {
                (packed.number(size_bytes)?, packed.number(size_bytes)?)
            } else if bits & 0x800 != 0 {
                (0, 0)
            } else {
                (1, count.saturating_sub(1))
            };
            let sampling = if bits & 0x100 != 0 {
                packed.number(size_bytes)?
            } else {
                0
            };
            if last_changed > 0 && !(1..=last_changed).contains(&first_changed) {
                return Err(packed.refuse("the first changed sample before the last", &format!("{first_changed}")));
            }
            let known = self.samplings.get(sampling);
            if !known.is_some_and(|known| count <= 1 || known.reaches(count) && known.ascends()) {
                let expected = format!("ascending times for {count} samples");
                return Err(packed.refuse(&expected, "a time sampling without them"));
            }
            kind = Kind::Samples(Samples {
                pod,
                extent: (bits >> 12 & 0xff).max(1),
                is_array: bits & 3 != 1,
                count,
                first_changed,
                last_changed,
                sampling,
            });
        }
        let length = packed.number(size_bytes)?;
        let name = packed.text(length)?;
        let metadata = self.metadata(packed, bits >> 20 & 0xff, size_bytes)?;
        Ok((name, metadata, kind))
    }

    /// Where sample `n` of a property lies, its key before it.
    fn sample(&mut self, property: &Property, n: usize) -> Result<(Samples, Data), SequenceError> {
        let Kind::Samples(samples) = &property.kind else {
            return Err(self
                .file
                .refuse(0, &format!("samples of `{}`", property.name), "properties"));
        };
        if samples.count == 0 {
            return Err(self.file.refuse(0, &format!("a sample of `{}`", property.name), "none"));
        }
        let stored = samples.stored(n.min(samples.count - 1));
        // Arrays have their dimensions behind each sample.
        let child = if samples.is_array { 2 * stored } else { stored };
        Ok((samples.clone(), self.file.data(&property.group, child)?))
    }

    /// The key of sample `n`: equal where samples are equal.
    pub(super) fn key(&mut self, property: &Property, n: usize) -> Result<[u8; 16], SequenceError> {
        let (_, data) = self.sample(property, n)?;
        if data.length < SAMPLE_KEY_BYTES {
            return Ok([0; 16]);
        }
        self.file.bytes.array_at(data.at)
    }

    /// How many numbers sample `n` has, without reading them.
    pub(super) fn number_count(&mut self, property: &Property, n: usize) -> Result<usize, SequenceError> {
        let (samples, data) = self.sample(property, n)?;
        Ok((data.length.saturating_sub(SAMPLE_KEY_BYTES) / samples.pod.size_bytes() as u64) as usize)
    }

    /// The bytes of sample `n`.
    pub(super) fn raw(&mut self, property: &Property, n: usize) -> Result<(Pod, Vec<u8>), SequenceError> {
        let (samples, data) = self.sample(property, n)?;
        let key_bytes = SAMPLE_KEY_BYTES.min(data.length);
        let raw = self.file.bytes.vec_at(data.at + key_bytes, data.length - key_bytes)?;
        Ok((samples.pod, raw))
    }
}

impl Pod {
    pub(super) fn size_bytes(self) -> usize {
        match self {
            Pod::Bool | Pod::U8 | Pod::I8 | Pod::String => 1,
            Pod::U16 | Pod::I16 | Pod::F16 => 2,
            Pod::U32 | Pod::I32 | Pod::F32 | Pod::Wide => 4,
            Pod::U64 | Pod::I64 | Pod::F64 => 8,
        }
    }

    /// Floating-point numbers; none of other types.
    pub(super) fn floats(self, raw: &[u8]) -> Option<Vec<f64>> {
        Some(match self {
            Pod::F32 => raw
                .as_chunks()
                .0
                .iter()
                .map(|&raw| f64::from(f32::from_le_bytes(raw)))
                .collect(),
            Pod::F64 => raw.as_chunks().0.iter().map(|&raw| f64::from_le_bytes(raw)).collect(),
            Pod::F16 => raw
                .as_chunks()
                .0
                .iter()
                .map(|&raw| half::f16::from_le_bytes(raw).to_f64())
                .collect(),
            _ => return None,
        })
    }

    /// Whole numbers of 32 bits at most; none of other types.
    pub(super) fn integers(self, raw: &[u8]) -> Option<Vec<i64>> {
        Some(match self {
            Pod::Bool | Pod::U8 => raw.iter().map(|&byte| i64::from(byte)).collect(),
            Pod::I8 => raw.iter().map(|&byte| i64::from(byte as i8)).collect(),
            Pod::U16 => raw
                .as_chunks()
                .0
                .iter()
                .map(|&raw| i64::from(u16::from_le_bytes(raw)))
                .collect(),
            Pod::I16 => raw
                .as_chunks()
                .0
                .iter()
                .map(|&raw| i64::from(i16::from_le_bytes(raw)))
                .collect(),
            Pod::U32 => raw
                .as_chunks()
                .0
                .iter()
                .map(|&raw| i64::from(u32::from_le_bytes(raw)))
                .collect(),
            Pod::I32 => raw
                .as_chunks()
                .0
                .iter()
                .map(|&raw| i64::from(i32::from_le_bytes(raw)))
                .collect(),
            _ => return None,
        })
    }
}

/// The value of a key in metadata `key=value;key=value`.
pub(super) fn value_of<'a>(metadata: &'a str, key: &str) -> Option<&'a str> {
    metadata
        .split(';')
        .find_map(|pair| pair.split_once('=').filter(|(found, _)| *found == key))
        .map(|(_, value)| value)
}

fn read_samplings(file: &mut Ogawa, data: Data) -> Result<Vec<Sampling>, SequenceError> {
    let bytes = file.read(data)?;
    let mut packed = Packed {
        archive: file,
        bytes: &bytes,
        start: data.at,
        at: 0,
    };
    let mut samplings = Vec::new();
    while !packed.is_done() {
        // The largest number of samples, which the properties say too.
        packed.number(4)?;
        let cycle = packed.float()?;
        let count = packed.number(4)?;
        if count == 0 || count > bytes.len() / 8 || cycle.is_nan() {
            return Err(packed.refuse("a time sampling", &format!("{count} times, {cycle} seconds a cycle")));
        }
        let times = (0..count).map(|_| packed.float()).collect::<Result<_, _>>()?;
        samplings.push(Sampling { cycle, times });
    }
    Ok(samplings)
}

fn read_metadata(file: &mut Ogawa, data: Data) -> Result<Vec<Rc<str>>, SequenceError> {
    let bytes = file.read(data)?;
    let mut packed = Packed {
        archive: file,
        bytes: &bytes,
        start: data.at,
        at: 0,
    };
    let mut metadata: Vec<Rc<str>> = vec!["".into()];
    while !packed.is_done() {
        let length = packed.number(1)?;
        metadata.push(packed.text(length)?.into());
    }
    Ok(metadata)
}
