//! A take on its way to the disk: whole chunks go to a thread that appends them, so that a slow disk, or one that hangs, does not hold a
//! frame up: it costs the take its end.

use core::time::Duration;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use crossbeam::channel::{Receiver, Sender, bounded};
use miette::{IntoDiagnostic, Report, WrapErr, miette};

/// Bytes of a take's chunk: some seconds of eight busy knobs.
pub const CHUNK_BYTES: usize = 16 * 1024;
/// Chunks that may wait for the disk.
const CHUNKS: usize = 32;
/// How long a frame waits, once in a take, for a disk that took none of them: no hand feels it.
const STALL: Duration = Duration::from_millis(50);
/// How long the end of a take waits for the disk.
const PATIENCE: Duration = Duration::from_secs(10);

/// A file that grows by whole chunks.
pub struct TakeFile {
    path: PathBuf,
    empty: Receiver<Vec<u8>>,
    full: Option<Sender<Vec<u8>>>,
    thread: Option<JoinHandle<()>>,
    fault: Arc<Mutex<Option<String>>>,
}

/// What was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TakeSummary {
    /// The file.
    pub path: PathBuf,
    /// Its frames and their checksum, in words.
    pub frames: String,
}

impl core::fmt::Display for TakeSummary {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(out, "take {}: {}", self.path.display(), self.frames)
    }
}

impl TakeFile {
    /// Makes a new file.
    ///
    /// # Errors
    /// It is there already (a take is never written over), or cannot be made.
    pub fn create(path: &Path) -> Result<Self, Report> {
        let mut file = match File::create_new(path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                return Err(miette!(
                    help = "name another file, or move this one away",
                    "{} is there already; a take is never written over",
                    path.display()
                ));
            }
            Err(error) => {
                return Err(error)
                    .into_diagnostic()
                    .wrap_err_with(|| format!("cannot record to {}", path.display()));
            }
        };
        let (give_back, empty) = bounded(CHUNKS);
        let (full, filled) = bounded::<Vec<u8>>(CHUNKS);
        for _ in 0..CHUNKS {
            let _ = give_back.try_send(Vec::with_capacity(CHUNK_BYTES));
        }
        let fault = Arc::new(Mutex::new(None));
        let told = Arc::clone(&fault);
        let thread = thread::Builder::new().name("sinew-take".to_owned()).spawn(move || {
            for chunk in &filled {
                // After a chunk that is lost, or cut, nothing can be read: one fault ends the take.
                if let Err(error) = file.write_all(&chunk) {
                    let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
                    told.get_or_insert_with(|| error.to_string());
                    return;
                }
                let _ = give_back.try_send(chunk);
            }
            if let Err(error) = file.sync_all() {
                *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string());
            }
        });
        Ok(Self {
            path: path.to_path_buf(),
            empty,
            full: Some(full),
            thread: Some(thread.into_diagnostic()?),
            fault,
        })
    }

    /// Takes bytes to append. Where the disk takes nothing, the take is cut, and the show goes on: after a chunk that is lost nothing can
    /// be read.
    pub fn append(&self, bytes: &[u8]) {
        let Some(full) = self.full.as_ref().filter(|_| self.fault().is_none()) else {
            return;
        };
        match self.empty.recv_timeout(STALL) {
            Ok(mut chunk) => {
                chunk.clear();
                chunk.extend_from_slice(bytes);
                // There is room for all chunks that there are.
                let _ = full.try_send(chunk);
            }
            Err(_) => self.cut("the disk takes nothing"),
        }
    }

    fn cut(&self, why: &str) {
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        fault.get_or_insert_with(|| why.to_owned());
    }

    /// Why nothing more is written.
    pub fn fault(&self) -> Option<String> {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        fault
            .as_ref()
            .map(|fault| format!("the take {} is cut: {fault}", self.path.display()))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Waits until everything is on the disk.
    ///
    /// # Errors
    /// The disk did not take it.
    pub fn finish(mut self) -> Result<PathBuf, Report> {
        self.end();
        match self.fault() {
            Some(fault) => Err(miette!(help = "what was written before can be replayed", "{fault}")),
            None => Ok(self.path.clone()),
        }
    }

    fn end(&mut self) {
        self.full = None;
        let Some(thread) = self.thread.take() else { return };
        let until = Instant::now() + PATIENCE;
        while !thread.is_finished() {
            if Instant::now() > until {
                // The thread goes on as long as the program does; whole chunks are in the file.
                return self.cut("the disk does not answer");
            }
            thread::sleep(Duration::from_millis(2));
        }
        // It does not panic; if it did, the file holds whole chunks all the same.
        let _ = thread.join();
    }
}

impl Drop for TakeFile {
    fn drop(&mut self) {
        self.end();
    }
}

/// The first name of a row that is free: `show.take`, `show-2.take`, `show-3.take`.
pub fn free_name(wanted: &Path) -> PathBuf {
    let stem = wanted
        .file_stem()
        .map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
    let extension = wanted
        .extension()
        .map_or(String::new(), |extension| format!(".{}", extension.to_string_lossy()));
    let names = (1_u32..).map(|n| match n {
        1 => wanted.to_path_buf(),
        n => wanted.with_file_name(format!("{stem}-{n}{extension}")),
    });
    names
        .into_iter()
        .find(|path| !path.exists())
        .unwrap_or_else(|| wanted.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_arrive_in_order_and_no_take_is_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.take");
        let file = TakeFile::create(&path).unwrap();
        for n in 0..100_u8 {
            file.append(&[n; 10]);
        }
        assert_eq!(file.finish().unwrap(), path);
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.chunks(10).enumerate().all(|(n, chunk)| chunk == [n as u8; 10]) && bytes.len() == 1000);
        let refused = TakeFile::create(&path).map(|_| ()).unwrap_err();
        assert!(refused.to_string().contains("never written over"), "{refused}");
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        assert_eq!(free_name(&path), folder.path().join("a-2.take"));
        assert!(TakeFile::create(&folder.path().join("no").join("a.take")).is_err());
    }

    #[test]
    fn a_disk_that_took_no_more_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.take");
        let (give_back, empty) = bounded(1);
        give_back.send(Vec::new()).unwrap();
        let (full, filled) = bounded::<Vec<u8>>(1);
        drop(filled);
        let fault = Arc::new(Mutex::new(Some("no space".to_owned())));
        let file = TakeFile {
            path,
            empty,
            full: Some(full),
            thread: None,
            fault,
        };
        file.append(b"lost");
        assert!(file.finish().unwrap_err().to_string().contains("is cut: no space"));
    }

    #[test]
    fn a_disk_that_hangs_holds_no_frame_up() {
        let folder = tempfile::tempdir().unwrap();
        let (give_back, empty) = bounded(2);
        (0..2).for_each(|_| give_back.send(Vec::new()).unwrap());
        // Nobody takes the chunks.
        let (full, filled) = bounded::<Vec<u8>>(2);
        let file = TakeFile {
            path: folder.path().join("a.take"),
            empty,
            full: Some(full),
            thread: None,
            fault: Arc::new(Mutex::new(None)),
        };
        for n in 0..5_u8 {
            file.append(&[n]);
        }
        assert!(file.fault().unwrap().contains("takes nothing"));
        // The disk wakes up: what it had is whole, and nothing follows a gap.
        let taken: Vec<_> = filled.try_iter().collect();
        give_back.send(Vec::new()).unwrap();
        file.append(b"late");
        assert_eq!((taken, filled.len()), (vec![vec![0], vec![1]], 0));
        assert!(file.finish().unwrap_err().to_string().contains("is cut"));
    }
}
