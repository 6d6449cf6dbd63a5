//! Writes packages: the archive, then the header in front of it; the same record gives the same bytes, always. What was
//! written is opened before it is handed out, so no package leaves that opening would refuse.

use core::{fmt, ops::Deref};

use rkyv::{api::high::to_bytes_in, rancor::Failure, util::AlignedVec};

use super::{BakedBasis, BakedView, CompactBasis, CompactView, HEADER_BYTES, Header, OpenError, PackageKind};

/// More than [`super::PAYLOAD_ALIGNMENT`] asks for: the factor's tiles then lie on cache lines.
const CACHE_LINE_BYTES: usize = 64;
const _: () = assert!(CACHE_LINE_BYTES.is_multiple_of(super::PAYLOAD_ALIGNMENT));

/// A package, or any bytes, at a multiple of 64 bytes in memory, where every package may lie.
#[derive(Clone)]
pub struct AlignedBytes(AlignedVec<CACHE_LINE_BYTES>);

impl AlignedBytes {
    /// Copies `bytes` to a place where a package may lie.
    pub fn from_slice(bytes: &[u8]) -> Self {
        let mut aligned = AlignedVec::with_capacity(bytes.len());
        aligned.extend_from_slice(bytes);
        Self(aligned)
    }

    /// `byte_count` zeros, to be filled.
    pub fn zeroed(byte_count: usize) -> Self {
        let mut aligned = AlignedVec::new();
        aligned.resize(byte_count, 0);
        Self(aligned)
    }

    /// The bytes, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        self.0.as_mut_slice()
    }
}

impl Deref for AlignedBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.0.as_slice()
    }
}

impl PartialEq for AlignedBytes {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl fmt::Debug for AlignedBytes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "AlignedBytes({} bytes)", self.len())
    }
}

/// Why a record does not become a package.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum WriteError {
    /// The archive would be larger than its 32-bit pointers reach ([`super::limits::PAYLOAD_BYTES`]).
    TooLarge,
    /// The record breaks a rule.
    Refused(OpenError),
}

impl core::error::Error for WriteError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::TooLarge => None,
            Self::Refused(error) => Some(error),
        }
    }
}

impl fmt::Display for WriteError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLarge => write!(out, "the package would exceed {} bytes", super::limits::PAYLOAD_BYTES),
            Self::Refused(_) => write!(out, "the package breaks a rule of its format"),
        }
    }
}

/// A whole compact package.
///
/// Errors: [`WriteError::Refused`] names the rule that `basis` breaks.
pub fn write_compact(basis: &CompactBasis<'_>) -> Result<AlignedBytes, WriteError> {
    let archive = to_bytes_in::<_, Failure>(basis, room_for_header()).map_err(|_| WriteError::TooLarge)?;
    let bytes = seal(archive, PackageKind::Compact);
    CompactView::open(&bytes).map_err(WriteError::Refused)?;
    Ok(bytes)
}

/// A whole baked package.
///
/// Errors: [`WriteError::Refused`] names the rule that `basis` breaks.
pub fn write_baked(basis: &BakedBasis<'_>) -> Result<AlignedBytes, WriteError> {
    let archive = to_bytes_in::<_, Failure>(basis, room_for_header()).map_err(|_| WriteError::TooLarge)?;
    let bytes = seal(archive, PackageKind::Baked);
    BakedView::open(&bytes).map_err(WriteError::Refused)?;
    Ok(bytes)
}

/// The archive's pointers are relative, so it may be written where it will stand.
fn room_for_header() -> AlignedVec<CACHE_LINE_BYTES> {
    AlignedBytes::zeroed(HEADER_BYTES).0
}

fn seal(mut package: AlignedVec<CACHE_LINE_BYTES>, kind: PackageKind) -> AlignedBytes {
    let (header, payload) = package.as_mut_slice().split_at_mut(HEADER_BYTES);
    header.copy_from_slice(&Header::for_payload(kind, payload).to_bytes());
    AlignedBytes(package)
}
