//! The fast tier of baked packages, played: it is as far from the exact one as its package says.

use sinew_bake::{BakeOptions, FastNodes, bake_bytes_with, fixture};
use sinew_formats::package::AlignedBytes;
use sinew_runtime::{Basis, Controls, Frame, Kernels, TierChoice, Workspace, WorkspaceLayout};

/// What is promised of the stored figures, on other poses of the same kind.
const FIGURES_TOLERANCE: f64 = 0.1;
/// The greatest of other vertices and poses.
const MAXIMUM_TOLERANCE: f64 = 0.35;
/// Share of the controls that move in a mixed pose.
const MIXED_SHARE: f64 = 0.25;

fn baked(seed: u64, vertices_a_node: u32) -> AlignedBytes {
    let options = BakeOptions {
        fast_nodes: FastNodes::OneIn(vertices_a_node),
    };
    bake_bytes_with(&fixture::compact(seed, false), &options).unwrap()
}

/// Both tiers of a basis, played on kernels of choice.
struct Tiers<'a> {
    basis: &'a Basis<'a>,
    kernels: Kernels,
    memory: [Vec<u8>; 2],
}

impl<'a> Tiers<'a> {
    fn new(basis: &'a Basis<'a>, kernels: Kernels) -> Self {
        let memory = [TierChoice::Exact, TierChoice::Fast]
            .map(|tier| vec![0; WorkspaceLayout::for_tier(basis, tier).unwrap().unaligned_bytes()]);
        Self { basis, kernels, memory }
    }

    /// Positions and normals of the exact tier, then of the fast one.
    fn play(&mut self, weights: &[f32]) -> [[Vec<[f32; 3]>; 2]; 2] {
        let mut own = vec![0.0; weights.len()];
        let mut controls = Controls::new(self.basis, &mut own).unwrap();
        for (k, &weight) in weights.iter().enumerate() {
            controls.set(k, weight).unwrap();
        }
        let [exact, fast] = &mut self.memory;
        [(TierChoice::Exact, exact), (TierChoice::Fast, fast)].map(|(tier, memory)| {
            let mut workspace = Workspace::for_tier(self.basis, tier, memory, self.kernels).unwrap();
            let mut positions = vec![[f32::NAN; 3]; self.basis.vertex_count()];
            let mut normals = positions.clone();
            let frame = Frame {
                basis: self.basis,
                controls: &controls,
                positions: &mut positions,
                normals: Some(&mut normals),
            };
            frame.run(&mut workspace).unwrap();
            [positions, normals]
        })
    }
}

/// Repeatable numbers in [0, 1): splitmix64.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn mixed(&mut self, basis: &Basis<'_>) -> Vec<f32> {
        let controls = basis.components();
        let weights = controls.map(|control| {
            let (moves, along) = (self.next() < MIXED_SHARE, self.next() as f32);
            if moves {
                control.minimum + (control.maximum - control.minimum) * along
            } else {
                0.0
            }
        });
        weights.collect()
    }
}

fn distance(a: &[f32; 3], b: &[f32; 3]) -> f64 {
    (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
}

fn diagonal(positions: &[[f32; 3]]) -> f64 {
    let bound =
        |fold: fn(f32, f32) -> f32, start| core::array::from_fn(|c| positions.iter().map(|p| p[c]).fold(start, fold));
    distance(&bound(f32::min, f32::INFINITY), &bound(f32::max, f32::NEG_INFINITY))
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

fn agree(name: &str, stored: f32, found: f64, tolerance: f64) {
    let stored = f64::from(stored);
    assert!(
        (found - stored).abs() <= tolerance * stored,
        "{name}: stored {stored:.3e}, found {found:.3e}"
    );
}

#[test]
fn the_stored_error_is_true() {
    const POSES: usize = 2000;
    for (seed, vertices_a_node) in [(1, 4), (2, 8)] {
        let bytes = baked(seed, vertices_a_node);
        let basis = Basis::open(&bytes).unwrap();
        let stored = basis.fast_error().unwrap();
        let size = diagonal(basis.rest_positions());
        let mut tiers = Tiers::new(&basis, Kernels::detect());
        let mut noise = Noise(seed);

        let (mut distances, mut angles) = (Vec::new(), Vec::new());
        for _ in 0..POSES {
            let [[exact, exact_normals], [fast, fast_normals]] = tiers.play(&noise.mixed(&basis));
            distances.extend(exact.iter().zip(&fast).map(|(a, b)| distance(a, b) / size));
            let chords = exact_normals.iter().zip(&fast_normals).map(|(a, b)| distance(a, b));
            angles.extend(chords.map(|chord| 2.0 * (0.5 * chord).min(1.0).asin()));
        }
        agree("mixed_rms", stored.mixed_rms, rms(&distances), FIGURES_TOLERANCE);
        agree("normal_rms", stored.normal_rms, rms(&angles), FIGURES_TOLERANCE);
        distances.sort_by(f64::total_cmp);
        let percentile = distances[distances.len() * 99 / 100];
        agree("mixed_p99", stored.mixed_p99, percentile, FIGURES_TOLERANCE);
        agree(
            "mixed_max",
            stored.mixed_max,
            distances[distances.len() - 1],
            MAXIMUM_TOLERANCE,
        );

        let mut distances = Vec::new();
        for (k, control) in basis.components().enumerate() {
            for stop in [control.minimum, control.maximum] {
                let mut weights = vec![0.0; basis.component_count()];
                weights[k] = stop;
                let [[exact, _], [fast, _]] = tiers.play(&weights);
                distances.extend(exact.iter().zip(&fast).map(|(a, b)| distance(a, b) / size));
            }
        }
        // The same poses.
        agree("single_rms", stored.single_rms, rms(&distances), 0.01);
        agree(
            "single_max",
            stored.single_max,
            distances.into_iter().fold(0.0, f64::max),
            0.01,
        );
    }
}

#[test]
fn rest_is_exact_on_all_kernels() {
    let bytes = baked(3, 8);
    let basis = Basis::open(&bytes).unwrap();
    for kernels in [Kernels::Scalar, Kernels::Avx2, Kernels::Avx512] {
        if !kernels.run_here() {
            continue;
        }
        let [[exact, exact_normals], [fast, fast_normals]] =
            Tiers::new(&basis, kernels).play(&vec![0.0; basis.component_count()]);
        assert_eq!((exact, exact_normals), (fast, fast_normals));
    }
}

#[test]
fn a_workspace_of_the_fast_tier_is_small() {
    let bytes = baked(1, 8);
    let basis = Basis::open(&bytes).unwrap();
    let bytes_of = |tier| WorkspaceLayout::for_tier(&basis, tier).unwrap().size_bytes;
    assert_eq!(
        bytes_of(TierChoice::Exact),
        WorkspaceLayout::for_basis(&basis).size_bytes
    );
    let limit = 16 * basis.vertex_count()
        + 128 * basis.fast_node_count().unwrap()
        + 12 * basis.component_count()
        + 72 * basis.block_count()
        + 9 * 64;
    assert!(
        bytes_of(TierChoice::Fast) <= limit,
        "{} {limit}",
        bytes_of(TierChoice::Fast)
    );
}

/// One basis, many workspaces on many threads, both tiers: the same bits as alone.
#[test]
fn a_crowd_shares_one_basis() {
    let bytes = baked(2, 8);
    let basis = Basis::open(&bytes).unwrap();
    let poses: Vec<Vec<f32>> = (0..16).map(|seed| Noise(seed).mixed(&basis)).collect();
    let alone: Vec<_> = poses
        .iter()
        .map(|pose| Tiers::new(&basis, Kernels::detect()).play(pose))
        .collect();
    let together: Vec<_> = std::thread::scope(|scope| {
        let basis = &basis;
        let threads: Vec<_> = poses
            .iter()
            .map(|pose| scope.spawn(move || Tiers::new(basis, Kernels::detect()).play(pose)))
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(alone, together);
}
