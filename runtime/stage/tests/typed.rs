//! Performances without a device: typed lines, streams, takes and what is refused.

mod common;

use core::time::Duration;
use std::io::Write;

use common::{Ran, Stage, table};
use sinew_formats::package::fixture::tiny_compact;
use sinew_formats::package::{save_package, write_compact};
use sinew_interchange::{Choice, read_sequence};

#[test]
fn typed_lines_move_the_mesh_and_the_take_gives_the_same_weights() {
    let stage = Stage::new();
    let line = "play model.sinew --typed --headless --for 700ms --record a.take --stream obj:live.obj";
    let live = stage.run(line, "c0 0.4\nc3 -0.2\nc9 1\nfocus c1\n").expect(0);
    let live = live.says(&[
        "standard input, line 3: there is no component or command `c9`",
        "stream obj:live.obj:",
    ]);
    let played = live.after("take a.take: ");
    let replay = stage
        .run(
            "play model.sinew --headless --replay a.take --export w.csv --stream obj:last.obj",
            "",
        )
        .expect(0);
    assert_eq!(replay.after("replayed "), played);
    let rows = table(&stage.path("w.csv"));
    assert_eq!(
        rows.len().to_string(),
        played.split(' ').next().unwrap(),
        "a row a frame"
    );
    let last = rows.last().unwrap();
    assert!((last[1] - 0.4).abs() < 1e-6 && (last[4] + 0.2).abs() < 1e-6, "{last:?}");
    // The mesh of a replay is the mesh that was played, once a frame got through to the live file.
    let obj = |name: &str| std::fs::read_to_string(stage.path(name)).unwrap();
    assert_eq!(obj("live.obj"), obj("last.obj"));
    assert!(obj("live.obj").starts_with("v "));
}

#[test]
fn frames_of_ones_own_are_even() {
    let stage = Stage::new();
    stage
        .run(
            "play model.sinew --typed --headless --for 600ms --record a.take",
            "c0 0.3\n",
        )
        .expect(0);
    stage
        .run(
            "play model.sinew --headless --replay a.take --fps 24 --export w.csv --stream obj:keys/",
            "",
        )
        .expect(0);
    let rows = table(&stage.path("w.csv"));
    assert!((13..=17).contains(&rows.len()), "{} keys of 600 ms", rows.len());
    for (n, row) in rows.iter().enumerate() {
        assert!((row[0] - n as f32 / 24.0).abs() < 1e-4);
    }
    let shapes = read_sequence(&stage.path("keys"), &Choice::default(), &mut |_, _| {})
        .unwrap()
        .sequence
        .shapes;
    assert_eq!(shapes.len(), rows.len(), "files are never left out");
    stage
        .run(
            "play model.sinew --headless --replay a.take --fps 24 --export w.npy",
            "",
        )
        .expect(0);
    let npy = std::fs::read(stage.path("w.npy")).unwrap();
    assert_eq!(npy.len(), 128 + rows.len() * 7 * 4);
}

#[test]
fn raw_frames_leave_by_standard_output() {
    let stage = Stage::new();
    let line = "play model.sinew --typed --for 500ms --stream raw";
    let mut child = stage.start(line);
    let mut stdin = child.stdin.take().unwrap();
    std::thread::sleep(Duration::from_millis(250));
    writeln!(stdin, "c0 0.4").unwrap();
    let ran = Ran::new(line, child.wait_with_output().unwrap()).expect(0);
    assert_eq!(&ran.out[..4], b"SNSR");
    let number = |at: usize| u32::from_le_bytes(ran.out[at..at + 4].try_into().unwrap()) as usize;
    let (vertices, faces) = (number(8), number(12));
    let frame = 8 + 12 * vertices;
    let frames = &ran.out[16 + 12 * faces..];
    assert!(frames.len().is_multiple_of(frame) && frames.len() / frame > 3);
    assert!(frames[8..frame] != frames[frames.len() - frame + 8..], "it moved");
}

#[test]
fn a_take_finds_components_by_name_and_says_which_are_gone() {
    let stage = Stage::new();
    stage
        .run(
            "play model.sinew --typed --headless --for 300ms --record a.take",
            "c0 0.3\nc6 0.1\n",
        )
        .expect(0);
    let tiny = tiny_compact();
    save_package(&stage.path("other.sinew"), &write_compact(&tiny.basis()).unwrap()).unwrap();
    let names: Vec<&str> = tiny.components.iter().map(|component| component.name).collect();
    let missing: Vec<String> = (0..7)
        .map(|k| format!("c{k}"))
        .filter(|name| !names.contains(&name.as_str()))
        .collect();
    let gone = format!("this package has no {}", missing.join(", "));
    stage
        .run("play other.sinew --headless --replay a.take", "")
        .expect(0)
        .says(&["played on another package", &gone, "records left out"]);
}

#[test]
fn a_cut_take_is_played_as_far_as_it_goes() {
    let stage = Stage::new();
    stage
        .run(
            "play model.sinew --typed --headless --for 300ms --record a.take",
            "c0 0.3\n",
        )
        .expect(0);
    let bytes = std::fs::read(stage.path("a.take")).unwrap();
    let cut = &bytes[..bytes.len() - 3];
    std::fs::write(stage.path("cut.take"), cut).unwrap();
    stage
        .run("play model.sinew --headless --replay cut.take", "")
        .expect(0)
        .says(&["was not closed", "behind the last whole piece"]);
    std::fs::write(stage.path("cut.take"), &bytes[..20]).unwrap();
    stage
        .run("play model.sinew --headless --replay cut.take", "")
        .expect(2)
        .says(&["cannot be replayed", "ends inside its header"]);
}

#[test]
fn a_recording_can_begin_and_end_while_it_plays() {
    let stage = Stage::new();
    let mut child = stage.start("play model.sinew --typed --headless --for 4s");
    let mut stdin = child.stdin.take().unwrap();
    for line in [
        "c0 0.3", "record", "c1 0.2", "record", "c2 0.1", "record", "rest", "stop",
    ] {
        writeln!(stdin, "{line}").unwrap();
        std::thread::sleep(Duration::from_millis(120));
    }
    let live = Ran::new("play", child.wait_with_output().unwrap()).expect(0);
    for name in ["sinew.take", "sinew-2.take"] {
        let replay = stage
            .run(
                &format!("play model.sinew --headless --replay {name} --export {name}.csv"),
                "",
            )
            .expect(0);
        assert_eq!(replay.after("replayed "), live.after(&format!("take {name}: ")));
    }
    let first = table(&stage.path("sinew.take.csv"));
    assert!(
        (first[0][1] - 0.3).abs() < 1e-6,
        "a take begins where the weights stand"
    );
    let last = table(&stage.path("sinew-2.take.csv")).pop().unwrap();
    assert_eq!(last[1..], [0.0; 7], "and ends where they went");
}

#[cfg(unix)]
#[test]
fn a_recording_that_cannot_begin_does_not_end_the_show() {
    let stage = Stage::new();
    // The name that a recording would take is a link to nowhere: it neither is there nor can be made.
    std::os::unix::fs::symlink(stage.path("no/where"), stage.path("sinew.take")).unwrap();
    let ran = stage
        .run("play model.sinew --typed --headless --for 600ms", "record\nc0 0.3\n")
        .expect(2);
    ran.says(&["played ", "sinew.take is there already"]);
}

#[test]
fn refusals_name_the_file_and_the_cure() {
    let stage = Stage::new();
    stage.write("knobs.toml", "[[knob]]\nknob = 0\ncomponent = \"c00\"\n");
    let refused = |line: &str, parts: &[&str]| drop(stage.run(line, "").expect(2).says(parts));
    refused("play missing.sinew", &["missing.sinew"]);
    refused("play knobs.toml", &["knobs.toml is no usable package"]);
    refused(
        "play model.sinew --knobs knobs.toml",
        &["knobs.toml:3:13", "did you mean `c0`?"],
    );
    refused("play model.sinew --typed --stream fbx", &["there is no stream `fbx`"]);
    refused(
        "play model.sinew --typed --stream obj:no/live.obj",
        &["there is no folder no"],
    );
    refused(
        "play model.sinew --typed --record model.sinew --for 100ms",
        &["never written over"],
    );
    refused("play model.sinew --replay model.sinew", &["this is not a take"]);
    refused("play model.sinew --serial /dev/no-such-port", &["/dev/no-such-port"]);
    refused("play model.sinew --fps 0", &["from 1 to 1000"]);
    refused("play model.sinew --serial auto --osc 9000", &["cannot be used with"]);
    refused("play model.sinew --export w.csv", &["--replay"]);
}
