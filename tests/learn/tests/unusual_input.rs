//! Sequences that are not as they should be: what can be learned from is learned from, and the user is told what was done;
//! the rest is refused with the reason.

use std::sync::Mutex;

use sinew_interchange::MeshSequence;
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{EvaluationInput, evaluate};
use sinew_trainer::learn::{LearnError, Learned, Reporter, RunOptions, learn};
use sinew_trainer::synthesize::{Settings, Subject};

/// A training of a second or two.
const SMALL: &str = "components = [3, 2]\n[mixes]\nper_step = 4\n[start]\nsamples = 48\nrounds = 3\ncentres = 24\nposition_modes = 6\n\
[fit]\nsteps = 12\nvalidate_every = 4\n[validation]\nmix_candidates = []\nstart_seeds = 1\n";

const TRAIN: [usize; 7] = [0, 2, 4, 6, 8, 10, 12];
const TEST: [usize; 7] = [1, 3, 5, 7, 9, 11, 13];

/// Position error that these small trainings must stay below on shapes they have not seen, per mille of the bounding ball;
/// the motion itself is above 100.
const SENSIBLE_E_RMS: f64 = 25.0;

fn synthesized(subject: Subject) -> MeshSequence {
    let settings = Settings {
        frames: 14,
        vertices: 200,
        seed: 1,
    };
    subject.synthesize(&settings).expect("the settings are in range")
}

fn bar() -> MeshSequence {
    synthesized(Subject::Bar)
}

/// Keeps what a user would read.
#[derive(Default)]
struct Notices(Mutex<Vec<String>>);

impl Reporter for Notices {
    fn stage(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64, _: &str) {}
    fn notice(&self, text: &str) {
        self.0.lock().expect("no test panics here").push(text.to_owned());
    }
    fn stop_requested(&self) -> bool {
        false
    }
}

fn learn_with(sequence: &MeshSequence, train: &[usize], settings: &str) -> (Result<Learned, LearnError>, Vec<String>) {
    let config = TrainConfig::from_toml(SMALL).expect("a valid configuration");
    let config = config.with_toml(settings).expect("a valid configuration");
    let notices = Notices::default();
    let learned = learn(sequence, train, &config, &RunOptions::default(), &notices);
    (learned, notices.0.into_inner().expect("no test panics here"))
}

/// Learns, expects every one of `words` in some notice, and plays unseen shapes: E_rms of the position projection.
fn played(sequence: &MeshSequence, train: &[usize], test: &[usize], words: &[&str]) -> f64 {
    let (learned, notices) = learn_with(sequence, train, "");
    let learned = learned.expect("something can be learned");
    for word in words {
        let said = notices.iter().any(|notice| notice.contains(word));
        assert!(said, "`{word}` is in none of {notices:?}");
    }
    error_of(sequence, &learned, test)
}

/// E_rms of the position projection.
fn error_of(sequence: &MeshSequence, learned: &Learned, test: &[usize]) -> f64 {
    let input = EvaluationInput {
        package: &learned.package,
        sequence,
        test_shapes: test,
        trained_shapes: &[],
        settings: learned.config.features,
        encoder: learned.config.encoder_settings(),
    };
    let (evaluation, _) = evaluate(&input, &|_| {}).expect("the package plays");
    evaluation.position_projection.e_rms
}

fn assert_sensible(sequence: &MeshSequence, words: &[&str]) {
    let error = played(sequence, &TRAIN, &TEST, words);
    assert!(error < SENSIBLE_E_RMS, "{error}");
}

#[test]
fn few_shapes_for_many_components_are_said() {
    let error = played(&bar(), &[0, 6, 12], &TEST, &["9 components are asked for and 2 shapes"]);
    assert!(error < 2.0 * SENSIBLE_E_RMS, "{error}");
    let alone = learn_with(&bar(), &[0], "").0;
    assert!(
        matches!(alone, Err(LearnError::TooFewShapes { found: 0, .. })),
        "{alone:?}"
    );
}

#[test]
fn shapes_that_do_not_move_are_left_out_or_refused() {
    let mut sequence = bar();
    let rest = sequence.shapes[0].to_vec();
    sequence.shapes[4].copy_from_slice(&rest);
    assert_sensible(&sequence, &["nothing moves there against the reference: shape 4"]);
    sequence
        .shapes
        .iter_mut()
        .for_each(|shape| shape.copy_from_slice(&rest));
    let refused = learn_with(&sequence, &TRAIN, "").0;
    assert!(
        matches!(refused, Err(LearnError::NothingMoves { shapes: 6 })),
        "{refused:?}"
    );
}

#[test]
fn one_broken_frame_is_left_out_and_named() {
    let mut collapsed = bar();
    collapsed.shapes[6].fill([0.5; 3]);
    assert_sensible(&collapsed, &["left out of training", "shape 6 (bar[6])"]);
    let mut spiked = bar();
    spiked.shapes[8][17] = [1e4, -1e4, 1e4];
    assert_sensible(&spiked, &["left out of training", "shape 8 (bar[8])"]);
    let mut spoilt = bar();
    spoilt.shapes[8][17][1] = f32::NAN;
    let refused = learn_with(&spoilt, &TRAIN, "")
        .0
        .expect_err("NaN teaches nothing")
        .to_string();
    assert!(refused.contains("vertex 17 of shape 8 (bar[8])"), "{refused}");
}

#[test]
fn poses_that_face_anywhere_are_learned_as_if_they_did_not() {
    let mut sequence = bar();
    for (m, shape) in sequence.shapes.iter_mut().enumerate() {
        let (turn, tilt) = (2.4 * m as f32, 1.7 * m as f32);
        for [x, y, z] in shape {
            let [a, b] = [turn.cos() * *x - turn.sin() * *y, turn.sin() * *x + turn.cos() * *y];
            let [b, c] = [tilt.cos() * b - tilt.sin() * *z, tilt.sin() * b + tilt.cos() * *z];
            [*x, *y, *z] = [a + 3.0 * m as f32, b, c - m as f32];
        }
    }
    assert_sensible(&sequence, &[]);
}

/// Adds to every shape a copy of some vertices, moved.
fn append(sequence: &mut MeshSequence, vertices: &[usize], offset: [f32; 3]) {
    let longer = |shape: &[[f32; 3]]| {
        let copies = vertices
            .iter()
            .map(|&v| core::array::from_fn(|c| shape[v][c] + offset[c]));
        shape.iter().copied().chain(copies).collect()
    };
    sequence.shapes = sequence.shapes.iter().map(longer).collect();
}

#[test]
fn separate_pieces_are_tied_together() {
    // A button: no edge joins it to the bar, and it follows all the same.
    let mut sequence = bar();
    let next = sequence.vertex_count() as u32;
    for offset in [[0.0, 0.0, 0.03], [0.02, 0.0, 0.03], [0.0, 0.02, 0.03], [0.0, 0.0, 0.05]] {
        append(&mut sequence, &[100], offset);
    }
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    sequence.faces.extend(faces.map(|face| face.map(|v: u32| v + next)));
    assert_sensible(&sequence, &["2 separate pieces"]);
}

#[test]
fn a_cloth_with_a_boundary_is_learned_without_ado() {
    let sequence = synthesized(Subject::Flag);
    let (_, notices) = learn_with(&sequence, &TRAIN, "");
    assert!(
        notices
            .iter()
            .all(|notice| notice.contains("components are asked for") || notice.contains("mirror image")),
        "{notices:?}"
    );
    assert!(played(&sequence, &TRAIN, &TEST, &[]) < 2.0 * SENSIBLE_E_RMS);
}

#[test]
fn faces_without_area_are_followed_and_said() {
    let mut sequence = bar();
    let [a, b, _] = sequence.faces[40].map(|v| v as usize);
    sequence.shapes[6][a] = sequence.shapes[6][b];
    assert_sensible(&sequence, &["faces lose their area in some shapes", "shape 6"]);
    let mut sequence = bar();
    for shape in &mut sequence.shapes {
        shape[a] = shape[b];
    }
    assert_sensible(&sequence, &["faces without area in the reference"]);
}

#[test]
fn surfaces_that_branch_or_meet_in_a_point_are_learned() {
    let mut sequence = bar();
    let next = sequence.vertex_count() as u32;
    let [a, b, _] = sequence.faces[40];
    // A fin along an edge, and a flag on a point.
    append(&mut sequence, &[a as usize, 0, 0], [0.02, 0.03, 0.01]);
    for shape in &mut sequence.shapes {
        shape[next as usize + 2][1] += 0.02;
    }
    sequence.faces.extend([[a, b, next], [0, next + 1, next + 2]]);
    assert_sensible(
        &sequence,
        &["edges with more than two faces: 1;", "meet in a point alone: 1;"],
    );
}

#[test]
fn a_loss_that_overflows_is_rolled_back_and_said() {
    // A rate that throws the weights beyond single precision, until it has been halved often enough: what comes of it is no
    // better than the start, and the start is kept.
    let mut train: Vec<usize> = (0..=9).collect();
    train.push(11);
    let wild = "[fit]\nrate = 1e20\nwarm_up = 0\n[fit.loss]\nunit_rows = false\n";
    let (learned, notices) = learn_with(&bar(), &train, wild);
    assert!(
        notices
            .iter()
            .any(|notice| notice.contains("the loss is no longer a number; back to the best weights")),
        "{notices:?}"
    );
    let test = [10, 12, 13];
    let error = error_of(&bar(), &learned.expect("the start can be packaged"), &test);
    let untrained = wild.replace("1e20", "1e-12");
    let untrained = learn_with(&bar(), &train, &untrained)
        .0
        .expect("the bar can be learned");
    let start = error_of(&bar(), &untrained, &test);
    assert!((error - start).abs() < 1e-3 * start, "{error}, from {start}");
}

#[test]
fn three_levels_learn_and_play() {
    let (learned, _) = learn_with(&bar(), &TRAIN, "components = [2, 2, 2]\n");
    let learned = learned.expect("the bar can be learned");
    let deepest = learned.config.components.len();
    assert_eq!(deepest, 3);
    let sequence = bar();
    let input = EvaluationInput {
        package: &learned.package,
        sequence: &sequence,
        test_shapes: &TEST,
        trained_shapes: &[],
        settings: learned.config.features,
        encoder: learned.config.encoder_settings(),
    };
    let (evaluation, _) = evaluate(&input, &|_| {}).expect("the package plays");
    assert!(evaluation.position_projection.e_rms < SENSIBLE_E_RMS, "{evaluation:?}");
    assert!(
        evaluation.max_percentage_error.two_level < evaluation.max_percentage_error.one_level,
        "{evaluation:?}"
    );
}
