//! What is added to positions after the solve, linear in the weights: loose pieces that move as a whole, and the modes of a
//! residual. Zero at rest, so rest stays exact.

use sinew_formats::package::{After, NO_PIECE, limits};

use crate::simd::generic::solve::Xyz0;

/// What is added in one pose.
#[derive(Debug)]
pub(crate) struct Added<'w> {
    /// How far each loose piece is from where the solve leaves it. Shape: `[P]`.
    pieces: &'w mut [[f32; 3]],
    /// What a unit of each mode's whole numbers counts; zero beyond the last mode.
    modes: [f32; limits::MODES],
}

impl<'w> Added<'w> {
    /// At rest. Shape: `pieces` `[P]`.
    pub(crate) fn at_rest(pieces: &'w mut [[f32; 3]]) -> Self {
        pieces.fill([0.0; 3]);
        Self {
            pieces,
            modes: [0.0; limits::MODES],
        }
    }

    /// Back to rest.
    pub(crate) fn rest(&mut self) {
        self.pieces.fill([0.0; 3]);
        self.modes = [0.0; limits::MODES];
    }

    /// Brings it to `weights` `[K]`.
    pub(crate) fn update(&mut self, after: &After<'_>, weights: &[f32]) {
        self.rest();
        if !self.pieces.is_empty() {
            for (&weight, offsets) in weights.iter().zip(after.piece_offsets.chunks_exact(self.pieces.len())) {
                if weight != 0.0 {
                    for (piece, offset) in self.pieces.iter_mut().zip(offsets) {
                        for c in 0..3 {
                            piece[c] += weight * offset[c];
                        }
                    }
                }
            }
        }
        let rows = after.mix.chunks_exact(weights.len()).zip(after.mode_scales);
        for (mode, (mix, scale)) in self.modes.iter_mut().zip(rows) {
            *mode = scale
                * mix
                    .iter()
                    .zip(weights)
                    .map(|(share, weight)| share * weight)
                    .sum::<f32>();
        }
    }

    /// What is added at one slot.
    pub(crate) fn at(&self, after: &After<'_>, slot: usize) -> [f32; 3] {
        let mut sum = match after.piece_of.get(slot) {
            Some(&piece) if piece != NO_PIECE => self.pieces[usize::from(piece)],
            _ => [0.0; 3],
        };
        let count = after.mode_count();
        if let Some(modes) = after.modes.get(slot * count..(slot + 1) * count) {
            for (share, mode) in self.modes.iter().zip(modes) {
                for c in 0..3 {
                    sum[c] += share * f32::from(mode[c]);
                }
            }
        }
        sum
    }

    /// Adds it to all positions. Shape: `posed` `[V]`, slots.
    pub(crate) fn apply(&self, after: &After<'_>, posed: &mut [Xyz0]) {
        if after.is_empty() {
            return;
        }
        for (slot, posed) in posed.iter_mut().enumerate() {
            let sum = self.at(after, slot);
            for c in 0..3 {
                posed[c] += sum[c];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AFTER: After<'_> = After {
        piece_of: &[NO_PIECE, 1, 0],
        piece_offsets: &[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 4.0]],
        mix: &[1.0, -0.5],
        modes: &[[2, 0, 0], [0, -4, 0], [0, 0, 8]],
        mode_scales: &[0.25],
    };

    #[test]
    fn pieces_and_modes_follow_the_weights() {
        let mut pieces = [[9.0; 3]; 2];
        let mut added = Added::at_rest(&mut pieces);
        let mut posed = [[1.0, 1.0, 1.0, 0.0]; 3];
        added.apply(&AFTER, &mut posed);
        assert_eq!(posed, [[1.0, 1.0, 1.0, 0.0]; 3], "rest is exact");
        added.update(&AFTER, &[2.0, 1.0]);
        added.apply(&AFTER, &mut posed);
        // Mode: 0.25 (2 - 0.5). Piece 0: 2 (1, 0, 0) + (0.5, 0, 0); piece 1: 2 (0, 2, 0) + (0, 0, 4).
        assert_eq!(posed[0], [1.75, 1.0, 1.0, 0.0]);
        assert_eq!(posed[1], [1.0, 3.5, 5.0, 0.0]);
        assert_eq!(posed[2], [3.5, 1.0, 4.0, 0.0]);
        for slot in 0..3 {
            let (one, two) = (AFTER.derivative(2, 0, slot), AFTER.derivative(2, 1, slot));
            let sum: [f32; 3] = core::array::from_fn(|c| 2.0 * one[c] + two[c]);
            assert_eq!(added.at(&AFTER, slot), sum);
        }
        added.rest();
        assert_eq!(added.at(&AFTER, 1), [0.0; 3]);
    }
}
