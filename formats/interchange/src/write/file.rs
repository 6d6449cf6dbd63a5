//! A file that is whole or not there.

use super::WriteError;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file under a temporary name beside its place, until it is finished.
pub(crate) struct Output {
    out: BufWriter<NamedTempFile>,
    path: PathBuf,
    /// Bytes written so far.
    length: u64,
}

impl Output {
    pub(crate) fn create(path: &Path) -> Result<Output, WriteError> {
        let io = |source| WriteError::Io {
            path: path.into(),
            source,
        };
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        // The umask decides who may read the result, not the temporary file's own caution.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.prefix(".sinew-").tempfile_in(folder).map_err(io)?;
        Ok(Output {
            out: BufWriter::new(file),
            path: path.into(),
            length: 0,
        })
    }

    /// A file that gets no name: what is kept apart until it can be appended to another.
    pub(crate) fn apart(path: &Path) -> Result<Output, WriteError> {
        Output::create(path)
    }

    /// Appends what was kept apart.
    pub(crate) fn append(&mut self, other: Output) -> Result<(), WriteError> {
        let mut file = other.out.into_inner().map_err(|error| self.fail(error.into_error()))?;
        file.seek(SeekFrom::Start(0)).map_err(|source| self.fail(source))?;
        io::copy(&mut file, self).map_err(|source| self.fail(source))?;
        Ok(())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes written so far: where the next ones will stand.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// The error for what the operating system refused.
    pub(crate) fn fail(&self, source: io::Error) -> WriteError {
        WriteError::Io {
            path: self.path.clone(),
            source,
        }
    }

    pub(crate) fn put(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.write_all(bytes).map_err(|source| self.fail(source))
    }

    /// Numbers in the order of little bytes first.
    pub(crate) fn put_f32(&mut self, values: &[f32]) -> Result<(), WriteError> {
        values.iter().try_for_each(|value| self.put(&value.to_le_bytes()))
    }

    /// Overwrites bytes that stand at `at`.
    pub(crate) fn patch(&mut self, at: u64, bytes: &[u8]) -> Result<(), WriteError> {
        let mut patch = || {
            self.out.seek(SeekFrom::Start(at))?;
            self.out.write_all(bytes)?;
            self.out.seek(SeekFrom::Start(self.length))
        };
        patch().map(drop).map_err(|source| self.fail(source))
    }

    /// Gives the file its name.
    pub(crate) fn commit(self) -> Result<(), WriteError> {
        let path = self.path;
        let fail = |source| WriteError::Io {
            path: path.clone(),
            source,
        };
        let file = self.out.into_inner().map_err(|error| fail(error.into_error()))?;
        file.persist(&path).map_err(|error| fail(error.error))?;
        Ok(())
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.length += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
