//! Plays a tier in f64, on the numbers that are stored: what the skin is fitted to and the error measured against.

use half::f16;
use rand::{Rng, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use sinew_formats::package::{BakedBlock, BakedComponent, FEATURE_COUNT, TILE_ENTRIES, TILE_SIDE};

use crate::fold::FoldedComponent;
use crate::tier::Tier;

/// `T - I` of a node, row-major.
pub type Gradient = [f64; 9];

/// Blocks, controls and scales: what all tiers share.
#[derive(Debug, Clone, Copy)]
pub struct Network<'a> {
    /// Shape: `[B]`.
    pub blocks: &'a [BakedBlock],
    /// Shape: `[K]`.
    pub components: &'a [BakedComponent<'a>],
    /// Network value to radians.
    pub rotation_scale: f32,
    /// Network value to stretch.
    pub stretch_scale: f32,
}

impl Network<'_> {
    /// The block of each component. Shape: `[K]`.
    pub fn block_of_component(&self) -> Vec<u32> {
        self.components.iter().map(|component| component.block).collect()
    }

    /// Mixed poses: every control moves in the given share of them, and then stands between its stops, evenly spread; which
    /// poses those are is drawn anew for each control. Shape: `[count][K]`.
    pub fn mixed_poses(&self, seed: u64, count: usize, share: f64) -> Vec<Vec<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut poses = vec![vec![0.0; self.components.len()]; count];
        let moving = ((share * count as f64).round() as usize).min(count);
        for (k, component) in self.components.iter().enumerate() {
            let (minimum, maximum) = (f64::from(component.minimum), f64::from(component.maximum));
            let mut order: Vec<usize> = (0..count).collect();
            order.shuffle(&mut random);
            for (place, &pose) in order[..moving].iter().enumerate() {
                let along = (place as f64 + random.random::<f64>()) / moving as f64;
                poses[pose][k] = minimum + (maximum - minimum) * along;
            }
        }
        poses
    }

    /// Single poses: each control at each of its stops that is not rest, the others at rest.
    pub fn single_poses(&self) -> Vec<Vec<f64>> {
        let stops = self.components.iter().enumerate();
        let stops = stops.flat_map(|(k, component)| [(k, component.minimum), (k, component.maximum)]);
        let at_stop = |(k, stop): (usize, f32)| {
            let mut weights = vec![0.0; self.components.len()];
            weights[k] = f64::from(stop);
            weights
        };
        stops.filter(|&(_, stop)| stop != 0.0).map(at_stop).collect()
    }
}

/// What a tier makes of a pose. Shape: both `[N]`, in the order that the function says.
#[derive(Debug, Clone)]
pub struct Pose {
    /// Of each node.
    pub gradients: Vec<Gradient>,
    /// Of each node, units of the source.
    pub displacement: Vec<[f64; 3]>,
}

/// A tier and the network on it.
#[derive(Debug)]
pub struct Player<'a> {
    network: Network<'a>,
    tier: &'a Tier,
    components: Vec<Component>,
}

/// A component, widened and scaled.
#[derive(Debug)]
struct Component {
    /// Solver indices.
    nodes: Vec<u32>,
    /// Shape: that of `nodes`.
    values: Vec<[f64; FEATURE_COUNT]>,
}

impl<'a> Player<'a> {
    /// Widens the components, which are those of the tier. Shape: `[K]`, in its solver order.
    pub fn new(network: Network<'a>, tier: &'a Tier, components: &[FoldedComponent]) -> Self {
        let widened = components.iter().map(|component| {
            let scale = f64::from(component.value_scale);
            let values = component.values.iter();
            Component {
                nodes: component.solver_indices.clone(),
                values: values
                    .map(|halves| halves.map(|bits| scale * f16::from_bits(bits).to_f64()))
                    .collect(),
            }
        });
        Self {
            network,
            tier,
            components: widened.collect(),
        }
    }

    /// Plays poses in parallel; the result does not depend on how. Node order. Shape: `[poses]`.
    pub fn play_all(&self, poses: &[Vec<f64>]) -> Vec<Pose> {
        poses.par_iter().map(|weights| self.play(weights)).collect()
    }

    /// One pose, in the tier's node order. Shape: `weights` `[K]`.
    pub fn play(&self, weights: &[f64]) -> Pose {
        let pose = self.play_in_lanes(weights);
        let order = || self.tier.lane_from_node.iter().map(|&lane| lane as usize);
        Pose {
            gradients: order().map(|lane| pose.gradients[lane]).collect(),
            displacement: order().map(|lane| pose.displacement[lane]).collect(),
        }
    }

    /// One pose, in the tier's lanes. Shape: `weights` `[K]`.
    pub fn play_in_lanes(&self, weights: &[f64]) -> Pose {
        let features = self.features(weights);
        let rotation = f64::from(self.network.rotation_scale);
        let stretch = f64::from(self.network.stretch_scale);
        let of_features = |x: &[f64; FEATURE_COUNT]| {
            gradient(&core::array::from_fn(|c| x[c] * if c < 3 { rotation } else { stretch }))
        };
        let lanes = || self.tier.lanes.solver_from_lane.iter().map(|&solver| solver as usize);
        let gradients: Vec<Gradient> = lanes().map(|solver| of_features(&features[solver])).collect();
        let mut solved = vec![[0.0; 3]; gradients.len()];
        for (solver, b) in lanes().zip(self.right_hand_side(&gradients)) {
            solved[solver] = b;
        }
        self.substitute(&mut solved);
        Pose {
            gradients,
            displacement: lanes().map(|solver| solved[solver]).collect(),
        }
    }

    /// In solver order. Shape: `[N]`.
    fn features(&self, weights: &[f64]) -> Vec<[f64; FEATURE_COUNT]> {
        let nothing = vec![[0.0; FEATURE_COUNT]; self.tier.node_count()];
        let (mut features, mut sums) = (nothing.clone(), nothing);
        for block in self.network.blocks {
            let first = block.first_component as usize;
            let active = (first..first + block.component_count as usize).filter(|&k| weights[k] != 0.0);
            let active: Vec<usize> = active.collect();
            for &k in &active {
                for (&node, value) in self.components[k].nodes.iter().zip(&self.components[k].values) {
                    for c in 0..FEATURE_COUNT {
                        sums[node as usize][c] += weights[k] * value[c];
                    }
                }
            }
            let bias = block.bias.map(f64::from);
            let rest = bias.map(f64::tanh);
            for &k in &active {
                for &node in &self.components[k].nodes {
                    // Taken when first met: then it is zero for the block's other components, and for the next block.
                    let sum = core::mem::replace(&mut sums[node as usize], [0.0; FEATURE_COUNT]);
                    for c in 0..FEATURE_COUNT {
                        features[node as usize][c] += (bias[c] + sum[c]).tanh() - rest[c];
                    }
                }
            }
        }
        features
    }

    /// In lanes. Shape: `[N]`.
    fn right_hand_side(&self, gradients: &[Gradient]) -> Vec<[f64; 3]> {
        let (rings, rest) = (&self.tier.rings, &self.tier.rest_positions);
        let row = |i: usize| {
            let mut sum = [0.0; 3];
            for e in rings.offsets[i] as usize..rings.offsets[i + 1] as usize {
                let j = rings.ring[e] as usize;
                let edge = core::array::from_fn(|c| f64::from(rest[i][c]) - f64::from(rest[j][c]));
                let both = core::array::from_fn(|n| gradients[i][n] + gradients[j][n]);
                let turned = times(&both, &edge);
                for c in 0..3 {
                    sum[c] += 0.5 * f64::from(rings.weights[e]) * turned[c];
                }
            }
            sum
        };
        (0..gradients.len()).map(row).collect()
    }

    /// `F D F^T x = b` by tiles, in place, in solver order.
    fn substitute(&self, b: &mut [[f64; 3]]) {
        let factor = &self.tier.factor;
        let tile_columns = |column: usize| factor.offsets[column] as usize..factor.offsets[column + 1] as usize;
        let column_count = factor.inverse_diagonals.len();
        let mut x = vec![[[0.0; 3]; TILE_SIDE]; column_count];
        for (lane, b) in x.as_flattened_mut().iter_mut().zip(b.iter()) {
            *lane = *b;
        }
        for column in 0..column_count {
            let own = x[column];
            for e in tile_columns(column) {
                let product = tile_times(&factor.tiles[e], &own, false);
                subtract(&mut x[factor.rows[e] as usize], &product);
            }
        }
        for column in (0..column_count).rev() {
            let mut own = tile_times(&factor.inverse_diagonals[column], &x[column], false);
            for e in tile_columns(column) {
                subtract(
                    &mut own,
                    &tile_times(&factor.tiles[e], &x[factor.rows[e] as usize], true),
                );
            }
            x[column] = own;
        }
        for (b, lane) in b.iter_mut().zip(x.as_flattened()) {
            *b = *lane;
        }
    }
}

/// Four nodes of a right-hand side or a solution.
type Block = [[f64; 3]; TILE_SIDE];

fn tile_times(tile: &[f32; TILE_ENTRIES], x: &Block, transposed: bool) -> Block {
    core::array::from_fn(|i| {
        let mut sum = [0.0; 3];
        for (j, x) in x.iter().enumerate() {
            let entry = if transposed {
                j * TILE_SIDE + i
            } else {
                i * TILE_SIDE + j
            };
            for c in 0..3 {
                sum[c] += f64::from(tile[entry]) * x[c];
            }
        }
        sum
    })
}

fn subtract(x: &mut Block, y: &Block) {
    for (x, y) in x.as_flattened_mut().iter_mut().zip(y.as_flattened()) {
        *x -= y;
    }
}

/// A matrix times a vector.
pub fn times(matrix: &Gradient, x: &[f64; 3]) -> [f64; 3] {
    core::array::from_fn(|row| matrix[3 * row] * x[0] + matrix[3 * row + 1] * x[1] + matrix[3 * row + 2] * x[2])
}

/// `exp([r]x) S - I` of a log-rotation, radians, and a stretch less identity.
fn gradient(x: &[f64; FEATURE_COUNT]) -> Gradient {
    let r = nalgebra::Vector3::new(x[0], x[1], x[2]);
    let rotation = nalgebra::Rotation3::new(r).into_inner();
    let stretch = nalgebra::Matrix3::new(1.0 + x[3], x[4], x[5], x[4], 1.0 + x[6], x[7], x[5], x[7], 1.0 + x[8]);
    let d = rotation * stretch - nalgebra::Matrix3::identity();
    core::array::from_fn(|n| d[(n / 3, n % 3)])
}
