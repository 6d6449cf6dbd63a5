//! What is added to positions after the solve, linear in the weights and zero at rest: loose pieces that move as a whole, and
//! a residual of a few modes over all vertices. In both kinds of package: points are vertices in source order in a compact
//! one, slots in a baked one. Written by the trainer, laid out in slots by the baker, played by the runtime.

use rkyv::{Archive, Serialize, with::InlineAsBox};

use super::archive::native;

/// Stands in [`After::piece_of`] where a point belongs to no loose piece.
pub const NO_PIECE: u16 = u16::MAX;

/// V points, K components, P loose pieces, R modes; P and R may be 0.
#[derive(Archive, Serialize, Debug, Clone, Copy, Default, PartialEq)]
pub struct After<'a> {
    /// The piece that a point belongs to, < P, or [`NO_PIECE`]. Shape: `[V]`; empty where P = 0.
    #[rkyv(with = InlineAsBox)]
    pub piece_of: &'a [u16],
    /// How far a piece moves a unit of weight, units of the source. Shape: `[K][P]`.
    #[rkyv(with = InlineAsBox)]
    pub piece_offsets: &'a [[f32; 3]],
    /// How much of a mode a unit of weight adds. Shape: `[R][K]`.
    #[rkyv(with = InlineAsBox)]
    pub mix: &'a [f32],
    /// Whole numbers, times the mode's scale. Shape: `[V][R]`.
    #[rkyv(with = InlineAsBox)]
    pub modes: &'a [[i16; 3]],
    /// Units of the source. Shape: `[R]`, positive.
    #[rkyv(with = InlineAsBox)]
    pub mode_scales: &'a [f32],
}

impl<'a> After<'a> {
    /// Of a package that adds nothing.
    pub const NONE: After<'static> = After {
        piece_of: &[],
        piece_offsets: &[],
        mix: &[],
        modes: &[],
        mode_scales: &[],
    };

    pub(super) fn view(archived: &'a ArchivedAfter<'static>) -> Self {
        Self {
            piece_of: native(&archived.piece_of),
            piece_offsets: native(&archived.piece_offsets),
            mix: native(&archived.mix),
            modes: native(&archived.modes),
            mode_scales: native(&archived.mode_scales),
        }
    }

    /// P, in a package of `component_count` components.
    pub fn piece_count(&self, component_count: usize) -> usize {
        self.piece_offsets.len() / component_count.max(1)
    }

    /// R.
    pub fn mode_count(&self) -> usize {
        self.mode_scales.len()
    }

    /// What a unit of component `k`'s weight adds to one point, units of the source. `k` < `component_count`, `point` < V.
    pub fn derivative(&self, component_count: usize, k: usize, point: usize) -> [f32; 3] {
        let mut sum = match self.piece_of.get(point) {
            Some(&piece) if piece != NO_PIECE => {
                self.piece_offsets[k * self.piece_count(component_count) + usize::from(piece)]
            }
            _ => [0.0; 3],
        };
        for (m, &scale) in self.mode_scales.iter().enumerate() {
            let share = self.mix[m * component_count + k] * scale;
            let mode = self.modes[point * self.mode_count() + m];
            for c in 0..3 {
                sum[c] += share * f32::from(mode[c]);
            }
        }
        sum
    }

    /// Whether nothing is added.
    pub fn is_empty(&self) -> bool {
        self.piece_of.is_empty() && self.mode_scales.is_empty()
    }
}

/// What is known of the weights before anything is held: a normal distribution, of full covariance `factors^T factors +
/// diagonal(variances)`. Of r factors, at most [`super::limits::PRIOR_FACTORS`]. All empty, and strength 0, where nothing is known.
#[derive(Archive, Serialize, Debug, Clone, Copy, Default, PartialEq)]
pub struct Prior<'a> {
    /// Shape: `[K]`, or empty.
    #[rkyv(with = InlineAsBox)]
    pub mean: &'a [f32],
    /// Shape: `[r][K]`.
    #[rkyv(with = InlineAsBox)]
    pub factors: &'a [f32],
    /// Of what the factors leave. Shape: `[K]`, positive; or empty.
    #[rkyv(with = InlineAsBox)]
    pub variances: &'a [f32],
    /// What one squared deviation counts against a squared misfit in shares of the bounding box' diagonal; at least 0.
    pub strength: f32,
}

impl<'a> Prior<'a> {
    /// Of a package that knows nothing.
    pub const NONE: Prior<'static> = Prior {
        mean: &[],
        factors: &[],
        variances: &[],
        strength: 0.0,
    };

    pub(super) fn view(archived: &'a ArchivedPrior<'static>) -> Self {
        Self {
            mean: native(&archived.mean),
            factors: native(&archived.factors),
            variances: native(&archived.variances),
            strength: archived.strength.to_native(),
        }
    }
}
