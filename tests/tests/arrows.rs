//! Which crate may know which: formats <- runtime, formats and runtime <- capi and trainer, all <- tests; and what the
//! runtime may pull in. An arrow not listed here is a change of architecture.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    process::Command,
};

use serde_json::Value;
use sinew_tests::workspace_folder;

/// `(crate, what it may depend on)`, within the workspace.
const ARROWS: &[(&str, &[&str])] = &[
    ("sinew-formats", &[]),
    ("sinew-runtime", &["sinew-formats"]),
    ("sinew-capi", &["sinew-formats", "sinew-runtime"]),
    ("sinew-simulator", &["sinew-runtime"]),
    ("sinew-bake", &["sinew-formats"]),
    ("sinew-synthesize", &["sinew-formats"]),
    (
        "sinew-stage",
        &["sinew-formats", "sinew-runtime", "sinew-bake", "sinew-simulator"],
    ),
    ("sinew-peers", &["sinew-formats", "sinew-bake", "sinew-synthesize"]),
    (
        "sinew-trainer",
        &["sinew-formats", "sinew-runtime", "sinew-bake", "sinew-synthesize"],
    ),
    ("sinew-checksum", &["sinew-formats", "sinew-runtime"]),
    (
        "sinew-tests",
        &["sinew-checksum", "sinew-formats", "sinew-runtime", "sinew-trainer"],
    ),
];

/// What a crate may use in its tests and benchmarks besides: the runtime's benchmarks and the simulated box's tests play packages
/// baked on the spot.
const DEVELOPMENT_ARROWS: &[(&str, &[&str])] = &[
    ("sinew-runtime", &["sinew-peers", "sinew-bake"]),
    ("sinew-simulator", &["sinew-bake", "sinew-peers"]),
];

/// Everything that the runtime links, all of it without std.
const RUNTIME_CLOSURE: &[&str] = &[
    "bytecheck",
    "bytemuck",
    "byteorder",
    "cfg-if",
    "cpufeatures",
    "cobs",
    "crc",
    "crc-catalog",
    "half",
    "hash32",
    "heapless",
    "libm",
    "munge",
    "ptr_meta",
    "rancor",
    "rend",
    "rkyv",
    "simdutf8",
    "sinew-formats",
    "sinew-runtime",
    "stable_deref_trait",
    "thiserror",
    "xxhash-rust",
    "zerocopy",
];

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .current_dir(workspace_folder())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "cargo {arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn no_arrow_but_the_drawn_ones() {
    let metadata: Value =
        serde_json::from_str(&cargo(&["metadata", "--offline", "--no-deps", "--format-version", "1"])).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let names: BTreeSet<&str> = packages
        .iter()
        .map(|package| package["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        ARROWS.iter().map(|(name, _)| *name).collect(),
        "members of the workspace"
    );
    for package in packages {
        let name = package["name"].as_str().unwrap();
        let (_, allowed) = ARROWS.iter().find(|(known, _)| *known == name).unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            let target = dependency["name"].as_str().unwrap();
            let in_tests = dependency["kind"].as_str() == Some("dev")
                && DEVELOPMENT_ARROWS
                    .iter()
                    .any(|(known, more)| *known == name && more.contains(&target));
            // A crate may name itself or a crate below it with other features in its own tests.
            let known = allowed.contains(&target) || in_tests || !names.contains(target);
            assert!(known, "{name} must not depend on {target}");
        }
    }
}

#[test]
fn the_runtime_links_nothing_that_needs_std() {
    let tree = cargo(&[
        "tree",
        "--offline",
        "-p",
        "sinew-runtime",
        "-e",
        "normal,no-proc-macro",
        "--prefix",
        "none",
    ]);
    let linked: BTreeSet<&str> = tree.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(
        linked.contains("sinew-formats") && linked.contains("rkyv"),
        "the tree was read: {tree}"
    );
    let strange: Vec<_> = linked.iter().filter(|name| !RUNTIME_CLOSURE.contains(name)).collect();
    assert!(strange.is_empty(), "not known to live without std: {strange:?}");
}

#[test]
fn the_cores_switch_nothing_on_that_needs_std() {
    for package in ["sinew-runtime", "sinew-formats"] {
        let arguments = [
            "tree",
            "--offline",
            "-p",
            package,
            "--no-default-features",
            "-e",
            "normal,features,no-proc-macro",
        ];
        let tree = cargo(&arguments);
        let std: Vec<_> = tree.lines().filter(|line| line.contains("feature \"std\"")).collect();
        assert!(std.is_empty(), "{package}: {std:?}");
    }
}

/// Packages of a lock file: name to version. Those that need two versions have one of them here.
fn locked(folder: &str) -> BTreeMap<String, String> {
    let path = workspace_folder().join(folder).join("Cargo.lock");
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let value = |line: Option<&str>, key: &str| Some(line?.strip_prefix(key)?.trim_matches('"').to_owned());
    let packages = text.split("[[package]]").filter_map(|package| {
        let mut lines = package.trim_start().lines();
        Some((value(lines.next(), "name = ")?, value(lines.next(), "version = ")?))
    });
    packages.collect()
}

#[test]
fn other_targets_lock_the_versions_of_the_workspace() {
    let workspace = locked(".");
    for folder in ["runtime/web", "runtime/cortex-m7"] {
        let outside = locked(folder);
        assert!(
            outside.contains_key("sinew-runtime"),
            "{folder}: the lock file was read"
        );
        for name in RUNTIME_CLOSURE {
            if let Some(version) = outside.get(*name) {
                assert_eq!(
                    Some(version),
                    workspace.get(*name),
                    "{folder}/Cargo.lock, {name}: copy the root's Cargo.lock there and build"
                );
            }
        }
    }
}
