//! The header is what cbindgen makes of the sources, it is plain C99 and C++, and the shared library exports exactly its
//! functions. `UPDATE_HEADER=1` writes it.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{compile, crate_folder, header_functions, libraries, run, tool};

/// The order in which the manual is read.
const SOURCES: [&str; 16] = [
    "version.rs",
    "status.rs",
    "details.rs",
    "memory.rs",
    "basis.rs",
    "workspace.rs",
    "controls.rs",
    "frame.rs",
    "output.rs",
    "drag.rs",
    "batch.rs",
    "device.rs",
    "decoder.rs",
    "surface_map.rs",
    "surface_state.rs",
    "surface.rs",
];

fn header_file() -> PathBuf {
    crate_folder().join("include/sinew.h")
}

fn generated() -> String {
    let config = cbindgen::Config::from_file(crate_folder().join("cbindgen.toml")).expect("the configuration is good");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(crate_folder().join("src").join(source));
    }
    let mut header = Vec::new();
    builder.generate().expect("the sources are good").write(&mut header);
    String::from_utf8(header).expect("UTF-8")
}

#[test]
fn the_header_is_that_of_the_sources() {
    let generated = generated();
    if std::env::var_os("UPDATE_HEADER").is_some() {
        fs::write(header_file(), &generated).expect("the header can be written");
        panic!("the header was written; run the test again without UPDATE_HEADER");
    }
    let committed = fs::read_to_string(header_file()).expect("the header is there");
    assert!(
        committed == generated,
        "include/sinew.h is stale; run `UPDATE_HEADER=1 cargo test -p sinew-capi --test header`"
    );
}

#[test]
fn every_function_of_the_sources_is_in_the_header() {
    let mut exported = BTreeSet::new();
    for entry in fs::read_dir(crate_folder().join("src")).expect("there are sources") {
        let text = fs::read_to_string(entry.expect("readable").path()).expect("readable");
        for (_, after) in text
            .split("#[unsafe(no_mangle)]\n")
            .skip(1)
            .filter_map(|item| item.split_once("fn "))
        {
            exported.insert(after.split('(').next().expect("a name").to_owned());
        }
    }
    assert!(exported.len() > 20, "{exported:?}");
    assert_eq!(header_functions(), exported);
}

#[test]
#[cfg(target_os = "linux")]
fn the_shared_library_exports_the_functions_of_the_header_and_nothing_else() {
    let Some(nm) = tool("nm") else { return };
    let output = run(Command::new(nm)
        .args(["--dynamic", "--defined-only", "--format=just-symbols"])
        .arg(&libraries().shared));
    let symbols: BTreeSet<String> = output.stdout.lines().map(str::to_owned).collect();
    assert_eq!(symbols, header_functions());
}

/// A program that includes the header twice, and uses a type, a constant and a function.
const INCLUDES: &str = r#"
#include "sinew.h"
#include "sinew.h"
int main(void) {
    SinewLayout layout;
    if (sinew_abi_version() != SINEW_ABI_VERSION) return 1;
    return sinew_basis_layout(&layout) == SINEW_STATUS_OK && layout.size_bytes > 0 ? 0 : 2;
}
"#;

#[test]
fn the_header_is_c99_and_c11_and_cpp() {
    let folder = tempfile::tempdir().expect("a folder");
    let compiles = |compiler: &str, standard: &str, suffix: &str| {
        let Some(compiler) = tool(compiler) else { return };
        let source = folder.path().join("includes").with_extension(suffix);
        fs::write(&source, INCLUDES).expect("written");
        let program = compile(
            &compiler,
            &[&format!("-std={standard}")],
            &source,
            &[Path::new(&libraries().archive)],
            folder.path(),
        );
        assert_eq!(run(&mut Command::new(program)).code, Some(0), "{standard}");
    };
    compiles("gcc", "c99", "c");
    compiles("gcc", "c11", "c");
    compiles("g++", "c++11", "cc");
    compiles("g++", "c++20", "cc");
}
