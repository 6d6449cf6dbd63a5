//! The small problem of a drag: steps within limits that bring a few held coordinates to where they should be, as short as
//! possible beside the controls' ranges.
//!
//! Minimises `|r - J d|^2 + ridge |d|^2` over the steps `d` of the free components: `d = J^T m` with
//! `(J J^T + ridge) m = r`, a system as large as the held coordinates, however many components there are. f64, because a ridge
//! of 1e-5 beside a few handles on one limb leaves f32 no digits.

/// Rounds of a pass: a component that reaches a stop stays there, and the others try again.
const ROUNDS: usize = 3;
/// Added to the ridge as a share of the trace: rows that say the same leave the matrix singular to rounding.
const TRACE_SHARE: f64 = 1e-12;

/// R held coordinates, K components.
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
}

impl Reach<'_> {
    /// Steps further with the components of which `takes_part` is true; the ridge holds to the steps taken before.
    pub(super) fn pass(&mut self, ridge: f64, takes_part: impl Fn(usize) -> bool) {
        let rows = self.residual.len();
        for k in 0..self.offsets.len() {
            self.is_free[k] = u32::from(takes_part(k) && self.lower[k] < self.upper[k]);
        }
        for _ in 0..ROUNDS {
            self.fill_gram(ridge);
            self.multipliers.copy_from_slice(self.residual);
            if !solve(self.gram, self.multipliers) {
                return;
            }
            let mut is_stopped = false;
            for k in 0..self.offsets.len() {
                if self.is_free[k] == 0 {
                    continue;
                }
                let column = &self.jacobian[k * rows..][..rows];
                let step: f64 = column
                    .iter()
                    .zip(&*self.multipliers)
                    .map(|(&j, m)| f64::from(j) * m)
                    .sum();
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

    /// Lower triangle of `J J^T + ridge` over the free components.
    fn fill_gram(&mut self, ridge: f64) {
        let rows = self.residual.len();
        self.gram.fill(0.0);
        for k in (0..self.offsets.len()).filter(|&k| self.is_free[k] == 1) {
            let column = &self.jacobian[k * rows..][..rows];
            for i in 0..rows {
                for j in 0..=i {
                    self.gram[i * rows + j] += f64::from(column[i]) * f64::from(column[j]);
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
    use crate::simd::scalar::naive::Noise;

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
        let case = reach(1, 100.0, |reach| reach.pass(RIDGE, |k| k != 2));
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
    fn limits_hold_and_others_take_over() {
        let free = reach(2, 100.0, |reach| reach.pass(1e-6, |_| true));
        let limit = 0.5 * free.offsets.iter().fold(0.0_f32, |most, d| most.max(d.abs()));
        let held = reach(2, limit, |reach| reach.pass(1e-6, |_| true));
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
                reach.pass(1e-3, |_| true);
            });
            assert!(case.offsets.iter().all(|d| d.is_finite() && d.abs() <= 1.0));
        }
    }
}
