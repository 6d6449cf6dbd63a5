//! Unseen shapes moved by a few control points, through each method's components: a package's by the runtime's held vertices, with
//! the prior that it holds; every other method's by one search, with a prior that is fitted in the same way to its weights.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::CompareError;
use super::bench::{Bench, narrowed};
use super::fitting::{HANDLE_NOISE, weights_from_handles};
use crate::baselines::model::Model;
use sinew_trainer::components::prior::{Sight, WeightPrior};
use sinew_trainer::evaluate::{NormalisedPair, ScoreError, drag_to, gram_matrix};

/// Unseen shapes moved by control points.
const HANDLE_SHAPES: usize = 8;

/// Control points by which a prior is chosen, as for a package.
const PRIOR_COUNTS: [usize; 3] = [3, 8, 20];

/// E_rms of some measured shapes, of which the first control points alone are known, for every one of `counts`. `handles`
/// are vertices, `train_weights` of shape `[1 + M][K]` say which weights are likely.
pub(super) fn move_by_handles(
    bench: &Bench<'_>,
    handles: &[usize],
    counts: &[usize],
    model: &dyn Model,
    train_weights: &[Vec<f64>],
) -> Result<Vec<f64>, ScoreError> {
    if counts.is_empty() {
        return Ok(Vec::new());
    }
    let root = root_of_prior(bench, handles, model, train_weights);
    let chosen = chosen(bench);
    let truth: Vec<Vec<[f32; 3]>> = chosen.iter().map(|&n| bench.truth[n].clone()).collect();
    let follow = model.handles(handles);
    let diagonal = bench.diagonal();
    let errors = counts.iter().map(|&count| {
        let posed: Vec<Vec<[f32; 3]>> = chosen
            .par_iter()
            .map(|&n| {
                let targets: Vec<[f64; 3]> = handles[..count].iter().map(|&v| bench.test[n][v]).collect();
                let weights = weights_from_handles(&*follow, &targets, &root, diagonal);
                narrowed(&model.pose(&weights))
            })
            .collect();
        Ok(NormalisedPair::new(&truth, &posed)?.e_rms())
    });
    errors.collect()
}

/// The same for a package, by the runtime's held vertices.
pub(super) fn drag_held(
    bench: &Bench<'_>,
    handles: &[usize],
    counts: &[usize],
    package: &[u8],
    method: &str,
) -> Result<Vec<f64>, CompareError> {
    let chosen = chosen(bench);
    let truth: Vec<Vec<[f32; 3]>> = chosen.iter().map(|&n| bench.truth[n].clone()).collect();
    let errors = counts.iter().map(|&count| {
        let held = &handles[..count];
        let targets: Vec<Vec<[f32; 3]>> = chosen
            .iter()
            .map(|&n| narrowed(&held.iter().map(|&v| bench.test[n][v]).collect::<Vec<_>>()))
            .collect();
        let posed = drag_to(package, held, &targets).map_err(|source| CompareError::Hold {
            method: method.to_owned(),
            source,
        })?;
        let pair = NormalisedPair::new(&truth, &posed).map_err(|source| CompareError::Score {
            method: method.to_owned(),
            source,
        })?;
        Ok(pair.e_rms())
    });
    errors.collect()
}

/// The measured shapes, spread evenly over those that were not trained on.
fn chosen(bench: &Bench<'_>) -> Vec<usize> {
    let count = HANDLE_SHAPES.min(bench.test.len());
    (0..count)
        .map(|i| (2 * i + 1) * bench.test.len() / (2 * count))
        .collect()
}

/// L with `L L^T` the second moments of likely weights: of the prior fitted to `train_weights` `[1 + M][K]`, which a package of them
/// would hold, about its mean and with it. Shape: `[K][K + factors + 1]`.
fn root_of_prior(bench: &Bench<'_>, handles: &[usize], model: &dyn Model, train_weights: &[Vec<f64>]) -> DMatrix<f64> {
    let component_count = model.component_count();
    let rest = vec![0.0; component_count];
    let (follow, diagonal) = (model.handles(handles), bench.diagonal());
    let lower = gram_matrix(&model.tangents(&rest));
    let sight = Sight {
        held: PRIOR_COUNTS
            .iter()
            .map(|&count| follow.jacobian(&rest, count.min(handles.len())) / diagonal)
            .collect(),
        gram: DMatrix::from_fn(component_count, component_count, |i, j| lower[(i.max(j), i.min(j))]) / diagonal.powi(2),
        misfit: HANDLE_NOISE.powi(2),
    };
    let ranges: Vec<f64> = (0..component_count)
        .map(|k| {
            let of = |fold: fn(f64, f64) -> f64| train_weights.iter().map(|w| w[k]).fold(0.0, fold);
            of(f64::max) - of(f64::min)
        })
        .collect();
    let Some(prior) = WeightPrior::fit(train_weights, &ranges, &sight) else {
        return DMatrix::identity(component_count, component_count);
    };
    let factors: Vec<&[f32]> = prior
        .factors
        .chunks_exact(component_count)
        .chain([&*prior.mean])
        .collect();
    DMatrix::from_fn(
        component_count,
        component_count + factors.len(),
        |k, column| match column.checked_sub(component_count) {
            Some(q) => f64::from(factors[q][k]),
            None if column == k => f64::from(prior.variances[k]).sqrt(),
            None => 0.0,
        },
    )
}
