//! What the tests of the C interface share: the libraries as users build them, compilers, packages.
#![allow(dead_code, reason = "each test program uses its own part")]

pub mod player;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use sinew_formats::package::{
    AlignedBytes, fixture::TinyRender, fixture::tiny_baked, fixture::tiny_compact, limits, write_baked, write_compact,
};

pub fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The hand-made package, with a fast tier.
pub fn package() -> AlignedBytes {
    let mut baked = tiny_baked();
    baked.fast = Some(baked.own_nodes());
    write_baked(&baked.basis()).expect("the fixture is valid")
}

/// The compact package it comes from.
pub fn compact_package() -> AlignedBytes {
    write_compact(&tiny_compact().basis()).expect("the fixture is valid")
}

/// One of the same shape with another rest mesh, and a solver so stiff that large weights overflow; without fast tier and
/// texture coordinates.
pub fn other_package() -> AlignedBytes {
    let mut baked = tiny_baked();
    baked.exact.rest_positions[0][2] += 0.25;
    baked.render = TinyRender::default();
    baked.exact.ring_weights.fill(limits::EDGE_WEIGHT);
    baked.exact.tiles.as_flattened_mut().fill(limits::FACTOR_VALUE);
    for block in &mut baked.exact.inverse_diagonals {
        block
            .iter_mut()
            .filter(|x| **x > 0.0)
            .for_each(|x| *x = limits::INVERSE_PIVOT);
    }
    write_baked(&baked.basis()).expect("the fixture is valid")
}

/// The libraries, built with the features of a release and not with those of its tests.
pub struct Libraries {
    pub archive: PathBuf,
    pub shared: PathBuf,
}

pub fn libraries() -> &'static Libraries {
    static LIBRARIES: OnceLock<Libraries> = OnceLock::new();
    LIBRARIES.get_or_init(|| {
        let arguments = ["build", "--release", "--offline", "--package", "sinew-capi", "--lib"];
        let output = run(Command::new(env!("CARGO"))
            .args(arguments)
            .arg("--message-format=json")
            .current_dir(crate_folder()));
        assert_eq!(output.code, Some(0), "{}", output.stderr);
        let files: Vec<PathBuf> = output
            .stdout
            .lines()
            .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
            .filter(|message| message["target"]["name"] == "sinew")
            .filter_map(|message| message["filenames"].as_array().cloned())
            .flatten()
            .filter_map(|name| name.as_str().map(PathBuf::from))
            .collect();
        let with = |extension: &str| {
            let found = files
                .iter()
                .find(|file| file.extension().is_some_and(|e| e == extension));
            found
                .unwrap_or_else(|| panic!("no .{extension} among {files:?}"))
                .clone()
        };
        Libraries {
            archive: with("a"),
            shared: with(std::env::consts::DLL_EXTENSION),
        }
    })
}

/// Names of the functions that the header declares.
pub fn header_functions() -> BTreeSet<String> {
    let header = fs::read_to_string(crate_folder().join("include/sinew.h")).expect("the header is there");
    let mut code = String::new();
    for part in header.split("*/") {
        code += part.split("/*").next().expect("a first part");
    }
    code.split(|c: char| !(c.is_alphanumeric() || c == '_'))
        .filter(|word| word.starts_with("sinew_"))
        .map(str::to_owned)
        .collect()
}

/// What a program left behind.
pub struct Output {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

pub fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    Output {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).expect("UTF-8"),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

/// The tool, if this machine has it; says so when not.
pub fn tool(name: &str) -> Option<String> {
    let there = Command::new(name)
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success());
    if !there {
        println!("skipped: this machine has no {name}");
    }
    there.then(|| name.to_owned())
}

/// Compiles one source with every warning an error; returns the program.
pub fn compile(compiler: &str, options: &[&str], source: &Path, libraries: &[&Path], folder: &Path) -> PathBuf {
    let program = folder.join(source.file_name().expect("a file")).with_extension("out");
    let output = run(Command::new(compiler)
        .args(["-Wall", "-Wextra", "-Werror", "-pedantic", "-g"])
        .args(options)
        .arg("-I")
        .arg(crate_folder().join("include"))
        .arg(source)
        .args(libraries)
        .arg("-o")
        .arg(&program)
        .args(["-lpthread", "-ldl", "-lm"]));
    assert_eq!(output.code, Some(0), "{compiler} {options:?}: {}", output.stderr);
    program
}
