//! The writer: records into the caller's buffer, whole chunks out to the caller's sink.

use super::error::TakeError;
use super::header;
use super::record::{Context, Entry, RECORD_BYTES_MAX, Record, Stamped};
use super::wire::{CHUNK_HEAD_BYTES, CRC, EVENTS_CHUNK, HEADER_CHUNK, chunk_head};
use crate::{ControlMap, SurfaceSettings};

/// Least size of a writer's buffer. Some thousands are better: each chunk costs 24 bytes, and a crash loses at most one.
pub const WRITER_BYTES_MIN: usize = EVENTS_AT + RECORD_BYTES_MAX + 1;
/// Where records start: after the head and the time of the first.
const EVENTS_AT: usize = CHUNK_HEAD_BYTES + 8;

/// Records a take. Begin it with a new surface: what a surface already knows is not in a take.
///
/// The sink gets whole chunks, append-only, in one call each but for the header; a sink that can fail remembers its own
/// error. Call [`TakeWriter::flush`] about once a second: what is not flushed is what a crash loses.
#[derive(Debug)]
pub struct TakeWriter<'b, S: FnMut(&[u8])> {
    buffer: &'b mut [u8],
    used: usize,
    context: Context,
    sequence: u32,
    sink: S,
}

impl<'b, S: FnMut(&[u8])> TakeWriter<'b, S> {
    /// Writes the header: what is needed to make the same surface again, and the names of the components.
    ///
    /// # Errors
    /// [`TakeError::BufferTooSmall`], [`TakeError::NameTooLong`]; nothing was then written.
    pub fn new(
        device: &str,
        map: &ControlMap<'_>,
        settings: &SurfaceSettings,
        buffer: &'b mut [u8],
        mut sink: S,
    ) -> Result<Self, TakeError> {
        if buffer.len() < WRITER_BYTES_MIN {
            return Err(TakeError::BufferTooSmall {
                required_bytes: WRITER_BYTES_MIN,
                actual_bytes: buffer.len(),
            });
        }
        header::check_names(device, map)?;
        // Twice through: the head of the chunk says how long it is and what its checksum is.
        let mut payload_bytes = 0;
        header::write(device, map, settings, &mut |bytes| payload_bytes += bytes.len());
        let head = chunk_head(HEADER_CHUNK, payload_bytes as u32, 0);
        let mut digest = CRC.digest();
        digest.update(&head);
        header::write(device, map, settings, &mut |bytes| digest.update(bytes));
        sink(&head);
        sink(&digest.finalize().to_le_bytes());
        header::write(device, map, settings, &mut sink);
        Ok(Self {
            buffer,
            used: EVENTS_AT,
            context: Context::new(0),
            sequence: 1,
            sink,
        })
    }

    /// Appends a record. Everything goes in, in the order in which the surface got it.
    pub fn record(&mut self, at_us: u64, record: Record) {
        self.append(at_us, Entry::Record(Stamped { at_us, record }));
    }

    /// Appends the weights that are not at rest: where the controls stand when a take begins. Shape: `[K]`.
    pub fn weights(&mut self, at_us: u64, weights: &[f32]) {
        for (control, &weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            // The format of packages allows 4,096 components.
            let control = control as u16;
            self.record(at_us, Record::Weight { control, weight });
        }
    }

    fn append(&mut self, at_us: u64, entry: Entry) {
        if self.used + RECORD_BYTES_MAX > self.buffer.len() {
            self.flush();
        }
        if self.used == EVENTS_AT {
            self.context = Context::new(at_us);
            self.buffer[CHUNK_HEAD_BYTES..EVENTS_AT].copy_from_slice(&at_us.to_le_bytes());
        }
        let bytes = entry.write(&mut self.context);
        let bytes = bytes.as_slice();
        self.buffer[self.used..][..bytes.len()].copy_from_slice(bytes);
        self.used += bytes.len();
    }

    /// Hands what was recorded so far to the sink as a whole chunk.
    pub fn flush(&mut self) {
        if self.used == EVENTS_AT {
            return;
        }
        let head = chunk_head(EVENTS_CHUNK, (self.used - CHUNK_HEAD_BYTES) as u32, self.sequence);
        let mut digest = CRC.digest();
        digest.update(&head);
        digest.update(&self.buffer[CHUNK_HEAD_BYTES..self.used]);
        self.buffer[..12].copy_from_slice(&head);
        self.buffer[12..CHUNK_HEAD_BYTES].copy_from_slice(&digest.finalize().to_le_bytes());
        (self.sink)(&self.buffer[..self.used]);
        self.sequence = self.sequence.wrapping_add(1);
        self.used = EVENTS_AT;
    }

    /// Closes the take, so that a reader knows that nothing is missing.
    pub fn finish(mut self) {
        self.append(self.context.at_us, Entry::End);
        self.flush();
    }
}
