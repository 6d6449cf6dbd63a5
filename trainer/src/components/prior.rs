//! What training shapes say of weights before anything is held: a normal distribution of low rank and a diagonal. Weights of the
//! training shapes -> the package's prior, which held vertices and the fit of bones draw on.
//!
//! Rank, diagonal and strength are those with which a few held vertices tell most of shapes held out.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;
use sinew_formats::package::limits;

/// Numbers of factors to choose from.
const RANKS: [usize; 6] = [0, 1, 2, 4, 8, limits::PRIOR_FACTORS];
/// Shares of what the factors explain that go to the diagonal instead, to choose from: a handful of shapes spans far less than what
/// the next one does.
const SHARES: [f64; 5] = [0.02, 0.1, 0.3, 0.6, 0.9];
/// What a squared deviation counts, times the mean square of what the components leave, to choose from.
const STRENGTHS: [f64; 3] = [0.1, 1.0, 10.0];
/// Runs of consecutive shapes held out in turn; each shape alone where there are fewer.
const RUNS: usize = 10;
/// The least deviation of a weight, as a share of its range: what no shape moved may move all the same.
const LEAST_DEVIATION: f64 = 0.01;

/// A normal distribution of K weights: covariance `factors^T factors + diag(variances)`.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightPrior {
    /// Shape: `[K]`.
    pub mean: Vec<f32>,
    /// Shape: `[r][K]`, r at most [`limits::PRIOR_FACTORS`].
    pub factors: Vec<f32>,
    /// Shape: `[K]`, positive.
    pub variances: Vec<f32>,
    /// See [`sinew_formats::package::Prior::strength`].
    pub strength: f32,
}

/// What held vertices see of the weights, near the rest shape, all in shares of the bounding box' diagonal.
#[derive(Debug, Clone)]
pub struct Sight {
    /// Derivatives of the held coordinates by the weights, for a few vertices and for more. Shape of each: `[R][K]`.
    pub held: Vec<DMatrix<f64>>,
    /// Squared displacement of the whole mesh: `w^T gram w`. Shape: `[K][K]`.
    pub gram: DMatrix<f64>,
    /// Mean square of one coordinate of a training shape that the components leave.
    pub misfit: f64,
}

impl WeightPrior {
    /// The distribution that tells most of `codes` `[N][K]` that were held out in runs, from what `sight` sees of them; nothing of
    /// fewer than two shapes, or of weights beyond what a package holds. `ranges` `[K]` are the controls' ranges.
    ///
    /// Source: factor analysis by principal axes; ridge regression with that covariance, as [`sinew_runtime::Drag`] has it.
    pub fn fit(codes: &[Vec<f64>], ranges: &[f64], sight: &Sight) -> Option<Self> {
        let count = codes.len();
        if count < 2 || ranges.is_empty() {
            return None;
        }
        let runs = RUNS.min(count);
        let floors: Vec<f64> = ranges
            .iter()
            .map(|range| (LEAST_DEVIATION * range).powi(2).max(1e-12))
            .collect();
        let held_out: Vec<(&[Vec<f64>], Axes)> = (0..runs)
            .map(|run| {
                let held = run * count / runs..(run + 1) * count / runs;
                let rest: Vec<&Vec<f64>> = (0..count).filter(|n| !held.contains(n)).map(|n| &codes[n]).collect();
                (&codes[held], Axes::of(&rest))
            })
            .collect();
        let choices: Vec<(usize, f64, f64)> = RANKS
            .iter()
            .flat_map(|&rank| SHARES.iter().map(move |&share| (rank, share)))
            .flat_map(|(rank, share)| STRENGTHS.iter().map(move |&times| (rank, share, times * sight.misfit)))
            .collect();
        let errors: Vec<f64> = choices
            .par_iter()
            .map(|&(rank, share, strength)| {
                let of_run = |(held, axes): &(&[Vec<f64>], Axes)| {
                    let moments = axes.normal(rank, share, &floors).second_moments();
                    sight
                        .held
                        .iter()
                        .map(|rows| sight.missed(rows, &moments, strength, held))
                        .sum::<f64>()
                };
                held_out.iter().map(of_run).sum()
            })
            .collect();
        // The first of equals: fewer factors.
        let best = (0..choices.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]))?;
        let (rank, share, strength) = choices[best];
        let normal = Axes::of(&codes.iter().collect::<Vec<_>>()).normal(rank, share, &floors);
        let narrow = |values: &[f64]| values.iter().map(|&x| x as f32).collect::<Vec<f32>>();
        let prior = Self {
            mean: narrow(&normal.mean),
            factors: narrow(&normal.factors),
            variances: narrow(&normal.variances),
            strength: strength as f32,
        };
        let fits = |x: &f32| x.is_finite() && x.abs() <= limits::CONTROL;
        let positive = |x: &f32| *x > 0.0 && *x <= limits::CONTROL * limits::CONTROL;
        (prior.mean.iter().chain(&prior.factors).all(fits) && prior.variances.iter().all(positive)).then_some(prior)
    }
}

impl Sight {
    /// Squared displacement between `codes` and what is told of them by the coordinates `rows` sees.
    fn missed(&self, rows: &DMatrix<f64>, moments: &DMatrix<f64>, strength: f64, codes: &[Vec<f64>]) -> f64 {
        let pulled = moments * rows.transpose();
        let mut seen = rows * &pulled;
        for i in 0..seen.nrows() {
            seen[(i, i)] += strength;
        }
        let Some(factor) = Cholesky::new(seen) else {
            return f64::INFINITY;
        };
        let missed = codes.iter().map(|code| {
            let code = DVector::from_column_slice(code);
            let off = &pulled * factor.solve(&(rows * &code)) - code;
            off.dot(&(&self.gram * &off))
        });
        missed.sum()
    }
}

/// Principal axes of some weights, strongest first.
struct Axes {
    mean: Vec<f64>,
    /// Mean square about the mean. Shape: `[K]`.
    variances: Vec<f64>,
    /// Each as long as the deviation along it. Shape: up to [`limits::PRIOR_FACTORS`] of `[K]`.
    axes: Vec<Vec<f64>>,
}

impl Axes {
    fn of(codes: &[&Vec<f64>]) -> Self {
        let (count, components) = (codes.len(), codes[0].len());
        let mean: Vec<f64> = (0..components)
            .map(|k| codes.iter().map(|code| code[k]).sum::<f64>() / count as f64)
            .collect();
        let off = DMatrix::from_fn(count, components, |n, k| codes[n][k] - mean[k]);
        let variances = (0..components)
            .map(|k| off.column(k).norm_squared() / count as f64)
            .collect();
        // The small one of the two products has the same eigenvalues.
        let eigen = SymmetricEigen::new(&off * off.transpose() / count as f64);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let axes = order
            .into_iter()
            .take(limits::PRIOR_FACTORS)
            .filter(|&i| eigen.eigenvalues[i] > 1e-12 * eigen.eigenvalues.max())
            .map(|i| {
                let axis = off.tr_mul(&eigen.eigenvectors.column(i)) / (count as f64).sqrt();
                axis.iter().copied().collect()
            })
            .collect();
        Self { mean, variances, axes }
    }

    /// `rank` factors, `share` of what they explain left to the diagonal: every weight keeps its variance.
    fn normal(&self, rank: usize, share: f64, floors: &[f64]) -> Normal {
        let axes = &self.axes[..rank.min(self.axes.len())];
        let scale = (1.0 - share).sqrt();
        let explained = |k: usize| axes.iter().map(|axis| (scale * axis[k]).powi(2)).sum::<f64>();
        Normal {
            mean: self.mean.clone(),
            factors: axes.iter().flatten().map(|x| scale * x).collect(),
            variances: (0..floors.len())
                .map(|k| (self.variances[k] - explained(k)).max(floors[k]))
                .collect(),
        }
    }
}

struct Normal {
    mean: Vec<f64>,
    /// Shape: `[r][K]`.
    factors: Vec<f64>,
    variances: Vec<f64>,
}

impl Normal {
    /// About zero: steps are counted from where the weights stand. Shape: `[K][K]`.
    fn second_moments(&self) -> DMatrix<f64> {
        let components = self.mean.len();
        let mut moments = DMatrix::from_diagonal(&DVector::from_column_slice(&self.variances));
        for row in self.factors.chunks_exact(components).chain([&*self.mean]) {
            let row = DVector::from_column_slice(row);
            moments += &row * row.transpose();
        }
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two weights that go together, one on its own.
    fn codes(count: usize) -> Vec<Vec<f64>> {
        (0..count)
            .map(|n| {
                let (a, b) = ((n as f64 * 1.7).sin(), (n as f64 * 2.9).cos());
                vec![a, 2.0 * a + 0.02 * b, 0.3 * b]
            })
            .collect()
    }

    /// Every weight moves a coordinate of its own; the first alone is held, or the first and the third.
    fn sight(components: usize) -> Sight {
        let rows = |seen: &[usize]| DMatrix::from_fn(seen.len(), components, |i, k| f64::from(seen[i] == k));
        Sight {
            held: vec![rows(&[0]), rows(&[0, components - 1])],
            gram: DMatrix::identity(components, components),
            misfit: 1e-5,
        }
    }

    #[test]
    fn what_goes_together_is_a_factor_and_every_weight_keeps_its_variance() {
        let codes = codes(60);
        let Some(prior) = WeightPrior::fit(&codes, &[2.0, 4.0, 0.6], &sight(3)) else {
            panic!("sixty shapes say something");
        };
        let covariance = |i: usize, j: usize| {
            let shared: f32 = prior.factors.chunks_exact(3).map(|f| f[i] * f[j]).sum();
            shared + if i == j { prior.variances[i] } else { 0.0 }
        };
        let measured = |i: usize| {
            let mean = codes.iter().map(|code| code[i]).sum::<f64>() / 60.0;
            codes.iter().map(|code| (code[i] - mean).powi(2)).sum::<f64>() / 60.0
        };
        for k in 0..3 {
            assert!((f64::from(covariance(k, k)) / measured(k) - 1.0).abs() < 0.02, "{k}");
        }
        let correlation = covariance(0, 1) / (covariance(0, 0) * covariance(1, 1)).sqrt();
        assert!(correlation > 0.9, "{correlation}");
        assert!(prior.strength > 0.0 && prior.strength < 1e-3);
    }

    #[test]
    fn a_weight_that_never_moved_may_move_a_little() {
        let codes: Vec<Vec<f64>> = codes(20).into_iter().map(|code| vec![code[0], 0.0]).collect();
        let Some(prior) = WeightPrior::fit(&codes, &[2.0, 1.0], &sight(2)) else {
            panic!("twenty shapes say something");
        };
        assert!((prior.variances[1] - 1e-4).abs() < 1e-9, "{:?}", prior.variances);
        assert_eq!(WeightPrior::fit(&codes[..1], &[2.0, 1.0], &sight(2)), None);
    }
}
