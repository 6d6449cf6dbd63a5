//! Files of other programs that are almost right: a small file of every format that is written, or kept here, with words written over and
//! the end cut off, listed and read. Whatever comes of it is an error or shapes whose numbers are finite; nothing panics.
//!
//! Bytes of an input: one for the format, one for the number of edits, eight for each edit; of a format without a small file, the bytes
//! themselves are the file.
#![no_main]

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use sinew_interchange::{Choice, OutputSurface, create_writer, read_contents, read_sequence};

/// Written by this project's own writers.
const WRITTEN: [&str; 8] = ["abc", "glb", "usda", "obj", "ply", "pc2", "mdd", "npy"];
/// Nobody writes these here.
const RAW: [&str; 6] = ["usdz", "npz", "mc", "xml", "md2", "gltf"];

const OFF: &[u8] =
    b"OFF\n5 6 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n.5 .5 1\n3 0 1 2\n3 0 2 3\n3 0 1 4\n3 1 2 4\n3 2 3 4\n3 3 0 4\n";
const POSITIONS: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.5, 0.5, 1.0],
];
const FACES: [[u32; 3]; 6] = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("sinew-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for files");
    folder
});

/// Endings and good files.
static FILES: LazyLock<Vec<(&str, Vec<u8>)>> = LazyLock::new(|| {
    let written = WRITTEN.iter().map(|ending| {
        let path = FOLDER.join(format!("good.{ending}"));
        let surface = OutputSurface {
            frame_count: Some(if ["obj", "ply"].contains(ending) { 1 } else { 2 }),
            ..OutputSurface::bare("tent", POSITIONS.len(), &FACES)
        };
        let mut writer = create_writer(&path, &surface).expect("a writer");
        for height in 0..surface.frame_count.unwrap_or(1) {
            writer
                .frame(&POSITIONS.map(|[x, y, z]| [x, y, z * (1 + height) as f32]))
                .expect("a frame");
        }
        writer.finish().expect("a file");
        (*ending, fs::read(&path).expect("the file"))
    });
    let mut files: Vec<(&str, Vec<u8>)> = written.collect();
    // What points and positions stand on.
    fs::rename(FOLDER.join("good.obj"), FOLDER.join("mesh.obj")).expect("a mesh beside the caches");
    files.push(("off", OFF.to_vec()));
    let crate_file = include_bytes!("../../../formats/interchange/tests/fixtures/tent.usdc");
    files.push(("usdc", crate_file.to_vec()));
    files
});

/// A good file with words written over, and cut off at the end.
fn edited(good: &[u8], edits: &[[u8; 8]]) -> Vec<u8> {
    let mut file = good.to_vec();
    for edit in edits {
        let [a, b, c, kind, value @ ..] = *edit;
        let at = u32::from_le_bytes([a, b, c, 0]) as usize % file.len().max(1);
        if kind >= 0xf0 {
            file.truncate(at);
        } else {
            let length = (1 + usize::from(kind % 4)).min(file.len() - at);
            file[at..at + length].copy_from_slice(&value[..length]);
        }
    }
    file
}

fuzz_target!(|data: &[u8]| {
    let Some((&[format, edit_count], data)) = data.split_first_chunk() else {
        return;
    };
    let files = &*FILES;
    let which = usize::from(format) % (files.len() + RAW.len());
    let (ending, file) = match files.get(which) {
        Some((ending, good)) => {
            let edits = data.as_chunks().0;
            (
                *ending,
                edited(good, &edits[..edits.len().min(usize::from(edit_count % 16))]),
            )
        }
        None => (RAW[which - files.len()], data.to_vec()),
    };
    let path = FOLDER.join(format!("tried.{ending}"));
    fs::write(&path, file).expect("a file to read");
    let choice = Choice {
        surface: ["pc2", "mdd", "mc", "xml", "npy"]
            .contains(&ending)
            .then(|| FOLDER.join("mesh.obj")),
        ..Choice::default()
    };
    let _ = read_contents(&path, &choice);
    if let Ok(read) = read_sequence(&path, &choice, &mut |_, _| {}) {
        let shapes = read.sequence.shapes;
        assert!(shapes.iter().all(|shape| shape.iter().flatten().all(|x| x.is_finite())));
    }
});
