//! Order in the source: every file says what it is, none is too long, nothing is left undone, and the cores name neither
//! std nor alloc outside the files that their features switch on.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use sinew_support::workspace_folder;

/// A file longer than this holds two things.
const LINES_MAX: usize = 500;
/// Marks of unfinished work, taken apart so that this file does not hold them.
const UNFINISHED: [&str; 5] = [
    concat!("to", "do!("),
    concat!("unimple", "mented!("),
    concat!("TO", "DO"),
    concat!("FIX", "ME"),
    concat!("//! st", "ub"),
];

/// All `.rs` files under a folder of the workspace, in order of their paths.
fn sources(folder: &str) -> Vec<PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![workspace_folder().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("target") {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.insert(path);
            }
        }
    }
    assert!(!found.is_empty(), "no sources in {folder}");
    found.into_iter().collect()
}

fn all_sources() -> impl Iterator<Item = (PathBuf, String)> {
    ["formats", "runtime", "trainer", "tests"]
        .into_iter()
        .flat_map(sources)
        .map(|path| (path.clone(), fs::read_to_string(path).unwrap()))
}

fn fail_with(faults: Vec<String>) {
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_file_says_what_it_is() {
    fail_with(
        all_sources()
            .filter(|(_, text)| !text.starts_with("//! "))
            .map(|(path, _)| format!("{} does not begin with a module doc", path.display()))
            .collect(),
    );
}

#[test]
fn no_file_is_too_long() {
    fail_with(
        all_sources()
            .map(|(path, text)| (path, text.lines().count()))
            .filter(|(_, line_count)| *line_count > LINES_MAX)
            .map(|(path, line_count)| format!("{} has {line_count} lines, more than {LINES_MAX}", path.display()))
            .collect(),
    );
}

#[test]
fn nothing_is_left_undone() {
    let mut faults = Vec::new();
    for (path, text) in all_sources() {
        for (number, line) in text.lines().enumerate() {
            if UNFINISHED.iter().any(|mark| line.contains(mark)) {
                faults.push(format!("{}:{}: {line}", path.display(), number + 1));
            }
        }
    }
    fail_with(faults);
}

/// What a module may name because of the `cfg` in front of it.
#[derive(Clone, Copy, Default)]
struct Allowed {
    std: bool,
    alloc: bool,
}

impl Allowed {
    fn with(self, attribute: &str) -> Self {
        let positive = attribute.starts_with("#[cfg(") && !attribute.contains("not(");
        let std = positive && (attribute.contains("test") || attribute.contains("\"std\""));
        let alloc = positive && (attribute.contains("\"alloc\"") || attribute.contains("\"fixture\""));
        Self {
            std: self.std || std,
            alloc: self.alloc || std || alloc,
        }
    }
}

/// Follows `mod` lines from a module's file and collects each use of std and alloc that no `cfg` covers.
fn follow(file: &Path, children: &Path, allowed: Allowed, faults: &mut Vec<String>, visited: &mut usize) {
    *visited += 1;
    let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let mut attribute = Allowed::default();
    for (number, line) in text.lines().enumerate() {
        let code = line.trim_start();
        if code.starts_with("#[cfg(") {
            attribute = allowed.with(code);
            continue;
        }
        if code.starts_with("//") || code.starts_with("#[") {
            continue;
        }
        let here = Allowed {
            std: allowed.std || attribute.std,
            alloc: allowed.alloc || attribute.alloc,
        };
        attribute = Allowed::default();
        let declared = code.trim_start_matches("pub(crate) ").trim_start_matches("pub(super) ");
        let declared = declared.trim_start_matches("pub ").strip_prefix("mod ");
        if let Some(name) = declared.and_then(|rest| rest.strip_suffix(';')) {
            let (flat, nested) = (children.join(format!("{name}.rs")), children.join(name).join("mod.rs"));
            let child = if flat.exists() { flat } else { nested };
            follow(&child, &children.join(name), here, faults, visited);
            continue;
        }
        if declared.is_some_and(|rest| rest.starts_with("tests {")) && here.std {
            break; // by custom the last item of a file
        }
        let named = |library: &str| {
            code.match_indices(library).any(|(at, _)| {
                let before = code[..at].chars().next_back();
                !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
            })
        };
        if named("std::") && !here.std || named("alloc::") && !here.alloc {
            faults.push(format!("{}:{}: {code}", file.display(), number + 1));
        }
    }
}

#[test]
fn the_cores_name_neither_std_nor_alloc() {
    let (mut faults, mut visited) = (Vec::new(), 0);
    let root = workspace_folder();
    let package = root.join("formats/src/package");
    follow(
        &package.join("mod.rs"),
        &package,
        Allowed::default(),
        &mut faults,
        &mut visited,
    );
    let in_formats = sources("formats/src/package").len();
    assert_eq!(
        visited, in_formats,
        "every file of the package module is declared and was read"
    );
    let mut there = in_formats;
    for core in ["runtime/src", "runtime/knobs/src"] {
        let folder = root.join(core);
        follow(
            &folder.join("lib.rs"),
            &folder,
            Allowed::default(),
            &mut faults,
            &mut visited,
        );
        there += sources(core).len();
        assert_eq!(visited, there, "every file of {core} is declared and was read");
    }
    fail_with(faults);
}
