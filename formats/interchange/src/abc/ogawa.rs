//! Ogawa, the container of Alembic files: groups of children, each a group or data, named by their byte offsets.

use crate::bytes::Bytes;
use crate::error::{Place, SequenceError};
use crate::text::unexpected;
use std::path::Path;

const SIGNATURE: &[u8; 5] = b"Ogawa";
/// Signature, whether writing was finished, version, offset of the root group.
const HEADER_BYTES: u64 = 16;
/// What the byte behind the signature holds once a file is whole.
const FINISHED: u8 = 0xff;
/// Set in the offset of a child that is data.
const IS_DATA: u64 = 1 << 63;
/// Before them, older archives were HDF5.
const HDF5_SIGNATURE: &[u8; 4] = b"\x89HDF";

/// A file of groups and data.
pub(super) struct Ogawa {
    pub(super) bytes: Bytes,
    /// Children that may still be looked up: a damaged file may name one group from many others, so that walking it would not end.
    visits: u64,
}

/// Children of a group: offsets with [`IS_DATA`].
#[derive(Debug, Clone, Default)]
pub(super) struct Group(Vec<u64>);

/// Where data lies.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Data {
    pub(super) at: u64,
    pub(super) length: u64,
}

impl Ogawa {
    /// Opens a file and reads its root group.
    ///
    /// Errors: `Unsupported` for HDF5, `Parse` for what is no Alembic file or was not finished.
    pub(super) fn open(mut bytes: Bytes) -> Result<(Ogawa, Group), SequenceError> {
        let path = bytes.path().to_path_buf();
        let head = bytes.head(HEADER_BYTES)?;
        if head.starts_with(HDF5_SIGNATURE) {
            return Err(SequenceError::Unsupported {
                path,
                what: "an Alembic file in HDF5, which has been obsolete since 2013,".into(),
                advice: "export it again as Alembic with the format Ogawa, or convert it with `abcconvert -toOgawa`"
                    .into(),
            });
        }
        let Some(header) = head.first_chunk::<16>().filter(|header| header.starts_with(SIGNATURE)) else {
            return Err(unexpected(
                &path,
                Place::Byte(0),
                "the signature Ogawa of an Alembic file",
                Some(&head),
            ));
        };
        if header[5] != FINISHED {
            let found = Some(&b"a file that was not finished"[..]);
            return Err(unexpected(&path, Place::Byte(5), "a finished Alembic file", found));
        }
        let root = u64::from_le_bytes([
            header[8], header[9], header[10], header[11], header[12], header[13], header[14], header[15],
        ]);
        let visits = bytes.len() / 4 + 64;
        let mut file = Ogawa { bytes, visits };
        let root = file.group_at(root)?;
        Ok((file, root))
    }

    pub(super) fn path(&self) -> &Path {
        self.bytes.path()
    }

    /// The error for bytes that are not as they should be.
    pub(super) fn refuse(&self, at: u64, expected: &str, found: &str) -> SequenceError {
        SequenceError::Parse {
            path: self.path().into(),
            place: Place::Byte(at as usize),
            expected: expected.into(),
            found: found.into(),
        }
    }

    fn group_at(&mut self, at: u64) -> Result<Group, SequenceError> {
        if at == 0 {
            return Ok(Group::default());
        }
        let count = u64::from_le_bytes(self.bytes.array_at(at)?);
        let size = count.checked_mul(8).filter(|&size| size <= self.bytes.len());
        let (Some(size), Some(visits)) = (size, self.visits.checked_sub(count.saturating_add(1))) else {
            return Err(self.refuse(at, "a group", &format!("{count} children")));
        };
        self.visits = visits;
        let raw = self.bytes.vec_at(at + 8, size)?;
        Ok(Group(
            raw.as_chunks().0.iter().map(|&raw| u64::from_le_bytes(raw)).collect(),
        ))
    }

    /// Child `i` of a group, a group.
    pub(super) fn group(&mut self, parent: &Group, i: usize) -> Result<Group, SequenceError> {
        match parent.0.get(i) {
            Some(&offset) if offset & IS_DATA == 0 => self.group_at(offset),
            _ => Err(self.refuse(0, &format!("child {i} of a group to be a group"), "none")),
        }
    }

    /// Child `i` of a group, data.
    pub(super) fn data(&mut self, parent: &Group, i: usize) -> Result<Data, SequenceError> {
        let Some(&offset) = parent.0.get(i).filter(|&offset| offset & IS_DATA != 0) else {
            return Err(self.refuse(0, &format!("child {i} of a group to be data"), "none"));
        };
        let at = offset & !IS_DATA;
        if at == 0 {
            return Ok(Data::default());
        }
        let length = u64::from_le_bytes(self.bytes.array_at(at)?);
        if length > self.bytes.len() - at - 8 {
            return Err(self.refuse(at, "data", &format!("{length} bytes, more than the file has")));
        }
        Ok(Data { at: at + 8, length })
    }

    /// The bytes of data.
    pub(super) fn read(&mut self, data: Data) -> Result<Vec<u8>, SequenceError> {
        self.bytes.vec_at(data.at, data.length)
    }
}

impl Group {
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }
}
