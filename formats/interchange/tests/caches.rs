//! Point caches on their meshes: PC2, MDD and Maya's, good ones and broken ones.

mod common;

use common::{flips, prefixes};
use sinew_interchange::{Choice, MeshSequence, SequenceError, read_contents, read_sequence};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const MESH: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nf 1/1 2/2 3/1 4/2\n";
const FRAME_COUNT: usize = 5;

/// Frame `m` of the square.
fn square(m: usize) -> Vec<[f32; 3]> {
    let z = m as f32 * 0.25;
    vec![[0.0, 0.0, z], [1.0, 0.0, 0.0], [1.0, 1.0, z], [0.0, 1.0, 0.5]]
}

fn numbers(m: usize) -> impl Iterator<Item = f32> {
    square(m).into_iter().flatten()
}

fn pc2() -> Vec<u8> {
    let mut bytes = b"POINTCACHE2\0".to_vec();
    bytes.extend([1i32, 4].iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend([40.0f32, 1.0].iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend((FRAME_COUNT as i32).to_le_bytes());
    bytes.extend((0..FRAME_COUNT).flat_map(|m| numbers(m).flat_map(f32::to_le_bytes)));
    bytes
}

fn mdd() -> Vec<u8> {
    let mut bytes: Vec<u8> = [FRAME_COUNT as i32, 4].iter().flat_map(|n| n.to_be_bytes()).collect();
    bytes.extend((0..FRAME_COUNT).flat_map(|m| (m as f32 / 24.0).to_be_bytes()));
    bytes.extend((0..FRAME_COUNT).flat_map(|m| numbers(m).flat_map(f32::to_be_bytes)));
    bytes
}

/// A block of a Maya cache.
fn block(wide: bool, tag: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = tag.to_vec();
    if wide {
        bytes.extend([0; 4]);
        bytes.extend((content.len() as u64).to_be_bytes());
    } else {
        bytes.extend((content.len() as u32).to_be_bytes());
    }
    bytes.extend(content);
    // Content is padded by its own length, groups are not.
    if !tag.starts_with(b"FOR") {
        let padding = if wide { 8 } else { 4 };
        let missing = content.len().next_multiple_of(padding) - content.len();
        bytes.extend(core::iter::repeat_n(0, missing));
    }
    bytes
}

fn maya_header(wide: bool, ticks: i32) -> Vec<u8> {
    let mut content = b"CACH".to_vec();
    content.extend(block(wide, b"VRSN", b"0.1\0"));
    content.extend(block(wide, b"STIM", &ticks.to_be_bytes()));
    block(wide, if wide { b"FOR8" } else { b"FOR4" }, &content)
}

/// One frame of two channels, the second with normals.
fn maya_frame(wide: bool, m: usize, time: Option<i32>) -> Vec<u8> {
    let mut content = b"MYCH".to_vec();
    if let Some(time) = time {
        content.extend(block(wide, b"TIME", &time.to_be_bytes()));
    }
    for (name, is_double) in [(&b"squareShape\0"[..], m == 1), (b"squareShape_normals\0", false)] {
        content.extend(block(wide, b"CHNM", name));
        content.extend(block(wide, b"SIZE", &4i32.to_be_bytes()));
        content.extend(if is_double {
            block(
                wide,
                b"DVCA",
                &numbers(m).flat_map(|x| f64::from(x).to_be_bytes()).collect::<Vec<_>>(),
            )
        } else {
            block(
                wide,
                b"FVCA",
                &numbers(m).flat_map(f32::to_be_bytes).collect::<Vec<_>>(),
            )
        });
    }
    block(wide, if wide { b"FOR8" } else { b"FOR4" }, &content)
}

fn maya(wide: bool) -> Vec<u8> {
    let mut bytes = maya_header(wide, 0);
    (0..FRAME_COUNT).for_each(|m| bytes.extend(maya_frame(wide, m, Some(250 * m as i32))));
    bytes
}

fn description(kind: &str, format: &str) -> Vec<u8> {
    format!(
        "<?xml version=\"1.0\"?>\n<Autodesk_Cache_File>\n<cacheType Type=\"{kind}\" Format=\"{format}\"/>\n<Channels>\n\
         <channel0 ChannelName=\"squareShape\" ChannelInterpretation=\"positions\"/>\n\
         <channel1 ChannelName=\"squareShape_normals\" ChannelInterpretation=\"normals\"/>\n\
         </Channels>\n</Autodesk_Cache_File>\n"
    )
    .into_bytes()
}

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

fn read(path: &Path) -> Result<MeshSequence, SequenceError> {
    read_sequence(path, &Choice::default(), &mut |_, _| {}).map(|read| read.sequence)
}

fn assert_is_the_square(sequence: &MeshSequence, name: &str) {
    assert_eq!(sequence.shape_count(), FRAME_COUNT, "{name}");
    for m in 0..FRAME_COUNT {
        assert_eq!(sequence.shapes[m], square(m)[..], "{name}, frame {m}");
    }
    assert_eq!(
        (
            sequence.faces.len(),
            sequence.render.as_ref().map(|render| render.vertices.len())
        ),
        (2, Some(4))
    );
}

#[test]
fn every_cache_gives_the_same_frames_on_the_mesh_beside_it() {
    for (name, bytes) in [
        ("a.pc2", pc2()),
        ("a.mdd", mdd()),
        ("a.mc", maya(false)),
        ("a.MCX", maya(true)),
    ] {
        let folder = folder(&[(name, &bytes), ("a.obj", MESH.as_bytes()), ("other.obj", b"v 0 0 0\n")]);
        let sequence = read(&folder.path().join(name)).unwrap();
        assert_is_the_square(&sequence, name);
        assert_eq!(sequence.shape_names[3], format!("{name}[3]"));
        assert_eq!(sequence.fps, (name != "a.pc2").then_some(24.0), "{name}");
    }
}

#[test]
fn a_maya_cache_with_a_file_a_frame_is_found_by_its_description_and_by_any_of_its_files() {
    let frames: Vec<(String, Vec<u8>)> = (0..FRAME_COUNT)
        .map(|m| {
            let bytes = [maya_header(false, 250 * m as i32), maya_frame(false, m, None)].concat();
            (format!("squareFrame{}.mc", m + 8), bytes)
        })
        .collect();
    let mut files: Vec<(&str, &[u8])> = frames.iter().map(|(name, bytes)| (name.as_str(), &bytes[..])).collect();
    let description = description("OneFilePerFrame", "mcc");
    files.extend([("square.xml", &description[..]), ("mesh.obj", MESH.as_bytes())]);
    let folder = folder(&files);
    for name in ["square.xml", "squareFrame10.mc"] {
        assert_is_the_square(&read(&folder.path().join(name)).unwrap(), name);
    }
    fs::write(folder.path().join("one.xml"), self::description("OneFile", "mcx")).unwrap();
    fs::write(folder.path().join("one.mcx"), maya(true)).unwrap();
    assert_is_the_square(&read(&folder.path().join("one.xml")).unwrap(), "one.xml");
    fs::remove_file(folder.path().join("one.mcx")).unwrap();
    let error = read(&folder.path().join("one.xml")).unwrap_err().to_string();
    assert!(error.contains("one.mcx"), "{error}");
}

#[test]
fn frames_between_samples_are_blended_where_there_are_times() {
    let folder = folder(&[("a.mdd", &mdd()), ("a.pc2", &pc2()), ("a.obj", MESH.as_bytes())]);
    let choice = Choice {
        fps: Some(48.0),
        ..Choice::default()
    };
    let read = |name: &str| read_sequence(&folder.path().join(name), &choice, &mut |_, _| {});
    let shapes = read("a.mdd").unwrap().sequence.shapes;
    assert_eq!(shapes.len(), 2 * FRAME_COUNT - 1);
    assert!((shapes[3][0][2] - 0.375).abs() < 1e-6, "{:?}", shapes[3][0]);
    assert!(read("a.pc2").unwrap_err().to_string().contains("no times"));
}

#[test]
fn a_cache_without_its_mesh_says_what_it_needs() {
    let folder = folder(&[("a.pc2", &pc2())]);
    let path = folder.path().join("a.pc2");
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("--surface"), "{error}");
    for name in ["b.obj", "c.obj"] {
        fs::write(folder.path().join(name), MESH.replace("v 0 1 0", "v 0 1 0\nv 5 5 5")).unwrap();
    }
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("b.obj") && error.contains("c.obj"), "{error}");
    let choice = Choice {
        surface: Some(folder.path().join("c.obj")),
        ..Choice::default()
    };
    let error = read_contents(&path, &choice).unwrap_err().to_string();
    assert!(error.contains("4 points") && error.contains("5 vertices"), "{error}");
}

#[test]
fn every_prefix_of_a_cache_and_flipped_bits_are_read_or_refused() {
    for (name, bytes) in [
        ("a.pc2", pc2()),
        ("a.mdd", mdd()),
        ("a.mc", maya(false)),
        ("a.mcx", maya(true)),
    ] {
        let folder = folder(&[(name, &bytes), ("a.obj", MESH.as_bytes())]);
        let path = folder.path().join(name);
        prefixes(&path, |length| {
            let cut = read(&path);
            // A Maya cache that ends behind a frame is a shorter one, and its last padding may be missing.
            let is_shorter = name.starts_with("a.mc") && cut.as_ref().is_ok_and(|cut| cut.shape_count() <= FRAME_COUNT);
            assert!(cut.is_err() || is_shorter, "{name}: {length} bytes");
        });
        flips(&path, 1, || drop(read(&path)));
    }
    let description = description("OneFile", "mcx");
    let folder = folder(&[("a.mcx", &maya(true)), ("a.obj", MESH.as_bytes())]);
    let path = folder.path().join("a.xml");
    fs::write(&path, &description).unwrap();
    prefixes(&path, |length| {
        assert!(
            read(&path).is_err() || length == description.len() - 1,
            "{length} bytes"
        );
    });
}
