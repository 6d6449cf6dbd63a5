//! E_rms (Kavan et al. 2010; method section 4): how far reconstructed positions are from the truth, per mille of the
//! sequence's bounding ball, after rigid alignment.

use rayon::prelude::*;

use super::{ScoreError, ball::smallest_ball};
use crate::features::align::{RigidMotion, widened};

/// A ball this small beside the coordinates holds nothing but their rounding.
const ROUNDING: f64 = 1e-12;

/// Truth and reconstruction in one frame and one unit, ready for every metric.
#[derive(Debug, Clone)]
pub struct NormalisedPair {
    /// Each shape rigidly aligned to the first one; the largest bounding ball has radius 1. Shape: `[N][V]`.
    pub truth: Vec<Vec<[f64; 3]>>,
    /// Each shape rigidly aligned to its truth, same unit. Shape: `[N][V]`.
    pub reconstruction: Vec<Vec<[f64; 3]>>,
}

impl NormalisedPair {
    /// Aligns and scales. Shapes: both `[N][V]`, N and V at least 1, same units.
    /// Errors: counts disagree, nothing to measure, positions that are not finite, a truth without extent.
    pub fn new(truth: &[Vec<[f32; 3]>], reconstruction: &[Vec<[f32; 3]>]) -> Result<Self, ScoreError> {
        check(truth, reconstruction)?;
        let first = widened(&truth[0]);
        let mut truth: Vec<_> = truth
            .par_iter()
            .map(|shape| laid_onto(&widened(shape), &first))
            .collect();
        let mut reconstruction: Vec<_> = reconstruction
            .par_iter()
            .zip(&truth)
            .map(|(shape, onto)| laid_onto(&widened(shape), onto))
            .collect();
        let radii: Vec<f64> = truth.par_iter().map(|shape| smallest_ball(shape).radius).collect();
        let radius = radii.into_iter().fold(0.0, f64::max);
        let magnitude = first
            .as_flattened()
            .iter()
            .fold(0.0_f64, |largest, c| largest.max(c.abs()));
        if radius <= magnitude * ROUNDING || radius == 0.0 {
            return Err(ScoreError::NoExtent);
        }
        for shape in truth.iter_mut().chain(&mut reconstruction) {
            for position in shape {
                *position = position.map(|coordinate| coordinate / radius);
            }
        }
        Ok(Self { truth, reconstruction })
    }

    /// `1000 |A - A'|_F / sqrt(3 V N)`.
    pub fn e_rms(&self) -> f64 {
        let squared: Vec<f64> = self
            .truth
            .par_iter()
            .zip(&self.reconstruction)
            .map(|(truth, reconstruction)| squared_difference(truth, reconstruction))
            .collect();
        let value_count = 3 * self.truth.len() * self.truth[0].len();
        1000.0 * (squared.into_iter().sum::<f64>() / value_count as f64).sqrt()
    }

    /// The same of each shape alone, for pictures and tables. Shape: `[N]`.
    pub fn e_rms_of_shapes(&self) -> Vec<f64> {
        let shapes = self.truth.par_iter().zip(&self.reconstruction);
        shapes
            .map(|(truth, reconstruction)| {
                1000.0 * (squared_difference(truth, reconstruction) / (3 * truth.len()) as f64).sqrt()
            })
            .collect()
    }
}

fn squared_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(p, q)| (0..3).map(|c| (p[c] - q[c]).powi(2)).sum::<f64>())
        .sum()
}

fn check(truth: &[Vec<[f32; 3]>], reconstruction: &[Vec<[f32; 3]>]) -> Result<(), ScoreError> {
    if truth.len() != reconstruction.len() {
        return Err(ScoreError::ShapeCount {
            truth: truth.len(),
            reconstruction: reconstruction.len(),
        });
    }
    let vertex_count = truth.first().map_or(0, Vec::len);
    if vertex_count == 0 {
        return Err(ScoreError::Nothing);
    }
    for (shape, positions) in truth.iter().enumerate().chain(reconstruction.iter().enumerate()) {
        if positions.len() != vertex_count {
            return Err(ScoreError::VertexCount {
                shape,
                expected: vertex_count,
                actual: positions.len(),
            });
        }
        if let Some(vertex) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(ScoreError::NotFinite { shape, vertex });
        }
    }
    Ok(())
}

fn laid_onto(shape: &[[f64; 3]], onto: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let motion = RigidMotion::onto(onto, shape);
    shape.iter().map(|&position| motion.apply(position)).collect()
}
