//! Why bytes are no take, or a take cannot be written.

use core::fmt;

/// Why a take was not opened or begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TakeError {
    /// The bytes do not begin like a take.
    NotATake,
    /// Written by a version that this one cannot read.
    UnsupportedVersion {
        /// Version that wrote it.
        version: u16,
        /// Oldest version that can read it.
        oldest_reader: u16,
    },
    /// The bytes end inside the header; there is nothing to recover.
    HeaderCut {
        /// Bytes that the header needs.
        required_bytes: usize,
        /// Bytes there are.
        actual_bytes: usize,
    },
    /// The header's checksum is wrong.
    HeaderCorrupt,
    /// The header says something that no writer writes.
    HeaderMalformed {
        /// Where, bytes from the start of the file.
        at: usize,
    },
    /// The writer's buffer is too small.
    BufferTooSmall {
        /// Bytes needed.
        required_bytes: usize,
        /// Bytes given.
        actual_bytes: usize,
    },
    /// A name is longer than 65,535 bytes.
    NameTooLong,
}

impl core::error::Error for TakeError {}

impl fmt::Display for TakeError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotATake => write!(out, "this is not a take"),
            Self::UnsupportedVersion { version, oldest_reader } => write!(
                out,
                "the take has format version {version}, readable from version {oldest_reader} on; this is version 1"
            ),
            Self::HeaderCut {
                required_bytes,
                actual_bytes,
            } => write!(
                out,
                "the take ends inside its header ({actual_bytes} of {required_bytes} bytes); nothing was recorded yet"
            ),
            Self::HeaderCorrupt => write!(out, "the take's header is damaged"),
            Self::HeaderMalformed { at } => write!(out, "the take's header makes no sense at byte {at}"),
            Self::BufferTooSmall {
                required_bytes,
                actual_bytes,
            } => write!(
                out,
                "a take needs a buffer of {required_bytes} bytes and got {actual_bytes}"
            ),
            Self::NameTooLong => write!(out, "a name is longer than 65535 bytes"),
        }
    }
}
