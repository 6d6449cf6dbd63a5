//! `sinew export`: a file for engines is as far from the runtime as it says.

mod common;

use std::path::Path;

use common::{SMALL, path, refused, run, sinew};
use sinew_interchange::{Choice, read_sequence};

#[test]
fn an_exported_clip_is_as_far_from_the_runtime_as_the_file_says() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    let (model, baked) = (at("bar.sinew"), at("bar.baked.sinew"));
    std::fs::write(at("small.toml"), SMALL).expect("a file in the temporary folder");
    run(&[
        "synthesize",
        "bar",
        "-o",
        &at("bar"),
        "--frames",
        "12",
        "--vertices",
        "150",
        "-q",
    ]);
    run(&[
        "train",
        &at("bar"),
        "-o",
        &model,
        "--train-every",
        "3",
        "--config",
        &at("small.toml"),
        "-q",
    ]);
    run(&["bake", &model, "-o", &baked, "-q"]);
    run(&["encode", &model, &at("bar"), "-o", &at("weights.csv"), "-q"]);
    run(&[
        "frame",
        &model,
        "--weights",
        &at("weights.csv"),
        "-o",
        &at("again.abc"),
        "-q",
    ]);
    let clip = format!("walk={}", at("weights.csv"));
    let output = sinew(&[
        "export",
        &model,
        "--clip",
        &clip,
        "--bones",
        "12",
        "--morphs",
        "100",
        "-o",
        &at("bar.glb"),
    ]);
    assert!(output.status.success());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("12 bones") && said.contains("clip walk: 12 frames"),
        "{said}"
    );
    let shapes = |name: &str| {
        let read = read_sequence(Path::new(&at(name)), &Choice::default(), &mut |_, _| {}).expect("what was written");
        read.sequence.shapes.iter().map(<[_]>::to_vec).collect::<Vec<_>>()
    };
    let (exported, exact) = (shapes("bar.glb"), shapes("again.abc"));
    assert_eq!(exported.len(), exact.len());
    let pairs = exported.iter().flatten().zip(exact.iter().flatten());
    let squares: f64 = pairs
        .map(|(a, b)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>())
        .sum();
    let rms = (squares / exact.iter().flatten().count() as f64).sqrt();
    let edge = |c: usize| {
        let along = exact[0].iter().map(|p| f64::from(p[c]));
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    };
    let diagonal = (0..3).map(|c| edge(c).powi(2)).sum::<f64>().sqrt();
    let (_, tail) = said.split_once("from the exact tier ").expect("how far it is");
    let percent: f64 = tail
        .split(' ')
        .next()
        .and_then(|text| text.parse().ok())
        .expect("a number");
    assert!(
        (100.0 * rms / diagonal - percent).abs() < 0.02 * percent + 0.001,
        "{rms} {diagonal}: {said}"
    );
    refused(
        &["export", &baked, "--bones", "12", "-o", &at("wrong.glb")],
        &["baked already"],
    );
    refused(
        &["export", &model, "--bones", "none", "-o", &at("wrong.glb")],
        &["--morphs"],
    );
    refused(
        &["export", &model, "--clip", &at("wrong.npy"), "-o", &at("wrong.glb")],
        &["wrong.npy"],
    );
    refused(&["export", &model, "-o", &at("wrong.abc")], &[".glb"]);
}
