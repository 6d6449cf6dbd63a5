//! Principal components, the oldest peer: of positions (Alexa & Müller 2000), and of the very features that the network
//! learns from. Both global: every component moves the whole shape.

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

use sinew_trainer::features::reconstruct::PoissonSystem;

/// Variances below this share of the greatest are rounding: N shapes span at most N - 1 directions about their mean.
const VARIANCE_FLOOR: f64 = 1e-12;

/// Mean and orthonormal directions of greatest variance of N vectors of length D.
#[derive(Debug, Clone)]
pub struct PrincipalComponents {
    /// Shape: `[D]`.
    pub mean: Vec<f64>,
    /// Shape: `[K][D]`.
    pub directions: Vec<Vec<f64>>,
}

impl PrincipalComponents {
    /// Fits up to `component_count` directions to `samples` (shape `[N][D]`); fewer where the samples span fewer.
    /// Goes through the N x N matrix of products, so D may be large.
    pub fn fit(samples: &[Vec<f64>], component_count: usize) -> Self {
        let length = samples.first().map_or(0, Vec::len);
        let sample_count = samples.len().max(1) as f64;
        let mean: Vec<f64> = (0..length)
            .into_par_iter()
            .map(|d| samples.iter().map(|x| x[d]).sum::<f64>() / sample_count)
            .collect();
        let centred: Vec<Vec<f64>> = samples
            .par_iter()
            .map(|x| x.iter().zip(&mean).map(|(x, mean)| x - mean).collect())
            .collect();
        let rows: Vec<Vec<f64>> = centred
            .par_iter()
            .map(|a| centred.iter().map(|b| product(a, b)).collect())
            .collect();
        let gram = DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i.max(j)][i.min(j)]);
        let eigen = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..samples.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let greatest = order.first().map_or(0.0, |&first| eigen.eigenvalues[first]);
        let directions = order
            .into_iter()
            .take(component_count)
            .filter(|&n| eigen.eigenvalues[n] > VARIANCE_FLOOR * greatest)
            .map(|n| {
                let scale = 1.0 / eigen.eigenvalues[n].sqrt();
                let mut direction = vec![0.0; length];
                for (sample, share) in centred.iter().zip(eigen.eigenvectors.column(n).iter()) {
                    for (sum, x) in direction.iter_mut().zip(sample) {
                        *sum += scale * share * x;
                    }
                }
                direction
            })
            .collect();
        Self { mean, directions }
    }

    /// K found.
    pub fn component_count(&self) -> usize {
        self.directions.len()
    }

    /// The nearest vector that mean and directions make. Shape: `[D]`.
    pub fn project(&self, sample: &[f64]) -> Vec<f64> {
        let centred: Vec<f64> = sample.iter().zip(&self.mean).map(|(x, mean)| x - mean).collect();
        let mut nearest = self.mean.clone();
        for direction in &self.directions {
            let weight = product(direction, &centred);
            for (sum, x) in nearest.iter_mut().zip(direction) {
                *sum += weight * x;
            }
        }
        nearest
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Test shapes through principal components of the training shapes' positions. Shapes: all `[N][V]`, rigidly aligned to
/// the reference.
pub fn reconstruct_positions(
    train: &[Vec<[f64; 3]>],
    test: &[Vec<[f64; 3]>],
    component_count: usize,
) -> Vec<Vec<[f32; 3]>> {
    let flat: Vec<Vec<f64>> = train.iter().map(|shape| shape.as_flattened().to_vec()).collect();
    let components = PrincipalComponents::fit(&flat, component_count);
    let narrowed = |flat: &[f64]| flat.as_chunks::<3>().0.iter().map(|p| p.map(|c| c as f32)).collect();
    test.par_iter()
        .map(|shape| narrowed(&components.project(shape.as_flattened())))
        .collect()
}

/// Test shapes through principal components of the training shapes' features, then through the solve. Shapes: `[N][V]`,
/// unscaled features as in [`sinew_trainer::features::acap::AcapFeatures`]; positions come out near the reference.
pub fn reconstruct_features(
    system: &PoissonSystem,
    train: &[Vec<[f64; 9]>],
    test: &[Vec<[f64; 9]>],
    component_count: usize,
) -> Vec<Vec<[f32; 3]>> {
    let flat: Vec<Vec<f64>> = train.iter().map(|shape| shape.as_flattened().to_vec()).collect();
    let components = PrincipalComponents::fit(&flat, component_count);
    test.par_iter()
        .map(|shape| {
            let projected = components.project(shape.as_flattened());
            let positions = system.reconstruct(projected.as_chunks::<9>().0);
            positions.into_iter().map(|p| p.map(|c| c as f32)).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a few products in f64.
    const TOLERANCE: f64 = 1e-12;

    /// Two directions, orthogonal, the first with the larger variance.
    fn samples() -> Vec<Vec<f64>> {
        [[3.0, 0.0], [-3.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
            .iter()
            .map(|[a, b]| vec![1.0 + a, 2.0 + b, 3.0 + a, 4.0 - b])
            .collect()
    }

    #[test]
    fn spans_the_samples_and_keeps_the_strongest_first() {
        let all = PrincipalComponents::fit(&samples(), 10);
        assert_eq!(all.component_count(), 2, "four samples of rank two");
        for sample in samples() {
            let projected = all.project(&sample);
            assert!(sample.iter().zip(&projected).all(|(a, b)| (a - b).abs() < TOLERANCE));
        }
        let one = PrincipalComponents::fit(&samples(), 1);
        let projected = one.project(&[4.0, 3.0, 6.0, 3.0]);
        let expected = [4.0, 2.0, 6.0, 4.0];
        assert!(
            projected.iter().zip(expected).all(|(a, b)| (a - b).abs() < TOLERANCE),
            "{projected:?}"
        );
    }

    #[test]
    fn one_sample_is_its_own_mean() {
        let single = PrincipalComponents::fit(&samples()[..1], 3);
        assert_eq!(single.component_count(), 0);
        assert_eq!(single.project(&[0.0; 4]), samples()[0]);
    }

    #[test]
    fn training_shapes_come_back() {
        let shapes: Vec<Vec<[f64; 3]>> = (0..4_i32)
            .map(|m| {
                (0..6)
                    .map(|v| [f64::from(m * v), f64::from(m * m), f64::from(v)])
                    .collect()
            })
            .collect();
        let back = reconstruct_positions(&shapes, &shapes, 3);
        for (shape, back) in shapes.iter().zip(&back) {
            let pairs = shape.as_flattened().iter().zip(back.as_flattened());
            assert!(pairs.into_iter().all(|(a, b)| (a - f64::from(*b)).abs() < 1e-5));
        }
    }
}
