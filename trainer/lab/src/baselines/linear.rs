//! Linear bases: a mean and K directions over elements (vertices or faces) of a few numbers each. What all factorising
//! peers end in; a test shape's weights are the least-squares ones.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use sinew_command::report::principal::PrincipalComponents;

/// Added to the diagonal of the normal equations as a share of its mean: components that repeat each other keep an answer.
const RIDGE: f64 = 1e-9;

/// `x = mean + sum_k w_k direction_k`. Elements E, numbers per element `width`, D = E x width.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearBasis {
    /// Numbers per element.
    pub width: usize,
    /// Shape: `[D]`.
    pub mean: Vec<f64>,
    /// Shape: `[K][D]`.
    pub directions: Vec<Vec<f64>>,
}

impl LinearBasis {
    /// Principal components, values of `width` numbers an element.
    pub fn of(components: PrincipalComponents, width: usize) -> Self {
        Self {
            width,
            mean: components.mean,
            directions: components.directions,
        }
    }

    /// The vector at `weights` (`[K]`).
    pub fn compose(&self, weights: &[f64]) -> Vec<f64> {
        let mut sum = self.mean.clone();
        for (direction, weight) in self
            .directions
            .iter()
            .zip(weights)
            .filter(|(_, weight)| **weight != 0.0)
        {
            for (sum, x) in sum.iter_mut().zip(direction) {
                *sum += weight * x;
            }
        }
        sum
    }

    /// Squared length of each element of direction k. Shape: `[E]`.
    pub fn energy(&self, k: usize) -> Vec<f64> {
        let elements = self.directions[k].chunks_exact(self.width);
        elements.map(|x| x.iter().map(|x| x * x).sum()).collect()
    }

    /// Products of all directions, elements weighted (`[E]`). Shape: `[K][K]`.
    pub(crate) fn gram(&self, element_weights: &[f64]) -> DMatrix<f64> {
        let count = self.directions.len();
        let rows: Vec<Vec<f64>> = (0..count)
            .into_par_iter()
            .map(|k| {
                let weighted = weighted(&self.directions[k], element_weights, self.width);
                let others = self.directions[..=k].iter();
                others.map(|other| product(&weighted, other)).collect()
            })
            .collect();
        DMatrix::from_fn(count, count, |i, j| rows[i.max(j)][i.min(j)])
    }

    /// Directions that are not zero.
    pub fn used_count(&self) -> usize {
        self.directions
            .iter()
            .filter(|direction| direction.iter().any(|&x| x != 0.0))
            .count()
    }
}

/// The least-squares weights of any vector, its normal equations factored once.
#[derive(Debug, Clone)]
pub struct LinearProjection<'b> {
    basis: &'b LinearBasis,
    element_weights: Vec<f64>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl<'b> LinearProjection<'b> {
    /// Misfits count by `element_weights`, shape `[E]`, positive.
    pub fn new(basis: &'b LinearBasis, element_weights: &[f64]) -> Self {
        let component_count = basis.directions.len();
        let mut gram = basis.gram(element_weights);
        let mean = gram.diagonal().sum() / component_count.max(1) as f64;
        for k in 0..component_count {
            gram[(k, k)] += RIDGE * mean;
        }
        Self {
            basis,
            element_weights: element_weights.to_vec(),
            factor: Cholesky::new(gram),
        }
    }

    /// Weights of the vector nearest to `sample` (`[D]`). Shape: `[K]`; zeros for a basis that is zero throughout.
    pub fn weights(&self, sample: &[f64]) -> Vec<f64> {
        let Some(factor) = &self.factor else {
            return vec![0.0; self.basis.directions.len()];
        };
        let centred: Vec<f64> = sample.iter().zip(&self.basis.mean).map(|(x, mean)| x - mean).collect();
        let centred = weighted(&centred, &self.element_weights, self.basis.width);
        let directions = self.basis.directions.iter();
        let right = DVector::from_iterator(
            self.basis.directions.len(),
            directions.map(|direction| product(direction, &centred)),
        );
        factor.solve(&right).iter().copied().collect()
    }
}

/// Every element times its weight.
pub(crate) fn weighted(values: &[f64], element_weights: &[f64], width: usize) -> Vec<f64> {
    let elements = values.chunks_exact(width).zip(element_weights);
    elements
        .flat_map(|(x, weight)| x.iter().map(move |x| x * weight))
        .collect()
}

/// Scalar product, in four running sums of fixed order.
pub(crate) fn product(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_tail), (b, b_tail)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let tail: f64 = a_tail.iter().zip(b_tail).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_weights_it_composed_and_heeds_element_weights() {
        let basis = LinearBasis {
            width: 2,
            mean: vec![1.0, 0.0, 0.0, 2.0, 0.0],
            directions: vec![vec![1.0, 0.0, 1.0, 0.0], vec![0.0, 0.0, 1.0, 1.0]],
        };
        let basis = LinearBasis {
            mean: basis.mean[..4].to_vec(),
            ..basis
        };
        let projection = LinearProjection::new(&basis, &[1.0, 1.0]);
        let weights = projection.weights(&basis.compose(&[0.5, -2.0]));
        assert!(
            (weights[0] - 0.5).abs() < 1e-7 && (weights[1] + 2.0).abs() < 1e-7,
            "{weights:?}"
        );
        // The first direction alone cannot have both elements right: it serves the heavier one.
        let single = LinearBasis {
            directions: vec![basis.directions[0].clone()],
            ..basis
        };
        let weights = LinearProjection::new(&single, &[1.0, 1e6]).weights(&[1.0, 0.0, 3.0, 2.0]);
        assert!((weights[0] - 3.0).abs() < 1e-4, "{weights:?}");
        assert_eq!(single.used_count(), 1);
    }

    #[test]
    fn a_zero_basis_has_zero_weights() {
        let basis = LinearBasis {
            width: 1,
            mean: vec![0.0; 2],
            directions: vec![vec![0.0; 2]],
        };
        assert_eq!(LinearProjection::new(&basis, &[1.0, 1.0]).weights(&[1.0, 1.0]), [0.0]);
        assert_eq!(basis.used_count(), 0);
    }
}
