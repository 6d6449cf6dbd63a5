//! Refining, between the fit and the package: components are fitted anew to the weights that the package's encoder reads off
//! unseen mixes, in the metric that counts positions, and so on in turns.
//!
//! The fit's gradient is shared with all that its loss asks for. Here least squares say which weights suit each mix, and every
//! vertex then answers to the few components that reach it, by least squares of its own. Supports stay as they are.

use core::ops::Range;

use nalgebra::{Cholesky, DMatrix, SMatrix};
use rayon::prelude::*;
use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::draft::PackageError;
use super::package::draft;
use super::prepare::Prepared;
use super::trial::Trial;
use super::{LearnError, Reporter};
use crate::config::{RefineSettings, TrainConfig};
use crate::network::weights::StackWeights;

/// Number of the first mix of the first turn, far from those that everything else sees.
const REFINE_MIXES: u64 = 1 << 43;

/// Added to each diagonal entry of a vertex's normal equations, as a share of it: what mixes hardly tell apart stays.
const VERTEX_RIDGE: f64 = 1e-3;

/// Takes a change of decoded values back to one of C.
type Undo = Option<SMatrix<f64, FEATURE_COUNT, FEATURE_COUNT>>;

/// Refines `weights`, which the given `shapes` of `prepared` were learned from. Rows that come back have unit length, and
/// what the package will cut is cut.
/// Errors: those of drafting a package, a wish to stop.
pub(super) fn refine(
    prepared: &Prepared,
    config: &TrainConfig,
    shapes: &[usize],
    mut weights: StackWeights,
    reporter: &dyn Reporter,
) -> Result<StackWeights, LearnError> {
    let RefineSettings { rounds, samples } = config.refine;
    if rounds == 0 || samples == 0 {
        return Ok(weights);
    }
    reporter.stage("refining", rounds as u64);
    let mixer = prepared.mixer(shapes, &config.mixes, config.seed);
    for round in 0..rounds {
        if reporter.stop_requested() {
            return Err(LearnError::Stopped);
        }
        let mixes = mixer.mixes(REFINE_MIXES + (round * samples) as u64, samples);
        turn(prepared, config, shapes, &mut weights, &mixes)?;
        reporter.advance(round as u64 + 1, "");
    }
    Ok(weights)
}

fn turn(
    prepared: &Prepared,
    config: &TrainConfig,
    shapes: &[usize],
    weights: &mut StackWeights,
    mixes: &[f32],
) -> Result<(), PackageError> {
    let vertex_count = weights.vertex_count;
    let cut = draft(prepared, config, weights, shapes)?;
    cut.put_rows_into(weights);
    let samples: Vec<&[[f32; FEATURE_COUNT]]> = mixes.as_chunks::<FEATURE_COUNT>().0.chunks(vertex_count).collect();
    let trial = Trial::new(prepared, config, &cut)?;
    let codes = trial.encoded(&samples)?;
    let decoder = trial.decoder();
    let residuals: Vec<Vec<[f32; FEATURE_COUNT]>> = samples
        .par_iter()
        .zip(&codes)
        .map(|(sample, code)| {
            let decoded = decoder.decode_all(code);
            let pairs = sample.iter().zip(&decoded);
            pairs
                .map(|(x, y)| core::array::from_fn(|c| (f64::from(x[c]) - y[c]) as f32))
                .collect()
        })
        .collect();
    correct(weights, &codes, &residuals, prepared.kept_roots());
    weights.normalize_rows();
    Ok(())
}

/// Adds to every component, where it is not zero, what explains most of the residuals at its weights; those of the root block
/// that are `kept` stay.
fn correct(
    weights: &mut StackWeights,
    codes: &[Vec<f64>],
    residuals: &[Vec<[f32; FEATURE_COUNT]>],
    kept: Range<usize>,
) {
    let vertex_count = weights.vertex_count;
    let component_count = codes.first().map_or(0, Vec::len);
    let mut gram = DMatrix::from_fn(component_count, component_count, |i, j| {
        codes.iter().map(|code| code[i] * code[j]).sum::<f64>()
    });
    for k in 0..component_count {
        gram[(k, k)] *= 1.0 + VERTEX_RIDGE;
    }
    let rows: Vec<&[f32]> = weights
        .blocks()
        .flat_map(|block| block.components.chunks_exact(vertex_count * FEATURE_COUNT))
        .collect();
    let undo: Vec<Undo> = weights
        .blocks()
        .flat_map(|block| {
            let count = block.components.len() / (vertex_count * FEATURE_COUNT);
            core::iter::repeat_n(inverse_of_point(&block.decoder), count)
        })
        .collect();
    let corrections: Vec<Vec<(usize, [f32; FEATURE_COUNT])>> = (0..vertex_count)
        .into_par_iter()
        .map(|v| {
            let at = FEATURE_COUNT * v..FEATURE_COUNT * (v + 1);
            let reaching: Vec<usize> = (0..rows.len())
                .filter(|&k| !kept.contains(&k) && undo[k].is_some() && rows[k][at.clone()].iter().any(|&x| x != 0.0))
                .collect();
            correct_vertex(v, &reaching, &gram, codes, residuals, &undo)
        })
        .collect();
    let mut owned: Vec<&mut [f32]> = weights
        .blocks_mut()
        .flat_map(|block| block.components.chunks_exact_mut(vertex_count * FEATURE_COUNT))
        .collect();
    for (v, found) in corrections.into_iter().enumerate() {
        for (k, change) in found {
            let entry = &mut owned[k][FEATURE_COUNT * v..FEATURE_COUNT * (v + 1)];
            entry.iter_mut().zip(change).for_each(|(x, change)| *x += change);
        }
    }
}

fn correct_vertex(
    v: usize,
    reaching: &[usize],
    gram: &DMatrix<f64>,
    codes: &[Vec<f64>],
    residuals: &[Vec<[f32; FEATURE_COUNT]>],
    undo: &[Undo],
) -> Vec<(usize, [f32; FEATURE_COUNT])> {
    let count = reaching.len();
    let normal = DMatrix::from_fn(count, count, |i, j| gram[(reaching[i], reaching[j])]);
    let mut right = DMatrix::zeros(count, FEATURE_COUNT);
    for (code, residual) in codes.iter().zip(residuals) {
        for (i, &k) in reaching.iter().enumerate() {
            for c in 0..FEATURE_COUNT {
                right[(i, c)] += code[k] * f64::from(residual[v][c]);
            }
        }
    }
    let Some(factor) = Cholesky::new(normal) else {
        return Vec::new();
    };
    let change = factor.solve(&right);
    let changes = reaching.iter().enumerate().filter_map(|(i, &k)| {
        let folded = change.row(i).transpose();
        let own = undo[k]? * SMatrix::<f64, FEATURE_COUNT, 1>::from_fn(|c, _| folded[c]);
        Some((k, core::array::from_fn(|c| own[c] as f32)))
    });
    changes.collect()
}

/// What takes a change of decoded values back to one of C; nothing where the point matrix has no inverse. The neighbours'
/// part is left to the next turn.
fn inverse_of_point(convolution: &GraphConvRecord) -> Undo {
    SMatrix::<f64, FEATURE_COUNT, FEATURE_COUNT>::from_fn(|i, j| f64::from(convolution.point[i][j])).try_inverse()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::weights::{BlockWeights, LevelWeights, zero_convolution};

    /// Residuals pass through f32, and a ridge holds back.
    const TOLERANCE: f32 = 5e-3;

    fn identity() -> GraphConvRecord {
        let mut convolution = zero_convolution();
        (0..FEATURE_COUNT).for_each(|c| convolution.point[c][c] = 1.0);
        convolution
    }

    #[test]
    fn what_residuals_say_is_added_where_a_component_reaches_and_nowhere_else() {
        let vertex_count = 3;
        let mut components = vec![0.0; 2 * vertex_count * FEATURE_COUNT];
        // The first component reaches vertices 0 and 1, the second 1 and 2.
        for (k, v) in [(0, 0), (0, 1), (1, 1), (1, 2)] {
            components[(k * vertex_count + v) * FEATURE_COUNT] = 0.5;
        }
        let block = BlockWeights {
            encoder: identity(),
            decoder: identity(),
            components,
        };
        let mut weights = StackWeights {
            vertex_count,
            levels: vec![LevelWeights {
                component_count: 2,
                blocks: vec![block],
            }],
        };
        let before = weights.flat_components();
        let missing = |k: usize, v: usize, c: usize| 0.1 * ((k + 2 * v + 3 * c) % 7) as f32 - 0.3;
        let codes: Vec<Vec<f64>> = (0..40)
            .map(|n| vec![(f64::from(n) * 0.7).sin(), (f64::from(n) * 1.9).cos()])
            .collect();
        let residuals: Vec<Vec<[f32; FEATURE_COUNT]>> = codes
            .iter()
            .map(|code| {
                (0..vertex_count)
                    .map(|v| {
                        core::array::from_fn(|c| {
                            let of = |k: usize, reaches: bool| {
                                if reaches {
                                    code[k] as f32 * missing(k, v, c)
                                } else {
                                    0.0
                                }
                            };
                            of(0, v < 2) + of(1, v > 0)
                        })
                    })
                    .collect()
            })
            .collect();
        correct(&mut weights, &codes, &residuals, 0..0);
        let after = weights.flat_components();
        for k in 0..2 {
            for v in 0..vertex_count {
                for c in 0..FEATURE_COUNT {
                    let i = (k * vertex_count + v) * FEATURE_COUNT + c;
                    let reaches = if k == 0 { v < 2 } else { v > 0 };
                    let expected = before[i] + if reaches { missing(k, v, c) } else { 0.0 };
                    assert!(
                        (after[i] - expected).abs() < TOLERANCE,
                        "{k} {v} {c}: {} {expected}",
                        after[i]
                    );
                }
            }
        }
    }
}
