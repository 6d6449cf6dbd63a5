//! A sparse basis fitted to samples in turns: codes of the samples by least squares in the feature metric, then rows by least
//! squares at these codes, every vertex for itself among the few rows that reach it. Over all vertices and all rows this would
//! be the power iteration that finds leading modes; cut to supports it finds what comes nearest to them.

use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side};
use rayon::prelude::*;
use sinew_formats::package::FEATURE_COUNT;

use super::embedding::{Embedding, products};

/// Added to the diagonal of the codes' equations as a share of its mean: rows that repeat each other keep an answer.
const CODE_RIDGE: f64 = 1e-6;

/// Added to each diagonal entry of a vertex's equations, as a share of it: what samples hardly tell apart stays small.
const ROW_RIDGE: f64 = 1e-3;

/// Samples, and the same in the metric.
pub struct Samples<'a> {
    embedding: &'a Embedding<'a>,
    /// Flat `[N][V][9]`.
    fields: &'a [f32],
    embedded: Mat<f32>,
}

/// Rows in the metric, ready to read codes off samples: `z = (C M C^T)^-1 C M x`.
pub struct Reader {
    embedded: Mat<f32>,
    /// Inner products of the rows in the metric. Shape: `[K] x [K]`.
    pub gram: Mat<f64>,
}

impl Reader {
    /// One solve a row.
    pub fn new(embedding: &Embedding<'_>, rows: &[Vec<f32>]) -> Self {
        let embedded = embedding.embed(&rows.concat());
        let gram = products(embedded.as_ref(), embedded.as_ref());
        Self { embedded, gram }
    }

    /// Codes of all samples: least squares in the metric, without the nonlinearity of the decoder. Shape: `[N] x [K]`.
    pub fn codes(&self, samples: &Samples<'_>) -> Mat<f64> {
        let right = products(self.embedded.as_ref(), samples.embedded.as_ref());
        let count = self.gram.nrows();
        let mean = (0..count).map(|k| self.gram[(k, k)]).sum::<f64>() / count.max(1) as f64;
        let mut held = self.gram.clone();
        (0..count).for_each(|k| held[(k, k)] += (CODE_RIDGE * mean).max(f64::MIN_POSITIVE));
        match held.llt(Side::Lower) {
            Ok(factor) => factor.solve(&right).transpose().to_owned(),
            Err(_) => Mat::zeros(samples.count(), count),
        }
    }
}

impl<'a> Samples<'a> {
    /// One solve a sample.
    pub fn new(embedding: &'a Embedding<'a>, fields: &'a [f32]) -> Self {
        Self {
            embedding,
            fields,
            embedded: embedding.embed(fields),
        }
    }

    /// N.
    pub fn count(&self) -> usize {
        self.embedded.ncols()
    }

    /// The metric.
    pub fn embedding(&self) -> &'a Embedding<'a> {
        self.embedding
    }

    fn width(&self) -> usize {
        self.embedding.vertex_count() * FEATURE_COUNT
    }

    /// What `rows` at `codes` leave of the samples. Shape: flat `[N][V][9]`.
    pub fn residuals(&self, rows: &[Vec<f32>], codes: MatRef<'_, f64>) -> Vec<f32> {
        let mut residuals = self.fields.to_vec();
        residuals
            .par_chunks_exact_mut(self.width())
            .enumerate()
            .for_each(|(n, x)| {
                for (k, row) in rows.iter().enumerate() {
                    let weight = codes[(n, k)] as f32;
                    x.iter_mut().zip(row).for_each(|(x, c)| *x -= weight * c);
                }
            });
        residuals
    }

    /// Rows that come nearest to the samples at `codes`, where `supports` lets them be; those that `is_fixed` keep their values
    /// in `rows`. Shapes: `rows` `[K]`, each flat `[V][9]`; `supports` `[K][V]`.
    pub fn fit_rows(&self, rows: &mut [Vec<f32>], codes: MatRef<'_, f64>, supports: &[Vec<bool>], is_fixed: &[bool]) {
        let (sample_count, width) = (self.count(), self.width());
        let squares: Mat<f64> = codes.transpose() * codes;
        let held: Vec<&Vec<f32>> = rows.iter().collect();
        let fitted: Vec<Vec<(usize, [f32; FEATURE_COUNT])>> = (0..self.embedding.vertex_count())
            .into_par_iter()
            .map(|v| {
                let free: Vec<usize> = (0..rows.len()).filter(|&k| supports[k][v] && !is_fixed[k]).collect();
                if free.is_empty() {
                    return Vec::new();
                }
                let mut normal = Mat::from_fn(free.len(), free.len(), |i, j| squares[(free[i], free[j])]);
                for i in 0..free.len() {
                    normal[(i, i)] = (normal[(i, i)] * (1.0 + ROW_RIDGE)).max(f64::MIN_POSITIVE);
                }
                let fixed: Vec<usize> = (0..rows.len())
                    .filter(|&k| is_fixed[k] && at(held[k], v).iter().any(|&x| x != 0.0))
                    .collect();
                let mut right = Mat::<f64>::zeros(free.len(), FEATURE_COUNT);
                for n in 0..sample_count {
                    let mut x: [f64; FEATURE_COUNT] =
                        core::array::from_fn(|c| f64::from(self.fields[n * width + FEATURE_COUNT * v + c]));
                    for &k in &fixed {
                        let row = at(held[k], v);
                        (0..FEATURE_COUNT).for_each(|c| x[c] -= codes[(n, k)] * f64::from(row[c]));
                    }
                    for (i, &k) in free.iter().enumerate() {
                        let code = codes[(n, k)];
                        (0..FEATURE_COUNT).for_each(|c| right[(i, c)] += code * x[c]);
                    }
                }
                let Ok(factor) = normal.llt(Side::Lower) else {
                    return Vec::new();
                };
                let solved = factor.solve(&right);
                let values = free.iter().enumerate();
                values
                    .map(|(i, &k)| (k, core::array::from_fn(|c| solved[(i, c)] as f32)))
                    .collect()
            })
            .collect();
        for (row, _) in rows.iter_mut().zip(is_fixed).filter(|(_, fixed)| !**fixed) {
            row.fill(0.0);
        }
        for (v, values) in fitted.into_iter().enumerate() {
            for (k, x) in values {
                rows[k][FEATURE_COUNT * v..FEATURE_COUNT * (v + 1)].copy_from_slice(&x);
            }
        }
    }
}

fn at(row: &[f32], v: usize) -> &[f32] {
    &row[FEATURE_COUNT * v..FEATURE_COUNT * (v + 1)]
}

/// Where rows are worth their price: of all entries the `budget` with the greatest effect, `|C_kv|^2` times the mean square of
/// the row's code, stay; the others are set to zero. Rows that `is_fixed` keep all, at no price. Shapes: `rows` `[K]`, each flat
/// `[V][9]`; the answer `[K][V]`.
pub fn cut_to_budget(
    rows: &mut [Vec<f32>],
    codes: MatRef<'_, f64>,
    budget: usize,
    is_fixed: &[bool],
) -> Vec<Vec<bool>> {
    let strength: Vec<f64> = (0..rows.len())
        .map(|k| (0..codes.nrows()).map(|n| codes[(n, k)].powi(2)).sum::<f64>() / codes.nrows().max(1) as f64)
        .collect();
    let effect = |row: &[f32], k: usize| -> Vec<f64> {
        let entries = row.as_chunks::<FEATURE_COUNT>().0.iter();
        entries
            .map(|x| strength[k] * x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>())
            .collect()
    };
    let effects: Vec<Vec<f64>> = rows.iter().enumerate().map(|(k, row)| effect(row, k)).collect();
    let mut free: Vec<f64> = effects
        .iter()
        .zip(is_fixed)
        .filter(|(_, fixed)| !**fixed)
        .flat_map(|(effects, _)| effects)
        .copied()
        .filter(|&effect| effect > 0.0)
        .collect();
    let least = match free.len().checked_sub(budget) {
        Some(first) if first > 0 => *free.select_nth_unstable_by(first, f64::total_cmp).1,
        _ => f64::MIN_POSITIVE,
    };
    let rows = rows.iter_mut().zip(&effects).zip(is_fixed);
    rows.map(|((row, effects), fixed)| {
        let entries = row.as_chunks_mut::<FEATURE_COUNT>().0.iter_mut().zip(effects);
        entries
            .map(|(x, &effect)| {
                let stays = if *fixed { effect > 0.0 } else { effect >= least };
                if !stays {
                    *x = [0.0; FEATURE_COUNT];
                }
                stays
            })
            .collect()
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_goes_to_the_strongest_entries_and_fixed_rows_pay_nothing() {
        let entry = |x: f32| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let row = |values: [f32; 3]| values.map(entry).concat();
        let mut rows = vec![row([3.0, 0.1, 2.0]), row([1.0, 0.0, 9.0]), row([0.01, 0.0, 0.02])];
        // The second row's weights are a tenth of the others': its entries count a hundredth.
        let codes = Mat::from_fn(2, 3, |n, k| [1.0, 0.1, 1.0][k] * if n == 0 { 1.0 } else { -1.0 });
        let supports = cut_to_budget(&mut rows, codes.as_ref(), 3, &[false, false, true]);
        let kept = vec![
            vec![true, false, true],
            vec![false, false, true],
            vec![true, false, true],
        ];
        assert_eq!(supports, kept);
        assert_eq!(rows[0], row([3.0, 0.0, 2.0]));
        assert_eq!(rows[1], row([0.0, 0.0, 9.0]));
        assert_eq!(rows[2], row([0.01, 0.0, 0.02]), "a fixed row is whole");
    }
}
