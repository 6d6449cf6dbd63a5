//! The folded network, in the evaluator and in the runtime, against the unfolded one.

use sinew_formats::package::{BakedView, CompactView, FEATURE_COUNT};

use super::{EncoderSettings, FeatureDecoder, StackEncoder};
use crate::bake::{Surface, bake, bake_bytes, fixture};

/// Half precision keeps 11 binary digits of each folded value; a vertex sums a handful.
const HALF_TOLERANCE: f64 = 2e-3;

/// f32 products against f64 ones.
const SINGLE_TOLERANCE: f64 = 1e-5;

const WEIGHTS: [f64; 7] = [0.8, -0.5, 1.0, 0.3, -0.9, 0.6, 0.4];

#[test]
fn folded_decoder_is_the_unfolded_one() {
    let bytes = fixture::compact(2, false);
    let compact = CompactView::open(&bytes).unwrap();
    let baked = bake(&compact).unwrap();
    let folded = FeatureDecoder::new(&BakedView::open(&baked).unwrap()).decode_all(&WEIGHTS);
    let surface = Surface::of_package(&compact);
    let unfolded = StackEncoder::new(&compact, &surface.topology, EncoderSettings::default()).decode(&WEIGHTS);
    let largest = unfolded
        .as_flattened()
        .iter()
        .fold(0.0_f64, |largest, x| largest.max(x.abs()));
    assert!(largest > 0.1, "the fixture moves nothing: {largest}");
    for (folded, unfolded) in folded.as_flattened().iter().zip(unfolded.as_flattened()) {
        assert!(
            (folded - unfolded).abs() < HALF_TOLERANCE * largest,
            "{folded} {unfolded}"
        );
    }
}

#[test]
fn runtime_plays_the_folded_features() {
    let bytes = fixture::compact(4, false);
    let baked = bake_bytes(&bytes).unwrap();
    let decoder = FeatureDecoder::new(&BakedView::open(&baked).unwrap());
    let basis = sinew_runtime::Basis::open(&baked).unwrap();
    let mut memory = vec![0; sinew_runtime::WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = sinew_runtime::Workspace::new(&basis, &mut memory).unwrap();
    let mut weights = [0.0; WEIGHTS.len()];
    let mut controls = sinew_runtime::Controls::new(&basis, &mut weights).unwrap();
    for (k, &weight) in WEIGHTS.iter().enumerate() {
        controls.set_unclamped(k, weight as f32).unwrap();
    }
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let frame = sinew_runtime::Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: None,
    };
    frame.run(&mut workspace).unwrap();
    let expected = decoder.decode_all(&WEIGHTS);
    let mut played = vec![[0.0; FEATURE_COUNT]; basis.vertex_count()];
    workspace.features(&basis, &mut played).unwrap();
    for (features, expected) in played.iter().zip(&expected) {
        for c in 0..FEATURE_COUNT {
            assert!((f64::from(features[c]) - expected[c]).abs() < SINGLE_TOLERANCE);
        }
    }
    let anchor = CompactView::open(&bytes).unwrap().anchor_vertex() as usize;
    let rest = fixture::mesh().0[anchor];
    assert!(
        (0..3).all(|c| (positions[anchor][c] - rest[c]).abs() < 1e-4),
        "the anchor stays"
    );
}
