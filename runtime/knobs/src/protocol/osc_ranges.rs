//! What OSC cannot say of its floats: from where to where they go. The caller's settings for [`super::osc`].

use super::names::hash;

/// Addresses that may have a range of their own.
pub const OSC_RANGES_MAX: usize = 64;

/// Ranges of floats, `[lowest, highest]`: `[0, 1]` unless said otherwise. Trackers send `[-1, 1]` for gaze and for a mouth that goes
/// both ways.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OscRanges {
    all: [f32; 2],
    /// Hash of a whole name, and its range.
    own: [(u32, [f32; 2]); OSC_RANGES_MAX],
    count: usize,
}

impl OscRanges {
    /// All from 0 to 1.
    pub const fn new() -> Self {
        Self {
            all: [0.0, 1.0],
            own: [(0, [0.0, 1.0]); OSC_RANGES_MAX],
            count: 0,
        }
    }

    /// Sets the range of every address that has none of its own. Returns whether it is one: finite, the lower end below the upper.
    pub fn set_all(&mut self, range: [f32; 2]) -> bool {
        let is_range = is_range(range);
        if is_range {
            self.all = range;
        }
        is_range
    }

    /// Sets the range of one knob, by its name: `/gaze/x`, `/gaze#1`, `/VMC/Ext/Blend/Val/Joy`. Returns whether it is a range and
    /// there was room for it.
    pub fn set(&mut self, name: &str, range: [f32; 2]) -> bool {
        let key = hash(name.bytes());
        let known = self.own[..self.count].iter().position(|(own, _)| *own == key);
        let at = known.unwrap_or(self.count);
        let fits = is_range(range) && at < OSC_RANGES_MAX;
        if fits {
            self.own[at] = (key, range);
            self.count = self.count.max(at + 1);
        }
        fits
    }

    /// The share of its range that a value of the knob whose name is the parts in a row is; outside `[0, 1]` when it leaves it.
    pub(super) fn share(&self, parts: &[&[u8]], value: f32) -> f32 {
        let [low, high] = if self.count == 0 {
            self.all
        } else {
            let key = hash(parts.iter().flat_map(|part| part.iter().copied()));
            let own = self.own[..self.count].iter().find(|(own, _)| *own == key);
            own.map_or(self.all, |(_, range)| *range)
        };
        (value - low) / (high - low)
    }
}

impl Default for OscRanges {
    fn default() -> Self {
        Self::new()
    }
}

fn is_range([low, high]: [f32; 2]) -> bool {
    low < high && (high - low).is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn a_face_that_goes_both_ways_uses_its_whole_range() {
        let mut ranges = OscRanges::new();
        assert!(ranges.set("/gaze/x", [-1.0, 1.0]));
        assert_eq!(ranges.share(&[b"/gaze", b"/x"], -0.5), 0.25);
        assert_eq!(ranges.share(&[b"/jaw"], 0.25), 0.25);
        assert!(ranges.set_all([-2.0, 2.0]) && ranges.set("/gaze/x", [0.0, 2.0]));
        assert_eq!(
            (ranges.share(&[b"/jaw"], 0.0), ranges.share(&[b"/gaze/x"], 1.0)),
            (0.5, 0.5)
        );
        for wrong in [
            [1.0, 0.0],
            [0.0, 0.0],
            [0.0, f32::INFINITY],
            [f32::NAN, 1.0],
            [f32::MIN, f32::MAX],
        ] {
            assert!(!ranges.set("/jaw", wrong) && !ranges.set_all(wrong));
        }
        for n in 1..OSC_RANGES_MAX {
            assert!(ranges.set(&format!("/{n}"), [0.0, 1.0]));
        }
        assert!(!ranges.set("/one more", [0.0, 1.0]));
    }
}
