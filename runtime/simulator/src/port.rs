//! The box's end of the cable: a pseudo-terminal, and a link to it whose path stays the same when the cable is pulled and
//! put back, as a host needs it to find the box again.

use core::time::Duration;
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use serialport::{SerialPort, TTYPort};

/// Longest wait for room in the terminal's buffer; what then has none is lost, as on a line that nobody reads.
const WRITE_TIMEOUT: Duration = Duration::from_millis(20);
const READ_TIMEOUT: Duration = Duration::ZERO;
/// Bytes of a write: the terminal takes few at a time.
const WRITE_BYTES: usize = 256;

/// Why there is no port.
#[derive(Debug)]
#[non_exhaustive]
pub enum PortError {
    /// The system gives no pseudo-terminal.
    NoTerminal(serialport::Error),
    /// The path is something else than a link; it stays as it is.
    Occupied(PathBuf),
    /// The link cannot be made.
    NoLink(PathBuf, io::Error),
}

impl core::error::Error for PortError {}

impl core::fmt::Display for PortError {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoTerminal(error) => write!(out, "the system gives no pseudo-terminal: {error}"),
            Self::Occupied(path) => write!(
                out,
                "{} exists and is not a link to a simulated box; remove it or choose another path",
                path.display()
            ),
            Self::NoLink(path, error) => write!(out, "the link {} cannot be made: {error}", path.display()),
        }
    }
}

/// A port that can be unplugged. Dropping it unplugs it and removes its link.
#[derive(Debug)]
pub struct Port {
    link: PathBuf,
    plugged: Option<(TTYPort, PathBuf)>,
}

impl Port {
    /// A plugged port that hosts open by the path `link`. A link that is there already is replaced, anything else is not.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn open(link: impl Into<PathBuf>) -> Result<Self, PortError> {
        let mut port = Self {
            link: link.into(),
            plugged: None,
        };
        if fs::symlink_metadata(&port.link).is_ok_and(|found| !found.file_type().is_symlink()) {
            return Err(PortError::Occupied(port.link.clone()));
        }
        port.plug()?;
        Ok(port)
    }

    /// The path that hosts open.
    pub fn path(&self) -> &Path {
        &self.link
    }

    /// Whether the cable is in.
    pub const fn is_plugged(&self) -> bool {
        self.plugged.is_some()
    }

    /// Puts the cable in: a new terminal under the same path, which leads to the old one or to the new one at every moment.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn plug(&mut self) -> Result<(), PortError> {
        if self.is_plugged() {
            return Ok(());
        }
        // The host's end is closed at once: the host opens it by its path.
        let (mut own, host) = TTYPort::pair().map_err(PortError::NoTerminal)?;
        own.set_timeout(WRITE_TIMEOUT).map_err(PortError::NoTerminal)?;
        let terminal = PathBuf::from(host.name().unwrap_or_default());
        let mut fresh = self.link.clone().into_os_string();
        fresh.push(format!(".{}", std::process::id()));
        let fresh = PathBuf::from(fresh);
        let linked = symlink(&terminal, &fresh).and_then(|()| fs::rename(&fresh, &self.link));
        linked.map_err(|error| PortError::NoLink(self.link.clone(), error))?;
        self.plugged = Some((own, terminal));
        Ok(())
    }

    /// Pulls the cable: the path is gone, and a host that has it open sees the device vanish.
    pub fn unplug(&mut self) {
        if let Some((own, terminal)) = self.plugged.take() {
            // Somebody else may have put a link of theirs there.
            if fs::read_link(&self.link).is_ok_and(|target| target == terminal) {
                // If it cannot be removed it leads nowhere, which hosts see as well.
                let _ = fs::remove_file(&self.link);
            }
            drop(own);
        }
    }

    /// Sends bytes; returns how many a host can read. The others are lost: nobody has the port open, or nobody reads it.
    pub fn send(&mut self, bytes: &[u8]) -> usize {
        let Some((own, _)) = &mut self.plugged else { return 0 };
        let mut sent = 0;
        for chunk in bytes.chunks(WRITE_BYTES) {
            let mut rest = chunk;
            while !rest.is_empty() {
                match own.write(rest) {
                    Ok(count) if count > 0 => {
                        sent += count;
                        rest = &rest[count..];
                    }
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    _ => return sent,
                }
            }
        }
        sent
    }

    /// What the host has written meanwhile; never waits. Returns the part of `buffer` that was filled.
    pub fn receive<'b>(&mut self, buffer: &'b mut [u8]) -> &'b [u8] {
        let Some((own, _)) = &mut self.plugged else { return &[] };
        // A port that cannot change its timeout would wait for the longer one: late, but right.
        let _ = own.set_timeout(READ_TIMEOUT);
        let count = own.read(buffer).unwrap_or(0);
        let _ = own.set_timeout(WRITE_TIMEOUT);
        &buffer[..count]
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.unplug();
    }
}
