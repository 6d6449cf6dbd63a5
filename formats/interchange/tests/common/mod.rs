//! What tests share: where real files lie, and truth beside them.

#![allow(dead_code, reason = "each test file uses a part")]

use sinew_interchange::{
    Choice, Dress, MeshSequence, RenderSurface, SequenceError, SequenceRead, Space, read_sequence,
};
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The folder of real files of other programs.
pub fn formats() -> PathBuf {
    let data = std::env::var_os("SINEW_DATA").expect("SINEW_DATA names the folder with real files");
    PathBuf::from(data).join("formats")
}

pub fn read(path: &Path, choice: &Choice) -> Result<SequenceRead, SequenceError> {
    read_sequence(path, choice, &mut |_, _| {})
}

/// Takes the named meshes in their own coordinates, every vertex of the file.
pub fn local(meshes: &[&str]) -> Choice {
    Choice {
        meshes: meshes.iter().map(ToString::to_string).collect(),
        space: Space::Local,
        keep_split: true,
        ..Choice::default()
    }
}

/// Numbers of an npy file or of one inside an npz archive.
pub struct Array {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

impl Array {
    pub fn of_npy(bytes: &[u8]) -> Array {
        let header_end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = String::from_utf8_lossy(&bytes[10..header_end]).into_owned();
        let shape = header.split_once("'shape': (").unwrap().1.split_once(')').unwrap().0;
        let shape = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        let body = &bytes[header_end..];
        let values = if header.contains("<f4") {
            body.as_chunks()
                .0
                .iter()
                .map(|&raw| f64::from(f32::from_le_bytes(raw)))
                .collect()
        } else if header.contains("<f8") {
            body.as_chunks().0.iter().map(|&raw| f64::from_le_bytes(raw)).collect()
        } else if header.contains("<i4") {
            body.as_chunks()
                .0
                .iter()
                .map(|&raw| f64::from(i32::from_le_bytes(raw)))
                .collect()
        } else {
            assert!(header.contains("<i8"), "{header}");
            body.as_chunks()
                .0
                .iter()
                .map(|&raw| i64::from_le_bytes(raw) as f64)
                .collect()
        };
        Array { shape, values }
    }

    pub fn of_npz(path: &Path, name: &str) -> Array {
        let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
        let mut bytes = Vec::new();
        archive
            .by_name(&format!("{name}.npy"))
            .unwrap()
            .read_to_end(&mut bytes)
            .unwrap();
        Array::of_npy(&bytes)
    }

    /// Positions of frame `m` of an array [N][V][3].
    pub fn frame(&self, m: usize) -> &[[f64; 3]] {
        let width = self.shape[1] * 3;
        self.values[m * width..(m + 1) * width].as_chunks().0
    }
}

/// Of the bounding box of a shape.
pub fn diagonal(shape: &[[f64; 3]]) -> f64 {
    let side = |c: usize| {
        let values = shape.iter().map(|p| p[c]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    (0..3).map(|c| side(c).powi(2)).sum::<f64>().sqrt()
}

/// The largest distance of a vertex from its place in the truth, over the truth's diagonal in its first frame; frame `m` of the
/// sequence is held against frame `of_frame(m)` of the truth.
pub fn error(sequence: &MeshSequence, truth: &Array, of_frame: impl Fn(usize) -> usize) -> f64 {
    assert_eq!(sequence.vertex_count(), truth.shape[1], "vertices");
    let mut largest = 0.0f64;
    for (m, shape) in sequence.shapes.iter().enumerate() {
        for (p, q) in shape.iter().zip(truth.frame(of_frame(m))) {
            let distance = (0..3).map(|c| (f64::from(p[c]) - q[c]).powi(2)).sum::<f64>().sqrt();
            largest = largest.max(distance);
        }
    }
    largest / diagonal(truth.frame(0))
}

/// Calls `each` with every prefix of a file in its place, and its length. The file is shortened bit by bit, for writing it anew each
/// time would take long; then it is whole again.
pub fn prefixes(path: &Path, mut each: impl FnMut(usize)) {
    let bytes = fs::read(path).unwrap();
    let file = fs::OpenOptions::new().write(true).open(path).unwrap();
    for length in (0..bytes.len()).rev() {
        file.set_len(length as u64).unwrap();
        each(length);
    }
    fs::write(path, bytes).unwrap();
}

/// Calls `each` with one bit of every `step`-th byte of a file flipped, one byte after the other; then the file is as before.
pub fn flips(path: &Path, step: usize, mut each: impl FnMut()) {
    let bytes = fs::read(path).unwrap();
    let mut file = fs::OpenOptions::new().write(true).open(path).unwrap();
    let mut put = |at: usize, byte: u8| {
        file.seek(SeekFrom::Start(at as u64)).unwrap();
        file.write_all(&[byte]).unwrap();
    };
    for at in (0..bytes.len()).step_by(step) {
        put(at, bytes[at] ^ 1 << (at * 5 % 8));
        each();
        put(at, bytes[at]);
    }
}

/// Reads every prefix of a file, each of which must be refused, and the file with one bit of every byte flipped. How many of the
/// latter were read.
pub fn torment(path: &Path) -> usize {
    prefixes(path, |length| {
        let cut = read(path, &Choice::default());
        assert!(cut.is_err(), "{}: {length} bytes", path.display());
    });
    let mut accepted = 0;
    flips(path, 1, || {
        accepted += usize::from(read(path, &Choice::default()).is_ok())
    });
    accepted
}

pub const FRAME_COUNT: usize = 6;

/// A tent of four triangles with a seam, two materials and colours; numbers whose text is long or tiny among them.
pub fn tent() -> MeshSequence {
    let shape = |m: usize| {
        let z = 0.1 + m as f32 / 3.0;
        vec![
            [0.0, 1e-40, 0.0],
            [1.0, 0.0, -0.0],
            [1.0, 1.0, 1.1e-7],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, z],
        ]
    };
    MeshSequence {
        name: "tent".into(),
        faces: vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
        shapes: (0..FRAME_COUNT).map(shape).collect(),
        shape_names: (0..FRAME_COUNT).map(|m| m.to_string()).collect(),
        render: Some(RenderSurface {
            vertices: vec![0, 1, 4, 2, 3, 0],
            uvs: vec![[0.0, 0.0], [0.25, 0.0], [0.5, 1.0], [0.5, 0.0], [0.75, 0.0], [1.0, 0.0]],
            faces: vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 5, 2]],
        }),
        dress: Dress {
            materials: vec!["cloth".into(), "rope".into()],
            face_materials: vec![0, 1, 0, 1],
            colors: (0..5).map(|v| [v as f32 / 4.0, 0.5, 0.25, 1.0]).collect(),
            skin: None,
        },
        fps: Some(24.0),
        ..MeshSequence::default()
    }
}

pub fn bits(sequence: &MeshSequence) -> Vec<u32> {
    sequence
        .shapes
        .iter()
        .flatten()
        .flatten()
        .map(|x| x.to_bits())
        .collect()
}
