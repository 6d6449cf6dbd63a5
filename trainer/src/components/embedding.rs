//! Fields of features laid out so that plain inner products of what comes out are those of the feature metric: what every
//! closed-form step on samples (modes, codes, trees) does its algebra on.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use sinew_formats::package::FEATURE_COUNT;

use crate::features::metric::FeatureMetric;

/// Columns of a product that one thread works on; fixed, so that sums do not depend on the number of threads.
const TILE: usize = 64;

/// The metric with one weight of positions for all samples.
pub struct Embedding<'a> {
    metric: &'a FeatureMetric<'a>,
    position_weight: f64,
}

impl<'a> Embedding<'a> {
    /// `position_weight`: w of the metric.
    pub fn new(metric: &'a FeatureMetric<'a>, position_weight: f64) -> Self {
        Self {
            metric,
            position_weight,
        }
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.metric.areas().len()
    }

    /// Shape: `[V]`.
    pub fn areas(&self) -> &'a [f64] {
        self.metric.areas()
    }

    /// `(sqrt(area_v) x_v, sqrt(w) G x)` of each of the `fields`, one solve each. Shapes: flat `[N][V][9]` to columns, `[12 V] x [N]`.
    pub fn embed(&self, fields: &[f32]) -> Mat<f32> {
        let width = self.vertex_count() * FEATURE_COUNT;
        let rows = width + 3 * self.vertex_count();
        let count = fields.len() / width.max(1);
        let (roots, weight): (Vec<f64>, f64) = (
            self.areas().iter().map(|a| a.sqrt()).collect(),
            self.position_weight.sqrt(),
        );
        let mut embedded = Mat::<f32>::zeros(rows, count);
        embedded
            .par_col_iter_mut()
            .zip(fields.par_chunks_exact(width))
            .for_each(|(column, field)| {
                let Some(column) = column.try_as_col_major_mut() else {
                    return;
                };
                let (features, moved) = column.as_slice_mut().split_at_mut(width);
                let wide: Vec<[f64; FEATURE_COUNT]> = field
                    .as_chunks()
                    .0
                    .iter()
                    .map(|x: &[f32; 9]| x.map(f64::from))
                    .collect();
                for ((out, x), root) in features.as_chunks_mut().0.iter_mut().zip(&wide).zip(&roots) {
                    *out = x.map(|x| (root * x) as f32);
                }
                let displacements = self.metric.displacements(&wide);
                for (out, x) in moved.iter_mut().zip(displacements.as_flattened()) {
                    *out = (weight * x) as f32;
                }
            });
        embedded
    }
}

/// `A^T B`. The same bits whatever the number of threads.
pub fn products(a: MatRef<'_, f32>, b: MatRef<'_, f32>) -> Mat<f64> {
    let (rows, columns) = (a.ncols(), b.ncols());
    let tiles: Vec<Mat<f32>> = (0..columns)
        .step_by(TILE)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|first| {
            let part = b.subcols(first, TILE.min(columns - first));
            let mut tile = Mat::<f32>::zeros(rows, part.ncols());
            matmul(tile.as_mut(), Accum::Replace, a.transpose(), part, 1.0, Par::Seq);
            tile
        })
        .collect();
    Mat::from_fn(rows, columns, |i, j| f64::from(tiles[j / TILE][(i, j % TILE)]))
}

/// `sum_n coefficients[(n, k)] field_n` for every k. Shapes: `fields` flat `[N][V][9]`; the answer `[K]`, each flat `[V][9]`.
pub fn combined(fields: &[f32], coefficients: MatRef<'_, f64>) -> Vec<Vec<f32>> {
    let width = fields.len() / coefficients.nrows().max(1);
    (0..coefficients.ncols())
        .into_par_iter()
        .map(|k| {
            let mut sum = vec![0.0_f32; width];
            for (n, field) in fields.chunks_exact(width.max(1)).enumerate() {
                let weight = coefficients[(n, k)] as f32;
                if weight != 0.0 {
                    sum.iter_mut().zip(field).for_each(|(sum, x)| *sum += weight * x);
                }
            }
            sum
        })
        .collect()
}
