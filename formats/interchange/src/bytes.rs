//! The bytes of a file, read where they are wanted: a file of gigabytes is never in memory as a whole.

use super::error::{Place, SequenceError};
use super::text::ends_early;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// How a file begins that stands in a working copy for one that was not fetched.
const LFS_POINTER: &[u8] = b"version https://git-lfs";

/// Refuses a file of Git LFS that says where another file lies.
pub(crate) fn refuse_pointer(bytes: &[u8], path: &Path) -> Result<(), SequenceError> {
    if !bytes.starts_with(LFS_POINTER) {
        return Ok(());
    }
    Err(SequenceError::Unsupported {
        path: path.into(),
        what: "a pointer of Git LFS, not the file itself,".into(),
        advice: "fetch the file with `git lfs pull`".into(),
    })
}

/// A file, or a part of one, or bytes that were made in memory.
#[derive(Debug)]
pub(crate) struct Bytes {
    path: PathBuf,
    source: Source,
    /// Where the part begins.
    start: u64,
    length: u64,
}

#[derive(Debug)]
enum Source {
    File {
        file: File,
        /// What was read last, since small pieces lie close together, and where in the file it begins.
        block: Vec<u8>,
        block_at: u64,
    },
    Memory(Vec<u8>),
}

/// Bytes that are read at once for the sake of small pieces.
const BLOCK_BYTES: usize = 4096;

impl Source {
    fn of_file(file: File) -> Source {
        Source::File {
            file,
            block: Vec::new(),
            block_at: 0,
        }
    }
}

impl Bytes {
    /// Opens a file.
    pub(crate) fn open(path: &Path) -> Result<Bytes, SequenceError> {
        let io = |source| SequenceError::Io {
            path: path.into(),
            source,
        };
        let file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut bytes = Bytes {
            path: path.into(),
            source: Source::of_file(file),
            start: 0,
            length,
        };
        refuse_pointer(&bytes.head(LFS_POINTER.len() as u64)?, path)?;
        Ok(bytes)
    }

    /// Bytes in memory; the path serves messages only.
    pub(crate) fn of_memory(bytes: Vec<u8>, path: &Path) -> Bytes {
        Bytes {
            path: path.into(),
            start: 0,
            length: bytes.len() as u64,
            source: Source::Memory(bytes),
        }
    }

    /// A file without a name that holds what was unpacked; the path serves messages only.
    pub(crate) fn of_file(file: File, path: &Path) -> Result<Bytes, SequenceError> {
        let length = file
            .metadata()
            .map_err(|source| SequenceError::Io {
                path: path.into(),
                source,
            })?
            .len();
        Ok(Bytes {
            path: path.into(),
            source: Source::of_file(file),
            start: 0,
            length,
        })
    }

    /// A part of these bytes, which the caller has checked to lie inside; messages name `path`.
    pub(crate) fn part(self, start: u64, length: u64, path: PathBuf) -> Bytes {
        Bytes {
            path,
            source: self.source,
            start: self.start + start,
            length,
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn len(&self) -> u64 {
        self.length
    }

    /// Fills `out` from byte `at` on.
    ///
    /// Errors: `Parse` where the file ends before, `Io`.
    pub(crate) fn read_at(&mut self, at: u64, out: &mut [u8]) -> Result<(), SequenceError> {
        let end = at.checked_add(out.len() as u64).filter(|&end| end <= self.length);
        if end.is_none() {
            let expected = format!("{} bytes from byte {at} on", out.len());
            return Err(ends_early(&self.path, Place::Byte(self.length as usize), &expected));
        }
        match &mut self.source {
            Source::Memory(bytes) => {
                let at = (self.start + at) as usize;
                out.copy_from_slice(&bytes[at..at + out.len()]);
                Ok(())
            }
            Source::File { file, block, block_at } => {
                let at = self.start + at;
                let mut read = || -> io::Result<()> {
                    if out.len() > BLOCK_BYTES {
                        file.seek(SeekFrom::Start(at))?;
                        return file.read_exact(out);
                    }
                    if at < *block_at || at + out.len() as u64 > *block_at + block.len() as u64 {
                        let left = self.start + self.length - at;
                        block.clear();
                        file.seek(SeekFrom::Start(at))?;
                        file.by_ref().take(left.min(BLOCK_BYTES as u64)).read_to_end(block)?;
                        *block_at = at;
                    }
                    let within = (at - *block_at) as usize;
                    let found = block.get(within..within + out.len());
                    out.copy_from_slice(found.ok_or(io::ErrorKind::UnexpectedEof)?);
                    Ok(())
                };
                read().map_err(|source| SequenceError::Io {
                    path: self.path.clone(),
                    source,
                })
            }
        }
    }

    /// `length` bytes from byte `at` on; no memory is taken for bytes that are not there.
    pub(crate) fn vec_at(&mut self, at: u64, length: u64) -> Result<Vec<u8>, SequenceError> {
        if at.checked_add(length).is_none_or(|end| end > self.length) {
            let expected = format!("{length} bytes from byte {at} on");
            return Err(ends_early(&self.path, Place::Byte(self.length as usize), &expected));
        }
        let mut out = vec![0; length as usize];
        self.read_at(at, &mut out)?;
        Ok(out)
    }

    /// A number's bytes at `at`.
    pub(crate) fn array_at<const N: usize>(&mut self, at: u64) -> Result<[u8; N], SequenceError> {
        let mut out = [0; N];
        self.read_at(at, &mut out)?;
        Ok(out)
    }

    /// The first bytes, as many as there are up to `length`.
    pub(crate) fn head(&mut self, length: u64) -> Result<Vec<u8>, SequenceError> {
        self.vec_at(0, length.min(self.length))
    }
}
