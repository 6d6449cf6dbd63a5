//! Streams into files and sockets, read back as docs/streams.md says.

use core::net::Ipv4Addr;
use core::time::Duration;
use std::net::UdpSocket;

use sinew_interchange::{Choice, read_sequence};

use super::*;

const FACES: [[u32; 3]; 2] = [[0, 1, 2], [1, 3, 2]];

fn shape(n: u64) -> [[f32; 3]; 4] {
    core::array::from_fn(|v| [(v % 2) as f32, (v as u64 / 2 + n) as f32, 0.5])
}

fn play(spec: StreamSpec, frames: u64) -> StreamSummary {
    let mut stream = Stream::start(spec, 4, 2, &FACES).unwrap();
    for n in 1..=frames {
        stream.offer(n, 1000 * n, &shape(n), &[n as f32, -1.0], true);
    }
    stream.finish()
}

#[test]
fn specs_are_read_as_they_are_written() {
    let parse = |text: &str| text.parse::<StreamSpec>();
    assert_eq!(parse("obj"), Ok(StreamSpec::Obj("sinew-stage.obj".into())));
    assert_eq!(parse("obj:a/b.obj"), Ok(StreamSpec::Obj("a/b.obj".into())));
    assert_eq!(parse("obj:out/"), Ok(StreamSpec::ObjFolder("out/".into())));
    assert_eq!(parse("raw"), Ok(StreamSpec::Raw(None)));
    assert_eq!(parse("raw:-"), Ok(StreamSpec::Raw(None)));
    assert_eq!(parse("raw:x.bin"), Ok(StreamSpec::Raw(Some("x.bin".into()))));
    assert_eq!(parse("udp:9001"), Ok(StreamSpec::Udp(9001)));
    assert_eq!(parse("udp-weights:9001"), Ok(StreamSpec::UdpWeights(9001)));
    for wrong in ["udp", "udp:0", "udp:70000", "udp:x", "fbx", ""] {
        assert!(parse(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn obj_files_are_numbered_or_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("frames");
    let summary = play(StreamSpec::ObjFolder(out.clone()), 3);
    assert_eq!(
        (summary.sent, summary.dropped, summary.lost, summary.ended),
        (3, 0, 0, false)
    );
    let read = read_sequence(&out, &Choice::default(), &mut |_, _| {})
        .unwrap()
        .sequence;
    assert_eq!(read.shapes.len(), 3);
    assert_eq!(read.shapes[2], shape(3));
    assert_eq!(read.faces, FACES);
    let one = folder.path().join("live.obj");
    play(StreamSpec::Obj(one.clone()), 3);
    assert!(std::fs::read_to_string(&one).unwrap().starts_with("v 0 3 0.5\n"));
}

#[test]
fn raw_files_hold_faces_and_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shapes.bin");
    play(StreamSpec::Raw(Some(path.clone())), 2);
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(&bytes[..4], b"SNSR");
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    assert_eq!([number(4), number(8), number(12)], [1, 4, 2]);
    assert_eq!(number(16 + 4 * 4), 3, "fifth index");
    let frames = &bytes[16 + 24..];
    assert_eq!(frames.len(), 2 * (8 + 48));
    assert_eq!(frames[56..64], 2000_u64.to_le_bytes());
    assert_eq!(frames[64 + 4..64 + 8], 2.0_f32.to_le_bytes());
}

#[test]
fn datagrams_put_together_are_the_frame() {
    let listener = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    listener.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let port = listener.local_addr().unwrap().port();
    let positions: Vec<[f32; 3]> = (0..300).map(|v| [v as f32, 1.0, 2.0]).collect();
    let mut stream = Stream::start(StreamSpec::Udp(port), positions.len(), 2, &FACES).unwrap();
    stream.offer(7, 123_456, &positions, &[0.0; 2], true);
    let mut floats = vec![f32::NAN; 900];
    let mut buffer = [0; 2000];
    while floats.iter().any(|value| value.is_nan()) {
        let count = listener.recv(&mut buffer).unwrap();
        let bytes = &buffer[..count];
        assert!(count <= 1420 && bytes[..8] == *b"SNST\x01\x01\0\0");
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!((number(8), number(24)), (7, 900));
        assert_eq!(bytes[16..24], 123_456_u64.to_le_bytes());
        for (n, value) in bytes[28..].chunks(4).enumerate() {
            floats[number(12) as usize + n] = f32::from_le_bytes(value.try_into().unwrap());
        }
    }
    assert_eq!(floats, positions.as_flattened());
    assert_eq!(stream.finish().lost, 0);
}

#[test]
fn weights_go_alone_and_nobody_need_listen() {
    let port = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let summary = play(StreamSpec::UdpWeights(port), 50);
    assert_eq!((summary.sent, summary.lost), (50, 0), "the port is closed");
}

#[test]
fn a_slow_target_costs_the_stream_frames_and_a_broken_one_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("frames");
    let mut stream = Stream::start(StreamSpec::ObjFolder(out.clone()), 4, 2, &FACES).unwrap();
    std::fs::remove_dir(&out).unwrap();
    for n in 1..=1000 {
        stream.offer(n, n, &shape(n), &[0.0; 2], false);
    }
    let summary = stream.finish();
    assert!(
        summary.dropped > 0 && summary.sent + summary.dropped == 1000,
        "{summary:?}"
    );
    assert!(summary.to_string().contains("could not be written"), "{summary}");
    assert!(Stream::start(StreamSpec::Obj(folder.path().join("no/live.obj")), 4, 2, &FACES).is_err());
}

#[test]
fn a_frame_that_cannot_be_written_is_counted_and_the_next_one_tried() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("frames");
    let mut stream = Stream::start(StreamSpec::ObjFolder(out.clone()), 4, 2, &FACES).unwrap();
    let offer = |stream: &mut Stream, n: u64| {
        stream.offer(n, n, &shape(n), &[0.0; 2], true);
        let until = std::time::Instant::now() + Duration::from_secs(10);
        while stream.empty.len() < BUFFERS && std::time::Instant::now() < until {
            thread::sleep(Duration::from_millis(1));
        }
    };
    offer(&mut stream, 1);
    // The folder goes away, as a stick or a share does, and comes back.
    std::fs::remove_dir_all(&out).unwrap();
    offer(&mut stream, 2);
    assert!(stream.trouble().unwrap().contains("fails"));
    std::fs::create_dir(&out).unwrap();
    offer(&mut stream, 3);
    assert_eq!(stream.trouble(), None);
    let summary = stream.finish();
    assert_eq!((summary.lost, summary.ended), (1, false));
    assert!(
        summary.to_string().contains("1 frame could not be written"),
        "{summary}"
    );
    assert!(out.join("frame_000003.obj").exists());
}
