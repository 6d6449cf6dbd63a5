//! C programs, compiled as users compile them (C99, every warning an error), linked with either library, run plainly and
//! under valgrind where this machine has it.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{
    Output, compact_package, compile, crate_folder, headers, libraries, other_package, package, renamed_package, run,
    tool,
};
use sinew_knobs::{
    ControlMap, ControlSurface, Decoder, DecoderSettings, Knob, KnobState, SlotState, SurfaceMemory, SurfaceSettings,
    TreePages,
};
use sinew_runtime::{Basis, Controls, Frame, Kernels, TierChoice, Workspace, WorkspaceLayout};
use tempfile::TempDir;

/// What valgrind ends with when it found anything.
const VALGRIND_ERROR: &str = "99";

/// `misuse.c` compares whole memories, so it also looks at the padding inside of handles, which nobody sets.
const SUPPRESSION: &str = "{\n padding\n Memcheck:Cond\n fun:*cmp*\n fun:say\n}\n";

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, bytes) in [
            ("baked.sinew", package()),
            ("other.sinew", other_package()),
            ("compact.sinew", compact_package()),
            ("plain.sinew", renamed_package()),
        ] {
            fs::write(folder.path().join(name), &*bytes).expect("written");
        }
        fs::write(folder.path().join("suppression"), SUPPRESSION).expect("written");
        Self(folder)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The program of a source in this crate, linked with a library.
    fn program(&self, source: &str, library: &Path) -> PathBuf {
        let run_path = format!("-Wl,-rpath,{}", library.parent().expect("in a folder").display());
        compile(
            "gcc",
            &["-std=c99", &run_path],
            &crate_folder().join(source),
            &[library],
            self.0.path(),
        )
    }
}

/// Runs a program; under valgrind too, which must find nothing and see the same. Plainly last: valgrind offers narrower
/// kernels, and what the program writes should be this machine's.
fn run_twice(program: &Path, arguments: &[PathBuf]) -> Output {
    let folder = program.parent().expect("in a folder");
    let mut under_valgrind = None;
    if let Some(valgrind) = tool("valgrind") {
        let checked = run(Command::new(valgrind)
            .args([
                "--quiet",
                "--leak-check=full",
                "--show-leak-kinds=all",
                "--errors-for-leak-kinds=all",
            ])
            .arg(format!("--error-exitcode={VALGRIND_ERROR}"))
            .arg(format!("--suppressions={}", folder.join("suppression").display()))
            .arg(program)
            .args(arguments));
        under_valgrind = Some(checked);
    }
    let plain = run(Command::new(program).args(arguments));
    if let Some(checked) = under_valgrind {
        assert_eq!(checked.code, plain.code, "{}", checked.stderr);
        assert_eq!(checked.stdout, plain.stdout);
    }
    plain
}

/// The pose that the example plays when it is given no controls: positions and normals. Shape: `[V]`.
fn expected_pose(bytes: &[u8]) -> [Vec<[f32; 3]>; 2] {
    let basis = Basis::open(bytes).expect("valid");
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory).expect("enough");
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
    for k in 0..2 {
        controls.set(k, 0.5 * basis.component(k).maximum).expect("finite");
    }
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    let job = Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    };
    job.run(&mut workspace).expect("finite");
    [positions, normals]
}

/// Vectors of an OBJ's lines that begin with a word.
fn vectors(obj: &str, word: &str) -> Vec<[f32; 3]> {
    obj.lines()
        .filter_map(|line| line.strip_prefix(word)?.strip_prefix(' '))
        .map(|rest| {
            let mut numbers = rest.split(' ').map(|number| number.parse().expect("a number"));
            core::array::from_fn(|_| numbers.next().expect("three numbers"))
        })
        .collect()
}

fn check_example(library: &Path) {
    let folder = Folder::new();
    let program = folder.program("examples/pose.c", library);
    let obj = folder.file("pose.obj");
    let output = run_twice(&program, &[folder.file("baked.sinew"), obj.clone()]);
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    let written = fs::read_to_string(&obj).expect("the example wrote it");
    let [positions, normals] = expected_pose(&package());
    assert_eq!(
        vectors(&written, "v"),
        positions,
        "the runtime's own positions, to the bit"
    );
    assert_eq!(vectors(&written, "vn"), normals);
    let face_count = Basis::open(&package()).expect("valid").face_count();
    assert_eq!(
        written.lines().filter(|line| line.starts_with("f ")).count(),
        face_count
    );

    let refused = run(Command::new(&program).args([folder.file("compact.sinew"), obj.clone()]));
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("run `sinew bake` on it"), "{}", refused.stderr);
    let refused = run(Command::new(&program).args([folder.file("baked.sinew"), obj, "no=1".into()]));
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("no control of this name"), "{}", refused.stderr);
}

#[test]
fn the_example_plays_the_runtime_s_pose_linked_statically() {
    check_example(&libraries().archive);
}

#[test]
fn the_example_plays_the_runtime_s_pose_linked_dynamically() {
    check_example(&libraries().shared);
}

/// Lines of a box of four knobs: one is turned up and part of the way back, the others stand; a print among them.
fn knob_lines() -> String {
    let mut lines = String::from("hello, I am a box\r\n");
    for step in 0..200_u32 {
        let turned = (17 * step).min(1023) - 5 * step.saturating_sub(100).min(60);
        lines += &format!("{turned}|100|0|1023\r\n");
    }
    lines
}

/// What the runtime makes of bytes that come 64 a frame, sixty frames a second: positions, and the weights.
fn expected_play(bytes: &[u8]) -> (Vec<[f32; 3]>, Vec<f32>) {
    let package = package();
    let basis = Basis::open(&package).expect("valid");
    let knobs: [Knob<'_>; 4] = core::array::from_fn(|n| Knob::new(n as u16, ""));
    let (coarse_knobs, fine_knobs) = TreePages::share(&basis, 4);
    let tree = TreePages {
        coarse_knobs,
        fine_knobs,
        ..TreePages::default()
    };
    let map = ControlMap::new(basis, &knobs, &[], &[], Some(tree)).expect("a map");
    let (mut states, mut slots) = ([KnobState::default(); 4], [SlotState::default(); 4]);
    let memory = SurfaceMemory {
        knobs: &mut states,
        slots: &mut slots,
        left: &mut vec![0.0; basis.component_count()],
    };
    let mut surface = ControlSurface::new(map, SurfaceSettings::default(), memory).expect("room");
    let mut decoder = Decoder::new(None, DecoderSettings::default());
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
    let mut now_us = 0;
    for piece in bytes.chunks(64).chain([&[][..]]) {
        decoder.feed(piece, &mut |event| surface.event(now_us, event));
        surface.advance(now_us, &mut controls).expect("its own controls");
        now_us += 16_667;
    }
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory).expect("enough");
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let job = Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: None,
    };
    job.run(&mut workspace).expect("finite");
    (positions, weights)
}

#[test]
fn the_knob_example_plays_what_the_box_says() {
    let folder = Folder::new();
    let (bytes, obj) = (folder.file("bytes"), folder.file("knobs.obj"));
    let lines = knob_lines();
    fs::write(&bytes, &lines).expect("written");
    let program = folder.program("examples/knobs.c", &libraries().archive);
    let output = run_twice(&program, &[folder.file("baked.sinew"), bytes, obj.clone(), "4".into()]);
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    let (positions, weights) = expected_play(lines.as_bytes());
    assert!(weights[0] > 0.1, "{weights:?}");
    let written = fs::read_to_string(&obj).expect("the example wrote it");
    assert_eq!(
        vectors(&written, "v"),
        positions,
        "the runtime's own positions, to the bit"
    );
    let mut said = output.stdout.lines();
    let device = said.next().expect("a line on the device");
    assert!(device.starts_with("text lines, "), "{device}");
    assert!(device.contains(&format!("; {} bytes, ", lines.len())), "{device}");
    let knobs: Vec<&str> = said.collect();
    assert_eq!(knobs.len(), 4, "{knobs:?}");
    assert_eq!(knobs[0], "knob 0  moves c00");
    assert_eq!(knobs[1], "knob 1  moves c00.f0, turn right 40 % to pick up");
    assert_eq!(knobs[2], "knob 2  moves nothing", "c00 has one child");
}

/// What the runtime plays for an instance of the crowd, in the round that is written. Shape: `[V]`.
fn expected_instance(bytes: &[u8], instance: usize) -> Vec<[f32; 3]> {
    const LAST_ROUND: usize = 2;
    let basis = Basis::open(bytes).expect("valid");
    let tier = match basis.bones() {
        Some(_) => TierChoice::Bones,
        None => TierChoice::Exact,
    };
    let layout = WorkspaceLayout::for_tier(&basis, tier).expect("it has it");
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut workspace = Workspace::for_tier(&basis, tier, &mut memory, Kernels::detect()).expect("enough");
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
    for k in 0..basis.component_count() {
        let share = ((3 * instance + 5 * k + 7 * LAST_ROUND) % 11) as f32 / 10.0;
        controls.set(k, share * basis.component(k).maximum).expect("finite");
    }
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let job = Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: None,
    };
    job.run(&mut workspace).expect("finite");
    positions
}

#[test]
fn the_crowd_example_plays_every_instance_on_threads() {
    let folder = Folder::new();
    let obj = folder.file("crowd.obj");
    let program = folder.program("examples/crowd.c", &libraries().shared);
    for (name, bytes) in [("baked.sinew", package()), ("plain.sinew", renamed_package())] {
        let output = run_twice(&program, &[folder.file(name), obj.clone(), "13".into(), "3".into()]);
        assert_eq!(output.code, Some(0), "{}", output.stderr);
        let played: Vec<&str> = output.stdout.lines().collect();
        assert_eq!(
            played,
            [0, 1, 2].map(|round| format!("round {round}: 13 instances played"))
        );
        let written = fs::read_to_string(&obj).expect("the example wrote it");
        let expected: Vec<[f32; 3]> = (0..13).flat_map(|n| expected_instance(&bytes, n)).collect();
        assert_eq!(
            vectors(&written, "v"),
            expected,
            "the runtime's own positions, to the bit"
        );
    }
}

/// Programs of wrong uses, each with its expected lines beside it.
const MISUSES: [&str; 3] = ["misuse", "misuse_frames", "misuse_knobs"];

fn check_misuse(name: &str) {
    let folder = Folder::new();
    let program = folder.program(&format!("tests/{name}.c"), &libraries().archive);
    let packages = ["baked.sinew", "other.sinew", "compact.sinew"].map(|name| folder.file(name));
    let output = run_twice(&program, &packages);
    let expected_file = crate_folder().join(format!("tests/{name}.txt"));
    if std::env::var_os("UPDATE_MISUSE").is_some() {
        fs::write(&expected_file, &output.stdout).expect("written");
        panic!("{name}.txt was written; read the changes, then run the test again without UPDATE_MISUSE");
    }
    let expected = fs::read_to_string(&expected_file).expect("the expected lines are there");
    for (number, (line, expected)) in output.stdout.lines().zip(expected.lines()).enumerate() {
        assert_eq!(line, expected, "line {}", number + 1);
    }
    assert_eq!(output.stdout.lines().count(), expected.lines().count());
    assert_eq!(output.code, Some(0), "{}", output.stderr);
}

#[test]
fn every_misuse_of_packages_players_and_frames_is_refused_by_name_and_changes_nothing() {
    check_misuse("misuse");
}

#[test]
fn every_misuse_of_tiers_buffers_pins_and_batches_is_refused_by_name_and_changes_nothing() {
    check_misuse("misuse_frames");
}

#[test]
fn every_misuse_of_decoders_and_surfaces_is_refused_by_name_and_changes_nothing() {
    check_misuse("misuse_knobs");
}

/// What no single-threaded C program can bring about.
const NOT_IN_MISUSE: [&str; 2] = ["SINEW_STATUS_IN_USE", "SINEW_STATUS_INTERNAL"];

#[test]
fn the_misuses_show_every_status() {
    let shown = MISUSES.map(|name| {
        fs::read_to_string(crate_folder().join(format!("tests/{name}.txt"))).expect("the expected lines are there")
    });
    let headers = headers();
    let statuses = headers
        .lines()
        .filter_map(|line| line.trim().split_once(" = "))
        .map(|(name, _)| name)
        .filter(|name| name.starts_with("SINEW_STATUS_"));
    let mut count = 0;
    for status in statuses.filter(|name| !NOT_IN_MISUSE.contains(name)) {
        count += 1;
        assert!(
            shown
                .iter()
                .flat_map(|text| text.lines())
                .any(|line| line.ends_with(status)),
            "{status} is not shown"
        );
    }
    assert!(count > 40);
}
