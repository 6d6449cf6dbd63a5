//! Where the moving mesh goes: OBJ files, raw floats, UDP. Each stream has a thread and three buffers, so that a slow disk or a
//! slow reader costs the stream frames and the performance nothing. Layouts are in `docs/streams.md`.

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
    fault: Arc<Mutex<Option<String>>>,
    sent: u64,
    dropped: u64,
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
    /// Why it ended early.
    pub fault: Option<String>,
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
        let fault = Arc::new(Mutex::new(None));
        let told = Arc::clone(&fault);
        let thread = thread::Builder::new().name("sinew-stream".to_owned()).spawn(move || {
            let mut run = || -> Result<(), String> {
                for shape in &filled {
                    sink.write(&shape)?;
                    let _ = give_back.try_send(shape);
                }
                sink.finish()
            };
            if let Err(message) = run() {
                *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
            }
        });
        let thread = thread.map_err(|error| miette::miette!("no thread for the stream {spec}: {error}"))?;
        Ok(Self {
            spec,
            empty,
            full: Some(full),
            thread: Some(thread),
            fault,
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

    /// Why it ended, if it did.
    pub fn fault(&self) -> Option<String> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Frames left out.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Writes what waits and ends.
    pub fn finish(mut self) -> StreamSummary {
        self.end();
        StreamSummary {
            name: self.spec.to_string(),
            sent: self.sent,
            dropped: self.dropped,
            fault: self.fault(),
        }
    }

    fn end(&mut self) {
        self.full = None;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            *self.fault.lock().unwrap_or_else(PoisonError::into_inner) = Some("its thread failed".to_owned());
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
        match &self.fault {
            Some(fault) => write!(out, "; ended early: {fault}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
