//! Packages as files: read whole to an aligned place, written whole or not at all.

use std::{
    fs::File,
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

use super::{AlignedBytes, HEADER_BYTES, limits};

/// Why a package file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file system refuses.
    #[error("cannot read `{path}`")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// No package is that large.
    #[error("`{path}` has {actual} bytes, more than any Sinew package; is it the right file?")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        actual: u64,
    },
}

/// Why a package file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write `{path}`; nothing was changed there")]
pub struct SaveError {
    /// The file.
    pub path: PathBuf,
    /// What the system says.
    pub source: io::Error,
}

/// Reads a file to a place from which it can be opened; does not open it.
///
/// Errors: the system's, and a file larger than a package can be; both name the file.
pub fn read_package(path: &Path) -> Result<AlignedBytes, ReadError> {
    let fail = |source| ReadError::Io {
        path: path.to_path_buf(),
        source,
    };
    let mut file = File::open(path).map_err(fail)?;
    let actual = file.metadata().map_err(fail)?.len();
    if actual > limits::PAYLOAD_BYTES + HEADER_BYTES as u64 {
        return Err(ReadError::TooLarge {
            path: path.to_path_buf(),
            actual,
        });
    }
    let mut bytes = AlignedBytes::zeroed(actual as usize);
    file.read_exact(bytes.as_mut_slice()).map_err(fail)?;
    Ok(bytes)
}

/// Writes a file under a temporary name in the same folder and renames it, so that `path` holds the old content or the
/// new, never a part.
///
/// Errors: the system's, with the file's name.
pub fn save_package(path: &Path, bytes: &[u8]) -> Result<(), SaveError> {
    replace(path, bytes).map_err(|source| SaveError {
        path: path.to_path_buf(),
        source,
    })
}

fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        // A temporary file is private by default; a package is as public as any file its user writes.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_package_is_read_back_aligned_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.sinew");
        for content in [&b"first"[..], b"second, longer"] {
            save_package(&path, content).unwrap();
            let read = read_package(&path).unwrap();
            assert_eq!(&*read, content);
            assert_eq!(read.as_ptr().align_offset(super::super::PAYLOAD_ALIGNMENT), 0);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing").join("a.sinew");
        assert!(read_package(&missing).unwrap_err().to_string().contains("a.sinew"));
        assert!(
            save_package(&missing, b"x")
                .unwrap_err()
                .to_string()
                .contains("a.sinew")
        );
        // A folder opens but does not read.
        assert!(read_package(folder.path()).is_err());
    }
}
