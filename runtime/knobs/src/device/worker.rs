//! The life of a reader thread: it is asked to stop and is waited for when its source is dropped.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::string::String;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use crossbeam::sync::{Parker, Unparker};

/// A running thread. Dropping it ends the thread within one timeout of its port.
#[derive(Debug)]
pub(super) struct Worker {
    stop: Arc<AtomicBool>,
    waker: Unparker,
    thread: Option<JoinHandle<()>>,
}

/// How a thread learns that it shall stop.
pub(super) struct Halt {
    stop: Arc<AtomicBool>,
    parker: Parker,
}

impl Halt {
    pub(super) fn asked(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Sleeps; wakes at once when the thread shall stop.
    pub(super) fn sleep(&self, time: Duration) {
        if !self.asked() {
            self.parker.park_timeout(time);
        }
    }
}

impl Worker {
    /// Starts a thread; `body` must look at its [`Halt`] every few milliseconds.
    pub(super) fn start(name: &str, body: impl FnOnce(Halt) + Send + 'static) -> io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let parker = Parker::new();
        let waker = parker.unparker().clone();
        let halt = Halt {
            stop: stop.clone(),
            parker,
        };
        let thread = Builder::new().name(String::from(name)).spawn(move || body(halt))?;
        Ok(Self {
            stop,
            waker,
            thread: Some(thread),
        })
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.waker.unpark();
        if let Some(thread) = self.thread.take() {
            // A panic in it has been printed already, and there is nothing left to save.
            let _ = thread.join();
        }
    }
}
