//! Packages of released format versions: the same bytes are written, they open, and they hold and play what is written
//! beside them. `UPDATE_GOLDEN=1` writes those of the current version again; a test fails while it is set.

use core::fmt::{Debug, Write};
use std::{env, fs, path::PathBuf};

use sinew_formats::package::{
    BakedView, CompactView, FIRST_VERSION, FORMAT_VERSION, OpenError, PackageKind, PatchesView, SolveView,
    read_package, save_package,
};
use sinew_runtime::Basis;
use sinew_support::{baked_package, compact_package, play};

/// Rounding of another order of summation, on a mesh of size 2.
const PLAY_TOLERANCE: f32 = 1e-5;
/// Weights of the recorded frame, clamped to the components' ranges.
const WEIGHTS: [f32; 4] = [1.0, -0.75, 0.5, 2.0];

fn golden(version: u16, name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("golden/v{version}/{name}"))
}

fn updating() -> bool {
    env::var_os("UPDATE_GOLDEN").is_some_and(|value| value == "1")
}

/// Compares with the stored file, or stores.
fn check(version: u16, name: &str, actual: &[u8]) {
    let path = golden(version, name);
    if updating() && version == FORMAT_VERSION {
        fs::create_dir_all(path.parent().expect("a golden file has a folder")).unwrap();
        save_package(&path, actual).unwrap();
    }
    let stored = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert!(
        stored == actual,
        "{} differs; see the head of this file",
        path.display()
    );
}

/// One field a line, floats to the last bit.
fn describe_compact(view: &CompactView<'_>) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: &dyn Debug| writeln!(text, "{name} = {value:?}").unwrap();
    line("rest_positions", &view.rest_positions());
    line("surface", &view.surface());
    line("bridges", &view.bridges());
    line("anchor_vertex", &view.anchor_vertex());
    line("rotation_scale", &view.rotation_scale());
    line("stretch_scale", &view.stretch_scale());
    view.blocks().for_each(|block| line("block", &block));
    view.components().for_each(|component| line("component", &component));
    line("support_bits", &view.support_bits());
    line("values", &view.values());
    line("after", &view.after());
    line("prior", &view.prior());
    line("encoder", &view.encoder());
    line("provenance", &view.provenance());
    line("quality", &view.quality());
    text
}

fn describe_baked(view: &BakedView<'_>) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: &dyn Debug| writeln!(text, "{name} = {value:?}").unwrap();
    line("compact_id", &view.compact_id());
    line("rotation_scale", &view.rotation_scale());
    line("stretch_scale", &view.stretch_scale());
    view.blocks().for_each(|block| line("block", &block));
    view.components().for_each(|component| line("component", &component));
    line("rest_positions", &view.rest_positions());
    line("slot_from_vertex", &view.slot_from_vertex());
    line("vertex_from_slot", &view.vertex_from_slot());
    line("surface", &view.surface());
    line("fan_offsets", &view.fan_offsets());
    line("fans", &view.fans());
    if let Some(exact) = view.exact() {
        describe_patches("exact", &exact.patches, &mut line);
        describe_solve(&exact.solve, &mut line);
    }
    if let Some(bones) = view.bones() {
        describe_patches("bones", &bones.patches, &mut line);
        line("bones.node_count", &bones.node_count);
        line("bones.rest_places", &bones.rest_places);
        line("bones.axes", &bones.axes);
        line("bones.turn_nodes", &bones.turn_nodes);
        line("bones.turns", &bones.turns);
        line("bones.pulls", &bones.pulls);
        line("bones.pull_scales", &bones.pull_scales);
        line("bones.slides", &bones.slides);
        line("bones.slide_scales", &bones.slide_scales);
        line("bones.skin", &bones.skin);
        line("bones.error", &bones.error);
    }
    line("after", &view.after());
    line("prior", &view.prior());
    text
}

fn describe_patches(tier: &str, patches: &PatchesView<'_>, line: &mut dyn FnMut(&str, &dyn Debug)) {
    line(&format!("{tier}.patches.offsets"), &patches.offsets);
    line(&format!("{tier}.patches.owners"), &patches.owners);
    line(&format!("{tier}.patches.values"), &patches.values);
}

fn describe_solve(solve: &SolveView<'_>, line: &mut dyn FnMut(&str, &dyn Debug)) {
    let fields: [(&str, &dyn Debug); 8] = [
        ("ring_offsets", &solve.ring_offsets),
        ("ring", &solve.ring),
        ("ring_weights", &solve.ring_weights),
        ("tile_offsets", &solve.tile_offsets),
        ("tile_rows", &solve.tile_rows),
        ("tiles", &solve.tiles),
        ("inverse_diagonals", &solve.inverse_diagonals),
        ("solver_from_slot", &solve.solver_from_slot),
    ];
    for (field, value) in fields {
        line(&format!("exact.solve.{field}"), value);
    }
}

#[test]
fn golden_files_are_not_being_written() {
    assert!(
        !updating(),
        "UPDATE_GOLDEN is set: the golden files were written anew; unset it and look at what changed"
    );
}

#[test]
fn the_writer_still_writes_the_golden_bytes() {
    check(FORMAT_VERSION, "compact.sinew", &compact_package());
    check(FORMAT_VERSION, "baked.sinew", &baked_package());
}

#[test]
fn golden_packages_hold_what_is_written_beside_them() {
    if updating() {
        the_writer_still_writes_the_golden_bytes();
    }
    for version in FIRST_VERSION..=FORMAT_VERSION {
        let compact = read_package(&golden(version, "compact.sinew")).unwrap();
        let baked = read_package(&golden(version, "baked.sinew")).unwrap();
        assert_eq!(PackageKind::of(&compact), Ok(PackageKind::Compact));
        assert_eq!(PackageKind::of(&baked), Ok(PackageKind::Baked));
        let (compact, baked) = (CompactView::open(&compact).unwrap(), BakedView::open(&baked).unwrap());
        assert_eq!(compact.header().format_version, version);
        check(version, "compact.txt", describe_compact(&compact).as_bytes());
        check(version, "baked.txt", describe_baked(&baked).as_bytes());
        assert_eq!(baked.compact_id(), compact.content_id());
    }
}

/// Of versions that are refused, the first of which a package was kept.
const EARLIEST_KEPT: u16 = 2;

#[test]
fn packages_of_versions_that_were_never_released_are_refused_by_name() {
    for version in EARLIEST_KEPT..FIRST_VERSION {
        let refused = OpenError::UnsupportedVersion {
            found: version,
            first: FIRST_VERSION,
            latest: FORMAT_VERSION,
        };
        let compact = read_package(&golden(version, "compact.sinew")).unwrap();
        let baked = read_package(&golden(version, "baked.sinew")).unwrap();
        assert_eq!(CompactView::open(&compact).err(), Some(refused));
        assert_eq!(Basis::open(&baked).err(), Some(refused));
    }
}

#[test]
fn golden_packages_play_as_recorded() {
    if updating() {
        the_writer_still_writes_the_golden_bytes();
    }
    for version in FIRST_VERSION..=FORMAT_VERSION {
        let bytes = read_package(&golden(version, "baked.sinew")).unwrap();
        let basis = Basis::open(&bytes).unwrap();
        let [positions, _] = play(&basis, |k| WEIGHTS[k]).unwrap();
        let path = golden(version, "frame.txt");
        if updating() && version == FORMAT_VERSION {
            let text: String = positions.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
            save_package(&path, text.as_bytes()).unwrap();
        }
        let text = fs::read_to_string(&path).unwrap();
        let recorded: Vec<f32> = text.split_whitespace().map(|number| number.parse().unwrap()).collect();
        assert_eq!(recorded.len(), positions.as_flattened().len());
        for (i, (now, then)) in positions.as_flattened().iter().zip(&recorded).enumerate() {
            assert!(
                (now - then).abs() <= PLAY_TOLERANCE,
                "version {version}, coordinate {i}: {now}, was {then}"
            );
        }
        let [rest, _] = play(&basis, |_| 0.0).unwrap();
        let moved = rest
            .as_flattened()
            .iter()
            .zip(&recorded)
            .any(|(a, b)| (a - b).abs() > 0.1);
        assert!(moved, "the recorded frame is not the rest shape");
    }
}
