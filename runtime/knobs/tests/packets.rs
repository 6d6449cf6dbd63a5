//! The framed protocol of `docs/knob-protocol.md`: the conformance vectors against the parser, and the Arduino header
//! against the vectors.

use core::fmt::Write;
use std::{collections::BTreeMap, fs, path::PathBuf, process::Command};

use sinew_knobs::{
    KnobEvent, Reading,
    protocol::{FRAME_BYTES_MAX, FrameKind, Packets, write_frame},
};

fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

fn from_hex(text: &str) -> Vec<u8> {
    assert!(text.len().is_multiple_of(2), "{text}");
    (0..text.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap())
        .collect()
}

struct Case {
    title: String,
    bytes: Vec<u8>,
    expected: Vec<String>,
}

fn vectors() -> Vec<Case> {
    let text = fs::read_to_string(docs().join("knob-protocol-vectors.txt")).unwrap();
    let mut cases: Vec<Case> = Vec::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (word, rest) = line.split_once(' ').unwrap();
        if word == "case" {
            cases.push(Case {
                title: rest.into(),
                bytes: Vec::new(),
                expected: Vec::new(),
            });
            continue;
        }
        let case = cases.last_mut().expect("a case comes first");
        match word {
            "bytes" => case.bytes.extend(from_hex(rest)),
            _ => case.expected.push(line.into()),
        }
    }
    cases
}

fn event_line(event: KnobEvent) -> String {
    match event.reading {
        Reading::Position { value, full_scale } => format!("event {} {value}/{full_scale}", event.knob),
        Reading::Steps(steps) => format!("event {} {steps}", event.knob),
    }
}

/// What a host makes of the bytes, in the words of the vectors and in the order that `expected` asks.
fn seen(bytes: &[u8], chunk: usize, expected: &[String]) -> Vec<String> {
    let mut packets = Packets::new();
    let mut lines = Vec::new();
    for chunk in bytes.chunks(chunk) {
        packets.feed(chunk, &mut |event| lines.push(event_line(event)));
    }
    let argument = |line: &str| line.split(' ').nth(1).and_then(|knob| knob.parse().ok()).unwrap_or(0);
    for line in expected {
        let knob: u16 = argument(line);
        lines.extend(match line.split(' ').next().unwrap() {
            "firmware" => Some(format!("firmware {}", packets.firmware().unwrap_or("?"))),
            "knobs" => packets.knob_count().map(|count| format!("knobs {count}")),
            "name" => Some(format!("name {knob} {}", packets.name_of(knob).unwrap_or("?"))),
            "nameless" => packets.name_of(knob).is_none().then(|| format!("nameless {knob}")),
            "range" => packets
                .range_of(knob)
                .map(|(low, high)| format!("range {knob} {low} {high}")),
            _ => None,
        });
    }
    let counters = packets.counters();
    assert_eq!(counters.bytes, bytes.len() as u64);
    let counts = [
        ("good", counters.good),
        ("ignored", counters.ignored),
        ("partial", counters.partial),
        ("bad", counters.bad),
        ("dropped", counters.dropped),
    ];
    lines.extend(
        counts
            .iter()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{name} {count}")),
    );
    lines.extend(counters.last_fault.map(|fault| format!("fault {fault}")));
    lines
}

#[test]
fn the_parser_conforms_to_the_vectors() {
    let cases = vectors();
    assert!(cases.len() > 20, "the vectors were read");
    for Case { title, bytes, expected } in &cases {
        for chunk in [1, 2, 3, 7, bytes.len()] {
            let mut seen = seen(bytes, chunk, expected);
            let mut expected = expected.clone();
            // Events are compared in order, what else is known in any.
            let events = |lines: &[String]| {
                lines
                    .iter()
                    .filter(|line| line.starts_with("event"))
                    .cloned()
                    .collect::<Vec<_>>()
            };
            assert_eq!(events(&seen), events(&expected), "{title}, chunks of {chunk}");
            seen.sort();
            expected.sort();
            assert_eq!(seen, expected, "{title}, chunks of {chunk}");
        }
    }
}

#[test]
fn the_writer_writes_the_vectors() {
    let cases = vectors();
    let bytes_of = |title: &str| &cases.iter().find(|case| case.title == title).unwrap().bytes;
    let mut out = [0; 256];
    let payload = [0, 2, 0xff, 3, 0, 2, 0xff, 3];
    let length = write_frame(FrameKind::Values, 1, &payload, &mut out).unwrap();
    assert_eq!(out[..length], bytes_of("positions")[1..]);
    assert!(write_frame(FrameKind::Values, 1, &payload, &mut out[..length - 1]).is_none());
    let longest = vec![7; FRAME_BYTES_MAX - 5];
    assert!(write_frame(FrameKind::Hello, 0, &longest, &mut out).is_some_and(|length| length <= 256));
    assert!(write_frame(FrameKind::Hello, 0, &[7; FRAME_BYTES_MAX - 4], &mut out).is_none());
}

/// Compiles the header with the mock port of `arduino_host.cpp` and runs it: title -> bytes sent.
fn arduino() -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("arduino_host");
    let source = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/arduino_host.cpp");
    let compiled = Command::new("g++")
        .args(["-std=c++11", "-Wall", "-Wextra", "-Werror", "-I"])
        .arg(docs().join("arduino"))
        .arg(source)
        .arg("-o")
        .arg(&program)
        .output()
        .expect("g++ is installed");
    assert!(
        compiled.status.success(),
        "{}",
        String::from_utf8_lossy(&compiled.stderr)
    );
    let output = Command::new(program).output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let lines = text.lines().filter_map(|line| line.split_once(' '));
    lines.map(|(title, hex)| (title.to_owned(), from_hex(hex))).collect()
}

#[test]
#[ignore = "needs g++"]
fn the_arduino_header_sends_the_vectors() {
    let sent = arduino();
    let cases = vectors();
    let bytes_of = |title: &str| cases.iter().find(|case| case.title == title).unwrap().bytes.clone();
    assert_eq!(sent["begin"], bytes_of("a box introduces itself"));
    assert_eq!(sent["values"], bytes_of("positions")[1..]);
    let steps = bytes_of("a HELLO on request, and positions again");
    assert_eq!([&[0][..], &sent["steps"], &sent["asked"]].concat(), steps);

    let mut packets = Packets::new();
    let mut text = String::new();
    packets.feed(&sent["many"], &mut |event| {
        writeln!(text, "{}", event_line(event)).unwrap()
    });
    let expected: String = (0..255).map(|k| format!("event {k} {}/65535\n", k * 257)).collect();
    assert_eq!(text, expected);
    assert_eq!(
        (
            packets.counters().bad,
            packets.counters().dropped,
            packets.counters().partial
        ),
        (0, 0, 0)
    );
    assert_eq!(packets.firmware(), Some("a firmware whose name is longer "));
    assert_eq!(packets.name_of(63), Some("a name just as long as t"));
    assert_eq!(
        (packets.knob_count(), packets.range_of(63)),
        (Some(255), Some((0, 65535)))
    );

    let mut packets = Packets::new();
    let mut event_count = 0;
    packets.feed(&sent["wrap"], &mut |_| event_count += 1);
    let counters = packets.counters();
    assert_eq!((event_count, counters.bad, counters.dropped), (600, 0, 0));
    assert_eq!(
        counters.good,
        600 + 3,
        "one introduction at the start and one after each 256 updates"
    );

    let mut packets = Packets::new();
    let mut text = String::new();
    packets.feed(&sent["sketch"], &mut |event| {
        writeln!(text, "{}", event_line(event)).unwrap()
    });
    let expected: String = (0..8).map(|k| format!("event {k} {}/1023\n", k * 100)).collect();
    assert_eq!(text, expected);
    assert_eq!(
        (packets.firmware(), packets.name_of(1)),
        (Some("EightKnobs 1.1"), Some("brow left"))
    );
    assert_eq!(packets.counters().bad, 0);
}
