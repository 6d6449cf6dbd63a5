//! NumPy's npz: a zip of arrays, packed or not, among them `positions` and `faces`.

use super::{Bytes, Scene, SequenceError, arrays};
use crate::error::Place;
use crate::text::unexpected;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;
use zip::{CompressionMethod, ZipArchive};

/// Deflate makes nothing smaller than this.
const SHRINKS_MAX: u64 = 1032;

/// Arrays that a refusal names.
const NAMES_SHOWN: usize = 12;

/// Opens an archive with `positions` and `faces`.
///
/// Errors: `Parse` where it is no archive or lacks one of them, and as for arrays in files.
pub(super) fn open(path: &Path) -> Result<Box<dyn Scene>, SequenceError> {
    let file = File::open(path).map_err(|source| SequenceError::Io {
        path: path.into(),
        source,
    })?;
    let mut archive = ZipArchive::new(io::BufReader::new(file)).map_err(|error| refuse(path, &error))?;
    let positions = array(&mut archive, "positions.npy", path)?;
    arrays(
        positions,
        || array(&mut archive, "faces.npy", path),
        super::NPZ.name,
        Vec::new(),
    )
}

fn refuse(path: &Path, found: &impl ToString) -> SequenceError {
    unexpected(
        path,
        Place::Byte(0),
        "a zip of arrays with `positions` and `faces`",
        Some(found.to_string().as_bytes()),
    )
}

/// An array of the archive: its place in the file where it is stored as it is, else unpacked to a file without a name.
fn array<R: Read + Seek>(archive: &mut ZipArchive<R>, name: &str, path: &Path) -> Result<Bytes, SequenceError> {
    let names: Vec<String> = archive
        .file_names()
        .flatten()
        .take(NAMES_SHOWN)
        .map(|name| name.into_owned())
        .collect();
    let mut entry = archive
        .by_name(name)
        .map_err(|error| refuse(path, &format!("{error}: {name} among {}", names.join(", "))))?;
    let inside = path.join(name);
    let io = |source| SequenceError::Io {
        path: inside.clone(),
        source,
    };
    if entry.compression() == CompressionMethod::Stored && !entry.encrypted() {
        let (start, length) = (entry.data_start(), entry.compressed_size());
        drop(entry);
        let whole = Bytes::open(path)?;
        let start = start.filter(|start| start.checked_add(length).is_some_and(|end| end <= whole.len()));
        return match start {
            Some(start) => Ok(whole.part(start, length, inside)),
            None => Err(refuse(path, &format!("{name} of {length} bytes, more than there are"))),
        };
    }
    let length = entry.size();
    if length / SHRINKS_MAX > entry.compressed_size() {
        return Err(refuse(path, &format!("{name} that claims {length} bytes")));
    }
    let mut unpacked = tempfile::tempfile().map_err(|source| SequenceError::NoRoom {
        path: path.into(),
        source,
    })?;
    let written = io::copy(&mut entry.by_ref().take(length), &mut unpacked).map_err(io)?;
    if written != length {
        return Err(refuse(path, &format!("{name} of {written} bytes instead of {length}")));
    }
    Bytes::of_file(unpacked, &inside)
}
