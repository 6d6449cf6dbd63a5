//! A training that is stopped at any moment says so, and goes on to the same bytes.

#![cfg(unix)]

mod common;

use core::time::Duration;
use std::process::{Command, Stdio};
use std::thread::sleep;

use common::{path, refused, run};

/// Asks a process to end as a terminal does.
fn interrupt(process: u32) {
    let sent = Command::new("kill").args(["-INT", &process.to_string()]).status();
    assert!(sent.expect("kill starts").success());
}

#[test]
fn a_training_stopped_at_any_moment_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    run(&[
        "synthesize",
        "creature",
        "-o",
        &at("creature"),
        "--frames",
        "16",
        "--vertices",
        "900",
        "-q",
    ]);
    let arguments = |output: &str| {
        let words = [
            "train",
            &at("creature"),
            "-o",
            &at(output),
            "--train-every",
            "3",
            "--components",
            "3,2",
            "-q",
        ];
        words.map(str::to_owned).to_vec()
    };
    run(&arguments("whole.sinew").iter().map(String::as_str).collect::<Vec<_>>());

    let mut stopped = 0;
    for moment in [50, 400, 1000, 1800] {
        let mut words = arguments("stopped.sinew");
        words.push("--resume".to_owned());
        let training = Command::new(env!("CARGO_BIN_EXE_sinew"))
            .args(&words)
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command starts");
        sleep(Duration::from_millis(moment));
        interrupt(training.id());
        let ended = training.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        match ended.status.code() {
            // Done before it heard.
            Some(0) => break,
            Some(130) => assert!(said.contains("--resume"), "{said}"),
            // Not yet listening: the process ended as any does.
            None => {}
            code => panic!("{code:?}: {said}"),
        }
        stopped += 1;
        assert!(!folder.path().join("stopped.sinew").exists(), "nothing half done");
    }
    assert!(stopped > 0, "a training that nothing stops");
    if folder.path().join("stopped.sinew.training").exists() {
        let words = arguments("stopped.sinew");
        refused(
            &words.iter().map(String::as_str).collect::<Vec<_>>(),
            &["--resume", "--restart"],
        );
    }
    let mut words = arguments("stopped.sinew");
    words.push("--resume".to_owned());
    run(&words.iter().map(String::as_str).collect::<Vec<_>>());
    let read = |name: &str| std::fs::read(at(name)).expect("a package");
    assert!(read("stopped.sinew") == read("whole.sinew"), "the same bytes");
    assert!(!folder.path().join("stopped.sinew.training").exists());
}
