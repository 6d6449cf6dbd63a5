//! How far a loose piece is from where the solve leaves it, linear in the weights: ridge regression in closed form, its strength
//! chosen on shapes held out in runs. What is known of each pose -> weights of components -> an offset a unit of weight.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// Ridges to choose from, as shares of the mean eigenvalue, strongest first.
const RIDGES: [f64; 7] = [10.0, 1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5];

/// Runs of consecutive shapes that are held out in turn; each shape alone where there are fewer.
const RUNS: usize = 10;

/// An offset has to take away at least this share of what is missing on shapes held out, or the piece stays where it is.
const LEAST_GAIN: f64 = 0.05;

/// Offsets a unit of weight for one piece. Shape: `[K]`; nothing where shapes that were held out gain nothing.
///
/// `codes` `[N][K]` are weights of N shapes, `missing` `[N]` how far the piece is from its place in each, and `reach` `[K]` what
/// is known of how much each component moves the piece, as a variance: a component that moves it little explains little.
///
/// Source: ridge regression; a run of shapes is left out by the hat matrix H: `(1 - H_rr)^-1` times the run's residual.
pub fn fit_offsets(codes: &[Vec<f64>], missing: &[[f64; 3]], reach: &[f64]) -> Option<Vec<[f64; 3]>> {
    let (shape_count, component_count) = (codes.len(), reach.len());
    let kernel = DMatrix::from_fn(shape_count, shape_count, |i, j| {
        (0..component_count)
            .map(|k| codes[i][k] * reach[k] * codes[j][k])
            .sum::<f64>()
    });
    let mean = kernel.trace() / shape_count.max(1) as f64;
    if shape_count < 2 || !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(kernel);
    let wanted = DMatrix::from_fn(shape_count, 3, |n, c| missing[n][c]);
    let turned = eigen.eigenvectors.tr_mul(&wanted);
    let mut best = (wanted.norm_squared() * (1.0 - LEAST_GAIN), None);
    for ridge in RIDGES.map(|share| share * mean) {
        let error = held_out_error(&eigen, &wanted, ridge);
        if error < best.0 {
            best = (error, Some(ridge));
        }
    }
    let ridge = best.1?;
    let shares = eigen.eigenvalues.map(|value| 1.0 / (value.max(0.0) + ridge));
    let dual = &eigen.eigenvectors * DMatrix::from_diagonal(&shares) * turned;
    let offset = |k: usize| {
        core::array::from_fn(|c| reach[k] * (0..shape_count).map(|n| codes[n][k] * dual[(n, c)]).sum::<f64>())
    };
    Some((0..component_count).map(offset).collect())
}

/// Squared error on every shape, each predicted from those outside its run.
fn held_out_error(eigen: &SymmetricEigen<f64, nalgebra::Dyn>, wanted: &DMatrix<f64>, ridge: f64) -> f64 {
    let shape_count = wanted.nrows();
    let shares: DVector<f64> = eigen.eigenvalues.map(|value| value.max(0.0) / (value.max(0.0) + ridge));
    let hat = &eigen.eigenvectors * DMatrix::from_diagonal(&shares) * eigen.eigenvectors.transpose();
    let residual = wanted - &hat * wanted;
    let runs = RUNS.min(shape_count);
    (0..runs)
        .map(|run| {
            let first = run * shape_count / runs;
            let length = (run + 1) * shape_count / runs - first;
            let own = DMatrix::identity(length, length) - hat.view((first, first), (length, length));
            let left = residual.rows(first, length).into_owned();
            Cholesky::new(own).map_or(f64::INFINITY, |factor| factor.solve(&left).norm_squared())
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(shapes: usize) -> Vec<Vec<f64>> {
        (0..shapes)
            .map(|n| (0..3).map(|k| (n as f64 * (0.7 + 0.4 * k as f64)).sin()).collect())
            .collect()
    }

    #[test]
    fn a_piece_that_follows_two_components_is_found() {
        let codes = codes(30);
        let missing: Vec<[f64; 3]> = codes
            .iter()
            .map(|code| [2.0 * code[0], -code[2], 0.5 * code[0] + code[2]])
            .collect();
        let Some(offsets) = fit_offsets(&codes, &missing, &[1.0; 3]) else {
            panic!("a linear motion is explained");
        };
        for (offset, expected) in offsets.iter().zip([[2.0, 0.0, 0.5], [0.0; 3], [0.0, -1.0, 1.0]]) {
            for c in 0..3 {
                assert!((offset[c] - expected[c]).abs() < 1e-3, "{offsets:?}");
            }
        }
    }

    #[test]
    fn what_the_weights_do_not_say_moves_nothing() {
        let codes = codes(12);
        // Signs without a pattern that the weights have.
        let missing: Vec<[f64; 3]> = (0..12_u32)
            .map(|n| [if (n * 7 + n / 3) % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0])
            .collect();
        assert_eq!(fit_offsets(&codes, &missing, &[1.0; 3]), None);
        assert_eq!(
            fit_offsets(&codes, &[[0.0; 3]; 12], &[1.0; 3]),
            None,
            "nothing is missing"
        );
        assert_eq!(
            fit_offsets(&codes[..1], &missing[..1], &[1.0; 3]),
            None,
            "one shape says nothing"
        );
    }

    #[test]
    fn a_component_that_cannot_reach_explains_nothing() {
        let codes = codes(30);
        let missing: Vec<[f64; 3]> = codes.iter().map(|code| [code[1], 0.0, 0.0]).collect();
        let Some(offsets) = fit_offsets(&codes, &missing, &[1.0, 1.0, 0.0]) else {
            panic!("the second component explains it");
        };
        assert_eq!(offsets[2], [0.0; 3]);
    }
}
