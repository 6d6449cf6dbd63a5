//! The 64 bytes in front of every package, read by hand: what the file is, which version wrote it, how long it is and
//! whether a bit of it changed. First step of opening, last step of writing; `FORMAT.md` has the byte table.

use super::OpenError;

/// First bytes of a package. A non-ASCII byte, both line ends and an end-of-file mark reveal a transfer in text mode.
pub const MAGIC: [u8; 8] = [0x89, b'S', b'N', b'W', b'\r', b'\n', 0x1a, b'\n'];
/// Version this crate writes, and the newest it reads.
pub const FORMAT_VERSION: u16 = 3;
/// Oldest version this crate reads. Earlier ones were never released.
pub const FIRST_VERSION: u16 = 3;
/// Size of the header.
pub const HEADER_BYTES: usize = 64;
/// Required alignment of a package in memory; the payload keeps it because the header is a multiple of it.
pub const PAYLOAD_ALIGNMENT: usize = 16;

/// CRC-32C (Castagnoli).
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);
/// The header's own checksum covers everything before it.
const HEADER_CRC_AT: usize = 60;
/// Bytes that this version leaves at zero, so that a later one can use them.
const RESERVED: [core::ops::Range<usize>; 3] = [13..24, 32..40, 56..60];

/// What a package holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PackageKind {
    /// What the trainer learned: [`super::CompactBasis`].
    Compact,
    /// Ready for the frame path: [`super::BakedBasis`].
    Baked,
}

impl PackageKind {
    /// Peeks at a package: reads its header, and no more.
    ///
    /// Errors: those of [`Header::read`].
    pub fn of(bytes: &[u8]) -> Result<Self, OpenError> {
        Header::read(bytes).map(|header| header.kind)
    }

    const fn code(self) -> u8 {
        match self {
            Self::Compact => 1,
            Self::Baked => 2,
        }
    }
}

impl core::fmt::Display for PackageKind {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        out.write_str(match self {
            Self::Compact => "compact",
            Self::Baked => "baked",
        })
    }
}

/// The header, decoded and checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Version that wrote the package.
    pub format_version: u16,
    /// Oldest version whose reader understands the package.
    pub oldest_reader: u16,
    /// What the payload holds.
    pub kind: PackageKind,
    /// Size of the payload, which ends the file.
    pub payload_bytes: u64,
    /// XXH3-128 of the payload, little endian: names the package's content.
    pub content_id: [u8; 16],
}

impl Header {
    /// Reads and checks the header; does not look at the payload.
    ///
    /// Errors: `WrongMagic`, `TooShort`, `HeaderCorrupt`, `UnsupportedVersion`, `ReservedNotZero`, `UnknownKind`. The
    /// checksum comes before the version: the layout of the header is the same in all versions.
    pub fn read(bytes: &[u8]) -> Result<Self, OpenError> {
        if bytes.first_chunk().is_some_and(|magic| *magic != MAGIC) {
            return Err(OpenError::WrongMagic);
        }
        let Some(header) = bytes.first_chunk::<HEADER_BYTES>() else {
            return Err(OpenError::TooShort { actual: bytes.len() });
        };
        if u32::from_le_bytes(field(header, HEADER_CRC_AT)) != CRC.checksum(&header[..HEADER_CRC_AT]) {
            return Err(OpenError::HeaderCorrupt);
        }
        let format_version = u16::from_le_bytes(field(header, 8));
        let oldest_reader = u16::from_le_bytes(field(header, 10));
        if format_version < FIRST_VERSION || oldest_reader > FORMAT_VERSION || oldest_reader > format_version {
            return Err(OpenError::UnsupportedVersion {
                found: format_version,
                first: FIRST_VERSION,
                latest: FORMAT_VERSION,
            });
        }
        if RESERVED
            .iter()
            .any(|range| header[range.clone()].iter().any(|&byte| byte != 0))
        {
            return Err(OpenError::ReservedNotZero);
        }
        let kind = match header[12] {
            1 => PackageKind::Compact,
            2 => PackageKind::Baked,
            found => return Err(OpenError::UnknownKind { found }),
        };
        Ok(Self {
            format_version,
            oldest_reader,
            kind,
            payload_bytes: u64::from_le_bytes(field(header, 24)),
            content_id: field(header, 40),
        })
    }

    /// The header that belongs in front of `payload`.
    pub fn for_payload(kind: PackageKind, payload: &[u8]) -> Self {
        Self {
            format_version: FORMAT_VERSION,
            oldest_reader: FORMAT_VERSION,
            kind,
            payload_bytes: payload.len() as u64,
            content_id: content_id(payload),
        }
    }

    /// The header as it stands in the file, with its checksum.
    pub fn to_bytes(&self) -> [u8; HEADER_BYTES] {
        let mut header = [0; HEADER_BYTES];
        header[..8].copy_from_slice(&MAGIC);
        header[8..10].copy_from_slice(&self.format_version.to_le_bytes());
        header[10..12].copy_from_slice(&self.oldest_reader.to_le_bytes());
        header[12] = self.kind.code();
        header[24..32].copy_from_slice(&self.payload_bytes.to_le_bytes());
        header[40..56].copy_from_slice(&self.content_id);
        let crc = CRC.checksum(&header[..HEADER_CRC_AT]);
        header[HEADER_CRC_AT..].copy_from_slice(&crc.to_le_bytes());
        header
    }

    /// The payload behind this header, once its length, place in memory and content id are proved.
    ///
    /// Errors: `Truncated`, `TrailingBytes`, `Misaligned`, `ContentIdMismatch`.
    pub(super) fn payload<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], OpenError> {
        let actual = bytes.len() as u64;
        let expected = self.payload_bytes.saturating_add(HEADER_BYTES as u64);
        if actual < expected {
            return Err(OpenError::Truncated { expected, actual });
        }
        if actual > expected {
            return Err(OpenError::TrailingBytes { expected, actual });
        }
        if bytes.as_ptr().align_offset(PAYLOAD_ALIGNMENT) != 0 {
            return Err(OpenError::Misaligned {
                required: PAYLOAD_ALIGNMENT,
            });
        }
        let payload = &bytes[HEADER_BYTES..];
        // Damage shows here; and a workspace trusts the id to tell packages apart, so a wrong one must not get in.
        if content_id(payload) != self.content_id {
            return Err(OpenError::ContentIdMismatch);
        }
        Ok(payload)
    }
}

fn content_id(payload: &[u8]) -> [u8; 16] {
    xxhash_rust::xxh3::xxh3_128(payload).to_le_bytes()
}

/// `N` bytes of the header from `start`; every caller names a place inside it.
fn field<const N: usize>(header: &[u8; HEADER_BYTES], start: usize) -> [u8; N] {
    core::array::from_fn(|i| header[start + i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seal(mut header: [u8; HEADER_BYTES]) -> [u8; HEADER_BYTES] {
        let crc = CRC.checksum(&header[..HEADER_CRC_AT]);
        header[HEADER_CRC_AT..].copy_from_slice(&crc.to_le_bytes());
        header
    }

    #[test]
    fn what_is_written_is_read() {
        for kind in [PackageKind::Compact, PackageKind::Baked] {
            let header = Header::for_payload(kind, b"payload");
            assert_eq!(Header::read(&header.to_bytes()), Ok(header));
            assert_eq!(PackageKind::of(&header.to_bytes()), Ok(kind));
        }
    }

    #[test]
    fn crc_is_castagnoli() {
        // The check value of CRC-32C's definition.
        assert_eq!(CRC.checksum(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn each_header_fault_has_its_own_error() {
        let good = Header::for_payload(PackageKind::Baked, b"").to_bytes();
        let with = |at: usize, value: u8| {
            let mut header = good;
            header[at] = value;
            header
        };
        let version = |found| OpenError::UnsupportedVersion {
            found,
            first: FIRST_VERSION,
            latest: FORMAT_VERSION,
        };
        assert_eq!(Header::read(&[]), Err(OpenError::TooShort { actual: 0 }));
        assert_eq!(Header::read(&good[..63]), Err(OpenError::TooShort { actual: 63 }));
        assert_eq!(Header::read(b"v 1.0 2.0 3.0"), Err(OpenError::WrongMagic));
        assert_eq!(Header::read(&with(20, 1)), Err(OpenError::HeaderCorrupt));
        for old in 0..FIRST_VERSION {
            assert_eq!(Header::read(&seal(with(8, old as u8))), Err(version(old)));
        }
        let next = FORMAT_VERSION + 1;
        let mut newer = good;
        newer[8..12].copy_from_slice(&[next as u8, 0, next as u8, 0]);
        assert_eq!(Header::read(&seal(newer)), Err(version(next)));
        assert_eq!(
            Header::read(&seal(with(12, 7))),
            Err(OpenError::UnknownKind { found: 7 })
        );
        for reserved in [13, 23, 32, 39, 56, 59] {
            assert_eq!(Header::read(&seal(with(reserved, 1))), Err(OpenError::ReservedNotZero));
        }
    }

    #[test]
    fn a_newer_package_that_names_this_reader_is_read() {
        let mut header = Header::for_payload(PackageKind::Compact, b"").to_bytes();
        let next = FORMAT_VERSION + 1;
        header[8] = next as u8;
        assert_eq!(
            Header::read(&seal(header)).map(|header| header.format_version),
            Ok(next)
        );
    }
}
