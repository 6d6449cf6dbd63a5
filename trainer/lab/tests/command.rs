//! The `sinew-lab` command as its user meets it: what it writes, what it refuses, with which words and which exit code.

use std::path::Path;
use std::process::{Command, Output};

use sinew_formats::package::save_package;
use sinew_interchange::{MeshSequence, write_sequence_npy};
use sinew_trainer::config::TrainConfig;
use sinew_trainer::learn::{RunOptions, Silent, learn};
use sinew_trainer::synthesize::{Settings, Subject};

fn lab(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sinew-lab"))
        .args(arguments)
        .output()
        .expect("the command starts")
}

/// Runs and expects success; gives standard output.
fn run(arguments: &[&str]) -> String {
    let output = lab(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs and expects exit code 2 and all of `words` in the message.
fn refused(arguments: &[&str], words: &[&str]) {
    let output = lab(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    // Long messages are wrapped for the terminal.
    let message = message
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect::<Vec<_>>()
        .join(" ");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: `{word}` is not in: {message}");
    }
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_string_lossy().into_owned()
}

const SMALL: &str = "components = [3, 2]\n[mixes]\nper_step = 4\n[start]\nsamples = 48\nrounds = 2\ncentres = 16\nposition_modes = 4\n\
[fit]\nsteps = 6\nvalidate_every = 3\n[validation]\nmix_candidates = []\nstart_seeds = 1\n";

/// Nine shapes of a bar, in the folder's `bar`.
fn bar(folder: &Path) -> MeshSequence {
    let settings = Settings {
        frames: 9,
        vertices: 120,
        seed: 0,
    };
    let sequence = Subject::Bar.synthesize(&settings).expect("a bar");
    write_sequence_npy(&folder.join("bar"), &sequence).expect("files in the temporary folder");
    sequence
}

#[test]
fn methods_are_compared_on_one_split() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    let sequence = bar(folder.path());
    let model = at("bar.sinew");
    let config = TrainConfig::default().with_toml(SMALL).expect("a configuration");
    let train_shapes: Vec<usize> = (0..sequence.shape_count()).step_by(3).collect();
    let learned = learn(&sequence, &train_shapes, &config, &RunOptions::default(), &Silent).expect("a package");
    save_package(Path::new(&model), &learned.package).expect("a file in the temporary folder");
    let common = ["--components", "6", "--epochs", "5", "--quick", "-q"];
    let (json, report) = (at("all.json"), at("report"));
    let bar = at("bar");
    let mut arguments = vec![
        "compare",
        &bar,
        "--train-every",
        "3",
        "--ours",
        &model,
        "--json",
        &json,
        "--report",
        &report,
    ];
    arguments.extend(common);
    let table = run(&arguments);
    assert!(
        table.contains("SPLOCS on features") && table.contains("E_rms"),
        "{table}"
    );
    let text = std::fs::read_to_string(&json).expect("figures were written");
    let figures: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let last = figures["methods"]
        .as_array()
        .and_then(|methods| methods.last())
        .expect("methods");
    assert_eq!(last["name"], "Sinew");
    let peers = figures["methods"]
        .as_array()
        .map_or(&[][..], |methods| &methods[..methods.len() - 1]);
    for peer in peers {
        assert!(
            peer["peak_bytes"].as_u64().is_some_and(|bytes| bytes > 10_000),
            "{peer}"
        );
    }
    assert!(last["peak_bytes"].is_null(), "trained before");
    assert!(
        last["training_seconds"].is_null() && last["projections"][0]["e_rms"].is_number(),
        "{last}"
    );
    assert!(folder.path().join("report/index.html").exists());
    // Two of ours are told apart by their files.
    let other = at("other.sinew");
    std::fs::copy(&model, &other).expect("a copy");
    let mut arguments = vec![
        "compare",
        &bar,
        "--train-every",
        "3",
        "--ours",
        &model,
        "--ours",
        &other,
    ];
    arguments.extend(common);
    let table = run(&arguments);
    assert!(
        table.contains("Sinew, bar") && table.contains("Sinew, other"),
        "{table}"
    );
    // Another split would not be the same test.
    refused(
        &["compare", &bar, "--train-every", "4", "--ours", &model, "-q"],
        &["trained on other shapes", "--train-every"],
    );
}

#[test]
fn choices_are_ablated_row_by_row_and_finished_rows_are_kept() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    bar(folder.path());
    // The paper's rows would take a thousand steps: the groups here are of this recipe alone.
    std::fs::write(at("small.toml"), SMALL).expect("a file in the temporary folder");
    let (bar, config, work, json, report) = (at("bar"), at("small.toml"), at("rows"), at("all.json"), at("report"));
    let ablate = |only: &str| {
        run(&[
            "ablate",
            &bar,
            "--train-every",
            "3",
            "--quick",
            "--config",
            &config,
            "--only",
            only,
            "--work",
            &work,
            "--json",
            &json,
            "--report",
            &report,
            "-q",
        ])
    };
    let table = ablate("attention,levels");
    assert!(
        table.contains("equal shares, separate") && table.contains("* attention, joint"),
        "{table}"
    );
    let read = || -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(&json).expect("figures were written")).expect("JSON")
    };
    let first = read();
    let rows = first["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 7);
    for row in rows {
        let figures = &row["outcome"]["measured"];
        assert!(
            figures["encoder"]["e_rms"].is_number() && figures["missed_training"].is_number(),
            "{row}"
        );
    }
    // The base stands in both groups and is trained once; the kept rows are the whole second run.
    let kept = std::fs::read_dir(&work).expect("a folder of rows").count();
    assert_eq!(kept, 6);
    assert_eq!(ablate("attention,levels"), table);
    assert_eq!(read(), first);
    let page = std::fs::read_to_string(folder.path().join("report/index.html")).expect("a page");
    assert!(page.contains("Attention and joint training") && page.contains("equal shares, joint"));
    refused(&["ablate", &bar, "--only", "taste"], &["taste", "attention"]);
}
