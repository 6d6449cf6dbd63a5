//! Weights of linear bases of features, in the metric of this project's own feature projection: relative errors of features
//! and, to first order at the reference, of positions. The same rule for every method that has features.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::baselines::linear::{LinearBasis, product, weighted};
use crate::baselines::model::Model;
use sinew_trainer::evaluate::gram_matrix;
use sinew_trainer::features::metric::POSITION_WEIGHT;
use sinew_trainer::features::rigid::{remove_directions, rigid_directions};

/// Added to the diagonal as a share of its mean: components that repeat each other keep an answer.
const RIDGE: f64 = 1e-9;

/// One basis, ready to be fitted to any vector of features.
pub struct FeatureFit<'b, 'm> {
    basis: &'b LinearBasis,
    element_weights: &'b [f64],
    reference: &'b [f64],
    /// From a basis at the reference to a model, whose tangents are displacements.
    model: &'b (dyn Fn(LinearBasis) -> Box<dyn Model + 'm> + Sync),
    rigid: Vec<Vec<[f64; 3]>>,
    /// Shape: `[K]` of `[V]`.
    displacements: Vec<Vec<[f32; 3]>>,
    /// Of the mean, against the reference. Shape: `[V]`.
    mean_displacement: Vec<[f32; 3]>,
    feature_gram: DMatrix<f64>,
    position_gram: DMatrix<f64>,
}

impl<'b, 'm> FeatureFit<'b, 'm> {
    /// Shapes: `element_weights` `[E]`; `reference` `[D]`, the features of the rest shape `rest`, which is `[V]`.
    pub fn new(
        basis: &'b LinearBasis,
        element_weights: &'b [f64],
        reference: &'b [f64],
        rest: &[[f64; 3]],
        model: &'b (dyn Fn(LinearBasis) -> Box<dyn Model + 'm> + Sync),
    ) -> Self {
        let count = basis.directions.len();
        let mut fit = Self {
            basis,
            element_weights,
            reference,
            model,
            rigid: rigid_directions(rest),
            displacements: Vec::new(),
            mean_displacement: Vec::new(),
            feature_gram: basis.gram(element_weights),
            position_gram: DMatrix::zeros(count, count),
        };
        fit.displacements = fit.displacements_of(basis.directions.clone());
        fit.mean_displacement = fit
            .displacements_of(vec![fit.less_reference(&basis.mean)])
            .swap_remove(0);
        let lower = gram_matrix(&fit.displacements);
        fit.position_gram = DMatrix::from_fn(count, count, |i, j| lower[(i.max(j), i.min(j))]);
        fit
    }

    /// Weights of the vectors nearest to `samples` (each `[D]`). Shape: `[N][K]`.
    pub fn weights(&self, samples: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let displacements = self.displacements_of(samples.iter().map(|x| self.less_reference(x)).collect());
        samples
            .par_iter()
            .zip(&displacements)
            .map(|(sample, displacement)| self.fit(sample, displacement))
            .collect()
    }

    fn fit(&self, sample: &[f64], displacement: &[[f32; 3]]) -> Vec<f64> {
        let basis = self.basis;
        let moved = self.less_reference(sample);
        let features = product(&weighted(&moved, self.element_weights, basis.width), &moved);
        let positions = dot(displacement, displacement);
        let position_weight = if positions > features * f64::MIN_POSITIVE {
            POSITION_WEIGHT * features / positions
        } else {
            0.0
        };
        let mut normal = &self.feature_gram + &self.position_gram * position_weight;
        let ridge = RIDGE * normal.diagonal().sum() / basis.directions.len().max(1) as f64;
        for k in 0..basis.directions.len() {
            normal[(k, k)] += ridge;
        }
        let Some(factor) = Cholesky::new(normal) else {
            return vec![0.0; basis.directions.len()];
        };
        let centred: Vec<f64> = sample.iter().zip(&basis.mean).map(|(x, mean)| x - mean).collect();
        let centred = weighted(&centred, self.element_weights, basis.width);
        let left: Vec<[f32; 3]> = displacement
            .iter()
            .zip(&self.mean_displacement)
            .map(|(p, mean)| core::array::from_fn(|c| p[c] - mean[c]))
            .collect();
        let directions = basis.directions.iter().zip(&self.displacements);
        let right =
            directions.map(|(direction, moved)| product(direction, &centred) + position_weight * dot(moved, &left));
        let right = DVector::from_iterator(basis.directions.len(), right);
        factor.solve(&right).iter().copied().collect()
    }

    fn less_reference(&self, features: &[f64]) -> Vec<f64> {
        features.iter().zip(self.reference).map(|(x, r)| x - r).collect()
    }

    /// What small changes of features do to positions, less rigid motions.
    fn displacements_of(&self, directions: Vec<Vec<f64>>) -> Vec<Vec<[f32; 3]>> {
        let at_rest = vec![0.0; directions.len()];
        let mut moved = (self.model)(LinearBasis {
            width: self.basis.width,
            mean: self.reference.to_vec(),
            directions,
        })
        .tangents(&at_rest);
        moved
            .par_iter_mut()
            .for_each(|column| remove_directions(&self.rigid, column, |x| x as f32));
        moved
    }
}

fn dot(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}
