//! Weights by Gauss-Newton on positions, through the runtime's decode and solve and its exact derivative (method section
//! 3, number 3).

use nalgebra::{DMatrix, DVector};

use super::{
    descent::{DescentSettings, LeastSquares, NormalEquations, descend},
    player::{PlayError, Player},
};
use crate::features::align::{RigidMotion, widened};
use crate::features::rigid::{remove_directions, rigid_directions};

/// A few steps; the first two bring most of the gain.
const DESCENT: DescentSettings = DescentSettings {
    step_limit: 5,
    ridge: 1e-4,
    least_gain: 1e-3,
};

/// Values summed in f32 before they join the f64 total: keeps the K^2 V products fast and their sums good to six digits.
const CHUNK: usize = 512;

/// Weights that bring the played positions nearest to `target`, up to a rigid motion, from `start` (the feature
/// projection's). Shapes: `target` `[V]`, source order, units of the source; `start` `[K]`. Weights are not clamped.
/// Errors: those of [`Player::play`] at `start`.
pub fn project_positions(player: &mut Player<'_>, target: &[[f32; 3]], start: Vec<f64>) -> Result<Vec<f64>, PlayError> {
    // A start beyond f32 is an error; a step beyond it is merely refused.
    player.play(&start)?;
    descend(
        &mut PositionMisfit {
            player,
            target: widened(target),
        },
        start,
        &DESCENT,
    )
}

/// Squared distance of played positions from those of one shape, after rigid alignment.
struct PositionMisfit<'m, 'p> {
    player: &'m mut Player<'p>,
    target: Vec<[f64; 3]>,
}

impl PositionMisfit<'_, '_> {
    /// Played positions, and what separates them from the target laid onto them.
    fn residual(&mut self, weights: &[f64]) -> Result<(Vec<[f64; 3]>, Vec<[f64; 3]>), PlayError> {
        let played = widened(self.player.play(weights)?);
        let motion = RigidMotion::onto(&played, &self.target);
        let residual = self.target.iter().zip(&played).map(|(&target, played)| {
            let aligned = motion.apply(target);
            core::array::from_fn(|c| aligned[c] - played[c])
        });
        Ok((residual.collect(), played))
    }
}

impl LeastSquares for PositionMisfit<'_, '_> {
    type Error = PlayError;

    fn cost(&mut self, weights: &[f64]) -> Result<f64, PlayError> {
        match self.residual(weights) {
            Ok((residual, _)) => Ok(residual.as_flattened().iter().map(|x| x * x).sum()),
            Err(error) if error.is_overflow() => Ok(f64::INFINITY),
            Err(error) => Err(error),
        }
    }

    fn linearise(&mut self, weights: &[f64]) -> Result<NormalEquations, PlayError> {
        let (residual, played) = self.residual(weights)?;
        let rigid = rigid_directions(&played);
        let mut columns = Vec::with_capacity(weights.len());
        for k in 0..weights.len() {
            let mut column = vec![[0.0_f32; 3]; played.len()];
            self.player.differentiate(k, &mut column)?;
            remove_directions(&rigid, &mut column, |x| x as f32);
            columns.push(column);
        }
        let right_hand_side = DVector::from_iterator(
            columns.len(),
            columns.iter().map(|column| {
                let values = column.as_flattened().iter().zip(residual.as_flattened());
                values.map(|(&j, r)| f64::from(j) * r).sum::<f64>()
            }),
        );
        Ok(NormalEquations {
            matrix: gram_matrix(&columns),
            right_hand_side,
        })
    }
}

/// `J^T J`, lower triangle. Chunk by chunk, so that a chunk of all columns stays in cache.
pub fn gram_matrix(columns: &[Vec<[f32; 3]>]) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(columns.len(), columns.len());
    let row_count = columns.first().map_or(0, |column| column.as_flattened().len());
    for first in (0..row_count).step_by(CHUNK) {
        let rows = first..row_count.min(first + CHUNK);
        for k in 0..columns.len() {
            let left = &columns[k].as_flattened()[rows.clone()];
            for l in 0..=k {
                matrix[(k, l)] += f64::from(dot_f32(left, &columns[l].as_flattened()[rows.clone()]));
            }
        }
    }
    matrix
}

/// Eight running sums, so that the compiler may use vector registers; the order of summation is fixed.
fn dot_f32(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    let (a_lanes, b_lanes) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f32 = a_lanes
        .remainder()
        .iter()
        .zip(b_lanes.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a_lanes.zip(b_lanes) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f32>() + tail
}
