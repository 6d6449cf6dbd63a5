//! Bones through the whole baker: near the exact tier, as far as they say, the same everywhere, and of any mesh.

use rayon::ThreadPoolBuilder;
use sinew_formats::package::{AlignedBytes, PoseError, limits};
use sinew_runtime::{Basis, TierChoice};

use super::{BoneOptions, Influences, slider_poses};
use crate::play::{Played, play};
use crate::{BakeOptions, bake_bytes_with, fixture};

/// The fixture's poses move by a fifth of its diagonal (rms); its bones, one to seven vertices, come this near.
const RMS: f32 = 0.02;
/// Other poses give the same figures within this.
const FRESH: f64 = 0.15;
const SEED: u64 = 1234;

fn baked(compact: &AlignedBytes, count: u16, influences: Influences, exact: bool) -> AlignedBytes {
    let options = BakeOptions {
        exact,
        bones: Some(BoneOptions { count, influences }),
    };
    bake_bytes_with(compact, &options).unwrap()
}

fn squared(a: &Played, b: &Played) -> f64 {
    let pairs = a.positions.as_flattened().iter().zip(b.positions.as_flattened());
    pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
}

fn diagonal(basis: &Basis<'_>) -> f64 {
    let rest = basis.rest_positions();
    let extent = |c: usize| {
        let values = || rest.iter().map(|p| f64::from(p[c]));
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    (0..3).map(|c| extent(c).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn bones_are_near_the_exact_tier_and_as_far_as_they_say() {
    let bytes = baked(&fixture::compact(1, false), 16, Influences::Four, true);
    let basis = Basis::open(&bytes).unwrap();
    let info = basis.bones().unwrap();
    assert_eq!((info.count(), info.influences()), (16, 4));
    assert!((0..basis.component_count()).all(|k| info.moves(k)));
    let error = info.error();
    let of = |figures: PoseError| [figures.rms, figures.p99, figures.max];
    for figures in [error.sliders, error.sliders_scaled, error.shapes, error.shapes_scaled] {
        let [rms, p99, max] = of(figures);
        println!("{figures:?}");
        assert!(figures.poses > 0 && rms > 0.0 && rms < p99 && p99 <= max && figures.normal_rms > 0.0);
    }
    assert!(error.sliders.rms < RMS && error.sliders.rms <= error.sliders_scaled.rms);
    let (mut apart, mut moved, mut count) = (0.0, 0.0, 0.0);
    let still = play(&basis, TierChoice::Exact, &vec![0.0; basis.component_count()]).unwrap();
    for weights in slider_poses(&basis, SEED, 400) {
        let [exact, bones] = [TierChoice::Exact, TierChoice::Bones].map(|tier| play(&basis, tier, &weights).unwrap());
        apart += squared(&exact, &bones);
        moved += squared(&exact, &still);
        count += basis.vertex_count() as f64;
    }
    let [apart, moved] = [apart, moved].map(|sum| (sum / count).sqrt() / diagonal(&basis));
    println!("{apart} of {moved}");
    assert!(moved > 5.0 * apart, "they follow: {apart} of {moved}");
    let stored = f64::from(error.sliders.rms);
    assert!((apart - stored).abs() < FRESH * stored, "{apart} {stored}");
}

#[test]
fn eight_influences_are_nearer_than_four_and_bones_alone_play_the_same() {
    let compact = fixture::compact(2, false);
    let [four, eight] = [Influences::Four, Influences::Eight].map(|influences| {
        let bytes = baked(&compact, 12, influences, true);
        let info = Basis::open(&bytes).unwrap().bones().unwrap();
        (info.influences(), info.error().sliders.rms)
    });
    assert_eq!([four.0, eight.0], [4, 8]);
    assert!(eight.1 < four.1, "{eight:?} {four:?}");
    let [both, alone] = [true, false].map(|exact| baked(&compact, 12, Influences::Four, exact));
    assert!(alone.len() < both.len());
    let [both, alone] = [&both, &alone].map(|bytes| Basis::open(bytes).unwrap());
    assert!(!alone.has_tier(TierChoice::Exact) && alone.nearest_tier() == TierChoice::Bones);
    for weights in slider_poses(&both, SEED, 3) {
        let [a, b] = [&both, &alone].map(|basis| play(basis, TierChoice::Bones, &weights).unwrap());
        assert_eq!((a.positions, a.normals), (b.positions, b.normals));
    }
}

#[test]
fn the_same_bytes_on_one_thread_and_on_four() {
    let compact = fixture::compact(5, false);
    let on = |threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| baked(&compact, 20, Influences::Four, true))
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn meshes_of_two_triangles_and_of_loose_pieces_have_bones_too() {
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut pieces: Vec<[f32; 3]> = Vec::new();
    for n in 0..9 {
        let at = |x: f32, y: f32, z: f32| [x + 2.0 * (n % 3) as f32, y + 2.0 * (n / 3) as f32, z];
        pieces.extend([at(0.0, 0.0, 0.1), at(1.0, 0.0, 0.0), at(0.2, 1.0, 0.3)]);
    }
    let triangles: Vec<[u32; 3]> = (0..9).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    for (rest, faces) in [(&square[..], &[[0, 1, 2], [0, 2, 3]][..]), (&pieces, &triangles)] {
        let compact = fixture::compact_on(rest, faces, 7, false);
        let bytes = baked(&compact, limits::BONES as u16, Influences::Eight, true);
        let basis = Basis::open(&bytes).unwrap();
        let info = basis.bones().unwrap();
        assert!((1..=rest.len()).contains(&info.count()), "{}", info.count());
        let error = info.error().sliders;
        println!("{} bones: {error:?}", info.count());
        assert!(error.rms < RMS);
    }
}
