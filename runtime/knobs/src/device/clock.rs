//! The clock of a show: events of every source, the surface and a take are stamped by one, so that their times compare.

use std::time::Instant;

/// Microseconds since an origin. A copy is the same clock.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    origin: Instant,
}

impl Clock {
    /// A clock that reads 0 now.
    pub fn start() -> Self {
        Self::since(Instant::now())
    }

    /// A clock that read 0 at `origin`, for programs that have a clock already. Before its origin it reads 0.
    pub const fn since(origin: Instant) -> Self {
        Self { origin }
    }

    /// Time since the origin, µs. Never runs back.
    pub fn now_us(&self) -> u64 {
        self.origin.elapsed().as_micros() as u64
    }
}
