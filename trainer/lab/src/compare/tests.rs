//! The whole comparison on a small bar: every method comes out, in order, the same on one and on two threads.

use super::*;
use crate::compare::page::comparison_page;
use sinew_trainer::learn::Silent;
use sinew_trainer::synthesize::{Settings, Subject};

fn small(quick: bool) -> CompareSettings {
    let mut config = TrainConfig::default();
    config.mixes.per_step = 4;
    config.start.samples = 48;
    config.start.rounds = 2;
    config.start.centres = 16;
    config.start.position_modes = 4;
    config.fit.steps = 6;
    config.fit.validate_every = 3;
    config.validation.mix_candidates = Vec::new();
    config.validation.start_seeds = 1;
    CompareSettings {
        component_count: 10,
        epochs: 300,
        quick,
        config,
    }
}

fn bar() -> MeshSequence {
    let settings = Settings {
        frames: 11,
        vertices: 130,
        seed: 2,
    };
    Subject::Bar.synthesize(&settings).expect("a bar")
}

fn run(threads: usize, quick: bool) -> (Comparison, ComparedShapes) {
    let sequence = bar();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");
    pool.install(|| {
        let input = CompareInput {
            sequence: &sequence,
            train_shapes: &[0, 3, 6, 9],
            ours: &[],
            settings: &small(quick),
        };
        compare(input, &Silent).expect("a comparison")
    })
}

#[test]
fn every_method_is_measured_and_threads_change_nothing() {
    let (mut one, shapes) = run(1, false);
    let (mut two, _) = run(2, false);
    for method in one.methods.iter_mut().chain(&mut two.methods) {
        assert!(method.training_seconds.take().is_some_and(|seconds| seconds >= 0.0));
    }
    assert_eq!(one, two);
    assert_eq!((one.train_shapes, one.test_shapes, shapes.truth.len()), (4, 7, 7));
    assert_eq!(one.control_points, HANDLE_COUNTS);
    let names: Vec<&str> = one.methods.iter().map(|method| method.name.as_str()).collect();
    assert!(
        names.starts_with(&["PCA on positions", "SPLOCS on positions"]) && names.ends_with(&["Sinew"]),
        "{names:?}"
    );
    for (method, found) in one.methods.iter().zip(&shapes.reconstructions) {
        assert!(method.components <= 10 && method.components > 0, "{method:?}");
        assert!(method.locality > 0.0 && method.locality <= 1.0 + 1e-9, "{method:?}");
        assert!(method.basis_bytes_f16 < method.basis_bytes_f32);
        assert_eq!(method.projections.len(), found.len());
        assert_eq!(method.control_point_e_rms.len(), HANDLE_COUNTS.len());
        let [first, .., last] = &method.control_point_e_rms[..] else {
            panic!("errors for every count");
        };
        assert!(*last <= 1.05 * first, "more control points say more: {method:?}");
        for kind in [
            ProjectionKind::Encoder,
            ProjectionKind::LinearEncoder,
            ProjectionKind::Features,
        ] {
            let of = |kind| {
                method
                    .projections
                    .iter()
                    .find(|p| p.kind == kind)
                    .map(|p| p.scores.e_rms)
            };
            if let (Some(other), Some(positions)) = (of(kind), of(ProjectionKind::Positions)) {
                assert!(positions <= other * 1.001, "{}: {positions} from {other}", method.name);
            }
        }
    }
    let (quick, _) = run(1, true);
    assert!(quick.control_points.is_empty() && quick.methods.iter().all(|m| m.control_point_e_rms.is_empty()));
    let page = comparison_page(&one, &shapes, &bar()).expect("a page");
    assert!(!page.text().contains("http"), "the page stands alone");
    for part in [
        "Errors on unseen shapes",
        "All figures",
        "Moved by control points",
        "The worst of each",
    ] {
        assert!(page.text().contains(part), "{part}");
    }
    // Truth once, and every method on the common shape and on its worst.
    assert_eq!(page.text().matches("<img").count(), 1 + 2 * one.methods.len());
    assert_eq!(page.text().matches("<polyline").count(), one.methods.len());

    let text = serde_json::to_string(&quick).expect("JSON");
    let back: Comparison = serde_json::from_str(&text).expect("the same");
    let kinds = |comparison: &Comparison| -> Vec<(String, Vec<ProjectionKind>)> {
        let methods = comparison.methods.iter();
        methods
            .map(|m| (m.name.clone(), m.projections.iter().map(|p| p.kind).collect()))
            .collect()
    };
    assert_eq!(kinds(&back), kinds(&quick));
    assert!(text.contains("\"e_rms\"") && text.contains("\"positions\""), "{text}");
}

#[test]
fn levels_share_the_budget() {
    for (budget, levels) in [
        (50, vec![10, 4]),
        (60, vec![12, 4]),
        (10, vec![2, 4]),
        (1, vec![1]),
        (2, vec![1, 1]),
    ] {
        let found = two_levels(budget);
        assert_eq!(found, levels, "{budget}");
    }
}

#[test]
fn a_split_that_leaves_nothing_is_refused() {
    let sequence = bar();
    let all: Vec<usize> = (0..sequence.shape_count()).collect();
    let settings = small(true);
    let input = |train_shapes| CompareInput {
        sequence: &sequence,
        train_shapes,
        ours: &[],
        settings: &settings,
    };
    assert!(matches!(
        compare(input(&all), &Silent),
        Err(CompareError::NothingToMeasure(11))
    ));
    assert!(matches!(
        compare(input(&[0]), &Silent),
        Err(CompareError::Learn(LearnError::TooFewShapes { .. }))
    ));
}
