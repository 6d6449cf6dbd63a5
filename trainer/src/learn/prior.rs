//! The prior of a basis' weights, from the training shapes as its encoder reads them; the last step before packaging, beside the
//! places of loose pieces.

use nalgebra::DMatrix;
use sinew_runtime::Basis;

use super::draft::{PackageError, bounding_diagonal, with_players};
use super::prepare::{Prepared, spread};
use super::trial::Trial;
use crate::components::extract::LearnedBasis;
use crate::components::prior::{Sight, WeightPrior};
use crate::evaluate::gram_matrix;
use crate::features::align::{RigidMotion, widened};

/// Training shapes that it is fitted to, at most.
const SHAPES_MAX: usize = 128;
/// The least misfit that held vertices are taken to have, as a share of the diagonal.
const LEAST_MISFIT: f64 = 1e-4;

/// Held vertices by which the prior is chosen: a few, and more.
const HELD_COUNTS: [usize; 3] = [3, 8, 20];

/// The prior of `basis`, of which `trial` is the draft; nothing of a single shape.
pub fn weight_prior(
    prepared: &Prepared,
    trial: &Trial<'_>,
    basis: &LearnedBasis,
) -> Result<Option<WeightPrior>, PackageError> {
    let all: Vec<usize> = (0..prepared.network.len()).collect();
    let shapes: Vec<usize> = spread(&all, SHAPES_MAX).collect();
    let mut codes = trial.encoded(&shapes.iter().map(|&m| &prepared.network[m]).collect::<Vec<_>>())?;
    let played = Basis::open(trial.baked()?)?;
    let numbers: Vec<usize> = (0..shapes.len()).collect();
    // Mean square of one coordinate.
    let misfits = with_players(&played, &numbers, |player, &n| {
        let posed = widened(player.play(&codes[n])?);
        let truth = widened(&prepared.aligned[shapes[n]]);
        let motion = RigidMotion::onto(&posed, &truth);
        let squares = posed.iter().zip(&truth).map(|(posed, &truth)| {
            let truth = motion.apply(truth);
            (0..3).map(|c| (posed[c] - truth[c]).powi(2)).sum::<f64>()
        });
        Ok(squares.sum::<f64>() / (3 * posed.len()) as f64)
    })?;
    let diagonal = f64::from(bounding_diagonal(&prepared.rest_positions));
    let misfit = misfits.iter().sum::<f64>() / misfits.len().max(1) as f64 / diagonal.powi(2);
    // Shape: `[K][V]`, at rest.
    let components: Vec<usize> = (0..basis.components().count()).collect();
    let tangents = with_players(&played, &components, |player, &k| {
        player.play(&vec![0.0; components.len()])?;
        let mut tangent = vec![[0.0; 3]; prepared.rest.len()];
        player.differentiate(k, &mut tangent)?;
        Ok(tangent)
    })?;
    let held = prepared.spread_vertices(HELD_COUNTS[HELD_COUNTS.len() - 1]);
    let sight = Sight {
        held: HELD_COUNTS
            .iter()
            .map(|&count| {
                let held = &held[..count.min(held.len())];
                DMatrix::from_fn(3 * held.len(), tangents.len(), |row, k| {
                    f64::from(tangents[k][held[row / 3]][row % 3]) / diagonal
                })
            })
            .collect(),
        gram: symmetric(gram_matrix(&tangents)) / diagonal.powi(2),
        misfit: misfit.max(LEAST_MISFIT.powi(2)),
    };
    // The reference is a shape, too.
    codes.insert(0, vec![0.0; basis.components().count()]);
    let ranges: Vec<f64> = basis
        .components()
        .map(|c| f64::from(c.maximum) - f64::from(c.minimum))
        .collect();
    Ok(WeightPrior::fit(&codes, &ranges, &sight))
}

/// Of a matrix whose lower triangle alone is filled.
fn symmetric(lower: DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(lower.nrows(), lower.ncols(), |i, j| lower[(i.max(j), i.min(j))])
}
