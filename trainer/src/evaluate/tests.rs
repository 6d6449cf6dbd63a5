//! The evaluator on a package whose answers are known.

use sinew_formats::package::CompactView;
use sinew_interchange::MeshSequence;
use sinew_runtime::{Basis, Workspace, WorkspaceLayout};

use super::*;
use crate::{
    bake::{Surface, bake_bytes, fixture},
    features::{align::widened, gradient::FeatureSettings, metric::FeatureMetric, reconstruct::PoissonSystem},
};

const WEIGHTS: [f64; 7] = [0.8, -0.5, 1.0, 0.3, -0.9, 0.6, 0.4];

/// Weights go through f32 and a damped search.
const WEIGHT_TOLERANCE: f64 = 1e-3;

/// What four layers leave of weights that make the fixture's tanh bend far.
const LAYERED_TOLERANCE: f64 = 0.1;

/// Positions go through f32.
const POSITION_TOLERANCE: f64 = 1e-4;

/// Positions of `weights`, moved rigidly so that the projection has a motion to find.
fn pose(package: &[u8], weights: &[f64]) -> Vec<[f32; 3]> {
    let baked = bake_bytes(package).unwrap();
    let basis = Basis::open(&baked).unwrap();
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut player = Player::new(&basis, Workspace::new(&basis, &mut memory).unwrap());
    let positions = player.play(weights).unwrap();
    positions
        .iter()
        .map(|&[x, y, z]| [0.6 * x - 0.8 * y + 2.0, 0.8 * x + 0.6 * y, z - 1.0])
        .collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn feature_projection_finds_the_weights_back() {
    let package = fixture::compact(11, false);
    let compact = CompactView::open(&package).unwrap();
    let surface = Surface::of_package(&compact);
    let decoder = FeatureDecoder::new(&compact, &surface.topology);
    let features: Vec<_> = decoder
        .decode_all(&WEIGHTS)
        .iter()
        .map(|x| x.map(|x| x as f32))
        .collect();
    let areas = surface.topology.vertex_areas(&surface.rest);
    let system = PoissonSystem::new(&surface.topology, &surface.weights, &surface.rest, 0).unwrap();
    let metric = FeatureMetric::new(&system, [1.0; 9], &areas);
    let projection = FeatureProjection::new(&decoder, metric);
    let found = projection.weights(&features, vec![0.0; WEIGHTS.len()]);
    assert!(largest_difference(&found, &WEIGHTS) < WEIGHT_TOLERANCE, "{found:?}");

    // The unrolled encoder comes nearer with every layer, and needs no search to come near.
    let missed = |layers: u8| {
        let record = EncoderRecord {
            layers,
            position_weight: projection.metric().common_position_weight([&features[..]].into_iter()),
        };
        let encoder = UnrolledEncoder::new(&projection, record, 3);
        let roots = encoder.root_weights(&features);
        assert!(roots[3..].iter().all(|&weight| weight == 0.0) && roots[..3].iter().any(|&weight| weight != 0.0));
        let weights = encoder.weights(&features);
        assert!(encoder.left_by(&weights, &features) < encoder.left_by(&roots, &features));
        largest_difference(&weights, &WEIGHTS)
    };
    let (one, two, four) = (missed(1), missed(2), missed(4));
    assert!(
        two < one && four < two && four < LAYERED_TOLERANCE,
        "{one} {two} {four}"
    );
}

#[test]
fn position_projection_finds_the_pose_back() {
    let package = fixture::compact(12, false);
    let target = pose(&package, &WEIGHTS);
    let baked = bake_bytes(&package).unwrap();
    let basis = Basis::open(&baked).unwrap();
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut player = Player::new(&basis, Workspace::new(&basis, &mut memory).unwrap());
    let near: Vec<f64> = WEIGHTS.iter().map(|weight| 0.7 * weight + 0.05).collect();
    let found = project_positions(&mut player, &target, near).unwrap();
    let played = widened(player.play(&found).unwrap());
    let motion = crate::features::align::RigidMotion::onto(&played, &widened(&target));
    let error = widened(&target)
        .iter()
        .zip(&played)
        .map(|(&target, played)| largest_difference(&motion.apply(target), played))
        .fold(0.0, f64::max);
    assert!(error < 10.0 * POSITION_TOLERANCE, "{error} {found:?}");
}

#[test]
fn evaluation_ranks_the_three_ways_and_names_its_fields() {
    let package = fixture::compact(13, false);
    let (rest, faces) = fixture::mesh();
    let shapes: Vec<Vec<[f32; 3]>> = core::iter::once(rest)
        .chain([0.3, 0.6].map(|share| pose(&package, &WEIGHTS.map(|weight| share * weight))))
        .collect();
    let shape_names = (0..shapes.len()).map(|m| format!("{m}")).collect();
    let sequence = MeshSequence {
        name: "grid".into(),
        faces,
        shapes: shapes.into_iter().collect(),
        shape_names,
        ..MeshSequence::default()
    };
    let input = EvaluationInput {
        package: &package,
        sequence: &sequence,
        test_shapes: &[1, 2],
        trained_shapes: &[1],
        settings: FeatureSettings::default(),
        encoder: EncoderSettings::default(),
    };
    let (evaluation, reconstructions) = evaluate(&input, &|_| ()).unwrap();
    assert_eq!((evaluation.shapes, evaluation.vertices), (2, fixture::mesh().0.len()));
    assert_eq!(evaluation.components, ComponentCounts { coarse: 3, fine: 4 });
    assert!(evaluation.position_projection.e_rms < evaluation.feature_projection.e_rms);
    assert!(evaluation.feature_projection.e_rms < evaluation.encoder.e_rms);
    let trained = evaluation.trained_max_percentage_error.unwrap();
    assert!(trained.two_level > 0.0 && trained.two_level <= evaluation.max_percentage_error.two_level);
    assert_eq!(reconstructions.encoder.len(), 2);
    let json = serde_json::to_value(&evaluation).unwrap();
    for pointer in [
        "/components/coarse",
        "/encoder/e_rms",
        "/feature_projection/sted",
        "/position_projection/sted_s",
        "/round_trip/sted_t",
        "/max_percentage_error/one_level",
        "/max_percentage_error/two_level",
        "/trained_max_percentage_error/two_level",
    ] {
        assert!(
            json.pointer(pointer).is_some_and(serde_json::Value::is_number),
            "{pointer}"
        );
    }

    let outside = EvaluationInput {
        test_shapes: &[3],
        ..input
    };
    assert!(matches!(
        evaluate(&outside, &|_| ()),
        Err(EvaluationError::NoSuchShape {
            shape: 3,
            shape_count: 3
        })
    ));
    let none = EvaluationInput {
        test_shapes: &[],
        ..input
    };
    assert!(matches!(
        evaluate(&none, &|_| ()),
        Err(EvaluationError::Score(ScoreError::Nothing))
    ));
    let mut turned = sequence.clone();
    turned.faces[4].rotate_left(1);
    let other = EvaluationInput {
        sequence: &turned,
        ..input
    };
    assert!(matches!(
        evaluate(&other, &|_| ()),
        Err(EvaluationError::Faces { face: 4 })
    ));
    let damaged = EvaluationInput {
        package: &package[..100],
        ..input
    };
    assert!(matches!(evaluate(&damaged, &|_| ()), Err(EvaluationError::Open(_))));
}

/// The encoder once more, written with dense matrices and nothing shared.
#[test]
fn encoder_agrees_with_a_dense_one() {
    let bytes = fixture::compact(14, false);
    let package = CompactView::open(&bytes).unwrap();
    let surface = Surface::of_package(&package);
    let vertex_count = package.vertex_count();
    let target = pose(&bytes, &WEIGHTS);
    // Any features will do; those of a pose have the right size. Rows are v * 9 + c.
    let x: Vec<f64> = target
        .iter()
        .flat_map(|p| (0..9).map(|c| 0.1 * f64::from(p[c % 3]) * (c as f64).sin()))
        .collect();
    let features: Vec<[f32; 9]> = (0..vertex_count)
        .map(|v| core::array::from_fn(|c| x[v * 9 + c] as f32))
        .collect();
    let x: Vec<f64> = features.iter().flatten().map(|&x| f64::from(x)).collect();

    let mut dense = vec![vec![0.0; vertex_count * 9]; package.component_count()];
    for entry in package.entries() {
        let scales = package.component(entry.component).value_scales.by_feature();
        for c in 0..9 {
            dense[entry.component][entry.vertex * 9 + c] = f64::from(entry.values[c]) * f64::from(scales[c]);
        }
    }
    let convolve = |conv: &sinew_formats::package::GraphConvRecord, x: &[f64]| -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        for v in 0..vertex_count {
            let ring = surface.topology.ring_of(v);
            for out in 0..9 {
                let mut sum = f64::from(conv.bias[out]);
                for c in 0..9 {
                    sum += f64::from(conv.point[out][c]) * x[v * 9 + c];
                    for &j in ring {
                        sum += f64::from(conv.neighbour[out][c]) * x[j as usize * 9 + c] / ring.len() as f64;
                    }
                }
                y[v * 9 + out] = sum.tanh() - f64::from(conv.bias[out]).tanh();
            }
        }
        y
    };
    let mut weights = vec![0.0; package.component_count()];
    let mut run = |b: usize, input: &[f64]| -> Vec<f64> {
        let block = package.block(b);
        let hidden = convolve(&block.encoder, input);
        let mut blend = vec![0.0; hidden.len()];
        for k in block.first_component as usize..(block.first_component + block.component_count) as usize {
            weights[k] = dense[k].iter().zip(&hidden).map(|(c, h)| c * h).sum();
            blend
                .iter_mut()
                .zip(&dense[k])
                .for_each(|(sum, c)| *sum += weights[k] * c);
        }
        let output = convolve(&block.decoder, &blend);
        input.iter().zip(&output).map(|(x, y)| x - y).collect()
    };
    let residual = run(0, &x);
    let root_energy: f64 = residual.iter().map(|r| r * r).sum();
    let floor = MASK_FLOOR / vertex_count as f64;
    let energy_of = |k: usize, v: usize| dense[k][v * 9..v * 9 + 9].iter().map(|c| c * c).sum::<f64>();
    let mut total = residual.clone();
    for parent in 0..2 {
        let mask =
            |v: usize| (energy_of(parent, v) + floor) / ((0..3).map(|k| energy_of(k, v)).sum::<f64>() + 3.0 * floor);
        let input: Vec<f64> = (0..vertex_count * 9).map(|i| mask(i / 9) * residual[i]).collect();
        let left = run(1 + parent, &input);
        total
            .iter_mut()
            .zip(&input)
            .zip(&left)
            .for_each(|((total, x), r)| *total -= x - r);
    }
    let encoding = StackEncoder::new(&package, &surface.topology, EncoderSettings::default()).encode(&features);
    assert!(
        largest_difference(&encoding.weights, &weights) < 1e-9,
        "{:?} {weights:?}",
        encoding.weights
    );
    assert!((encoding.root_residual_energy / root_energy - 1.0).abs() < 1e-9);
    let energy: f64 = total.iter().map(|r| r * r).sum();
    assert!((encoding.residual_energy / energy - 1.0).abs() < 1e-9);
}
