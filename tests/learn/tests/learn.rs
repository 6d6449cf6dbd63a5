//! The whole chain from shapes to package: the same bytes whatever the thread count and however often it was stopped, and
//! a package that plays what it was taught.

use core::sync::atomic::{AtomicU64, Ordering};

use sinew_bake::Surface;
use sinew_formats::package::{CompactView, save_package};
use sinew_interchange::{MeshSequence, ShapeStore};
use sinew_trainer::components::fields::{Response, responses_of};
use sinew_trainer::components::kept::{KeepError, KeptComponent};
use sinew_trainer::components::painted::{PaintError, PaintedRegion, Vertices};
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{EvaluationInput, evaluate};
use sinew_trainer::learn::{LearnError, Learned, Reporter, RunOptions, Silent, learn};
use sinew_trainer::synthesize::{Settings, Subject};

fn bar() -> MeshSequence {
    let settings = Settings {
        frames: 14,
        vertices: 200,
        seed: 1,
    };
    Subject::Bar.synthesize(&settings).expect("the settings are in range")
}

/// A training of a second or two.
fn small() -> TrainConfig {
    TrainConfig::from_toml(
        "components = [3, 2]\n\
         [mixes]\nper_step = 4\n\
         [start]\nsamples = 48\nrounds = 3\ncentres = 24\nposition_modes = 6\n\
         [fit]\nsteps = 12\nvalidate_every = 3\ncheckpoint_every = 4\n\
         [validation]\nshapes_min = 4\nmix_candidates = [[0.2, 2, 4], [0.4, 2, 3]]\nstart_seeds = 1\n",
    )
    .expect("a valid configuration")
}

const TRAIN: [usize; 7] = [0, 2, 4, 6, 8, 10, 12];

fn learn_on(threads: usize, options: &RunOptions) -> Learned {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("a thread pool");
    pool.install(|| learn(&bar(), &TRAIN, &small(), options, &Silent))
        .expect("the bar can be learned")
}

#[test]
fn same_bytes_on_one_and_two_threads() {
    let one = learn_on(1, &RunOptions::default());
    let two = learn_on(2, &RunOptions::default());
    assert!(one.package[..] == two.package[..]);
}

/// Two bars side by side; the second swings the other way.
fn two_bars() -> MeshSequence {
    let mut both = bar();
    let count = both.vertex_count() as u32;
    let width = 3.0 * both.shapes[0].iter().fold(0.0, |most: f32, p| most.max(p[2].abs()));
    let second = both.faces.clone().into_iter().map(|face| face.map(|v| v + count));
    both.faces.extend(second);
    let shapes: Vec<Vec<[f32; 3]>> = both
        .shapes
        .iter()
        .map(|shape| {
            let turned = shape.iter().map(|&[x, y, z]| [x, y, width - z]);
            shape.iter().copied().chain(turned).collect()
        })
        .collect();
    both.shapes = ShapeStore::of_shapes(&shapes);
    // A mirror image is seen from inside.
    let half = both.faces.len() / 2;
    both.faces[half..].iter_mut().for_each(|face| face.swap(1, 2));
    both
}

#[test]
fn same_bytes_by_the_closed_form_alone_and_of_several_pieces() {
    let sequence = two_bars();
    let mut config = small();
    config.fit.steps = 0;
    let learned = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let learned = pool
            .expect("a thread pool")
            .install(|| learn(&sequence, &TRAIN, &config, &RunOptions::default(), &Silent));
        learned.expect("two bars can be learned").package
    };
    let (one, two) = (learned(1), learned(2));
    assert!(one[..] == two[..]);
    let view = CompactView::open(&one).expect("a package");
    assert!(!view.bridges().is_empty(), "the pieces hang together");
}

/// Asks to stop when the given number of training steps have been reported.
struct StopAfter {
    training: AtomicU64,
    left: AtomicU64,
}

impl Reporter for StopAfter {
    fn stage(&self, name: &str, _: u64) {
        self.training
            .store(u64::from(name.starts_with("training")), Ordering::SeqCst);
    }

    fn advance(&self, _: u64, _: &str) {
        if self.training.load(Ordering::SeqCst) == 1 {
            let left = self.left.load(Ordering::SeqCst);
            self.left.store(left.saturating_sub(1), Ordering::SeqCst);
        }
    }

    fn notice(&self, _: &str) {}

    fn stop_requested(&self) -> bool {
        self.training.load(Ordering::SeqCst) == 1 && self.left.load(Ordering::SeqCst) == 0
    }
}

#[test]
fn a_run_that_was_stopped_again_and_again_ends_with_the_same_bytes() {
    let whole = learn_on(2, &RunOptions::default());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = RunOptions {
        time_budget: None,
        work_folder: Some(folder.path().join("run")),
    };
    let mut stops = 0;
    let resumed = loop {
        let reporter = StopAfter {
            training: AtomicU64::new(0),
            left: AtomicU64::new(5),
        };
        match learn(&bar(), &TRAIN, &small(), &options, &reporter) {
            Ok(learned) => break learned,
            Err(LearnError::Stopped) => stops += 1,
            Err(error) => panic!("{error}"),
        }
        assert!(stops < 20, "no end in sight");
    };
    assert!(stops >= 2, "stopped {stops} times");
    assert!(whole.package[..] == resumed.package[..]);
}

#[test]
fn a_run_on_other_shapes_is_not_resumed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = RunOptions {
        time_budget: None,
        work_folder: Some(folder.path().join("run")),
    };
    let reporter = StopAfter {
        training: AtomicU64::new(0),
        left: AtomicU64::new(2),
    };
    assert!(matches!(
        learn(&bar(), &TRAIN, &small(), &options, &reporter),
        Err(LearnError::Stopped)
    ));
    let other = learn(&bar(), &[0, 1, 3, 5], &small(), &options, &Silent);
    assert!(matches!(other, Err(LearnError::RunFolder(_))), "{other:?}");
}

/// Position error that this small training must stay below on shapes it has not seen, per mille of the bounding ball; the
/// bar's own motion is above 100.
const UNSEEN_E_RMS: f64 = 25.0;

#[test]
fn unseen_shapes_are_played_from_few_components() {
    let learned = learn_on(2, &RunOptions::default());
    let view = CompactView::open(&learned.package).expect("a package that opens");
    assert_eq!(view.component_count(), learned.component_count);
    let sequence = bar();
    let input = EvaluationInput {
        package: &learned.package,
        sequence: &sequence,
        test_shapes: &[1, 3, 5, 7, 9, 11, 13],
        trained_shapes: &[],
        settings: learned.config.features,
        encoder: learned.config.encoder_settings(),
    };
    let (evaluation, _) = evaluate(&input, &|_| {}).expect("the package can be measured");
    assert!(evaluation.position_projection.e_rms < UNSEEN_E_RMS, "{evaluation:?}");
    assert!(
        evaluation.position_projection.e_rms <= evaluation.encoder.e_rms,
        "{evaluation:?}"
    );
    assert!(
        evaluation.round_trip.e_rms < evaluation.position_projection.e_rms,
        "{evaluation:?}"
    );
}

#[test]
fn a_painted_region_has_a_component_of_its_own() {
    let sequence = bar();
    let rest = &sequence.shapes[0];
    let [least, most] = [f32::min, f32::max].map(|of| rest.iter().map(|p| p[0]).reduce(of).expect("a bar"));
    let tip: Vec<u32> = (0..rest.len())
        .filter(|&v| rest[v][0] > most - 0.25 * (most - least))
        .map(|v| v as u32)
        .collect();
    let mut config = small();
    config.start.painted = vec![PaintedRegion {
        name: "tip".into(),
        vertices: Vertices::new(tip.clone()),
    }];
    let learned = learn(&sequence, &TRAIN, &config, &RunOptions::default(), &Silent).expect("trains");
    let view = CompactView::open(&learned.package).expect("a package that opens");
    let painted = view
        .components()
        .position(|component| component.name == "tip")
        .expect("a component of that name");
    let moved: Vec<u32> = view
        .entries()
        .filter(|entry| entry.component == painted)
        .map(|entry| entry.vertex as u32)
        .collect();
    assert!(!moved.is_empty() && moved.iter().all(|v| tip.contains(v)));
    assert!(
        view.components().any(|component| component.name.starts_with("tip.")),
        "what lies below it has its name"
    );

    config.start.painted[0].vertices = Vertices::new(vec![rest.len() as u32]);
    let refused = learn(&sequence, &TRAIN, &config, &RunOptions::default(), &Silent);
    assert!(
        matches!(refused, Err(LearnError::Paint(PaintError::NoSuchVertex { .. }))),
        "{refused:?}"
    );
}

/// Rows pass through half precision twice, and through another scaling of features.
const KEPT_COSINE: f64 = 0.9999;

#[test]
fn a_kept_component_stays_what_it_was() {
    let sequence = bar();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = folder.path().join("old.sinew");
    let old = learn(&sequence, &TRAIN, &small(), &RunOptions::default(), &Silent).expect("trains");
    save_package(&package, &old.package).expect("a file");
    let mut config = small();
    config.seed = 5;
    config.scaling.rotation_reach = 0.3;
    let keep = |component: &str, name: &str| KeptComponent {
        name: name.into(),
        package: package.clone(),
        component: component.into(),
    };
    config.start.kept = vec![keep("c1", "bend"), keep("c0.0", "detail")];
    let new = learn(&sequence, &TRAIN, &config, &RunOptions::default(), &Silent).expect("trains");
    let responses = |bytes: &[u8]| -> Vec<(String, Response)> {
        let view = CompactView::open(bytes).expect("a package that opens");
        let responses = responses_of(&view, &Surface::of_package(&view));
        let names = view.components().map(|component| component.name.to_owned());
        names.zip(responses).collect()
    };
    let dense = |all: &[(String, Response)], name: &str| -> Vec<f64> {
        let (_, response) = all
            .iter()
            .find(|(other, _)| other == name)
            .expect("a component of that name");
        let mut dense = vec![0.0; 9 * sequence.vertex_count()];
        for (&v, x) in response.vertices.iter().zip(&response.values) {
            dense[9 * v as usize..][..9].copy_from_slice(x);
        }
        dense
    };
    let (before, after) = (responses(&old.package), responses(&new.package));
    for (component, name) in [("c1", "bend"), ("c0.0", "detail")] {
        let (a, b) = (dense(&before, component), dense(&after, name));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let cosine = dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt();
        assert!(cosine > KEPT_COSINE, "{component}: {cosine}");
    }
    assert!(
        after.iter().any(|(name, _)| name.starts_with("bend.")),
        "what lies below it has its name"
    );

    let refusal = |kept: KeptComponent| {
        let mut config = small();
        config.start.kept = vec![kept];
        let refused = learn(&sequence, &TRAIN, &config, &RunOptions::default(), &Silent);
        refused.expect_err("nothing to keep").to_string()
    };
    assert!(refusal(keep("c77", "x")).contains("has no component `c77`: it has c0"));
    assert!(refusal(keep("c1", "c1")).contains("`c1` cannot name a kept component"));
    let absent = KeptComponent {
        package: folder.path().join("absent.sinew"),
        ..keep("c1", "x")
    };
    assert!(refusal(absent).contains("absent.sinew"));
    let mut config = small();
    config.start.kept = vec![keep("c1", "x")];
    let mut other = sequence.clone();
    other.shapes.iter_mut().for_each(|shape| shape[7][1] += 0.2);
    let refused = learn(&other, &TRAIN, &config, &RunOptions::default(), &Silent);
    assert!(
        matches!(&refused, Err(LearnError::Keep(KeepError::Mesh { difference, .. })) if difference.contains("vertex 7")),
        "{refused:?}"
    );
}

#[test]
fn what_cannot_be_learned_is_refused_with_a_reason() {
    let mut still = bar();
    let rest = still.shapes[0].to_vec();
    still.shapes.iter_mut().for_each(|shape| shape.copy_from_slice(&rest));
    let refused = learn(&still, &TRAIN, &small(), &RunOptions::default(), &Silent);
    assert!(matches!(refused, Err(LearnError::NothingMoves { .. })), "{refused:?}");
    let refused = learn(&bar(), &[0], &small(), &RunOptions::default(), &Silent);
    assert!(matches!(refused, Err(LearnError::TooFewShapes { .. })), "{refused:?}");
}
