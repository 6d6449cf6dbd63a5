//! Every set of kernels that runs here against twins in f64 and against each other, on sizes that fill no register.

use std::vec;
use std::vec::Vec;

use sinew_formats::package::{FEATURE_COUNT, Fans, GROUP_NODES, Patches, PatchesView};

use super::all::One;
use super::generic::decode::Share;
use super::generic::lanes::Lanes;
use super::generic::normals::FALLBACK_NORMAL;
use super::generic::{TANH_TOLERANCE, tanh};
use super::*;
use naive::{Noise, deformation_gradient};

mod four;
pub(crate) mod naive;
mod solve;

const NODE_COUNTS: [usize; 8] = [1, 3, 7, 8, 15, 16, 17, 53];
/// Roundings of features near one, through rotations of a few radians and stretches of a few.
const GRADIENT_TOLERANCE: f64 = 1e-5;
/// Components 0 and 1 belong to block 0, component 2 to block 1, components 3 and 4 to block 2.
const BLOCKS: [u32; 5] = [0, 0, 1, 2, 2];
const SCALES: FeatureScales = FeatureScales {
    rotation: 1.5,
    stretch: 0.4,
};

pub(crate) fn present() -> impl Iterator<Item = Kernels> {
    [Kernels::Scalar, Kernels::Portable, Kernels::Avx2, Kernels::Avx512]
        .into_iter()
        .filter(|kernels| kernels.run_here())
}

/// Components on scattered nodes; the last third of the nodes is out of reach of all.
struct Case {
    node_count: usize,
    patches: Patches,
    /// Zero where a component does not reach. Shape: `[K][N]`.
    dense: Vec<Vec<[f64; FEATURE_COUNT]>>,
    blocks: Vec<BlockRest>,
}

impl Case {
    fn new(node_count: usize) -> Self {
        let mut noise = Noise::new(node_count as u64);
        let mut dense = vec![vec![[0.0; FEATURE_COUNT]; node_count]; BLOCKS.len()];
        let mut entries = Vec::new();
        for (k, &block) in BLOCKS.iter().enumerate() {
            for slot in (0..node_count - node_count / 3).filter(|slot| !(slot + k).is_multiple_of(3)) {
                let whole = noise.features().map(|x| (16_384.0 * x) as i16);
                dense[k][slot] =
                    core::array::from_fn(|c| f64::from(whole[c]) * f64::from(of_feature(&VALUE_SCALES, c)));
                entries.push((k, block, slot as u32, whole));
            }
        }
        let bias = |_| BlockRest {
            bias: noise.features().map(|x| 0.3 * x),
            ..BlockRest::default()
        };
        Self {
            node_count,
            patches: Patches::gather(node_count, entries),
            dense,
            blocks: (0..3).map(bias).collect(),
        }
    }

    fn decoder<'a>(&'a self, shares: &'a [Share], blocks: &'a [BlockRest]) -> Decoder<'a> {
        Decoder {
            patches: PatchesView {
                offsets: &self.patches.offsets,
                owners: &self.patches.owners,
                values: &self.patches.values,
            },
            shares,
            blocks,
            scales: SCALES,
        }
    }

    fn blocks_for(&self, kernels: Kernels) -> Vec<BlockRest> {
        let mut blocks = self.blocks.clone();
        kernels.rest_activations(&mut blocks);
        blocks
    }

    /// Gradients of all nodes, from what `gradients` held.
    fn decode(&self, kernels: Kernels, shares: &[Share], all: bool, mut gradients: Vec<Gradient>) -> Vec<Gradient> {
        let blocks = self.blocks_for(kernels);
        let decoder = self.decoder(shares, &blocks);
        let mut touched = vec![1; gradients.len().div_ceil(GROUP_NODES)];
        if !all {
            decoder.mark_touched(&mut touched);
        }
        kernels.decode(&decoder, &touched, &mut gradients);
        gradients
    }

    /// `tanh(bias + sum_k z_k C_k) - tanh(bias)`, summed over the blocks.
    fn naive_features(&self, slot: usize, factors: &[f64]) -> [f64; FEATURE_COUNT] {
        core::array::from_fn(|c| {
            let block = |b: usize| {
                let own = (0..BLOCKS.len()).filter(|&k| BLOCKS[k] as usize == b);
                let u: f64 = own.map(|k| factors[k] * self.dense[k][slot][c]).sum();
                let bias = f64::from(self.blocks[b].bias[c]);
                (bias + u).tanh() - bias.tanh()
            };
            (0..3).map(block).sum()
        })
    }

    /// Columns of `exp([r]x) S - I`.
    fn naive_gradient(&self, slot: usize, factors: &[f64]) -> [[f64; 3]; 3] {
        less_identity(&self.naive_features(slot, factors), SCALES)
    }
}

fn less_identity(x: &[f64; FEATURE_COUNT], scales: FeatureScales) -> [[f64; 3]; 3] {
    let t = deformation_gradient(scales.rotation, scales.stretch, x);
    core::array::from_fn(|column| core::array::from_fn(|row| t[row][column] - f64::from(u8::from(row == column))))
}

/// Of whole numbers; far from each other, so that none is taken for the other.
const VALUE_SCALES: [f32; 2] = [1.0 / 32_768.0, 1.0 / 65_536.0];

fn of_feature(pair: &[f32; 2], c: usize) -> f32 {
    pair[usize::from(c >= 3)]
}

/// At these weights.
fn shares(weights: [f32; 5]) -> Vec<Share> {
    let share = |weight| Share {
        factors: VALUE_SCALES.map(|scale| weight * scale),
        scales: VALUE_SCALES,
        changed: 1,
    };
    weights.map(share).to_vec()
}

fn farthest(found: &Gradient, expected: &[[f64; 3]; 3]) -> f64 {
    assert!(found.iter().all(|column| column[3] == 0.0), "columns end in zero");
    let pairs = found.iter().zip(expected).flat_map(|(a, b)| a.iter().zip(b));
    pairs.map(|(&a, &b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
}

const ANY: Gradient = [[f32::NAN; 4]; 3];

#[test]
fn decode_equals_the_naive_network() {
    let factors = [0.7, -1.3, 0.9, 0.0, 2.0];
    for node_count in NODE_COUNTS {
        let case = Case::new(node_count);
        for kernels in present() {
            let found = case.decode(kernels, &shares(factors), true, vec![ANY; node_count]);
            for (lane, gradient) in found.iter().enumerate() {
                let expected = case.naive_gradient(lane, &factors.map(f64::from));
                let error = farthest(gradient, &expected);
                assert!(error < GRADIENT_TOLERANCE, "{kernels:?} {node_count} {lane}: {error}");
            }
        }
    }
}

#[test]
fn nothing_in_gives_exactly_nothing_out() {
    for kernels in present() {
        let case = Case::new(53);
        let found = case.decode(kernels, &shares([0.0; 5]), true, vec![ANY; 53]);
        assert_eq!(found, vec![[[0.0; 4]; 3]; 53]);
        // Beside nodes that move.
        let found = case.decode(kernels, &shares([1.0; 5]), true, vec![ANY; 53]);
        assert_eq!(found[53 - 53 / 3..], vec![[[0.0; 4]; 3]; 53 / 3]);
        assert!(found[..8].iter().all(|gradient| *gradient != [[0.0; 4]; 3]));
    }
}

#[test]
fn weights_without_measure_saturate() {
    for kernels in present() {
        let case = Case::new(17);
        let factors = [5e37, -5e37, 5e37, 5e37, 5e37];
        let found = case.decode(kernels, &shares(factors), true, vec![ANY; 17]);
        for (lane, gradient) in found.iter().enumerate() {
            let expected = case.naive_gradient(lane, &factors.map(f64::from));
            assert!(
                farthest(gradient, &expected) < 2.0 * GRADIENT_TOLERANCE,
                "{kernels:?} {lane}"
            );
        }
    }
}

#[test]
fn no_denormal_leaves_decode() {
    /// Far from the denormals, which begin at 1.2e-38: what follows may multiply once more.
    const SOUND_FROM: f32 = 1e-30;
    let is_sound = |x: &f32| *x == 0.0 || x.abs() >= SOUND_FROM;
    // Of a block without a bias, so that nothing lifts what is tiny.
    let mut case = Case::new(53);
    case.blocks
        .iter_mut()
        .for_each(|block| block.bias = [0.0; FEATURE_COUNT]);
    for kernels in present() {
        for exponent in (-44..=0).map(|e| 10_f32.powi(e)) {
            let factors = [exponent, -0.3 * exponent, 0.7 * exponent, 1e-3 * exponent, -exponent];
            let found = case.decode(kernels, &shares(factors), true, vec![ANY; 53]);
            let numbers = found.as_flattened().as_flattened();
            assert!(numbers.iter().all(is_sound), "{kernels:?} {exponent}");
            let mut features = [[0.0; GROUP_NODES]; FEATURE_COUNT];
            for (n, x) in features.as_flattened_mut().iter_mut().enumerate() {
                *x = exponent * ((n % 7) as f32 - 3.0);
            }
            let mut found = [ANY; GROUP_NODES];
            kernels.gradients(SCALES, &features, &mut found);
            let numbers = found.as_flattened().as_flattened();
            assert!(numbers.iter().all(is_sound), "{kernels:?} {exponent}");
        }
    }
}

#[test]
fn groups_that_nothing_changed_stay() {
    let mut own = shares([0.5, 0.25, 0.0, 0.0, 0.75]);
    own.iter_mut().for_each(|share| share.changed = 0);
    for kernels in present() {
        let case = Case::new(53);
        assert!(
            case.decode(kernels, &own, false, vec![[[3.0; 4]; 3]; 53])
                .iter()
                .all(|g| *g == [[3.0; 4]; 3])
        );
        own[2].changed = 1;
        let found = case.decode(kernels, &own, false, vec![[[3.0; 4]; 3]; 53]);
        let whole = case.decode(kernels, &own, true, vec![ANY; 53]);
        let reached = (53 - 53 / 3_usize).next_multiple_of(GROUP_NODES);
        assert_eq!(found[..reached], whole[..reached]);
        assert!(
            found[reached..].iter().all(|g| *g == [[3.0; 4]; 3]),
            "no component reaches the last group"
        );
        own[2].changed = 0;
    }
}

#[test]
fn features_equal_the_naive_sum() {
    let factors = [0.7, -1.3, 0.9, 0.0, 2.0];
    for kernels in present() {
        let case = Case::new(21);
        let (blocks, own) = (case.blocks_for(kernels), shares(factors));
        for g in 0..2 {
            let mut group: Group<f32> = [[f32::NAN; GROUP_NODES]; FEATURE_COUNT];
            kernels.features(&case.decoder(&own, &blocks), g, &mut group);
            for n in 0..GROUP_NODES.min(case.node_count - g * GROUP_NODES) {
                let expected = case.naive_features(g * GROUP_NODES + n, &factors.map(f64::from));
                for c in 0..FEATURE_COUNT {
                    assert!((f64::from(group[c][n]) - expected[c]).abs() < 3.0 * TANH_TOLERANCE);
                }
            }
        }
    }
}

#[test]
fn tangents_equal_the_difference_quotient() {
    /// Central differences in f64: truncation near its square.
    const STEP: f64 = 1e-5;
    let factors = [0.7_f32, -1.3, 0.9, 0.0, 2.0];
    for node_count in NODE_COUNTS {
        let case = Case::new(node_count);
        for kernels in present() {
            let (blocks, own) = (case.blocks_for(kernels), shares(factors));
            for k in 0..BLOCKS.len() {
                let mut found = vec![ANY; node_count];
                kernels.tangents(&case.decoder(&own, &blocks), k, &mut found);
                for (lane, tangent) in found.iter().enumerate() {
                    let at = |step: f64| {
                        let mut moved = factors.map(f64::from);
                        moved[k] += step;
                        case.naive_gradient(lane, &moved)
                    };
                    let (ahead, behind) = (at(STEP), at(-STEP));
                    let quotient = core::array::from_fn(|column| {
                        core::array::from_fn(|row| (ahead[column][row] - behind[column][row]) / (2.0 * STEP))
                    });
                    let error = farthest(tangent, &quotient);
                    assert!(
                        error < GRADIENT_TOLERANCE,
                        "{kernels:?} {node_count} {k} {lane}: {error}"
                    );
                }
            }
        }
    }
}

/// Angles of all sizes, side by side in one group: series, reduction, library.
#[test]
fn any_angle_gives_a_rotation() {
    /// The angle itself has 24 digits.
    const TOLERANCE_PER_RADIAN: f64 = 2e-7;
    let angles = [
        0.0, 1e-20, 1e-6, 0.01, 1.0, 3.1, 3.2, 6.3, 20.0, 99.0, 1e3, 4000.0, 5000.0, 1e5, 1e6, 3e6,
    ];
    let scales = FeatureScales {
        rotation: 1.0,
        stretch: 1.0,
    };
    let axis = [0.6_f32, -0.48, 0.64];
    for kernels in present() {
        let mut features = [[0.0; GROUP_NODES]; FEATURE_COUNT];
        for (n, &angle) in angles.iter().enumerate() {
            for c in 0..3 {
                features[c][n] = axis[c] * angle;
            }
        }
        let mut found = [ANY; GROUP_NODES];
        kernels.gradients(scales, &features, &mut found);
        for (n, &angle) in angles.iter().enumerate() {
            let r: [f64; 3] = core::array::from_fn(|c| f64::from(features[c][n]));
            let t = r.iter().map(|x| x * x).sum::<f64>().sqrt();
            let unit = r.map(|x| if t > 0.0 { x / t } else { 0.0 });
            let cross = [
                [0.0, -unit[2], unit[1]],
                [unit[2], 0.0, -unit[0]],
                [-unit[1], unit[0], 0.0],
            ];
            let (sine, less) = (t.sin(), 2.0 * (0.5 * t).sin().powi(2));
            let expected = core::array::from_fn(|column| {
                core::array::from_fn(|row| {
                    let square = unit[row] * unit[column] - f64::from(u8::from(row == column));
                    sine * cross[row][column] + less * square
                })
            });
            let error = farthest(&found[n], &expected);
            let tolerance = 5e-7 + TOLERANCE_PER_RADIAN * f64::from(angle);
            assert!(error < tolerance, "{kernels:?} {angle}: {error}");
        }
        features[1][5] = f32::INFINITY;
        features[2][6] = f32::NAN;
        let mut lost = [ANY; GROUP_NODES];
        kernels.gradients(scales, &features, &mut lost);
        for n in 0..GROUP_NODES {
            assert_eq!(
                lost[n].as_flattened().iter().any(|x| x.is_nan()),
                n == 5 || n == 6,
                "{kernels:?} {n}"
            );
        }
        assert_eq!(lost[9], found[9], "neighbours stay");
    }
}

/// Through the kernels' own door: the tanh of a bias.
fn activations(kernels: Kernels, arguments: &[f32]) -> Vec<f32> {
    let mut blocks: Vec<BlockRest> = arguments
        .chunks(FEATURE_COUNT)
        .map(|chunk| {
            let mut rest = BlockRest::default();
            rest.bias[..chunk.len()].copy_from_slice(chunk);
            rest
        })
        .collect();
    kernels.rest_activations(&mut blocks);
    blocks
        .iter()
        .flat_map(|block| block.activation)
        .take(arguments.len())
        .collect()
}

#[test]
fn tanh_is_near_odd_and_bounded() {
    let arguments: Vec<f32> = (0..200_000).map(|n| n as f32 * 5e-5).collect();
    let negated: Vec<f32> = arguments.iter().map(|x| -x).collect();
    for kernels in present() {
        let found = activations(kernels, &arguments);
        for (&x, &y) in arguments.iter().zip(&found) {
            assert!(
                (f64::from(y) - f64::from(x).tanh()).abs() < TANH_TOLERANCE,
                "{kernels:?} {x} {y}"
            );
            assert!(y <= 1.0);
        }
        let mirrored: Vec<f32> = activations(kernels, &negated).iter().map(|y| -y).collect();
        assert_eq!(mirrored, found);
        let ends = activations(kernels, &[0.0, 1e-38, 8.0, 9.0, f32::MAX, f32::INFINITY]);
        assert_eq!(ends[0], 0.0);
        assert!((ends[1] - 1e-38).abs() < 1e-44, "{kernels:?}: tiny arguments stay");
        assert!(
            ends[3..].iter().all(|&y| y == ends[2]),
            "{kernels:?} saturates: {ends:?}"
        );
    }
    assert_eq!(tanh(One::splat(0.0)), One(0.0));
}

#[test]
fn normals_have_the_same_bits_from_every_kernel() {
    for count in [3_usize, 4, 7, 8, 9, 16, 31, 45] {
        let mut noise = Noise::new(count as u64);
        let stride = (2..).find(|n| !count.is_multiple_of(*n)).unwrap();
        let slots: Vec<u32> = (0..count).map(|v| ((v * stride + 1) % count) as u32).collect();
        let distinct = slots.iter().collect::<std::collections::BTreeSet<_>>().len() == count;
        let slots = if distinct { slots } else { (0..count as u32).collect() };
        let mut vertex_from_slot = vec![0; count];
        for (v, &slot) in slots.iter().enumerate() {
            vertex_from_slot[slot as usize] = v as u32;
        }
        // Any triangles: boundaries, branches, doubles and triangles without area; the last vertex has none.
        let mut corner = || ((noise.next() + 1.0) * 0.5 * (count - 1) as f32) as u32;
        let faces: Vec<[u32; 3]> = (0..3 * count).map(|_| [corner(), corner(), corner()]).collect();
        let Fans { fan_offsets, fans } = Fans::gather(&faces, &slots);
        let around = Around {
            offsets: &fan_offsets,
            fans: &fans,
            vertex_from_slot: &vertex_from_slot,
        };
        let mut posed = vec![[0.0; 4]; count];
        for p in &mut posed {
            p[..3].copy_from_slice(&noise.point());
        }
        posed[1] = [1e30, -1e30, 1e30, 0.0];
        let all: Vec<Vec<[f32; 3]>> = present()
            .map(|kernels| {
                let mut normals = vec![[f32::NAN; 3]; count];
                kernels.normals(&around, &posed, &mut normals);
                normals
            })
            .collect();
        assert!(all.iter().all(|normals| *normals == all[0]), "{count}");
        assert_eq!(all[0][count - 1], FALLBACK_NORMAL);

        posed[1] = [0.25, 0.5, 0.75, 0.0];
        let mut normals = vec![[f32::NAN; 3]; count];
        Kernels::detect().normals(&around, &posed, &mut normals);
        let mut sums = vec![[0.0_f64; 3]; count];
        for face in &faces {
            let [p, q, r] = face.map(|v| posed[slots[v as usize] as usize].map(f64::from));
            let (a, b): ([f64; 3], [f64; 3]) = (
                core::array::from_fn(|c| q[c] - p[c]),
                core::array::from_fn(|c| r[c] - p[c]),
            );
            for &v in face {
                for c in 0..3 {
                    let (i, j) = ((c + 1) % 3, (c + 2) % 3);
                    sums[v as usize][c] += a[i] * b[j] - a[j] * b[i];
                }
            }
        }
        for (n, sum) in normals.iter().zip(&sums) {
            let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
            // Where a vertex has hardly any area, roundings turn its normal.
            if length > 0.1 {
                assert!(
                    (0..3).all(|c| (f64::from(n[c]) - sum[c] / length).abs() < 2e-5),
                    "{count}: {n:?} {sum:?}"
                );
            }
        }
    }
}
