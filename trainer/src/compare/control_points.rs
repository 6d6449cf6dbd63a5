//! Unseen shapes moved by a few control points, through each method's components.

use rayon::prelude::*;

use super::bench::{Bench, narrowed};
use super::fitting::weights_from_handles;
use crate::baselines::model::Model;
use crate::evaluate::{NormalisedPair, ScoreError};

/// Unseen shapes moved by control points.
const HANDLE_SHAPES: usize = 8;

/// E_rms of some measured shapes, of which the first control points alone are known, for every one of `counts`. `handles`
/// are vertices, `train_weights` of shape `[1 + M][K]` say how far weights go.
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
    let scales: Vec<f64> = (0..model.component_count())
        .map(|k| {
            let squares: f64 = train_weights.iter().map(|w| w[k] * w[k]).sum();
            (squares / train_weights.len() as f64).sqrt()
        })
        .collect();
    let count = HANDLE_SHAPES.min(bench.test.len());
    let chosen: Vec<usize> = (0..count)
        .map(|i| (2 * i + 1) * bench.test.len() / (2 * count))
        .collect();
    let truth: Vec<Vec<[f32; 3]>> = chosen.iter().map(|&n| bench.truth[n].clone()).collect();
    let follow = model.handles(handles);
    let diagonal = bench.diagonal();
    let errors = counts.iter().map(|&count| {
        let posed: Vec<Vec<[f32; 3]>> = chosen
            .par_iter()
            .map(|&n| {
                let targets: Vec<[f64; 3]> = handles[..count].iter().map(|&v| bench.test[n][v]).collect();
                let weights = weights_from_handles(&*follow, &targets, &scales, diagonal);
                narrowed(&model.pose(&weights))
            })
            .collect();
        Ok(NormalisedPair::new(&truth, &posed)?.e_rms())
    });
    errors.collect()
}
