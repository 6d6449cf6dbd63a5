//! The pages for people: what they link to exists, headings included; every page can be reached from the README, which stays
//! short; and the crates, examples and benchmarks that commands on them name are there.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use sinew_support::workspace_folder;

/// A front page that is longer is not read.
const README_WORDS_MAX: usize = 1200;

/// Every Markdown file of the repository.
fn pages() -> Vec<PathBuf> {
    let root = workspace_folder().canonicalize().unwrap();
    let mut found = Vec::new();
    let mut folders = vec![root];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && name != "target" && !name.starts_with('.') && !name.starts_with("sinew-") {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(path);
            }
        }
    }
    found.sort();
    assert!(found.len() > 5, "{found:?}");
    found
}

/// Lines outside fenced code, and those inside.
fn prose_and_code(text: &str) -> [Vec<&str>; 2] {
    let (mut prose, mut code, mut is_code) = (Vec::new(), Vec::new(), false);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if is_code {
            code.push(line);
        } else {
            prose.push(line);
        }
    }
    [prose, code]
}

/// Targets of `[text](target)` and `![text](target)`, code between backticks aside. A link may run over a line's end.
fn links(text: &str) -> Vec<String> {
    let prose = prose_and_code(text)[0].join("\n");
    let outside: Vec<&str> = prose.split('`').step_by(2).collect();
    let outside = outside.join("");
    let mut targets = Vec::new();
    for (at, _) in outside.match_indices("](") {
        let rest = &outside[at + 2..];
        targets.push(rest[..rest.find(')').expect("a link ends")].to_owned());
    }
    targets
}

/// A heading's anchor, as GitHub makes it: small letters, hyphens for spaces, no other punctuation.
fn anchor(heading: &str) -> String {
    let mut anchor = String::new();
    for c in heading.trim_start_matches('#').trim().to_lowercase().chars() {
        match c {
            ' ' => anchor.push('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => anchor.push(c),
            _ => (),
        }
    }
    anchor
}

fn anchors(page: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(page).unwrap();
    let [prose, _] = prose_and_code(&text);
    prose
        .iter()
        .filter(|line| line.starts_with('#'))
        .map(|line| anchor(line))
        .collect()
}

/// Where a link leads, if not to another site: file and heading.
fn target(page: &Path, link: &str) -> Option<(PathBuf, Option<String>)> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (file, heading) = match link.split_once('#') {
        Some((file, heading)) => (file, Some(heading.to_owned())),
        None => (link, None),
    };
    let path = match file {
        "" => page.to_path_buf(),
        file => page.parent().unwrap().join(file),
    };
    Some((path, heading))
}

#[test]
fn links_lead_somewhere() {
    let mut faults = Vec::new();
    for page in pages() {
        for link in links(&fs::read_to_string(&page).unwrap()) {
            let Some((path, heading)) = target(&page, &link) else {
                continue;
            };
            if !path.exists() {
                faults.push(format!("{}: nothing stands at `{link}`", page.display()));
            } else if heading.is_some_and(|heading| !anchors(&path).contains(&heading)) {
                faults.push(format!("{}: no heading there is `{link}`", page.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_page_is_reached_from_the_readme() {
    let mut reached = BTreeSet::new();
    let mut next = vec![workspace_folder().canonicalize().unwrap().join("README.md")];
    while let Some(page) = next.pop() {
        if page.extension().is_none_or(|extension| extension != "md") || !reached.insert(page.clone()) {
            continue;
        }
        let text = fs::read_to_string(&page).unwrap();
        let targets = links(&text).into_iter().filter_map(|link| target(&page, &link));
        next.extend(targets.filter_map(|(path, _)| path.canonicalize().ok()));
    }
    let lost: Vec<PathBuf> = pages().into_iter().filter(|page| !reached.contains(page)).collect();
    assert!(lost.is_empty(), "no page leads to {lost:?}");
}

#[test]
fn the_readme_is_short() {
    let text = fs::read_to_string(workspace_folder().join("README.md")).unwrap();
    let words = text.split_whitespace().count();
    assert!(words <= README_WORDS_MAX, "{words} words, more than {README_WORDS_MAX}");
}

/// Names that follow an option in the commands of a text.
fn named<'t>(text: &'t str, option: &str) -> impl Iterator<Item = &'t str> {
    let option = option.to_owned();
    text.lines()
        .filter(|line| line.contains("cargo "))
        .flat_map(move |line| {
            let words: Vec<&str> = line.split(|c: char| c.is_whitespace() || "`(),".contains(c)).collect();
            let pairs = words.windows(2).filter(|pair| pair[0] == option);
            pairs.map(|pair| pair[1]).collect::<Vec<_>>()
        })
}

#[test]
fn commands_name_crates_and_examples_that_exist() {
    let root = workspace_folder();
    let workspace: toml::Table = fs::read_to_string(root.join("Cargo.toml")).unwrap().parse().unwrap();
    let members = workspace["workspace"]["members"].as_array().unwrap();
    let mut crates = BTreeSet::new();
    let mut programs = BTreeSet::new();
    for folder in members.iter().map(|member| root.join(member.as_str().unwrap())) {
        let manifest: toml::Table = fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap();
        crates.insert(manifest["package"]["name"].as_str().unwrap().to_owned());
        for kind in ["examples", "benches"] {
            let entries = fs::read_dir(folder.join(kind)).into_iter().flatten();
            programs.extend(entries.map(|entry| {
                entry
                    .unwrap()
                    .path()
                    .file_stem()
                    .unwrap()
                    .to_string_lossy()
                    .into_owned()
            }));
        }
    }
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for name in named(&text, "-p") {
            assert!(crates.contains(name), "{}: there is no crate `{name}`", page.display());
            count += 1;
        }
        for name in named(&text, "--example").chain(named(&text, "--bench")) {
            assert!(
                programs.contains(name),
                "{}: there is no `{name}` to run",
                page.display()
            );
            count += 1;
        }
    }
    assert!(count > 5, "the pages name {count}");
}

#[test]
fn links_and_anchors_are_read_as_they_are_shown() {
    let text = "# A, b & C\n[one](x.md#a) `[no](y)` ![p\nq](z.png)\n```sh\n[no](w)\n```\n";
    assert_eq!(links(text), ["x.md#a", "z.png"]);
    assert_eq!(
        anchor("## Browser, and `micro`-controller"),
        "browser-and-micro-controller"
    );
}
