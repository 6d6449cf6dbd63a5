//! As-consistent-as-possible features of a sequence (method section 1): aligned shapes -> T -> R S -> log R, with the
//! branch of every logarithm chosen so that neighbours agree -> [`AcapFeatures`] -> scaler -> network.

use core::sync::atomic::{AtomicUsize, Ordering};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

use super::branches::consistent_logarithms;
use super::gradient::{FeatureSettings, GradientFit};
use super::polar::Polar;
use crate::mesh::topology::Topology;

/// The feature of an undeformed vertex: r = 0, S = I.
pub const NEUTRAL_FEATURE: [f64; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0];

/// Features of N shapes: log-rotation `r` (axis times angle, radians, **not** wrapped at pi) and stretch `S`.
#[derive(Debug, Clone)]
pub struct AcapFeatures {
    /// Shape: `[N][V][9]`: r_x r_y r_z, S_xx S_xy S_xz S_yy S_yz S_zz. The reference has r = 0, S = I.
    pub shapes: Vec<Vec<[f64; 9]>>,
}

impl AcapFeatures {
    /// Features of `shapes` (`[N][V][3]`, aligned to `rest`), shapes in parallel; the same bits for any thread count.
    /// `progress` is called with the number of shapes that are done, from any thread.
    pub fn compute(
        topology: &Topology,
        rest: &[[f64; 3]],
        shapes: &[Vec<[f64; 3]>],
        settings: &FeatureSettings,
        progress: &(dyn Fn(usize) + Sync),
    ) -> AcapFeatures {
        let fit = GradientFit::new(topology, rest, settings);
        let done = AtomicUsize::new(0);
        let shapes = shapes
            .par_iter()
            .map(|shape| {
                let features = features_of_shape(topology, &fit, shape);
                progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                features
            })
            .collect();
        AcapFeatures { shapes }
    }
}

/// Features of one aligned shape. Shape: `[V][3]` to `[V][9]`. Finite for finite positions.
pub fn features_of_shape(topology: &Topology, fit: &GradientFit<'_>, shape: &[[f64; 3]]) -> Vec<[f64; 9]> {
    let polars: Vec<Polar> = fit.gradients(shape).iter().map(Polar::of).collect();
    let rotations: Vec<Matrix3<f64>> = polars.iter().map(|polar| polar.rotation).collect();
    consistent_logarithms(topology, &rotations)
        .iter()
        .zip(&polars)
        .map(|(r, polar)| {
            let s = &polar.stretch;
            [
                r[0],
                r[1],
                r[2],
                s[(0, 0)],
                s[(0, 1)],
                s[(0, 2)],
                s[(1, 1)],
                s[(1, 2)],
                s[(2, 2)],
            ]
        })
        .collect()
}

/// Edges whose ends disagree by more than half a turn in `features` (`[V][9]`): a branch changes there. Zero on a
/// consistent shape; a few remain at folded joints.
pub fn inconsistent_edge_count(topology: &Topology, features: &[[f64; 9]]) -> usize {
    let half_turn = core::f64::consts::PI;
    topology
        .edges()
        .iter()
        .filter(|[a, b]| {
            (rotation_vector(&features[*a as usize]) - rotation_vector(&features[*b as usize])).norm() > half_turn
        })
        .count()
}

/// `T = exp(r) S` of one feature.
pub fn gradient_of_feature(feature: &[f64; 9]) -> Matrix3<f64> {
    let stretch = Matrix3::new(
        feature[3], feature[4], feature[5], //
        feature[4], feature[6], feature[7], //
        feature[5], feature[7], feature[8],
    );
    Rotation3::new(rotation_vector(feature)).into_inner() * stretch
}

/// `[r]x + s`: what a small change of a feature about the reference does to T.
pub fn widened_feature(change: &[f64; 9]) -> Matrix3<f64> {
    let [x, y, z, xx, xy, xz, yy, yz, zz] = *change;
    Matrix3::new(
        xx,
        xy - z,
        xz + y, //
        xy + z,
        yy,
        yz - x, //
        xz - y,
        yz + x,
        zz,
    )
}

fn rotation_vector(feature: &[f64; 9]) -> Vector3<f64> {
    Vector3::new(feature[0], feature[1], feature[2])
}
