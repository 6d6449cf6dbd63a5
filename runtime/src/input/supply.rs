//! A supply that sags: potentiometers fed from a weak rail all read low by one factor, while the converter's reference stays.
//! Finds that factor from knobs that nobody turns, so that the mesh does not bow when the lights come on.
//!
//! A drop counts as the supply's only if it shows in the same ratio on at least [`AGREEING_KNOBS`] knobs at different
//! heights, three quarters of those that can tell, against where they stood still before. Hands that move several knobs at
//! once move them by like amounts, not in like ratio: amounts alike give drops that differ as the heights do, by
//! [`SPREAD`], and drops count as alike within [`ALIKE`]. So a drop is seen once it is ten times the noise, and one slower
//! than [`STILL_US`] a noise width is taken for drift; calibration says how far to widen the range for that.

use libm::fabsf;

/// Knobs that must agree.
pub const AGREEING_KNOBS: usize = 3;
/// Drops count as alike when they differ by less than this part of themselves.
pub const ALIKE: f32 = 0.1;
/// A change of the factor smaller than this is left alone.
const TOLERANCE: f32 = 0.005;
/// A knob stands where it stood this long, µs.
pub const STILL_US: u64 = 500_000;
/// Knobs that stand lower than this share of the full scale cannot tell a ratio from noise.
const LOWEST_WITNESS: f32 = 0.25;
/// Highest over lowest of the agreeing knobs: at one height a ratio is no more than an amount.
pub const SPREAD: f32 = 1.25;
/// Factors believed.
const FACTORS: core::ops::RangeInclusive<f32> = 0.5..=1.2;
/// Knobs looked at.
const WITNESSES: usize = 64;

/// One knob as a witness of the supply.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Witness {
    /// What it would read at full supply where it stood still, share of the full scale.
    left_at: f32,
    seen: bool,
    /// What it would read where it stands now, and since when.
    recent: f32,
    since_us: u64,
}

/// The supply, as the knobs show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supply {
    factor: f32,
}

impl Default for Supply {
    fn default() -> Self {
        Self { factor: 1.0 }
    }
}

impl Supply {
    /// Supply over supply at the start: 0.8 when a rail went from 5 V to 4 V.
    pub fn factor(&self) -> f32 {
        self.factor
    }

    /// Takes what the knobs read now, `(witness, share of the full scale)`, once each; returns the factor.
    pub fn update<'w>(&mut self, now_us: u64, knobs: impl Iterator<Item = (&'w mut Witness, f32)>) -> f32 {
        let mut seen: [Option<(&mut Witness, f32)>; WITNESSES] = [const { None }; WITNESSES];
        let mut count = 0;
        for knob in knobs.take(WITNESSES) {
            seen[count] = Some(knob);
            count += 1;
        }
        let ratio = |knob: &Option<(&mut Witness, f32)>| {
            let (witness, reading) = knob.as_ref()?;
            (witness.left_at >= LOWEST_WITNESS).then(|| (reading / witness.left_at, witness.left_at))
        };
        let candidates = seen[..count].iter().filter_map(ratio).count();
        let mut best = (0, 1.0);
        for (pivot, _) in seen[..count].iter().filter_map(ratio) {
            let (mut agreeing, mut sum, mut low, mut high) = (0, 0.0, f32::MAX, 0.0_f32);
            for (other, height) in seen[..count].iter().filter_map(ratio) {
                if fabsf(other - pivot) <= ALIKE * fabsf(pivot - self.factor) {
                    agreeing += 1;
                    sum += other;
                    low = low.min(height);
                    high = high.max(height);
                }
            }
            if agreeing > best.0 && high >= SPREAD * low {
                best = (agreeing, sum / agreeing as f32);
            }
        }
        let (agreeing, found) = best;
        let believed = agreeing >= AGREEING_KNOBS && 4 * agreeing >= 3 * candidates && FACTORS.contains(&found);
        if believed && fabsf(found - self.factor) > TOLERANCE {
            self.factor = found;
        }
        for (witness, reading) in seen[..count].iter_mut().flatten() {
            let full = *reading / self.factor;
            if fabsf(full - witness.recent) > TOLERANCE {
                (witness.recent, witness.since_us) = (full, now_us);
            }
            if !witness.seen || now_us.saturating_sub(witness.since_us) >= STILL_US {
                witness.left_at = witness.recent;
            }
            witness.seen = true;
        }
        self.factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEIGHTS: [f32; 8] = [0.9, 0.5, 0.3, 1.0, 0.7, 0.1, 0.0, 0.62];

    struct Box<const N: usize> {
        supply: Supply,
        witnesses: [Witness; N],
        now_us: u64,
    }

    impl<const N: usize> Box<N> {
        /// A box whose knobs have stood for a second.
        fn resting(readings: [f32; N]) -> Self {
            let mut this = Self {
                supply: Supply::default(),
                witnesses: [Witness::default(); N],
                now_us: 0,
            };
            for _ in 0..60 {
                this.read(readings);
            }
            this
        }

        fn read(&mut self, readings: [f32; N]) -> f32 {
            self.now_us += 16_667;
            self.supply.update(self.now_us, self.witnesses.iter_mut().zip(readings))
        }
    }

    #[test]
    fn a_rail_that_sags_and_comes_back_is_followed() {
        let mut knobs = Box::resting(HEIGHTS);
        // Down to four fifths over 40 frames, then back at once.
        for n in 1..=40 {
            let rail = 1.0 - 0.2 * n as f32 / 40.0;
            let factor = knobs.read(HEIGHTS.map(|h| h * rail));
            assert!(fabsf(factor - rail) <= 2.0 * TOLERANCE, "{factor} {rail}");
        }
        let factor = knobs.read(HEIGHTS);
        assert!(fabsf(factor - 1.0) <= TOLERANCE, "{factor}");
    }

    #[test]
    fn one_hand_is_not_the_supply_and_does_not_hide_it() {
        let mut readings = HEIGHTS;
        let mut knobs = Box::resting(HEIGHTS);
        for n in 0..50 {
            readings[0] = 0.9 - 0.01 * n as f32;
            assert_eq!(knobs.read(readings), 1.0);
        }
        readings = readings.map(|r| 0.9 * r);
        readings[0] = 0.2;
        let factor = knobs.read(readings);
        assert!(fabsf(factor - 0.9) <= TOLERANCE, "{factor}");
    }

    #[test]
    fn a_flat_hand_on_all_faders_is_not_the_supply() {
        for start in [[1.0; 4], [1.0, 0.8, 0.6, 0.9]] {
            let mut knobs = Box::resting(start);
            for n in 1..50 {
                let pulled = start.map(|h: f32| (h - 0.01 * n as f32).max(0.0));
                assert_eq!(knobs.read(pulled), 1.0, "{start:?} {n}");
            }
        }
    }

    #[test]
    fn two_knobs_are_too_few() {
        let mut knobs = Box::resting([0.9, 0.5]);
        assert_eq!(knobs.read([0.81, 0.45]), 1.0);
    }
}
