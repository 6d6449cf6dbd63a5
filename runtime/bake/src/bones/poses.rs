//! The poses that bones are fitted to, and those that they are measured on.

use rand::{Rng, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use sinew_formats::package::Prior;
use sinew_runtime::{Basis, TierChoice};

use super::{Matrix, Source, Vector};
use crate::BakeError;
use crate::play::{gradient, play};

/// Chance of a control to move in a slider pose.
const SLIDER_SHARE: f64 = 0.5;
/// How far it then moves at most in a pose that is measured, as a share of its range.
const MEASURED_REACH: f32 = 0.7;
/// And in those that are fitted: a little farther, so that what is measured lies inside.
const FITTED_REACH: f32 = 0.85;
/// Some are fitted beyond the stops, where encoders and curves go.
const WIDE_REACH: f32 = 1.3;

/// Poses that are fitted: as many as make so many vertices, within these bounds. The positions of all are held in memory.
const FITTED_VERTICES: usize = 1 << 24;
const LEAST_FITTED: usize = 320;
const MOST_FITTED: usize = 1280;
/// How they share out: sliders, sliders beyond their stops, and the rest like the training shapes. Where nothing is known of these,
/// sliders take their part.
const SLIDERS: f64 = 0.4;
const WIDE: f64 = 0.2;

/// Poses with gradients at all vertices, which say where nodes and bones are wanted.
const DESCRIBED: usize = 40;

const FIT_SEED: u64 = 0x626f_6e65_2066_6974;

/// Exact poses, in source order.
pub(super) struct Samples {
    /// Shape: `[M][K]`.
    pub(super) weights: Vec<Vec<f32>>,
    /// Units of the source. Shape: `[M][V]`.
    pub(super) positions: Vec<Vec<[f32; 3]>>,
    /// `T` of the first poses. Shape: `[DESCRIBED or M][V]`.
    pub(super) gradients: Vec<Vec<Matrix>>,
    /// Length of the diagonal of the rest shape's bounding box, positive.
    pub(super) diagonal: f64,
}

impl Samples {
    /// Draws poses and plays them. A pose beyond the stops that leaves f32 is left out.
    /// Errors: [`BakeError::Overflow`] where so many do that hardly any is left.
    pub(super) fn play(source: &Source<'_>) -> Result<Self, BakeError> {
        let basis = source.played;
        let count = (FITTED_VERTICES / basis.vertex_count()).clamp(LEAST_FITTED, MOST_FITTED);
        let drawn = fitted_poses(basis, &source.prior, count);
        let played: Vec<_> = drawn
            .par_iter()
            .map(|weights| play(basis, TierChoice::Exact, weights))
            .collect();
        let mut samples = Self {
            weights: Vec::new(),
            positions: Vec::new(),
            gradients: Vec::new(),
            diagonal: diagonal(&source.surface.rest),
        };
        let mut lost = None;
        for (weights, played) in drawn.into_iter().zip(played) {
            match played {
                Ok(played) => {
                    if samples.gradients.len() < DESCRIBED {
                        let of_features = |x| Matrix::from_row_slice(&gradient(basis, x)) + Matrix::identity();
                        samples
                            .gradients
                            .push(played.features.iter().map(of_features).collect());
                    }
                    samples.weights.push(weights);
                    samples.positions.push(played.positions);
                }
                Err(error) => lost = Some(error),
            }
        }
        match lost {
            Some(error) if samples.weights.len() < count / 2 => Err(error),
            _ => Ok(samples),
        }
    }

    /// M.
    pub(super) fn count(&self) -> usize {
        self.weights.len()
    }

    pub(super) fn position(&self, pose: usize, v: usize) -> Vector {
        Vector::from(self.positions[pose][v].map(f64::from))
    }
}

/// Of the bounding box; 1 for a point, so that shares of it stay numbers.
fn diagonal(rest: &[[f64; 3]]) -> f64 {
    let bound = |fold: fn(f64, f64) -> f64, start: f64| -> Vector {
        Vector::from_fn(|c, _| rest.iter().map(|p| p[c]).fold(start, fold))
    };
    let length = (bound(f64::max, f64::NEG_INFINITY) - bound(f64::min, f64::INFINITY)).norm();
    if length > 0.0 { length } else { 1.0 }
}

/// In an order that mixes the kinds.
fn fitted_poses(basis: &Basis<'_>, prior: &Prior<'_>, count: usize) -> Vec<Vec<f32>> {
    let mut random = ChaCha8Rng::seed_from_u64(FIT_SEED);
    let of = |share: f64| (share * count as f64) as usize;
    let mut poses: Vec<Vec<f32>> = (0..of(WIDE)).map(|_| sliders(basis, &mut random, WIDE_REACH)).collect();
    if !prior.mean.is_empty() {
        let shapes = count - of(WIDE) - of(SLIDERS);
        poses.extend((0..shapes).map(|_| like_shapes(prior, &mut random)));
    }
    while poses.len() < count {
        poses.push(sliders(basis, &mut random, FITTED_REACH));
    }
    poses.shuffle(&mut random);
    poses
}

/// Poses of half of the sliders within 70 % of their ranges.
pub(crate) fn slider_poses(basis: &Basis<'_>, seed: u64, count: usize) -> Vec<Vec<f32>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| sliders(basis, &mut random, MEASURED_REACH))
        .collect()
}

/// Poses like the training shapes'; none where the package does not know them.
pub(crate) fn shape_poses(prior: &Prior<'_>, seed: u64, count: usize) -> Vec<Vec<f32>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let count = if prior.mean.is_empty() { 0 } else { count };
    (0..count).map(|_| like_shapes(prior, &mut random)).collect()
}

fn sliders(basis: &Basis<'_>, random: &mut ChaCha8Rng, reach: f32) -> Vec<f32> {
    let weight = |component: sinew_runtime::Component<'_>| {
        let (moves, along): (bool, f32) = (random.random_bool(SLIDER_SHARE), random.random());
        let anywhere = component.minimum + (component.maximum - component.minimum) * along;
        if moves { reach * anywhere } else { 0.0 }
    };
    basis.components().map(weight).collect()
}

/// Drawn from the prior.
fn like_shapes(prior: &Prior<'_>, random: &mut ChaCha8Rng) -> Vec<f32> {
    let components = prior.mean.len();
    let mut weights: Vec<f32> = prior.mean.to_vec();
    for factor in prior.factors.chunks_exact(components) {
        let share = normal(random);
        weights
            .iter_mut()
            .zip(factor)
            .for_each(|(weight, f)| *weight += share * f);
    }
    for (weight, variance) in weights.iter_mut().zip(prior.variances) {
        *weight += variance.sqrt() * normal(random);
    }
    weights
}

/// Of unit variance: the sum of twelve even numbers, which no libm rounds in its own way.
fn normal(random: &mut ChaCha8Rng) -> f32 {
    (0..12).map(|_| random.random::<f32>()).sum::<f32>() - 6.0
}
