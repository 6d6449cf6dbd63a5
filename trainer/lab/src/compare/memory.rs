//! What a method's training takes: time, and peak memory, bytes held from the allocator, counted. A program that wants the figure installs
//! [`CountingAllocator`]; in any other, nothing is measured and nothing is said.
//!
//! Counted, not read off the process's resident set: what earlier methods freed stays resident or not as the C library
//! pleases, and would be charged to the next one.

use core::alloc::{GlobalAlloc, Layout};
use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::alloc::System;
use std::time::Instant;

/// Bytes held, and the most of them.
#[derive(Debug)]
struct Counts {
    held: AtomicUsize,
    most: AtomicUsize,
}

static COUNTS: Counts = Counts::none();

impl Counts {
    const fn none() -> Self {
        Self {
            held: AtomicUsize::new(0),
            most: AtomicUsize::new(0),
        }
    }

    fn grow(&self, bytes: usize) {
        let held = self.held.fetch_add(bytes, Relaxed) + bytes;
        // Mostly a read: the maximum is seldom met.
        if held > self.most.load(Relaxed) {
            self.most.fetch_max(held, Relaxed);
        }
    }

    fn shrink(&self, bytes: usize) {
        self.held.fetch_sub(bytes, Relaxed);
    }
}

/// The system's allocator, with a count of the bytes held.
#[derive(Debug, Clone, Copy, Default)]
pub struct CountingAllocator;

// SAFETY: every call goes to the system's allocator as it came, and so does its answer.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are the system's.
        let memory = unsafe { System.alloc(layout) };
        if !memory.is_null() {
            COUNTS.grow(layout.size());
        }
        memory
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        let memory = unsafe { System.alloc_zeroed(layout) };
        if !memory.is_null() {
            COUNTS.grow(layout.size());
        }
        memory
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) };
        COUNTS.shrink(layout.size());
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // SAFETY: as above.
        let moved = unsafe { System.realloc(memory, layout, new_size) };
        if !moved.is_null() {
            COUNTS.shrink(layout.size());
            COUNTS.grow(new_size);
        }
        moved
    }
}

/// Counts from here on, for the whole process: one at a time.
#[derive(Debug)]
struct PeakMemory {
    counts: &'static Counts,
    held: usize,
}

impl PeakMemory {
    fn begin() -> Self {
        Self::of(&COUNTS)
    }

    fn of(counts: &'static Counts) -> Self {
        let held = counts.held.load(Relaxed);
        counts.most.store(held, Relaxed);
        Self { counts, held }
    }

    /// The most bytes held at once beyond those at the beginning; `None` where nobody counts.
    fn bytes(&self) -> Option<usize> {
        (self.held > 0).then(|| self.counts.most.load(Relaxed).saturating_sub(self.held))
    }
}

/// What training took; nothing where it was done before.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cost {
    pub(super) seconds: Option<f64>,
    pub(super) peak_bytes: Option<usize>,
}

/// Measures what training takes from here on.
pub(super) struct Meter {
    begun: Instant,
    memory: PeakMemory,
}

impl Meter {
    pub(super) fn begin() -> Self {
        let memory = PeakMemory::begin();
        let begun = Instant::now();
        Self { begun, memory }
    }

    pub(super) fn cost(&self) -> Cost {
        Cost {
            seconds: Some(self.begun.elapsed().as_secs_f64()),
            peak_bytes: self.memory.bytes(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_the_most_that_is_held_at_once() {
        static OWN: Counts = Counts::none();
        assert_eq!(PeakMemory::of(&OWN).bytes(), None, "nobody counts");
        OWN.grow(100);
        let peak = PeakMemory::of(&OWN);
        OWN.grow(1000);
        OWN.grow(2000);
        OWN.shrink(2500);
        OWN.grow(500);
        assert_eq!(peak.bytes(), Some(3000));
        assert_eq!(PeakMemory::of(&OWN).bytes(), Some(0));
    }
}
