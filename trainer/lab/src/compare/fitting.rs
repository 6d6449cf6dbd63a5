//! Weights of unseen shapes: in positions (exactly for linear bases, by Gauss-Newton for the others), and from a few control
//! points. The same rules for every method.

use nalgebra::{DMatrix, DVector};

use crate::baselines::linear::{LinearBasis, LinearProjection};
use crate::baselines::model::{Handles, Model};
use sinew_trainer::evaluate::descent::{DescentSettings, LeastSquares, NormalEquations, descend};
use sinew_trainer::evaluate::gram_matrix;
use sinew_trainer::features::align::RigidMotion;
use sinew_trainer::features::rigid::{remove_directions, rigid_directions};

/// Turns of fitting weights and aligning anew; the misfit never grows, and two or three turns bring most.
const ALIGNING_TURNS: usize = 6;

/// As this project's own position projection.
const DESCENT: DescentSettings = DescentSettings {
    step_limit: 5,
    ridge: 1e-4,
    least_gain: 1e-3,
};

/// How exactly control points are to be met, as a share of the bounding box: beside it, weights are held near what training
/// saw.
pub(super) const HANDLE_NOISE: f64 = 2e-3;

/// A handful of steps; far handles turn much.
const HANDLE_DESCENT: DescentSettings = DescentSettings {
    step_limit: 12,
    ridge: 1e-6,
    least_gain: 1e-4,
};

/// Weights of a linear basis of positions that bring it nearest to `target` (`[V]`), up to a rigid motion.
pub fn project_linear(basis: &LinearBasis, projection: &LinearProjection<'_>, target: &[[f64; 3]]) -> Vec<f64> {
    let mut weights = projection.weights(target.as_flattened());
    for _ in 1..ALIGNING_TURNS {
        let posed = basis.compose(&weights);
        let motion = RigidMotion::onto(posed.as_chunks::<3>().0, target);
        let aligned: Vec<[f64; 3]> = target.iter().map(|&p| motion.apply(p)).collect();
        weights = projection.weights(aligned.as_flattened());
    }
    weights
}

/// Weights that bring a model nearest to `target` (`[V]`), up to a rigid motion, from `start` (`[K]`).
pub fn project_positions(model: &dyn Model, target: &[[f64; 3]], start: Vec<f64>) -> Vec<f64> {
    let Ok(weights) = descend(&mut PositionMisfit { model, target }, start, &DESCENT);
    weights
}

struct PositionMisfit<'m> {
    model: &'m dyn Model,
    target: &'m [[f64; 3]],
}

impl PositionMisfit<'_> {
    fn residual(&self, weights: &[f64]) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let posed = self.model.pose(weights);
        let motion = RigidMotion::onto(&posed, self.target);
        let residual = self.target.iter().zip(&posed).map(|(&target, posed)| {
            let aligned = motion.apply(target);
            core::array::from_fn(|c| aligned[c] - posed[c])
        });
        (residual.collect(), posed)
    }
}

impl LeastSquares for PositionMisfit<'_> {
    type Error = core::convert::Infallible;

    fn cost(&mut self, weights: &[f64]) -> Result<f64, Self::Error> {
        let (residual, _) = self.residual(weights);
        Ok(residual.as_flattened().iter().map(|x| x * x).sum())
    }

    fn linearise(&mut self, weights: &[f64]) -> Result<NormalEquations, Self::Error> {
        let (residual, posed) = self.residual(weights);
        let rigid = rigid_directions(&posed);
        let mut columns = self.model.tangents(weights);
        for column in &mut columns {
            remove_directions(&rigid, column, |x| x as f32);
        }
        let products = columns.iter().map(|column| {
            let values = column.as_flattened().iter().zip(residual.as_flattened());
            values.map(|(&j, r)| f64::from(j) * r).sum::<f64>()
        });
        Ok(NormalEquations {
            right_hand_side: DVector::from_iterator(columns.len(), products),
            matrix: gram_matrix(&columns),
        })
    }
}

/// Weights from the first control points alone: `targets` says where they are to go, up to a translation of all. Of the
/// weights that bring them there (to 0.2 % of the bounding box `diagonal`), the likeliest: `root` (`[K][S]`) times itself turned is
/// their second moments.
pub fn weights_from_handles(
    handles: &dyn Handles,
    targets: &[[f64; 3]],
    root: &DMatrix<f64>,
    diagonal: f64,
) -> Vec<f64> {
    let mut problem = HandleMisfit {
        handles,
        targets,
        root,
        noise: HANDLE_NOISE * diagonal,
    };
    let Ok(standard) = descend(&mut problem, vec![0.0; root.ncols()], &HANDLE_DESCENT);
    problem.weights(&standard)
}

/// Searched in S standard weights, of which the prior is a unit ball; L times those are the weights.
struct HandleMisfit<'h> {
    handles: &'h dyn Handles,
    targets: &'h [[f64; 3]],
    root: &'h DMatrix<f64>,
    noise: f64,
}

impl HandleMisfit<'_> {
    fn weights(&self, standard: &[f64]) -> Vec<f64> {
        (self.root * DVector::from_column_slice(standard))
            .iter()
            .copied()
            .collect()
    }

    fn residual(&self, standard: &[f64]) -> DVector<f64> {
        let count = self.targets.len();
        let positions = self.handles.positions(&self.weights(standard), count);
        let mut residual = DVector::from_fn(3 * count, |row, _| {
            (self.targets[row / 3][row % 3] - positions[row / 3][row % 3]) / self.noise
        });
        for c in 0..3 {
            let mean = (0..count).map(|h| residual[3 * h + c]).sum::<f64>() / count as f64;
            (0..count).for_each(|h| residual[3 * h + c] -= mean);
        }
        residual
    }
}

impl LeastSquares for HandleMisfit<'_> {
    type Error = core::convert::Infallible;

    fn cost(&mut self, standard: &[f64]) -> Result<f64, Self::Error> {
        Ok(self.residual(standard).norm_squared() + standard.iter().map(|x| x * x).sum::<f64>())
    }

    fn linearise(&mut self, standard: &[f64]) -> Result<NormalEquations, Self::Error> {
        let count = self.targets.len();
        let mut jacobian = self.handles.jacobian(&self.weights(standard), count);
        for k in 0..jacobian.ncols() {
            for c in 0..3 {
                let mean = (0..count).map(|h| jacobian[(3 * h + c, k)]).sum::<f64>() / count as f64;
                (0..count).for_each(|h| jacobian[(3 * h + c, k)] -= mean);
            }
        }
        let jacobian = jacobian * self.root / self.noise;
        let weights = DVector::from_column_slice(standard);
        Ok(NormalEquations {
            matrix: jacobian.tr_mul(&jacobian) + DMatrix::identity(standard.len(), standard.len()),
            right_hand_side: jacobian.tr_mul(&self.residual(standard)) - weights,
        })
    }
}
