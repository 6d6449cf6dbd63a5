//! What the tests of the C interface share: the libraries as users build them, compilers, packages.
#![allow(dead_code, reason = "each test program uses its own part")]

pub mod player;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use sinew_formats::package::{
    AlignedBytes, fixture::TinySurface, fixture::tiny_baked, fixture::tiny_compact, limits, write_baked, write_compact,
};

pub fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The hand-made package, with bones.
pub fn package() -> AlignedBytes {
    let mut baked = tiny_baked();
    baked.bones = Some(baked.three_bones());
    write_baked(&baked.basis()).expect("the fixture is valid")
}

/// The compact package it comes from.
pub fn compact_package() -> AlignedBytes {
    write_compact(&tiny_compact().basis()).expect("the fixture is valid")
}

/// One of the same shape with another rest mesh, and a solver so stiff that large weights overflow; without bones and
/// texture coordinates.
pub fn other_package() -> AlignedBytes {
    let mut baked = tiny_baked();
    baked.rest_positions[0][2] += 0.25;
    let corners = baked.surface.corners.iter();
    let slots = corners.map(|corners| corners.map(|r| baked.surface.render_points[r as usize]));
    baked.surface = TinySurface::plain(&slots.collect::<Vec<_>>());
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

/// The first package with the names of its controls turned round, and one that no other package has.
pub fn renamed_package() -> AlignedBytes {
    let mut baked = tiny_baked();
    let mut names: Vec<&'static str> = baked.components.iter().map(|component| component.name).collect();
    names.rotate_left(1);
    *names.last_mut().expect("some") = "a new one";
    for (component, name) in baked.components.iter_mut().zip(names) {
        component.name = name;
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

/// The headers, that of the frame first.
pub const HEADERS: [&str; 5] = [
    "sinew.h",
    "sinew_pins.h",
    "sinew_batch.h",
    "sinew_bones.h",
    "sinew_knobs.h",
];

/// Their lines.
pub fn headers() -> String {
    let read = |name| fs::read_to_string(crate_folder().join("include").join(name)).expect("the header is there");
    HEADERS.map(read).concat()
}

/// Names of the functions that the headers declare.
pub fn header_functions() -> BTreeSet<String> {
    let headers = headers();
    let (_, mut declared) = headers.split_once("extern \"C\"").expect("functions");
    let mut code = String::new();
    while let Some((before, after)) = declared.split_once("/*") {
        code += before;
        declared = after.split_once("*/").expect("comments end").1;
    }
    code += declared;
    let code = code.lines().map(|line| line.split("//").next().expect("a first part"));
    code.flat_map(|line| line.split(|c: char| !(c.is_alphanumeric() || c == '_')))
        .filter(|word| word.starts_with("sinew_") && !HEADERS.contains(&format!("{word}.h").as_str()))
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
