//! How far the fast tier is from the exact one: both played in f64 on the stored numbers, on poses that a seed fixes.
//!
//! f32 arithmetic adds about 1e-6 of the bounding box to either tier, far below what is measured here, so the figures hold
//! for the runtime. Other poses of the same kind give them again within a tenth, but for the maxima.

use rayon::prelude::*;
use sinew_formats::package::{FastError, SKIN_WEIGHT_SUM};

use super::play::{Gradient, Player, Pose, times};
use super::{Fast, MIXED_SHARE, Source};
use crate::mesh::topology::{corners, cross, difference, dot, length};

/// Mixed poses: as many as make so many vertices, within these bounds.
const MIXED_VERTICES: usize = 1 << 21;
const LEAST_MIXED_POSES: usize = 128;
const MOST_MIXED_POSES: usize = 1024;

/// Their seed: not that of the poses that the skin was fitted to.
const MIXED_SEED: u64 = 0x6d69_7865_6470_6f73;

/// Single poses at most: of more, as many evenly spread ones are measured.
const SINGLE_POSES: usize = 256;

/// Poses held in memory at a time.
const POSES_AT_ONCE: usize = 8;

/// Bins of the histogram behind the percentile, and the least distance that has one of its own: each is 1 % wide.
const BINS: usize = 2048;
const LEAST_BINNED: f64 = 1e-9;
const BIN_WIDTH: f64 = 0.01;

/// Both tiers, ready to play.
pub struct Measure<'a> {
    source: &'a Source<'a>,
    exact: &'a Player<'a>,
    fast: &'a Fast,
    /// Distances are shares of this.
    diagonal: f64,
}

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

    fn rms(&self) -> f32 {
        (self.squares / self.count.max(1.0)).sqrt() as f32
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

impl<'a> Measure<'a> {
    /// Takes both tiers as they are.
    pub fn new(source: &'a Source<'a>, exact: &'a Player<'a>, fast: &'a Fast) -> Self {
        let bounds = |fold: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
            core::array::from_fn(|c| source.surface.rest.iter().map(|p| p[c]).fold(start, fold))
        };
        let extent = difference(bounds(f64::min, f64::INFINITY), bounds(f64::max, f64::NEG_INFINITY));
        Self {
            source,
            exact,
            fast,
            diagonal: length(extent),
        }
    }

    /// Plays all poses.
    pub fn error(&self) -> FastError {
        let network = self.source.network;
        let wanted = MIXED_VERTICES / self.source.rest_positions.len().max(1);
        let mixed_poses = wanted.clamp(LEAST_MIXED_POSES, MOST_MIXED_POSES);
        let mixed = self.tally(&network.mixed_poses(MIXED_SEED, mixed_poses, MIXED_SHARE));
        let singles = network.single_poses();
        let stride = singles.len().div_ceil(SINGLE_POSES).max(1);
        let singles: Vec<Vec<f64>> = singles.into_iter().step_by(stride).collect();
        let single = self.tally(&singles);
        FastError {
            mixed_rms: mixed.rms(),
            mixed_p99: mixed.percentile_99(),
            mixed_max: mixed.greatest as f32,
            single_rms: single.rms(),
            single_max: single.greatest as f32,
            normal_rms: (mixed.squared_angles / mixed.count.max(1.0)).sqrt() as f32,
            mixed_poses: mixed_poses as u32,
        }
    }

    fn tally(&self, poses: &[Vec<f64>]) -> Tally {
        let fast = Player::new(self.source.network, &self.fast.nodes, &self.fast.components);
        let mut sum = Tally::new();
        for poses in poses.chunks(POSES_AT_ONCE) {
            let tallies: Vec<Tally> = poses
                .par_iter()
                .map(|weights| self.compare(&self.exact.play(weights), &fast.play_in_lanes(weights)))
                .collect();
            // One after the other: sums do not depend on the threads.
            tallies.iter().for_each(|tally| sum.add(tally));
        }
        sum
    }

    fn compare(&self, exact: &Pose, nodes: &Pose) -> Tally {
        let rest = &self.source.surface.rest;
        let skinned = self.skinned(nodes);
        let mut tally = Tally::new();
        for (d, e) in skinned.iter().zip(&exact.displacement) {
            let distance = length(difference(*d, *e));
            let share = if self.diagonal > 0.0 {
                distance / self.diagonal
            } else {
                0.0
            };
            tally.count += 1.0;
            tally.squares += share * share;
            tally.greatest = tally.greatest.max(share);
            tally.bins[bin(share)] += 1;
        }
        let moved = |displacement: &[[f64; 3]]| -> Vec<[f64; 3]> {
            let pairs = rest.iter().zip(displacement);
            pairs.map(|(r, d)| core::array::from_fn(|c| r[c] + d[c])).collect()
        };
        let faces = &self.source.surface.topology.faces;
        let (a, b) = (
            normals(faces, &moved(&exact.displacement)),
            normals(faces, &moved(&skinned)),
        );
        for (a, b) in a.iter().zip(&b) {
            let angle = length(cross(*a, *b)).atan2(dot(*a, *b));
            tally.squared_angles += angle * angle;
        }
        tally
    }

    /// Displacements of the vertices, source order, as the frame path skins them.
    fn skinned(&self, nodes: &Pose) -> Vec<[f64; 3]> {
        let fast = self.fast;
        let centre = fast.centre.map(f64::from);
        // Gradient, and displacement less what the gradient makes of the way from the centre.
        let transforms: Vec<(Gradient, [f64; 3])> = (0..nodes.gradients.len())
            .map(|n| {
                let arm = core::array::from_fn(|c| f64::from(fast.nodes.rest_positions[n][c]) - centre[c]);
                let turned = times(&nodes.gradients[n], &arm);
                let offset = core::array::from_fn(|c| nodes.displacement[n][c] - turned[c]);
                (nodes.gradients[n], offset)
            })
            .collect();
        let exact = self.source.exact;
        let rows = fast
            .skin_nodes
            .iter()
            .zip(&fast.skin_weights)
            .zip(&exact.rest_positions);
        let mut skinned = vec![[0.0; 3]; exact.node_count()];
        for (((row, weights), rest), &vertex) in rows.zip(&exact.node_from_lane) {
            let arm = core::array::from_fn(|c| f64::from(rest[c]) - centre[c]);
            let mut sum = [0.0; 3];
            for (&node, &weight) in row.iter().zip(weights) {
                let (gradient, offset) = &transforms[usize::from(node)];
                let turned = times(gradient, &arm);
                let share = f64::from(weight) / f64::from(SKIN_WEIGHT_SUM);
                for c in 0..3 {
                    sum[c] += share * (turned[c] + offset[c]);
                }
            }
            skinned[vertex as usize] = sum;
        }
        skinned
    }
}

/// Sums of the triangles' normals times their area; zero where there is none.
fn normals(faces: &[[u32; 3]], positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; positions.len()];
    for face in faces {
        let [a, b, c] = corners(face, positions);
        let normal = cross(difference(a, b), difference(a, c));
        for &v in face {
            for c in 0..3 {
                sums[v as usize][c] += normal[c];
            }
        }
    }
    sums
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
