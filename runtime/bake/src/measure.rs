//! How far the bones are from the exact tier: both played through the runtime, on poses that a seed fixes and that nothing was
//! fitted to.
//!
//! Other poses of the same kind give the figures again within a tenth, but for the maxima.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rayon::prelude::*;
use sinew_formats::package::{BonesError, PoseError, Prior, SKIN_WEIGHT_SUM};
use sinew_runtime::{Basis, BoneTransform, BonesInfo, TierChoice};

use crate::BakeError;
use crate::bones::{shape_poses, slider_poses};
use crate::mesh::vector::{cross, difference, dot, length};
use crate::play::{Played, play, pose};

/// Poses of each kind: as many as make so many vertices, within these bounds.
const MEASURED_VERTICES: usize = 1 << 20;
const LEAST_POSES: usize = 64;
const MOST_POSES: usize = 512;

/// Not the seed of the poses that are fitted.
const MEASURE_SEED: u64 = 0x6d65_6173_7572_6564;

/// Poses held in memory at a time.
const POSES_AT_ONCE: usize = 8;

/// Bins of the histogram behind the percentile, and the least distance that has one of its own: each is 1 % wide.
const BINS: usize = 2048;
const LEAST_BINNED: f64 = 1e-9;
const BIN_WIDTH: f64 = 0.01;

/// Sums over vertices and poses.
struct Tally {
    count: f64,
    squares: f64,
    greatest: f64,
    squared_angles: f64,
    bins: Vec<u64>,
}

impl Tally {
    fn new() -> Self {
        Self {
            count: 0.0,
            squares: 0.0,
            greatest: 0.0,
            squared_angles: 0.0,
            bins: vec![0; BINS],
        }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.squares += other.squares;
        self.greatest = self.greatest.max(other.greatest);
        self.squared_angles += other.squared_angles;
        for (sum, bin) in self.bins.iter_mut().zip(&other.bins) {
            *sum += bin;
        }
    }

    fn figures(&self, poses: usize) -> PoseError {
        let mean = |sum: f64| (sum / self.count.max(1.0)).sqrt() as f32;
        PoseError {
            rms: mean(self.squares),
            p99: self.percentile_99(),
            max: self.greatest as f32,
            normal_rms: mean(self.squared_angles),
            poses: poses as u32,
        }
    }

    /// The upper end of the bin in which 99 of 100 are counted.
    fn percentile_99(&self) -> f32 {
        let wanted = (0.99 * self.count).ceil() as u64;
        let mut counted = 0;
        for (bin, &count) in self.bins.iter().enumerate() {
            counted += count;
            if counted >= wanted {
                let upper = if bin == 0 {
                    0.0
                } else {
                    LEAST_BINNED * (BIN_WIDTH * bin as f64).exp()
                };
                return upper.min(self.greatest) as f32;
            }
        }
        self.greatest as f32
    }
}

fn bin(share: f64) -> usize {
    if share <= LEAST_BINNED {
        return 0;
    }
    (((share / LEAST_BINNED).ln() / BIN_WIDTH) as usize + 1).min(BINS - 1)
}

/// Plays slider poses, and such as the prior knows, on both tiers of a package.
/// Errors: those of [`play`], for a slider pose.
pub fn bones_error(basis: &Basis<'_>, prior: &Prior<'_>) -> Result<BonesError, BakeError> {
    let count = (MEASURED_VERTICES / basis.vertex_count()).clamp(LEAST_POSES, MOST_POSES);
    let figures = Figures::new(basis)?;
    let [sliders, sliders_scaled] = figures.of(&slider_poses(basis, MEASURE_SEED, count), false)?;
    // What a normal distribution makes far out may leave f32; a slider pose may not.
    let [shapes, shapes_scaled] = figures.of(&shape_poses(prior, MEASURE_SEED, count), true)?;
    Ok(BonesError {
        sliders,
        sliders_scaled,
        shapes,
        shapes_scaled,
    })
}

/// Both tiers, ready to be compared.
struct Figures<'a> {
    basis: &'a Basis<'a>,
    info: BonesInfo<'a>,
    diagonal: f64,
    /// Source order. Shape: `[V]`.
    rest: Vec<[f32; 3]>,
    rest_normals: Vec<[f32; 3]>,
    /// Shape: `[V][I]`.
    bones: Vec<u8>,
    weights: Vec<u16>,
}

impl<'a> Figures<'a> {
    fn new(basis: &'a Basis<'a>) -> Result<Self, BakeError> {
        let tier = TierChoice::Bones;
        let info = basis.bones().ok_or(BakeError::NoTier { tier })?;
        let count = basis.vertex_count();
        let (mut bones, mut weights) = (vec![0; info.influences() * count], vec![0; info.influences() * count]);
        info.write_skin(&mut bones, &mut weights);
        let mut rest_normals = vec![[0.0; 3]; count];
        info.write_rest_normals(&mut rest_normals);
        let slots = basis.rest_positions();
        Ok(Self {
            basis,
            info,
            diagonal: diagonal(slots),
            rest: basis
                .slot_from_vertex()
                .iter()
                .map(|slot| slots[slot as usize])
                .collect(),
            rest_normals,
            bones,
            weights,
        })
    }

    /// Figures of affine bones, then of scaled ones.
    fn of(&self, poses: &[Vec<f32>], may_overflow: bool) -> Result<[PoseError; 2], BakeError> {
        let mut sums = [Tally::new(), Tally::new()];
        let mut count = 0;
        for poses in poses.chunks(POSES_AT_ONCE) {
            let tallies: Vec<_> = poses.par_iter().map(|weights| self.compare(weights)).collect();
            // One after the other: sums do not depend on the threads.
            for tallies in tallies {
                match tallies {
                    Ok(tallies) => {
                        count += 1;
                        sums.iter_mut().zip(&tallies).for_each(|(sum, tally)| sum.add(tally));
                    }
                    Err(_) if may_overflow => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(sums.map(|sum| sum.figures(count)))
    }

    fn compare(&self, weights: &[f32]) -> Result<[Tally; 2], BakeError> {
        let exact = play(self.basis, TierChoice::Exact, weights)?;
        let affine = play(self.basis, TierChoice::Bones, weights)?;
        let scaled = self.skinned(&pose(self.basis, weights)?.joints);
        Ok([&affine, &scaled].map(|other| compare(&exact, other, self.diagonal)))
    }

    /// What an engine makes of joints that translate, rotate and scale.
    fn skinned(&self, joints: &[BoneTransform]) -> Played {
        let maps: Vec<(Matrix3<f64>, Vector3<f64>)> = joints
            .iter()
            .enumerate()
            .map(|(b, joint)| {
                let rest = self.info.rest_transform(b);
                let linear = matrix(joint) * matrix(&rest).transpose();
                let place = Vector3::from(rest.translation.map(f64::from));
                (linear, Vector3::from(joint.translation.map(f64::from)) - linear * place)
            })
            .collect();
        let vertex = |v: usize| {
            let row = v * self.info.influences()..(v + 1) * self.info.influences();
            let (mut linear, mut offset) = (Matrix3::zeros(), Vector3::zeros());
            for (&bone, &weight) in self.bones[row.clone()].iter().zip(&self.weights[row]) {
                let share = f64::from(weight) / f64::from(SKIN_WEIGHT_SUM);
                let (of_bone, moved) = &maps[usize::from(bone)];
                linear += share * of_bone;
                offset += share * moved;
            }
            let position = linear * Vector3::from(self.rest[v].map(f64::from)) + offset;
            let cofactors = |m: &Matrix3<f64>| {
                let [x, y, z] = [
                    m.column(0).into_owned(),
                    m.column(1).into_owned(),
                    m.column(2).into_owned(),
                ];
                Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)])
            };
            let normal = cofactors(&linear) * Vector3::from(self.rest_normals[v].map(f64::from));
            let narrowed = |v: Vector3<f64>| core::array::from_fn(|c| v[c] as f32);
            (narrowed(position), narrowed(normal))
        };
        let (positions, normals) = (0..self.rest.len()).map(vertex).unzip();
        Played {
            positions,
            normals,
            features: Vec::new(),
        }
    }
}

/// Rotation and scale.
fn matrix(joint: &BoneTransform) -> Matrix3<f64> {
    let [x, y, z, w] = joint.rotation.map(f64::from);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
    rotation.into_inner() * Matrix3::from_diagonal(&Vector3::from(joint.scale.map(f64::from)))
}

/// Of the bounding box.
fn diagonal(positions: &[[f32; 3]]) -> f64 {
    let bounds = |fold: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        core::array::from_fn(|c| positions.iter().map(|p| f64::from(p[c])).fold(start, fold))
    };
    length(difference(
        bounds(f64::max, f64::NEG_INFINITY),
        bounds(f64::min, f64::INFINITY),
    ))
}

fn compare(exact: &Played, other: &Played, diagonal: f64) -> Tally {
    let mut tally = Tally::new();
    for (a, b) in exact.positions.iter().zip(&other.positions) {
        let distance = length(difference(a.map(f64::from), b.map(f64::from)));
        let share = if diagonal > 0.0 { distance / diagonal } else { 0.0 };
        tally.count += 1.0;
        tally.squares += share * share;
        tally.greatest = tally.greatest.max(share);
        tally.bins[bin(share)] += 1;
    }
    for (a, b) in exact.normals.iter().zip(&other.normals) {
        let (a, b) = (a.map(f64::from), b.map(f64::from));
        let angle = length(cross(a, b)).atan2(dot(a, b));
        tally.squared_angles += angle * angle;
    }
    tally
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_percentile_is_that_of_the_values_within_a_bin() {
        let mut tally = Tally::new();
        for i in 1..=1000 {
            let share = f64::from(i) * 1e-6;
            tally.count += 1.0;
            tally.greatest = share;
            tally.bins[bin(share)] += 1;
        }
        let found = f64::from(tally.percentile_99());
        assert!(
            (0.99e-3..=0.99e-3 * (1.0 + 2.0 * BIN_WIDTH)).contains(&found),
            "{found}"
        );
        assert_eq!((bin(0.0), bin(1e-10), bin(10.0)), (0, 0, BINS - 1));
    }
}
