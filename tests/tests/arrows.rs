//! Which crate may know which, inside the workspace and in the programs beside it: formats <- runtime <- what plays, what
//! bakes and what learns; runtime <- knobs <- who has knobs; formats <- interchange; all <- tests; and what the runtime and the
//! knobs may pull in. An arrow not listed here is a change of architecture.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    process::Command,
};

use serde_json::Value;
use sinew_support::workspace_folder;

/// Folder of a program that is a workspace of its own, its crate, and what of Sinew it may depend on.
const OUTSIDE_ARROWS: &[(&str, &str, &[&str])] = &[
    ("runtime/web", "sinew-web", &["sinew-runtime"]),
    (
        "runtime/cortex-m7",
        "sinew-cortex-m7",
        &["sinew-knobs", "sinew-runtime"],
    ),
    (
        "trainer/python",
        "sinew-python",
        &["sinew-formats", "sinew-interchange", "sinew-runtime", "sinew-trainer"],
    ),
    ("tests/embedded", "sinew-embedded", &["sinew-checksum", "sinew-runtime"]),
    (
        "tests/fuzz",
        "sinew-fuzz",
        &["sinew-capi", "sinew-formats", "sinew-interchange", "sinew-knobs"],
    ),
];

/// `(crate, what it may depend on)`, within the workspace.
const ARROWS: &[(&str, &[&str])] = &[
    ("sinew-formats", &[]),
    ("sinew-interchange", &["sinew-formats"]),
    ("sinew-runtime", &["sinew-formats"]),
    ("sinew-knobs", &["sinew-runtime"]),
    ("sinew-capi", &["sinew-formats", "sinew-runtime", "sinew-knobs"]),
    ("sinew-simulator", &["sinew-knobs"]),
    ("sinew-bake", &["sinew-formats", "sinew-runtime"]),
    ("sinew-synthesize", &["sinew-interchange"]),
    (
        "sinew-stage",
        &[
            "sinew-formats",
            "sinew-interchange",
            "sinew-runtime",
            "sinew-knobs",
            "sinew-bake",
            "sinew-simulator",
        ],
    ),
    ("sinew-peers", &["sinew-formats", "sinew-bake", "sinew-synthesize"]),
    (
        "sinew-trainer",
        &[
            "sinew-formats",
            "sinew-interchange",
            "sinew-runtime",
            "sinew-bake",
            "sinew-synthesize",
        ],
    ),
    (
        "sinew-command",
        &["sinew-formats", "sinew-interchange", "sinew-runtime", "sinew-trainer"],
    ),
    (
        "sinew-lab",
        &["sinew-formats", "sinew-interchange", "sinew-trainer", "sinew-command"],
    ),
    ("sinew-checksum", &["sinew-formats", "sinew-runtime"]),
    ("sinew-support", &["sinew-formats", "sinew-runtime", "sinew-bake"]),
    (
        "sinew-tests",
        &["sinew-bake", "sinew-checksum", "sinew-formats", "sinew-runtime"],
    ),
    (
        "sinew-learn-tests",
        &[
            "sinew-bake",
            "sinew-formats",
            "sinew-interchange",
            "sinew-runtime",
            "sinew-trainer",
        ],
    ),
];

/// What a crate may use in its tests and benchmarks besides: the runtime's benchmarks and the simulated box's tests play packages
/// baked on the spot.
const DEVELOPMENT_ARROWS: &[(&str, &[&str])] = &[
    ("sinew-runtime", &["sinew-peers", "sinew-bake", "sinew-interchange"]),
    ("sinew-knobs", &["sinew-formats"]),
    ("sinew-simulator", &["sinew-runtime", "sinew-bake", "sinew-peers"]),
    ("sinew-lab", &["sinew-bake"]),
];

/// What the tests of every crate may use.
const SUPPORT: &str = "sinew-support";

/// Everything that the runtime links, all of it without std.
const RUNTIME_CLOSURE: &[&str] = &[
    "bytecheck",
    "bytemuck",
    "cpufeatures",
    "crc",
    "crc-catalog",
    "libm",
    "munge",
    "ptr_meta",
    "rancor",
    "rend",
    "rkyv",
    "safe_arch",
    "simdutf8",
    "sinew-formats",
    "sinew-runtime",
    "wide",
    "xxhash-rust",
];

/// What the core of the knobs links besides, without std as well.
const KNOBS_CLOSURE: &[&str] = &[
    "byteorder",
    "cobs",
    "hash32",
    "heapless",
    "sinew-knobs",
    "stable_deref_trait",
    "thiserror",
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

/// The crates of the workspace in a folder, as Cargo reads them.
fn packages_of(folder: &str) -> Vec<Value> {
    let manifest = format!("{folder}/Cargo.toml");
    let arguments = [
        "metadata",
        "--offline",
        "--no-deps",
        "--format-version",
        "1",
        "--manifest-path",
        &manifest,
    ];
    let mut metadata: Value = serde_json::from_str(&cargo(&arguments)).unwrap();
    serde_json::from_value(metadata["packages"].take()).unwrap()
}

#[test]
fn no_arrow_but_the_drawn_ones() {
    let packages = packages_of(".");
    let names: BTreeSet<&str> = packages
        .iter()
        .map(|package| package["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        ARROWS.iter().map(|(name, _)| *name).collect(),
        "members of the workspace"
    );
    for package in &packages {
        let name = package["name"].as_str().unwrap();
        let (_, allowed) = ARROWS.iter().find(|(known, _)| *known == name).unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            let target = dependency["name"].as_str().unwrap();
            let more = DEVELOPMENT_ARROWS.iter().filter(|(known, _)| *known == name);
            let in_tests = dependency["kind"].as_str() == Some("dev")
                && (target == SUPPORT || more.flat_map(|(_, more)| *more).any(|known| *known == target));
            // A crate may name itself or a crate below it with other features in its own tests.
            let known = allowed.contains(&target) || in_tests || !names.contains(target);
            assert!(known, "{name} must not depend on {target}");
        }
    }
}

#[test]
fn programs_outside_the_workspace_obey_the_arrows_too() {
    let manifest = fs::read_to_string(workspace_folder().join("Cargo.toml")).unwrap();
    let excluded = manifest.lines().find(|line| line.starts_with("exclude = ")).unwrap();
    for folder in excluded.split('"').skip(1).step_by(2) {
        let listed = OUTSIDE_ARROWS.iter().any(|(known, ..)| *known == folder);
        assert!(listed, "{folder} is excluded from the workspace and has no arrows here");
    }
    for (folder, name, allowed) in OUTSIDE_ARROWS {
        let packages = packages_of(folder);
        let [package] = &packages[..] else {
            panic!("{folder} holds {} crates", packages.len());
        };
        assert_eq!(package["name"].as_str(), Some(*name), "{folder}");
        let mut found = 0;
        for dependency in package["dependencies"].as_array().unwrap() {
            let target = dependency["name"].as_str().unwrap();
            if target.starts_with("sinew-") {
                assert!(allowed.contains(&target), "{name} must not depend on {target}");
                found += 1;
            }
        }
        assert!(found > 0, "{name} depends on nothing of Sinew");
    }
}

/// A package's own code and everything linked with it, procedural macros aside.
fn closure(package: &str) -> BTreeSet<String> {
    let arguments = [
        "tree",
        "--offline",
        "-p",
        package,
        "-e",
        "normal,no-proc-macro",
        "--prefix",
        "none",
    ];
    let tree = cargo(&arguments);
    let names = tree.lines().filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).collect()
}

#[test]
fn the_cores_link_nothing_that_needs_std() {
    for (package, more) in [("sinew-runtime", &[][..]), ("sinew-knobs", KNOBS_CLOSURE)] {
        let linked = closure(package);
        assert!(
            linked.contains("sinew-formats") && linked.contains("rkyv"),
            "the tree was read: {linked:?}"
        );
        let known = |name: &String| RUNTIME_CLOSURE.iter().chain(more).any(|known| known == name);
        let strange: Vec<_> = linked.iter().filter(|name| !known(name)).collect();
        assert!(
            strange.is_empty(),
            "{package}: not known to live without std: {strange:?}"
        );
    }
}

#[test]
fn the_cores_switch_nothing_on_that_needs_std() {
    for package in ["sinew-runtime", "sinew-knobs", "sinew-formats"] {
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
        for name in RUNTIME_CLOSURE.iter().chain(KNOBS_CLOSURE) {
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
