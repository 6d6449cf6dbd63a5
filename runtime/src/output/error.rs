//! Why output was refused. Plain values without heap; nothing has been written when one comes back.

use core::fmt;

use super::AttributeName;
use crate::error::FrameError;

/// Why vertices were not written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OutputError {
    /// Positions or normals have not one element a vertex.
    Input(FrameError),
    /// The scratch for tangents has too few elements.
    ScratchTooShort {
        /// One a render vertex.
        expected: usize,
        /// Elements it has.
        actual: usize,
    },
    /// Normals are to be written, or tangents, which need them, and none were given.
    NormalsMissing {
        /// What needs them.
        attribute: AttributeName,
    },
    /// The package has no texture coordinates, and so no tangents.
    NoTexture {
        /// What was asked for.
        attribute: AttributeName,
    },
    /// An attribute's stride is less than its size.
    StrideTooShort {
        /// Which one.
        attribute: AttributeName,
        /// Bytes of one element.
        required_bytes: usize,
        /// Bytes from one to the next.
        stride_bytes: usize,
    },
    /// An attribute runs out of the buffer.
    BufferTooShort {
        /// Which one.
        attribute: AttributeName,
        /// Where its last element ends, in bytes.
        required_bytes: usize,
        /// Bytes of the buffer.
        actual_bytes: usize,
    },
    /// Two attributes would write into each other, or interleave with different strides.
    Overlap {
        /// The one.
        first: AttributeName,
        /// The other.
        second: AttributeName,
    },
}

impl core::error::Error for OutputError {}

impl fmt::Display for OutputError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Input(error) => error.fmt(out),
            Self::ScratchTooShort { expected, actual } => {
                write!(
                    out,
                    "the scratch for tangents has {actual} elements, and {expected} are needed"
                )
            }
            Self::NormalsMissing { attribute } => write!(out, "{attribute} need normals, and none were given"),
            Self::NoTexture { attribute } => write!(out, "the package has no texture coordinates, so no {attribute}"),
            Self::StrideTooShort {
                attribute,
                required_bytes,
                stride_bytes,
            } => {
                write!(
                    out,
                    "{attribute} have {required_bytes} bytes, and their stride is {stride_bytes}"
                )
            }
            Self::BufferTooShort {
                attribute,
                required_bytes,
                actual_bytes,
            } => {
                write!(
                    out,
                    "{attribute} end at byte {required_bytes}, and the buffer has {actual_bytes}"
                )
            }
            Self::Overlap { first, second } => write!(
                out,
                "{first} and {second} overlap, or interleave with different strides; move one of them"
            ),
        }
    }
}
