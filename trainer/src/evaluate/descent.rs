//! Damped Gauss-Newton over the weights of a shape's components: the search behind both projections (method section 3).

use nalgebra::{Cholesky, DMatrix, DVector};

/// A sum of squares over K weights.
pub trait LeastSquares {
    /// What evaluating can run into.
    type Error;

    /// The sum of squares at `weights`.
    fn cost(&mut self, weights: &[f64]) -> Result<f64, Self::Error>;

    /// Its normal equations at `weights`.
    fn linearise(&mut self, weights: &[f64]) -> Result<NormalEquations, Self::Error>;
}

/// `J^T J` and `J^T r`, where `r` is target less model and J the model's derivative: the step solves `J^T J s = J^T r`.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// `J^T J`; the lower triangle is read. Shape: `[K][K]`.
    pub matrix: DMatrix<f64>,
    /// `J^T r`. Shape: `[K]`.
    pub right_hand_side: DVector<f64>,
}

/// When to stop, and how firmly to hold weak directions.
#[derive(Debug, Clone, Copy)]
pub struct DescentSettings {
    /// Steps taken at most.
    pub step_limit: usize,
    /// Added to the diagonal as a share of its mean: the small ridge. A refused step raises it tenfold.
    pub ridge: f64,
    /// A step that saves less than this share of the cost is the last.
    pub least_gain: f64,
}

/// Refused trials of one step before the search ends: by then the ridge rules and the step is next to nothing.
const TRIAL_LIMIT: usize = 10;
const RIDGE_FACTOR: f64 = 10.0;

/// Descends from `start`; never returns weights of higher cost. Weights are not clamped.
pub fn descend<P: LeastSquares>(
    problem: &mut P,
    start: Vec<f64>,
    settings: &DescentSettings,
) -> Result<Vec<f64>, P::Error> {
    let mut weights = start;
    let mut cost = problem.cost(&weights)?;
    let mut ridge = settings.ridge;
    for _ in 0..settings.step_limit {
        let equations = problem.linearise(&weights)?;
        let mut accepted = None;
        for _ in 0..TRIAL_LIMIT {
            let Some(step) = equations.step(ridge) else {
                ridge *= RIDGE_FACTOR;
                continue;
            };
            let trial: Vec<f64> = weights
                .iter()
                .zip(step.iter())
                .map(|(weight, step)| weight + step)
                .collect();
            let trial_cost = problem.cost(&trial)?;
            if trial_cost < cost {
                accepted = Some((trial, trial_cost));
                break;
            }
            ridge *= RIDGE_FACTOR;
        }
        let Some((trial, trial_cost)) = accepted else {
            break;
        };
        let gain = cost - trial_cost;
        weights = trial;
        let last = gain < settings.least_gain * cost;
        cost = trial_cost;
        if last {
            break;
        }
        ridge = (ridge / RIDGE_FACTOR).max(settings.ridge);
    }
    Ok(weights)
}

impl NormalEquations {
    /// The step, where `ridge` times the mean diagonal is added to the diagonal; nothing where there is none.
    pub fn step(&self, ridge: f64) -> Option<DVector<f64>> {
        let mut matrix = self.matrix.clone();
        let component_count = matrix.nrows();
        let mean = matrix.diagonal().sum() / component_count as f64;
        for k in 0..component_count {
            matrix[(k, k)] += ridge * mean;
        }
        let step = Cholesky::new(matrix)?.solve(&self.right_hand_side);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `r = (10 (b - a^2), 1 - a)`: the banana valley, minimum 0 at (1, 1).
    struct Valley;

    impl LeastSquares for Valley {
        type Error = core::convert::Infallible;

        fn cost(&mut self, w: &[f64]) -> Result<f64, Self::Error> {
            Ok((10.0 * (w[1] - w[0] * w[0])).powi(2) + (1.0 - w[0]).powi(2))
        }

        fn linearise(&mut self, w: &[f64]) -> Result<NormalEquations, Self::Error> {
            // The model is -r against a target of zero.
            let jacobian = DMatrix::from_row_slice(2, 2, &[20.0 * w[0], -10.0, 1.0, 0.0]);
            let residual = DVector::from_row_slice(&[10.0 * (w[1] - w[0] * w[0]), 1.0 - w[0]]);
            Ok(NormalEquations {
                matrix: jacobian.tr_mul(&jacobian),
                right_hand_side: jacobian.tr_mul(&residual),
            })
        }
    }

    #[test]
    fn follows_a_curved_valley_and_never_climbs() {
        let settings = DescentSettings {
            step_limit: 100,
            ridge: 1e-9,
            least_gain: 0.0,
        };
        let Ok(weights) = descend(&mut Valley, vec![-1.2, 1.0], &settings);
        assert!(weights.iter().all(|w| (w - 1.0).abs() < 1e-6), "{weights:?}");
        let Ok(start) = Valley.cost(&[-1.2, 1.0]);
        for step_limit in 0..5 {
            let Ok(weights) = descend(
                &mut Valley,
                vec![-1.2, 1.0],
                &DescentSettings { step_limit, ..settings },
            );
            let Ok(cost) = Valley.cost(&weights);
            assert!(cost <= start);
        }
    }
}
