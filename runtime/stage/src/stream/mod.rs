//! Where the moving mesh goes: OBJ files, raw floats, UDP. Each stream has a thread and three buffers, so that a slow disk or a
//! slow reader costs the stream frames and the performance nothing. A frame that fails is counted and the next one tried. Layouts are in `docs/streams.md`.

mod packets;
mod spec;
mod write;

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use crossbeam::channel::{Receiver, Sender, bounded};
use miette::Report;

pub use packets::{DATAGRAM_FLOATS, Kind, write_datagrams};
pub use spec::StreamSpec;
use write::Sink;

use crate::count::count;

/// Buffers of a stream: one that is filled, one that waits, one that is written.
const BUFFERS: usize = 3;

/// One frame on its way out.
#[derive(Debug, Clone, Default)]
pub struct Shape {
    /// Frames since the performance began.
    pub frame: u64,
    /// Its time, µs.
    pub at_us: u64,
    /// Shape: `[V]`, or empty for a stream of weights.
    pub positions: Vec<[f32; 3]>,
    /// Shape: `[K]`.
    pub weights: Vec<f32>,
}

/// A stream at work.
pub struct Stream {
    spec: StreamSpec,
    empty: Receiver<Shape>,
    full: Option<Sender<Shape>>,
    thread: Option<JoinHandle<()>>,
    health: Arc<Mutex<Health>>,
    sent: u64,
    dropped: u64,
}

/// What the thread has met.
#[derive(Debug, Clone, Default)]
struct Health {
    /// Frames that failed.
    lost: u64,
    /// Why the last of them did.
    last: Option<String>,
    /// Whether the last frame was one of them.
    fails: bool,
    /// Whether the stream is over.
    ended: bool,
}

/// How a stream did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamSummary {
    /// As it was asked for.
    pub name: String,
    /// Frames handed over.
    pub sent: u64,
    /// Frames left out because the last ones were still being written.
    pub dropped: u64,
    /// Frames that could not be written.
    pub lost: u64,
    /// Why the last of them could not.
    pub last: Option<String>,
    /// Whether that ended the stream.
    pub ended: bool,
}

impl Stream {
    /// Opens the target and starts the thread. `faces` is for files that others can read on their own.
    ///
    /// # Errors
    /// The target cannot be opened.
    pub fn start(
        spec: StreamSpec,
        vertex_count: usize,
        component_count: usize,
        faces: &[[u32; 3]],
    ) -> Result<Self, Report> {
        let mut sink = Sink::open(&spec, vertex_count, faces)?;
        let (give_back, empty) = bounded(BUFFERS);
        let (full, filled) = bounded::<Shape>(BUFFERS);
        for _ in 0..BUFFERS {
            let shape = Shape {
                positions: vec![[0.0; 3]; if spec.wants_positions() { vertex_count } else { 0 }],
                weights: vec![0.0; component_count],
                ..Shape::default()
            };
            // There is room for all of them.
            let _ = give_back.try_send(shape);
        }
        let health = Arc::new(Mutex::new(Health::default()));
        let told = Arc::clone(&health);
        let thread = thread::Builder::new().name("sinew-stream".to_owned()).spawn(move || {
            let tell = |outcome: Result<(), String>, ends: bool| -> bool {
                let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
                told.fails = outcome.is_err();
                if let Err(message) = outcome {
                    told.lost += 1;
                    told.last = Some(message);
                    told.ended = ends;
                }
                told.ended
            };
            for shape in &filled {
                if tell(sink.write(&shape), sink.ends_with_a_fault()) {
                    return;
                }
                let _ = give_back.try_send(shape);
            }
            if let Err(message) = sink.finish() {
                tell(Err(message), true);
            }
        });
        let thread = thread.map_err(|error| miette::miette!("no thread for the stream {spec}: {error}"))?;
        Ok(Self {
            spec,
            empty,
            full: Some(full),
            thread: Some(thread),
            health,
            sent: 0,
            dropped: 0,
        })
    }

    /// Hands a frame over, or leaves it out if the thread is behind. With `wait` none is left out.
    pub fn offer(&mut self, frame: u64, at_us: u64, positions: &[[f32; 3]], weights: &[f32], wait: bool) {
        let buffer = if wait {
            self.empty.recv().ok()
        } else {
            self.empty.try_recv().ok()
        };
        let (Some(mut shape), Some(full)) = (buffer, &self.full) else {
            self.dropped += 1;
            return;
        };
        (shape.frame, shape.at_us) = (frame, at_us);
        if !shape.positions.is_empty() {
            shape.positions.copy_from_slice(positions);
        }
        shape.weights.copy_from_slice(weights);
        match full.try_send(shape) {
            Ok(()) => self.sent += 1,
            Err(_) => self.dropped += 1,
        }
    }

    /// What is wrong with it now, in words.
    pub fn trouble(&self) -> Option<String> {
        let health = self.health();
        let why = health.last.as_deref().unwrap_or_default();
        match (health.ended, health.fails) {
            (true, _) => Some(format!("a stream ended: {why}")),
            (false, true) => Some(format!("the stream {} fails: {why}", self.spec)),
            (false, false) => None,
        }
    }

    fn health(&self) -> Health {
        self.health.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Frames left out.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Writes what waits and ends.
    pub fn finish(mut self) -> StreamSummary {
        self.end();
        let Health { lost, last, ended, .. } = self.health();
        StreamSummary {
            name: self.spec.to_string(),
            sent: self.sent,
            dropped: self.dropped,
            lost,
            last,
            ended,
        }
    }

    fn end(&mut self) {
        self.full = None;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            let mut health = self.health.lock().unwrap_or_else(PoisonError::into_inner);
            (health.ended, health.last) = (true, Some("its thread failed".to_owned()));
        }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.end();
    }
}

impl core::fmt::Display for StreamSummary {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(out, "stream {}: {}", self.name, count(self.sent, "frame"))?;
        if self.dropped > 0 {
            write!(out, ", {} left out because it was behind", self.dropped)?;
        }
        let last = self.last.as_deref().unwrap_or_default();
        if self.ended {
            write!(out, "; ended early: {last}")
        } else if self.lost > 0 {
            write!(
                out,
                "; {} could not be written, the last: {last}",
                count(self.lost, "frame")
            )
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests;
