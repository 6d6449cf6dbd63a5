//! Frames at an even rate: sleeps until each is due, and leaves out those that a slow frame took the time of.

use core::time::Duration;
use std::thread;

use sinew_knobs::device::Clock;

/// When frames are due.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    clock: Clock,
    frame_us: u64,
    due_us: u64,
    missed: u64,
}

impl Pace {
    /// The first frame is due now. `fps` is at least 1.
    pub fn new(clock: Clock, fps: f64) -> Self {
        Self {
            clock,
            frame_us: (1e6 / fps.max(1.0)).round() as u64,
            due_us: clock.now_us(),
            missed: 0,
        }
    }

    /// Sleeps until the next frame is due.
    pub fn wait(&mut self) {
        let now_us = self.clock.now_us();
        let late_us = now_us.saturating_sub(self.due_us);
        if late_us > self.frame_us {
            let missed = late_us / self.frame_us;
            self.missed += missed;
            self.due_us += missed * self.frame_us;
        }
        thread::sleep(Duration::from_micros(self.due_us.saturating_sub(now_us)));
        self.due_us += self.frame_us;
    }

    /// Frames that were left out.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_at_their_times_and_a_slow_one_costs_only_what_it_took() {
        let clock = Clock::start();
        let mut pace = Pace::new(clock, 200.0);
        for _ in 0..11 {
            pace.wait();
        }
        assert!(clock.now_us() >= 50_000, "ten frames of 5 ms after the first");
        let before = pace.missed();
        thread::sleep(Duration::from_millis(40));
        pace.wait();
        assert!(pace.missed() >= before + 6, "{} after {before}", pace.missed());
        let after_stall = clock.now_us();
        pace.wait();
        pace.wait();
        assert!(clock.now_us() >= after_stall + 4_000, "no burst to catch up");
    }
}
