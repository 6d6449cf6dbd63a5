//! The header of a PLY file: encoding, and elements with their properties.

use crate::error::{Place, SequenceError};
use crate::text::{Lines, ends_early, tokens, unexpected};
use std::path::Path;

/// How the body is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryLittleEndian,
    BinaryBigEndian,
}

/// A number's type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn of_name(name: &[u8]) -> Option<Scalar> {
        Some(match name {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub(super) fn size_bytes(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// What stands for full colour in numbers of this type.
    pub(super) fn color_scale(self) -> f32 {
        match self {
            Scalar::I8 | Scalar::U8 => 255.0,
            Scalar::I16 | Scalar::U16 => 65535.0,
            Scalar::I32 | Scalar::U32 => u32::MAX as f32,
            Scalar::F32 | Scalar::F64 => 1.0,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Scalar::F32 | Scalar::F64)
    }
}

/// What one property holds in each item of its element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PropertyKind {
    Single(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property<'a> {
    pub(super) name: &'a [u8],
    pub(super) kind: PropertyKind,
}

#[derive(Debug)]
pub(super) struct Element<'a> {
    pub(super) name: &'a [u8],
    /// As the header claims it.
    pub(super) count: usize,
    pub(super) properties: Vec<Property<'a>>,
    /// Line of the header that declares it.
    pub(super) line: usize,
}

impl Element<'_> {
    /// The fewest bytes that one item of this element takes in the body.
    pub(super) fn item_bytes_min(&self, encoding: Encoding) -> usize {
        let of = |property: &Property<'_>| match (encoding, property.kind) {
            // A digit and a separator.
            (Encoding::Ascii, _) => 2,
            (_, PropertyKind::Single(scalar)) => scalar.size_bytes(),
            (_, PropertyKind::List { count, .. }) => count.size_bytes(),
        };
        self.properties.iter().map(of).sum()
    }
}

#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element<'a>>,
    /// Everything behind the header.
    pub(super) body: &'a [u8],
    /// Line on which an ascii body begins.
    pub(super) body_line: usize,
}

/// Reads the header. Lines with unknown keywords before the first element are passed over (some exporters write their
/// name there); behind it they are refused, for a misread property would shift every number that follows.
pub(super) fn parse<'a>(bytes: &'a [u8], path: &Path) -> Result<Header<'a>, SequenceError> {
    let mut lines = Lines::new(bytes);
    let mut encoding = None;
    let mut elements: Vec<Element<'a>> = Vec::new();
    let mut first = true;
    loop {
        let number = lines.next_number();
        let Some((_, line)) = lines.next(|_| false) else {
            return Err(ends_early(path, Place::Line(number), "the PLY header up to end_header"));
        };
        let place = Place::Line(number);
        let mut words = tokens(line);
        let keyword = words.next();
        if core::mem::take(&mut first) {
            if keyword != Some(b"ply") {
                return Err(unexpected(path, place, "the keyword ply", Some(line)));
            }
            continue;
        }
        match keyword {
            Some(b"format") => {
                encoding = Some(match words.next() {
                    Some(b"ascii") => Encoding::Ascii,
                    Some(b"binary_little_endian") => Encoding::BinaryLittleEndian,
                    Some(b"binary_big_endian") => Encoding::BinaryBigEndian,
                    other => {
                        let expected = "ascii, binary_little_endian or binary_big_endian";
                        return Err(unexpected(path, place, expected, other));
                    }
                });
            }
            Some(b"element") => {
                let (name, count) = (words.next(), words.next());
                let value = count
                    .and_then(|word| core::str::from_utf8(word).ok())
                    .and_then(|word| word.parse().ok());
                let (Some(name), Some(count)) = (name, value) else {
                    return Err(unexpected(path, place, "element, its name and its count", Some(line)));
                };
                elements.push(Element {
                    name,
                    count,
                    properties: Vec::new(),
                    line: number,
                });
            }
            Some(b"property") => {
                let (property, element) = (property(words), elements.last_mut());
                let (Some(property), Some(element)) = (property, element) else {
                    return Err(unexpected(
                        path,
                        place,
                        "a property of an element: its type and name",
                        Some(line),
                    ));
                };
                element.properties.push(property);
            }
            Some(b"end_header") => break,
            None | Some(b"comment" | b"obj_info") => {}
            Some(_) if elements.is_empty() => {}
            Some(_) => {
                return Err(unexpected(
                    path,
                    place,
                    "element, property, comment or end_header",
                    Some(line),
                ));
            }
        }
    }
    let Some(encoding) = encoding else {
        return Err(unexpected(
            path,
            Place::Line(lines.next_number()),
            "a format line in the header",
            None,
        ));
    };
    Ok(Header {
        encoding,
        elements,
        body: lines.rest(),
        body_line: lines.next_number(),
    })
}

/// `float x` or `list uchar int vertex_indices`.
fn property<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Option<Property<'a>> {
    let first = words.next()?;
    let kind = if first == b"list" {
        let count = Scalar::of_name(words.next()?).filter(|count| count.is_integer())?;
        PropertyKind::List {
            count,
            item: Scalar::of_name(words.next()?)?,
        }
    } else {
        PropertyKind::Single(Scalar::of_name(first)?)
    };
    Some(Property {
        name: words.next()?,
        kind,
    })
}
