//! A checksum over the weights of every frame: what a take gave live and what its replay gives are equal exactly if these are.

use xxhash_rust::xxh3::Xxh3;

use crate::count::count;

/// Sums up frames.
pub struct WeightsChecksum {
    hash: Box<Xxh3>,
    frames: u64,
}

impl Default for WeightsChecksum {
    fn default() -> Self {
        Self {
            hash: Box::new(Xxh3::new()),
            frames: 0,
        }
    }
}

impl WeightsChecksum {
    /// Takes one frame's weights, by their bits.
    pub fn frame(&mut self, weights: &[f32]) {
        for weight in weights {
            self.hash.update(&weight.to_le_bytes());
        }
        self.frames += 1;
    }

    /// Frames taken.
    pub fn frames(&self) -> u64 {
        self.frames
    }
}

impl core::fmt::Debug for WeightsChecksum {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(out, "WeightsChecksum({self})")
    }
}

/// `120 frames, weights checksum 0123456789abcdef`.
impl core::fmt::Display for WeightsChecksum {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            out,
            "{}, weights checksum {:016x}",
            count(self.frames, "frame"),
            self.hash.digest()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_every_frame_counts() {
        let sum = |frames: &[&[f32]]| {
            let mut checksum = WeightsChecksum::default();
            frames.iter().for_each(|frame| checksum.frame(frame));
            checksum.to_string()
        };
        let one = sum(&[&[0.0, 1.0], &[0.5, 0.25]]);
        assert!(one.starts_with("2 frames, weights checksum "), "{one}");
        assert_eq!(one, sum(&[&[0.0, 1.0], &[0.5, 0.25]]));
        assert_ne!(one, sum(&[&[0.0, 1.0], &[0.5, f32::from_bits(0.25_f32.to_bits() + 1)]]));
        assert_ne!(one, sum(&[&[-0.0, 1.0], &[0.5, 0.25]]));
    }
}
