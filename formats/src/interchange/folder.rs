//! What a folder holds: mesh files in natural order, and the rest.

use super::error::SequenceError;
use super::mesh::MeshKind;
use std::fs;
use std::path::{Path, PathBuf};

/// The files of a folder; hidden files and folders are left out.
pub(super) struct Folder {
    /// Mesh files of any kind, in natural order: `frame2` before `frame10`.
    pub(super) files: Vec<PathBuf>,
    /// Names of the others, sorted.
    pub(super) others: Vec<String>,
}

impl Folder {
    pub(super) fn list(path: &Path) -> Result<Folder, SequenceError> {
        let mut folder = Folder {
            files: Vec::new(),
            others: Vec::new(),
        };
        for file in entries(path)? {
            let name = file_name(&file);
            // Hidden files are leavings of other systems: `._frame1.obj` holds no mesh.
            if name.starts_with('.') || !file.is_file() {
                continue;
            }
            match MeshKind::of_path(&file) {
                Some(_) => folder.files.push(file),
                None => folder.others.push(name),
            }
        }
        folder.files.sort_by(|a, b| {
            let by_number = natord::compare(&file_name(a), &file_name(b));
            by_number.then_with(|| a.cmp(b))
        });
        folder.others.sort();
        Ok(folder)
    }

    /// A folder inside `path` that holds shapes: what the user may have meant. The first by name.
    pub(super) fn nearby(path: &Path) -> Result<Option<PathBuf>, SequenceError> {
        let mut folders: Vec<PathBuf> = entries(path)?.into_iter().filter(|entry| entry.is_dir()).collect();
        folders.sort();
        let holds_shapes = |folder: &PathBuf| {
            let meshes = Folder::list(folder).is_ok_and(|inside| inside.files.len() > 1);
            meshes || folder.join("positions.npy").is_file()
        };
        Ok(folders.into_iter().find(holds_shapes))
    }
}

fn entries(path: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let io = |source| SequenceError::Io {
        path: path.to_path_buf(),
        source,
    };
    fs::read_dir(path)
        .map_err(io)?
        .map(|entry| entry.map(|entry| entry.path()).map_err(io))
        .collect()
}

/// The last part of a path, for messages.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}
