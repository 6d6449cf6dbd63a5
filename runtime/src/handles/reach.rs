//! The small problem of a drag: steps within limits that bring a few held coordinates to where they should be, as short as
//! possible beside the controls' ranges.
//!
//! Minimises `|r - J d|^2 + ridge d^T S^-1 d` over the steps `d` of the free components: `d = S J^T m` with
//! `(J S J^T + ridge) m = r`, a system as large as the held coordinates, however many components there are. S says which steps are
//! likely: one, or the second moments of the package's prior. f64, because a ridge of 1e-5 beside a few handles on one limb leaves
//! f32 no digits.

use sinew_formats::package::Prior;

/// Rounds of a pass: a component that reaches a stop stays there, and the others try again.
const ROUNDS: usize = 3;
/// Added to the ridge as a share of the trace: rows that say the same leave the matrix singular to rounding.
const TRACE_SHARE: f64 = 1e-12;

/// Which steps are likely: S, in shares of the ranges.
#[derive(Clone, Copy)]
pub(super) enum Likely<'l> {
    /// All alike: S = 1.
    Alike,
    /// As the training shapes' weights: `S = diag(variances) + sum of f f^T` over the prior's factors, and over its mean, since steps
    /// are counted from where the weights stand.
    Known {
        /// In units of weight, not empty.
        prior: Prior<'l>,
        /// One over each component's range, 0 where it has none. Shape: `[K]`.
        shares: &'l [f32],
    },
}

impl Likely<'_> {
    /// Factors of a prior, its mean included; none where nothing is known.
    pub(super) fn factor_count(prior: &Prior<'_>) -> usize {
        prior
            .factors
            .len()
            .checked_div(prior.mean.len())
            .map_or(0, |count| 1 + count)
    }

    fn count(&self) -> usize {
        match self {
            Self::Alike => 0,
            Self::Known { prior, .. } => Self::factor_count(prior),
        }
    }

    /// Factor `q` at component `k`.
    fn factor(&self, q: usize, k: usize) -> f64 {
        match self {
            Self::Alike => 0.0,
            Self::Known { prior, shares } => {
                let value = match q.checked_sub(1) {
                    None => prior.mean[k],
                    Some(q) => prior.factors[q * shares.len() + k],
                };
                f64::from(value) * f64::from(shares[k])
            }
        }
    }

    /// What the factors leave of component `k`.
    fn variance(&self, k: usize) -> f64 {
        match self {
            Self::Alike => 1.0,
            Self::Known { prior, shares } => {
                f64::from(prior.variances[k]) * f64::from(shares[k]) * f64::from(shares[k])
            }
        }
    }
}

/// R held coordinates, K components, Q factors.
pub(super) struct Reach<'r> {
    /// Shape: `[K][R]`.
    pub(super) jacobian: &'r [f32],
    /// What is left to reach. Shape: `[R]`.
    pub(super) residual: &'r mut [f64],
    /// The steps. Shape: `[K]`.
    pub(super) offsets: &'r mut [f32],
    /// Shape: `[K]`, at most 0.
    pub(super) lower: &'r [f32],
    /// Shape: `[K]`, at least 0.
    pub(super) upper: &'r [f32],
    /// Scratch. Shape: `[K]`.
    pub(super) is_free: &'r mut [u32],
    /// Scratch. Shape: `[R][R]`.
    pub(super) gram: &'r mut [f64],
    /// Scratch. Shape: `[R]`.
    pub(super) multipliers: &'r mut [f64],
    /// Scratch. Shape: `[Q][R]`, or longer.
    pub(super) projected: &'r mut [f64],
}

impl Reach<'_> {
    /// Steps further with the components of which `takes_part` is true; the ridge holds to the steps taken before.
    pub(super) fn pass(&mut self, ridge: f64, likely: &Likely<'_>, takes_part: impl Fn(usize) -> bool) {
        let rows = self.residual.len();
        for k in 0..self.offsets.len() {
            self.is_free[k] = u32::from(takes_part(k) && self.lower[k] < self.upper[k]);
        }
        for _ in 0..ROUNDS {
            self.fill_gram(ridge, likely);
            self.multipliers.copy_from_slice(self.residual);
            if !solve(self.gram, self.multipliers) {
                return;
            }
            // F J^T m, in the first number of each row, which is not needed any more.
            for row in self.projected.chunks_exact_mut(rows.max(1)).take(likely.count()) {
                row[0] = row.iter().zip(&*self.multipliers).map(|(&x, m)| x * m).sum();
            }
            let mut is_stopped = false;
            for k in 0..self.offsets.len() {
                if self.is_free[k] == 0 {
                    continue;
                }
                let column = &self.jacobian[k * rows..][..rows];
                let along: f64 = column
                    .iter()
                    .zip(&*self.multipliers)
                    .map(|(&j, m)| f64::from(j) * m)
                    .sum();
                let shared = (0..likely.count()).map(|q| likely.factor(q, k) * self.projected[q * rows]);
                let step = likely.variance(k) * along + shared.sum::<f64>();
                let wanted = self.offsets[k] + step as f32;
                if !wanted.is_finite() {
                    continue;
                }
                let taken = wanted.clamp(self.lower[k], self.upper[k]);
                if taken != wanted {
                    is_stopped = true;
                    self.is_free[k] = 0;
                }
                let moved = f64::from(taken) - f64::from(self.offsets[k]);
                for (left, &j) in self.residual.iter_mut().zip(column) {
                    *left -= f64::from(j) * moved;
                }
                self.offsets[k] = taken;
            }
            if !is_stopped {
                return;
            }
        }
    }

    /// Lower triangle of `J S J^T + ridge` over the free components, and `F J^T`.
    fn fill_gram(&mut self, ridge: f64, likely: &Likely<'_>) {
        let rows = self.residual.len();
        self.gram.fill(0.0);
        let projected = &mut self.projected[..likely.count() * rows];
        projected.fill(0.0);
        for k in (0..self.offsets.len()).filter(|&k| self.is_free[k] == 1) {
            let column = &self.jacobian[k * rows..][..rows];
            let variance = likely.variance(k);
            for i in 0..rows {
                let left = variance * f64::from(column[i]);
                for j in 0..=i {
                    self.gram[i * rows + j] += left * f64::from(column[j]);
                }
            }
            for (q, row) in projected.chunks_exact_mut(rows.max(1)).enumerate() {
                let factor = likely.factor(q, k);
                row.iter_mut()
                    .zip(column)
                    .for_each(|(x, &j)| *x += factor * f64::from(j));
            }
        }
        for row in projected.chunks_exact(rows.max(1)) {
            for i in 0..rows {
                for j in 0..=i {
                    self.gram[i * rows + j] += row[i] * row[j];
                }
            }
        }
        let trace: f64 = (0..rows).map(|i| self.gram[i * rows + i]).sum();
        for i in 0..rows {
            self.gram[i * rows + i] += ridge + TRACE_SHARE * trace;
        }
    }
}

/// Solves in place by Cholesky on the lower triangle. Shape: `matrix` `[R][R]`, overwritten; `x` `[R]`. False, with `x` spoilt, where
/// a pivot is not positive.
fn solve(matrix: &mut [f64], x: &mut [f64]) -> bool {
    let rows = x.len();
    for j in 0..rows {
        for i in j..rows {
            let mut sum = matrix[i * rows + j];
            for k in 0..j {
                sum -= matrix[i * rows + k] * matrix[j * rows + k];
            }
            if i > j {
                matrix[i * rows + j] = sum / matrix[j * rows + j];
            } else if sum > 0.0 && sum.is_finite() {
                matrix[j * rows + j] = libm::sqrt(sum);
            } else {
                return false;
            }
        }
    }
    for i in 0..rows {
        let sum: f64 = (0..i).map(|k| matrix[i * rows + k] * x[k]).sum();
        x[i] = (x[i] - sum) / matrix[i * rows + i];
    }
    for i in (0..rows).rev() {
        let sum: f64 = (i + 1..rows).map(|k| matrix[k * rows + i] * x[k]).sum();
        x[i] = (x[i] - sum) / matrix[i * rows + i];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::tests::naive::Noise;

    const ROWS: usize = 6;
    const COMPONENTS: usize = 5;
    /// Normal equations of numbers near one, twice in f32 (steps) and once in f64.
    const TOLERANCE: f64 = 1e-5;

    struct Case {
        jacobian: [f32; COMPONENTS * ROWS],
        goal: [f64; ROWS],
        offsets: [f32; COMPONENTS],
        left: [f64; ROWS],
    }

    fn reach(seed: u64, limit: f32, passes: impl Fn(&mut Reach<'_>)) -> Case {
        let mut noise = Noise::new(seed);
        let jacobian = core::array::from_fn(|_| noise.next());
        let goal = core::array::from_fn(|_| f64::from(noise.next()));
        let (mut offsets, mut left) = ([0.0; COMPONENTS], goal);
        passes(&mut Reach {
            jacobian: &jacobian,
            residual: &mut left,
            offsets: &mut offsets,
            lower: &[-limit; COMPONENTS],
            upper: &[limit; COMPONENTS],
            is_free: &mut [0; COMPONENTS],
            gram: &mut [0.0; ROWS * ROWS],
            multipliers: &mut [0.0; ROWS],
            projected: &mut [0.0; 3 * ROWS],
        });
        Case {
            jacobian,
            goal,
            offsets,
            left,
        }
    }

    #[test]
    fn a_pass_is_the_ridge_regression() {
        const RIDGE: f64 = 0.3;
        let case = reach(1, 100.0, |reach| reach.pass(RIDGE, &Likely::Alike, |k| k != 2));
        assert_eq!(case.offsets[2], 0.0);
        // Gradient of the objective: J^T (r - J d) = ridge d.
        for k in [0, 1, 3, 4] {
            let pull: f64 = (0..ROWS)
                .map(|i| f64::from(case.jacobian[k * ROWS + i]) * case.left[i])
                .sum();
            assert!((pull - RIDGE * f64::from(case.offsets[k])).abs() < TOLERANCE);
        }
        for i in 0..ROWS {
            let reached: f64 = (0..COMPONENTS)
                .map(|k| f64::from(case.jacobian[k * ROWS + i]) * f64::from(case.offsets[k]))
                .sum();
            assert!((case.goal[i] - reached - case.left[i]).abs() < TOLERANCE);
        }
    }

    #[test]
    fn a_pass_with_a_prior_is_the_most_likely_answer() {
        const RIDGE: f64 = 0.3;
        let prior = Prior {
            mean: &[0.4, 0.0, -0.2, 0.0, 0.6],
            factors: &[1.0, 2.0, 0.0, -0.5, 0.3, 0.0, 0.7, 0.2, 0.0, -0.4],
            variances: &[0.1, 0.2, 0.05, 0.4, 0.3],
            strength: RIDGE as f32,
        };
        let shares = [1.0, 0.5, 2.0, 1.0, 0.25];
        let likely = Likely::Known { prior, shares: &shares };
        let case = reach(4, 100.0, |reach| reach.pass(RIDGE, &likely, |_| true));
        // Where the gradient vanishes: S J^T (r - J d) = ridge d.
        let pull: [f64; COMPONENTS] = core::array::from_fn(|k| {
            (0..ROWS)
                .map(|i| f64::from(case.jacobian[k * ROWS + i]) * case.left[i])
                .sum()
        });
        for k in 0..COMPONENTS {
            let mut answer = likely.variance(k) * pull[k];
            for q in 0..3 {
                let along: f64 = (0..COMPONENTS).map(|l| likely.factor(q, l) * pull[l]).sum();
                answer += likely.factor(q, k) * along;
            }
            assert!((answer - RIDGE * f64::from(case.offsets[k])).abs() < TOLERANCE, "{k}");
        }
    }

    #[test]
    fn limits_hold_and_others_take_over() {
        let free = reach(2, 100.0, |reach| reach.pass(1e-6, &Likely::Alike, |_| true));
        let limit = 0.5 * free.offsets.iter().fold(0.0_f32, |most, d| most.max(d.abs()));
        let held = reach(2, limit, |reach| reach.pass(1e-6, &Likely::Alike, |_| true));
        assert!(held.offsets.iter().all(|d| d.abs() <= limit));
        let one_round: [f32; COMPONENTS] = free.offsets.map(|d| d.clamp(-limit, limit));
        assert_ne!(held.offsets, one_round, "the others try again");
        let squared = |left: &[f64; ROWS]| left.iter().map(|x| x * x).sum::<f64>();
        assert!(squared(&held.left) < squared(&held.goal));
    }

    #[test]
    fn numbers_beyond_reason_move_nothing() {
        for bad in [f64::NAN, f64::INFINITY] {
            let case = reach(3, 1.0, |reach| {
                reach.residual[0] = bad;
                reach.pass(1e-3, &Likely::Alike, |_| true);
            });
            assert!(case.offsets.iter().all(|d| d.is_finite() && d.abs() <= 1.0));
        }
    }
}
