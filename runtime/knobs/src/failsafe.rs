//! What happens when a device vanishes, falls silent, freezes or floods, and the way back to rest. The clock is an argument.

/// How a surface behaves when its device does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Failsafe {
    /// How long an unplugged device's pose is held before it eases to rest, µs; `None`: for ever. Default 5 s.
    pub ease_after_us: Option<u64>,
    /// How long the way to rest takes, µs. Default 2 s.
    pub ease_us: u64,
    /// For a device that sends all the time: silent for this long, it counts as unplugged, µs. Default `None`: a device that
    /// speaks only when turned is never too silent.
    pub silence_us: Option<u64>,
    /// Readings of noisy knobs that stay exactly alike for this long are a frozen device's, µs; it is reported, and its pose
    /// holds anyway. Default 30 s.
    pub frozen_us: Option<u64>,
    /// More events a second than this are a flood; it is reported, and the newest value still wins. Default 20,000.
    pub flood_per_second: u32,
}

impl Default for Failsafe {
    fn default() -> Self {
        Self {
            ease_after_us: Some(5_000_000),
            ease_us: 2_000_000,
            silence_us: None,
            frozen_us: Some(30_000_000),
            flood_per_second: 20_000,
        }
    }
}

/// How the device is doing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Health {
    /// Gone: said to be unplugged, or silent too long.
    pub lost: bool,
    /// Of that: silent too long, though nobody said unplugged.
    pub silent: bool,
    /// Sends, but its noisy knobs do not tremble any more.
    pub frozen: bool,
    /// Sends more than it should.
    pub flooding: bool,
}

/// Counts of a surface since it was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SurfaceStatus {
    /// Events taken.
    pub events: u64,
    /// Of those: from addresses that no knob and no button of the map has.
    pub unlisted: u64,
    /// Of those: impossible readings, over their full scale; ignored.
    pub invalid: u64,
    /// Readings that the spike guard threw away.
    pub spikes: u64,
    /// Times the device was lost.
    pub losses: u64,
    /// When the last event came, µs.
    pub last_event_us: Option<u64>,
    /// How the device is doing.
    pub health: Health,
}

/// Watches the rate and the gaps of events.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Watch {
    pub(crate) last_event_us: Option<u64>,
    second: u64,
    in_second: u32,
    flooding: bool,
}

impl Watch {
    pub(crate) fn event(&mut self, now_us: u64, failsafe: &Failsafe) {
        self.last_event_us = Some(now_us);
        self.advance(now_us, failsafe);
        self.in_second = self.in_second.saturating_add(1);
        self.flooding |= self.in_second > failsafe.flood_per_second;
    }

    /// Returns whether the device floods: until a whole second has passed without.
    pub(crate) fn advance(&mut self, now_us: u64, failsafe: &Failsafe) -> bool {
        let second = now_us / 1_000_000;
        if second != self.second {
            self.flooding = self.in_second > failsafe.flood_per_second && second == self.second.wrapping_add(1);
            (self.second, self.in_second) = (second, 0);
        }
        self.flooding
    }

    pub(crate) fn is_silent(&self, now_us: u64, failsafe: &Failsafe) -> bool {
        match (self.last_event_us, failsafe.silence_us) {
            (Some(last), Some(limit)) => now_us.saturating_sub(last) > limit,
            _ => false,
        }
    }
}

/// The way to rest, as a factor a frame on every weight, so that it needs no memory of where each began.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ease {
    since_us: u64,
    left: f32,
}

impl Ease {
    pub(crate) fn start(now_us: u64) -> Self {
        Self {
            since_us: now_us,
            left: 1.0,
        }
    }

    /// What to multiply the weights by this frame; 0 once the time is up. Smooth at both ends.
    pub(crate) fn factor(&mut self, now_us: u64, duration_us: u64) -> f32 {
        let passed = now_us.saturating_sub(self.since_us);
        if passed >= duration_us {
            self.left = 0.0;
            return 0.0;
        }
        let t = (passed as f64 / duration_us as f64) as f32;
        let left = (1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t);
        let factor = if self.left > 0.0 {
            (left / self.left).min(1.0)
        } else {
            0.0
        };
        self.left = left;
        factor
    }

    pub(crate) fn is_over(&self) -> bool {
        self.left == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn easing_is_smooth_ends_exactly_and_does_not_depend_on_the_frames() {
        let at = |frame_us: u64, until_us: u64| {
            let mut ease = Ease::start(0);
            let mut weight = 0.8_f32;
            for n in 1..=until_us / frame_us {
                let next = weight * ease.factor(n * frame_us, 2_000_000);
                assert!(next <= weight);
                weight = next;
            }
            weight
        };
        let half = at(1_000, 1_000_000);
        assert!((half - 0.4).abs() < 1e-4, "{half}");
        for frame_us in [4_000, 20_000, 50_000] {
            assert!((at(frame_us, 1_000_000) - half).abs() < 1e-4);
            assert_eq!(at(frame_us, 2_000_000), 0.0);
        }
        assert_eq!(Ease::start(5).factor(5, 0), 0.0, "no time: at once");
    }

    #[test]
    fn a_flood_is_seen_and_passes() {
        let failsafe = Failsafe {
            flood_per_second: 100,
            ..Failsafe::default()
        };
        let mut watch = Watch::default();
        for n in 0..100 {
            watch.event(n, &failsafe);
        }
        assert!(!watch.advance(100, &failsafe));
        watch.event(101, &failsafe);
        assert!(watch.advance(200, &failsafe));
        assert!(watch.advance(1_500_000, &failsafe), "the second before was one");
        assert!(!watch.advance(2_500_000, &failsafe));
    }

    #[test]
    fn silence_matters_only_where_a_stream_is_expected() {
        let mut watch = Watch::default();
        let streaming = Failsafe {
            silence_us: Some(1_000_000),
            ..Failsafe::default()
        };
        assert!(!watch.is_silent(u64::MAX, &streaming), "never heard");
        watch.event(0, &streaming);
        assert!(!watch.is_silent(1_000_000, &streaming));
        assert!(watch.is_silent(1_000_001, &streaming));
        assert!(!watch.is_silent(u64::MAX, &Failsafe::default()));
    }
}
