//! The reader: bytes to a take. Everything is checked on opening, up to the last whole chunk; what lies beyond is lost and
//! said to be.

use super::error::TakeError;
use super::header::{self, Header, MissingControl, VERSION};
use super::record::{Context, Entry, Stamped};
use super::wire::{CHUNK_HEAD_BYTES, CRC, Cursor, EVENTS_CHUNK, HEADER_CHUNK, MAGIC, chunk_head};
use crate::{Binding, Button, Command, Knob, SurfaceSettings, TreePages};
use sinew_runtime::Basis;

/// An opened take. Borrows the bytes.
#[derive(Debug, Clone, Copy)]
pub struct Take<'a> {
    header: Header<'a>,
    /// Whole chunks of records.
    chunks: &'a [u8],
    record_count: usize,
    closed: bool,
    lost_bytes: usize,
}

/// A whole chunk and what follows it.
struct Chunk<'a> {
    payload: &'a [u8],
    rest: &'a [u8],
}

/// What is wrong with the chunk at the front.
enum ChunkFault {
    Cut { required_bytes: usize },
    Corrupt,
}

fn chunk(bytes: &[u8], kind: u8, sequence: u32) -> Result<Chunk<'_>, ChunkFault> {
    let cut = |required_bytes| ChunkFault::Cut { required_bytes };
    let (head, after) = bytes.split_at_checked(CHUNK_HEAD_BYTES).ok_or(cut(CHUNK_HEAD_BYTES))?;
    let mut cursor = Cursor::new(&head[4..]);
    let payload_bytes = cursor.u32().ok_or(ChunkFault::Corrupt)?;
    if head[..12] != chunk_head(kind, payload_bytes, sequence) {
        return Err(ChunkFault::Corrupt);
    }
    let (payload, rest) = after
        .split_at_checked(payload_bytes as usize)
        .ok_or(cut(CHUNK_HEAD_BYTES.saturating_add(payload_bytes as usize)))?;
    let mut digest = CRC.digest();
    digest.update(&head[..12]);
    digest.update(payload);
    if digest.finalize().to_le_bytes() != head[12..] {
        return Err(ChunkFault::Corrupt);
    }
    Ok(Chunk { payload, rest })
}

impl<'a> Take<'a> {
    /// Opens a take. A tail that was cut off or damaged does not keep it from opening: see [`Take::lost_bytes`].
    ///
    /// # Errors
    /// [`TakeError`], if the header is not whole.
    pub fn open(bytes: &'a [u8]) -> Result<Self, TakeError> {
        let start = [MAGIC[0], MAGIC[1], MAGIC[2], HEADER_CHUNK];
        if !bytes.starts_with(&start) && !start.starts_with(bytes) {
            return Err(TakeError::NotATake);
        }
        let whole = chunk(bytes, HEADER_CHUNK, 0).map_err(|fault| match fault {
            ChunkFault::Cut { required_bytes } => TakeError::HeaderCut {
                required_bytes,
                actual_bytes: bytes.len(),
            },
            ChunkFault::Corrupt => TakeError::HeaderCorrupt,
        })?;
        let malformed = |left| TakeError::HeaderMalformed {
            at: CHUNK_HEAD_BYTES + whole.payload.len() - left,
        };
        let mut cursor = Cursor::new(whole.payload);
        let (Some(version), Some(oldest_reader)) = (cursor.u16(), cursor.u16()) else {
            return Err(malformed(cursor.bytes.len()));
        };
        if version < VERSION || oldest_reader > VERSION {
            return Err(TakeError::UnsupportedVersion { version, oldest_reader });
        }
        let header = Header::read(cursor.bytes).map_err(malformed)?;
        let mut take = Self {
            header,
            chunks: &[],
            record_count: 0,
            closed: false,
            lost_bytes: 0,
        };
        take.recover(whole.rest);
        Ok(take)
    }

    /// Finds the whole chunks.
    fn recover(&mut self, bytes: &'a [u8]) {
        let mut rest = bytes;
        for sequence in 1.. {
            if self.closed {
                break;
            }
            let Ok(whole) = chunk(rest, EVENTS_CHUNK, sequence) else {
                break;
            };
            let Some((count, closed)) = count_records(whole.payload) else {
                break;
            };
            self.record_count += count;
            self.closed = closed;
            rest = whole.rest;
        }
        self.lost_bytes = rest.len();
        self.chunks = &bytes[..bytes.len() - rest.len()];
    }

    /// Identity of the compact package that was played.
    pub fn compact_id(&self) -> [u8; 16] {
        self.header.compact_id
    }

    /// The device, as its player called it.
    pub fn device(&self) -> &'a str {
        self.header.device
    }

    /// How the surface was set.
    pub fn settings(&self) -> SurfaceSettings {
        self.header.settings
    }

    /// Names of the components that were played, in the order of their indices.
    pub fn component_names(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.header.names.entries(Cursor::text)
    }

    /// The knobs.
    pub fn knobs(&self) -> impl Iterator<Item = Knob<'a>> + use<'a> {
        self.header.knobs.entries(header::knob)
    }

    /// The tree's knobs, if it had any.
    pub fn tree(&self) -> Option<TreePages> {
        self.header.tree
    }

    /// The bindings, for `basis`: by index on the package that was played, by name on any other, where limits wider than the
    /// component's are tightened to it.
    ///
    /// Each that has no component there is an `Err` with its name.
    pub fn bindings<'b>(
        &self,
        basis: &Basis<'b>,
    ) -> impl Iterator<Item = Result<Binding, MissingControl<'a>>> + use<'a, 'b> {
        let (take, basis) = (*self, *basis);
        self.header.bindings.entries(header::binding).map(move |mut binding| {
            binding.control = take.control_in(&basis, binding.control)?;
            if take.compact_id() != basis.compact_id() {
                let component = basis.component(binding.control.into());
                let response = &mut binding.response;
                response.minimum = response.minimum.filter(|&minimum| minimum > component.minimum);
                response.maximum = response.maximum.filter(|&maximum| maximum < component.maximum);
            }
            Ok(binding)
        })
    }

    /// The buttons, for `basis`, as [`Take::bindings`]. A button for a page whose bindings are all missing is refused by
    /// [`ControlMap`](crate::ControlMap) with the page; leave it out.
    pub fn buttons<'b>(
        &self,
        basis: &Basis<'b>,
    ) -> impl Iterator<Item = Result<Button, MissingControl<'a>>> + use<'a, 'b> {
        let (take, basis) = (*self, *basis);
        self.header.buttons.entries(header::button).map(move |mut button| {
            button.command = take.command_in(&basis, button.command)?;
            Ok(button)
        })
    }

    /// Index in `basis` of the component that was `control` when the take was played.
    ///
    /// # Errors
    /// [`MissingControl`], with an empty name if the take itself has no such component.
    pub fn control_in(&self, basis: &Basis<'_>, control: u16) -> Result<u16, MissingControl<'a>> {
        let name = self.component_names().nth(control.into()).unwrap_or("");
        let found = if name.is_empty() {
            None
        } else if self.compact_id() == basis.compact_id() && usize::from(control) < basis.component_count() {
            Some(control)
        } else {
            // The format of packages allows 4,096 components.
            basis.component_named(name).map(|k| k as u16)
        };
        found.ok_or(MissingControl { name })
    }

    pub(super) fn command_in(&self, basis: &Basis<'_>, command: Command) -> Result<Command, MissingControl<'a>> {
        match command {
            Command::Focus(control) => self.control_in(basis, control).map(Command::Focus),
            other => Ok(other),
        }
    }

    /// The records, in order.
    pub fn records(&self) -> Records<'a> {
        Records {
            chunks: self.chunks,
            payload: Cursor::new(&[]),
            context: Context::new(0),
        }
    }

    /// How many records there are.
    pub fn record_count(&self) -> usize {
        self.record_count
    }

    /// Whether the take was closed; if not, its player did not get to it.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Bytes behind the last whole chunk: what a crash cut off, or damage made unreadable.
    pub fn lost_bytes(&self) -> usize {
        self.lost_bytes
    }
}

/// Records of a chunk and whether it ends the take; `None` if any of it makes no sense.
fn count_records(payload: &[u8]) -> Option<(usize, bool)> {
    let mut cursor = Cursor::new(payload);
    let mut context = Context::new(cursor.u64()?);
    let mut count = 0;
    while !cursor.bytes.is_empty() {
        match Entry::read(&mut cursor, &mut context)? {
            Entry::Record(_) => count += 1,
            Entry::End => return cursor.bytes.is_empty().then_some((count, true)),
        }
    }
    Some((count, false))
}

/// Records of a take, in order.
#[derive(Debug, Clone)]
pub struct Records<'a> {
    chunks: &'a [u8],
    payload: Cursor<'a>,
    context: Context,
}

impl Iterator for Records<'_> {
    type Item = Stamped;

    fn next(&mut self) -> Option<Stamped> {
        loop {
            if self.payload.bytes.is_empty() {
                let mut cursor = Cursor::new(self.chunks.get(4..)?);
                let payload_bytes = cursor.u32()? as usize;
                let mut after = Cursor::new(self.chunks.get(CHUNK_HEAD_BYTES..)?);
                self.payload = Cursor::new(after.take(payload_bytes)?);
                self.chunks = after.bytes;
                self.context = Context::new(self.payload.u64()?);
            }
            if self.payload.bytes.is_empty() {
                continue;
            }
            match Entry::read(&mut self.payload, &mut self.context)? {
                Entry::Record(stamped) => return Some(stamped),
                Entry::End => return None,
            }
        }
    }
}
