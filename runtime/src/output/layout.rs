//! Where the attributes of a vertex lie in the caller's bytes, and the proof that they do not get into each other's way.

use core::fmt;

use super::OutputError;

/// What is written for every render vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum AttributeName {
    /// Three f32, units of the source.
    Positions,
    /// Unit vectors.
    Normals,
    /// Unit vectors along the texture's u, and the sign of the bitangent.
    Tangents,
    /// Two f32, as in the source.
    TextureCoordinates,
}

impl fmt::Display for AttributeName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Positions => "positions",
            Self::Normals => "normals",
            Self::Tangents => "tangents",
            Self::TextureCoordinates => "texture coordinates",
        })
    }
}

/// How a unit vector is written. Numbers have the byte order of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UnitEncoding {
    /// f32: three for a normal (12 bytes), four for a tangent (16 bytes).
    #[default]
    Float32,
    /// Four i16, 32767 for 1: a normal's fourth is 0 (8 bytes).
    Snorm16,
    /// Four i8, 127 for 1: a normal's fourth is 0 (4 bytes).
    Snorm8,
    /// Two u16, 65535 for 1: the place on an unfolded octahedron, as Godot has it (4 bytes). A tangent's second number holds the
    /// sign, too: in its upper half plus, in its lower half, turned over, minus.
    Octahedral16,
}

/// Where an attribute lies: element r begins at byte `offset_bytes + r * stride_bytes`. No alignment is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Attribute {
    /// First byte of the first element.
    pub offset_bytes: usize,
    /// Bytes from one element to the next.
    pub stride_bytes: usize,
}

impl Attribute {
    /// Of separate arrays: elements of `size_bytes` without gaps.
    pub fn packed(offset_bytes: usize, size_bytes: usize) -> Self {
        Self {
            offset_bytes,
            stride_bytes: size_bytes,
        }
    }
}

/// Which attributes are written, and where. All lie in one buffer: one after the other or interleaved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VertexLayout {
    /// Positions: 12 bytes each.
    pub positions: Option<Attribute>,
    /// Normals: as the encoding says.
    pub normals: Option<Attribute>,
    /// Tangents: as the encoding says.
    pub tangents: Option<Attribute>,
    /// Texture coordinates: 8 bytes each. They do not move: once is enough.
    pub texture_coordinates: Option<Attribute>,
    /// Of normals and tangents.
    pub encoding: UnitEncoding,
}

impl VertexLayout {
    /// Size of one element, in bytes.
    pub fn size_bytes(&self, attribute: AttributeName) -> usize {
        match (attribute, self.encoding) {
            (AttributeName::Positions, _) => 12,
            (AttributeName::TextureCoordinates, _) => 8,
            (AttributeName::Normals, UnitEncoding::Float32) => 12,
            (AttributeName::Tangents, UnitEncoding::Float32) => 16,
            (_, UnitEncoding::Snorm16) => 8,
            (_, UnitEncoding::Snorm8 | UnitEncoding::Octahedral16) => 4,
        }
    }

    /// The attributes that are written.
    fn wanted(&self) -> [Option<(AttributeName, Attribute)>; 4] {
        use AttributeName::*;
        [
            self.positions.map(|at| (Positions, at)),
            self.normals.map(|at| (Normals, at)),
            self.tangents.map(|at| (Tangents, at)),
            self.texture_coordinates.map(|at| (TextureCoordinates, at)),
        ]
    }

    /// Proves that `count` elements of every attribute lie within `buffer_bytes` and that no two of them share a byte.
    pub(super) fn check(&self, count: usize, buffer_bytes: usize) -> Result<(), OutputError> {
        let wanted = self.wanted();
        for (attribute, at) in wanted.into_iter().flatten() {
            let required_bytes = self.size_bytes(attribute);
            if at.stride_bytes < required_bytes {
                return Err(OutputError::StrideTooShort {
                    attribute,
                    required_bytes,
                    stride_bytes: at.stride_bytes,
                });
            }
            let end = self.end(attribute, at, count);
            if end > buffer_bytes {
                return Err(OutputError::BufferTooShort {
                    attribute,
                    required_bytes: end,
                    actual_bytes: buffer_bytes,
                });
            }
        }
        for (n, (first, one)) in wanted.into_iter().enumerate().filter_map(|(n, at)| Some((n, at?))) {
            for (second, other) in wanted[n + 1..].iter().copied().flatten() {
                if self.overlap((first, one), (second, other), count) {
                    return Err(OutputError::Overlap { first, second });
                }
            }
        }
        Ok(())
    }

    /// Where the last element ends; saturates, and is then beyond every buffer.
    fn end(&self, attribute: AttributeName, at: Attribute, count: usize) -> usize {
        let to_last = at.stride_bytes.saturating_mul(count.saturating_sub(1));
        at.offset_bytes
            .saturating_add(to_last)
            .saturating_add(self.size_bytes(attribute))
    }

    /// Whether two attributes whose ends are known to be in the buffer may share a byte.
    fn overlap(&self, one: (AttributeName, Attribute), other: (AttributeName, Attribute), count: usize) -> bool {
        let (low, high) = if one.1.offset_bytes <= other.1.offset_bytes {
            (one, other)
        } else {
            (other, one)
        };
        if self.end(low.0, low.1, count) <= high.1.offset_bytes {
            return false;
        }
        let stride_bytes = low.1.stride_bytes;
        // Interleaved: where the higher one begins in the lower one's stride, and how much of that is left for it.
        let place = (high.1.offset_bytes - low.1.offset_bytes) % stride_bytes;
        stride_bytes != high.1.stride_bytes
            || place < self.size_bytes(low.0)
            || stride_bytes - place < self.size_bytes(high.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeName::*;

    fn at(offset_bytes: usize, stride_bytes: usize) -> Option<Attribute> {
        Some(Attribute {
            offset_bytes,
            stride_bytes,
        })
    }

    /// Marks the bytes of every element, the slow way: whether none is marked twice and all are in the buffer.
    fn is_sound(layout: &VertexLayout, count: usize, buffer_bytes: usize) -> bool {
        let mut marks = std::vec![false; buffer_bytes];
        layout.wanted().into_iter().flatten().all(|(attribute, at)| {
            (0..count).all(|r| {
                let first = at.offset_bytes + r * at.stride_bytes;
                (first..first + layout.size_bytes(attribute))
                    .all(|byte| byte < buffer_bytes && !core::mem::replace(&mut marks[byte], true))
            })
        })
    }

    #[test]
    fn what_passes_is_sound_and_usual_layouts_pass() {
        const COUNT: usize = 5;
        let (mut passed, mut refused) = (0, 0);
        for encoding in [
            UnitEncoding::Float32,
            UnitEncoding::Snorm16,
            UnitEncoding::Snorm8,
            UnitEncoding::Octahedral16,
        ] {
            for offset in 0..80 {
                for (one, other) in [(12, 12), (24, 24), (28, 28), (32, 32), (24, 32)] {
                    for buffer_bytes in [60, 130, 160, 400] {
                        let layout = VertexLayout {
                            positions: at(7, one),
                            normals: at(offset, other),
                            encoding,
                            ..VertexLayout::default()
                        };
                        let sound = is_sound(&layout, COUNT, buffer_bytes);
                        let checked = layout.check(COUNT, buffer_bytes).is_ok();
                        assert!(sound || !checked, "{layout:?} in {buffer_bytes}");
                        // Only different strides are refused out of caution.
                        assert!(checked || !sound || one != other, "{layout:?} in {buffer_bytes}");
                        passed += u32::from(checked);
                        refused += u32::from(!checked);
                    }
                }
            }
        }
        assert!(passed > 300 && refused > 300, "{passed} {refused}");
        let interleaved = VertexLayout {
            positions: at(0, 48),
            normals: at(12, 48),
            tangents: at(24, 48),
            texture_coordinates: at(40, 48),
            encoding: UnitEncoding::Float32,
        };
        assert!(interleaved.check(COUNT, 48 * COUNT).is_ok());
        let separate = VertexLayout {
            positions: Some(Attribute::packed(0, 12)),
            normals: Some(Attribute::packed(60, 12)),
            tangents: Some(Attribute::packed(120, 16)),
            ..VertexLayout::default()
        };
        assert!(separate.check(COUNT, 200).is_ok());
    }

    #[test]
    fn each_fault_has_its_own_error() {
        let layout = |positions, normals| VertexLayout {
            positions,
            normals,
            ..VertexLayout::default()
        };
        assert_eq!(
            layout(at(0, 11), None).check(3, 100),
            Err(OutputError::StrideTooShort {
                attribute: Positions,
                required_bytes: 12,
                stride_bytes: 11
            })
        );
        assert_eq!(
            layout(at(0, 12), at(40, 12)).check(3, 75),
            Err(OutputError::BufferTooShort {
                attribute: Normals,
                required_bytes: 76,
                actual_bytes: 75
            })
        );
        for offset in [usize::MAX, usize::MAX / 2] {
            let far = layout(at(offset, usize::MAX / 2), None).check(4, 1000);
            assert!(matches!(far, Err(OutputError::BufferTooShort { .. })));
        }
        assert_eq!(
            layout(at(0, 24), at(8, 24)).check(3, 100),
            Err(OutputError::Overlap {
                first: Positions,
                second: Normals
            })
        );
        assert!(
            layout(at(0, 24), at(12, 36)).check(3, 200).is_err(),
            "different strides"
        );
    }
}
