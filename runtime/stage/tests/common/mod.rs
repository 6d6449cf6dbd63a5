//! What the tests of the command share: packages, a simulated box, and the command itself.
#![allow(dead_code, reason = "every test uses a part of it")]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use sinew_bake::fixture;
use sinew_formats::package::save_package;

/// A folder with a compact package; also the home of the commands run in it.
pub struct Stage {
    pub folder: tempfile::TempDir,
}

impl Stage {
    pub fn new() -> Self {
        let stage = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        save_package(&stage.path("model.sinew"), &fixture::compact(1, true)).unwrap();
        stage
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        std::fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sinew-stage"));
        command.args(line.split_whitespace()).current_dir(self.folder.path());
        command
            .env("HOME", self.folder.path())
            .env_remove("XDG_CONFIG_HOME")
            .env("NO_COLOR", "1");
        command
    }

    /// Runs a command line to its end, with `input` on standard input.
    pub fn run(&self, line: &str, input: &str) -> Ran {
        let mut child = self.start(line);
        // The command may end before it has read all of it.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        Ran::new(line, child.wait_with_output().unwrap())
    }

    /// Starts a command line.
    pub fn start(&self, line: &str) -> Child {
        let mut command = self.command(line);
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command.spawn().unwrap()
    }
}

/// What a command said.
pub struct Ran {
    pub line: String,
    pub code: Option<i32>,
    pub out: Vec<u8>,
    pub err: String,
}

impl Ran {
    pub fn new(line: &str, output: Output) -> Self {
        Self {
            line: line.to_owned(),
            code: output.status.code(),
            out: output.stdout,
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// It must have ended so.
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "sinew-stage {}\n{}", self.line, self.err);
        self
    }

    /// It must have said all of these.
    pub fn says(self, parts: &[&str]) -> Self {
        // Reports are wrapped to the terminal's width, with bars at the margin.
        let flat = |text: &str| {
            text.split_whitespace()
                .filter(|word| *word != "│")
                .collect::<Vec<_>>()
                .join(" ")
        };
        for part in parts {
            assert!(
                flat(&self.err).contains(&flat(part)),
                "sinew-stage {}: no `{part}` in\n{}",
                self.line,
                self.err
            );
        }
        self
    }

    /// What follows `start` in the line that has it.
    pub fn after(&self, start: &str) -> String {
        let line = self.err.lines().find_map(|line| line.split_once(start));
        line.unwrap_or_else(|| panic!("no `{start}` in\n{}", self.err))
            .1
            .to_owned()
    }
}

/// Rows of a CSV of weights: time, then one weight a component.
pub fn table(path: &Path) -> Vec<Vec<f32>> {
    let text = std::fs::read_to_string(path).unwrap();
    let number = |field: &str| field.parse().unwrap();
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(number).collect())
        .collect()
}
