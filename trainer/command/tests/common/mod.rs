//! What the tests of the command share: how it is run, and what is expected of it.

#![allow(dead_code, reason = "each test uses what it needs")]

use std::path::Path;
use std::process::{Command, Output};

/// Runs the command.
pub fn sinew(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sinew"))
        .args(arguments)
        .output()
        .expect("the command starts")
}

/// Runs and expects success; gives standard output.
pub fn run(arguments: &[&str]) -> String {
    let output = sinew(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs and expects exit code 2 and all of `words` in the message.
pub fn refused(arguments: &[&str], words: &[&str]) {
    let output = sinew(arguments);
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

/// A file in a folder, as an argument.
pub fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_string_lossy().into_owned()
}

/// A configuration that learns something in a second or two.
pub const SMALL: &str = "components = [3, 2]\n[mixes]\nper_step = 4\n[start]\nsamples = 48\nrounds = 2\ncentres = 16\nposition_modes = 4\n\
[fit]\nsteps = 6\nvalidate_every = 3\n[validation]\nmix_candidates = []\nstart_seeds = 1\n";
