//! Bytes of a take: numbers, options, texts, and the frame of a chunk. The reader trusts no length.

/// Starts every chunk; the fourth byte says which kind.
pub(super) const MAGIC: [u8; 3] = *b"SNT";
pub(super) const HEADER_CHUNK: u8 = b'H';
pub(super) const EVENTS_CHUNK: u8 = b'E';
/// Magic, kind, payload_bytes, sequence, crc.
pub(super) const CHUNK_HEAD_BYTES: usize = 16;
/// Castagnoli's polynomial, as in packages.
pub(super) const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);

/// Head of a chunk without its checksum.
pub(super) fn chunk_head(kind: u8, payload_bytes: u32, sequence: u32) -> [u8; 12] {
    let mut head = [0; 12];
    head[..3].copy_from_slice(&MAGIC);
    head[3] = kind;
    head[4..8].copy_from_slice(&payload_bytes.to_le_bytes());
    head[8..].copy_from_slice(&sequence.to_le_bytes());
    head
}

/// Takes numbers off the front of bytes; `None` once they end or make no sense.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(taken)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*taken)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.array().map(|[byte]| byte)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Option<f32> {
        self.array().map(f32::from_le_bytes)
    }

    pub(super) fn flag(&mut self) -> Option<bool> {
        match self.u8()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    /// A flag, then the value if it is set.
    pub(super) fn option<T>(&mut self, value: impl FnOnce(&mut Self) -> Option<T>) -> Option<Option<T>> {
        Some(if self.flag()? { Some(value(self)?) } else { None })
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        let count = self.u16()?;
        core::str::from_utf8(self.take(count.into())?).ok()
    }

    /// Seven bits a byte, low ones first; the shortest form only, so that one value has one form.
    pub(super) fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.u8()?;
            if (shift == 63 && byte > 1) || (shift > 0 && byte == 0) {
                return None;
            }
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    pub(super) fn varint_u16(&mut self) -> Option<u16> {
        u16::try_from(self.varint()?).ok()
    }

    pub(super) fn signed(&mut self) -> Option<i64> {
        let coded = self.varint()?;
        Some((coded >> 1).cast_signed() ^ -((coded & 1).cast_signed()))
    }
}

/// Bytes of one record, at most [`super::record::RECORD_BYTES_MAX`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Small {
    bytes: [u8; 32],
    count: usize,
}

impl Small {
    pub(super) fn new() -> Self {
        Self {
            bytes: [0; 32],
            count: 0,
        }
    }

    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.bytes[self.count..][..bytes.len()].copy_from_slice(bytes);
        self.count += bytes.len();
    }

    pub(super) fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.push(&[value as u8 | 0x80]);
            value >>= 7;
        }
        self.push(&[value as u8]);
    }

    pub(super) fn signed(&mut self, value: i64) {
        self.varint(((value << 1) ^ (value >> 63)).cast_unsigned());
    }

    pub(super) fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn varints_come_back_and_have_one_form() {
        let edges = [
            0,
            1,
            127,
            128,
            16_383,
            16_384,
            u64::from(u32::MAX),
            u64::MAX - 1,
            u64::MAX,
        ];
        for value in edges {
            let mut small = Small::new();
            small.varint(value);
            let mut cursor = Cursor::new(small.as_slice());
            assert_eq!((cursor.varint(), cursor.bytes.len()), (Some(value), 0));
            assert_eq!(Cursor::new(&small.as_slice()[1..]).varint().is_none(), value < 128);
        }
        for value in [0, -1, 1, i64::MIN, i64::MAX] {
            let mut small = Small::new();
            small.signed(value);
            assert_eq!(Cursor::new(small.as_slice()).signed(), Some(value));
        }
        assert_eq!(Cursor::new(&[0x80, 0]).varint(), None, "a longer form of 0");
        assert_eq!(Cursor::new(&[0xff; 11]).varint(), None);
    }
}
