//! The folded network, in the evaluator and in the runtime, against the unfolded one.

use sinew_formats::package::{CompactView, FEATURE_COUNT};

use super::{EncoderSettings, FeatureDecoder, StackEncoder};
use crate::bake::{Surface, bake_bytes, fixture};

/// The folded decoder keeps its values in single precision.
const SINGLE_TOLERANCE: f64 = 1e-5;

/// The runtime's values are whole numbers of 16 bits, each of which takes over what its neighbours' rounding left.
const PLAYED_TOLERANCE: f64 = 1e-3;

const WEIGHTS: [f64; 7] = [0.8, -0.5, 1.0, 0.3, -0.9, 0.6, 0.4];

#[test]
fn folded_decoder_is_the_unfolded_one() {
    let bytes = fixture::compact(2, false);
    let compact = CompactView::open(&bytes).unwrap();
    let surface = Surface::of_package(&compact);
    let folded = FeatureDecoder::new(&compact, &surface.topology).decode_all(&WEIGHTS);
    let unfolded = StackEncoder::new(&compact, &surface.topology, EncoderSettings::default()).decode(&WEIGHTS);
    let largest = unfolded
        .as_flattened()
        .iter()
        .fold(0.0_f64, |largest, x| largest.max(x.abs()));
    assert!(largest > 0.1, "the fixture moves nothing: {largest}");
    for (folded, unfolded) in folded.as_flattened().iter().zip(unfolded.as_flattened()) {
        assert!(
            (folded - unfolded).abs() < SINGLE_TOLERANCE * largest,
            "{folded} {unfolded}"
        );
    }
}

#[test]
fn runtime_plays_the_folded_features() {
    let bytes = fixture::compact(4, false);
    let baked = bake_bytes(&bytes).unwrap();
    let compact = CompactView::open(&bytes).unwrap();
    let decoder = FeatureDecoder::new(&compact, &Surface::of_package(&compact).topology);
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
    let largest = expected
        .as_flattened()
        .iter()
        .fold(0.0_f64, |largest, x| largest.max(x.abs()));
    for (features, expected) in played.iter().zip(&expected) {
        for c in 0..FEATURE_COUNT {
            assert!((f64::from(features[c]) - expected[c]).abs() < PLAYED_TOLERANCE * largest);
        }
    }
    // The anchor stays where the solve leaves it, at rest; what is added after the solve moves it.
    let (anchor, after) = (compact.anchor_vertex() as usize, compact.after());
    let mut expected = fixture::mesh().0[anchor].map(f64::from);
    for (k, weight) in WEIGHTS.iter().enumerate() {
        let added = after.derivative(WEIGHTS.len(), k, anchor);
        (0..3).for_each(|c| expected[c] += weight * f64::from(added[c]));
    }
    assert!(
        (0..3).all(|c| (f64::from(positions[anchor][c]) - expected[c]).abs() < 1e-5),
        "{:?} {expected:?}",
        positions[anchor]
    );
}
