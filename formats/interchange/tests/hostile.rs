//! Damaged and lying files: thousands of mutations of small files of every kind never panic, and never make a reader take
//! more memory than the bytes it was given can justify.

use std::fs;
use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_interchange::{Choice, NpyArray, PolygonMesh, read_sequence};

/// Bytes that a reader may hold above a fixed sum for each byte of the file: a face of two-byte corners becomes 4 bytes a
/// corner and 8 a face, and vectors double as they grow.
const BYTES_PER_BYTE: usize = 24;
/// For messages and small tables.
const FIXED_BYTES: usize = 16 * 1024;
/// Mutations of each file.
const ROUNDS: usize = 4000;

/// A number below `limit`, 0 where there is none.
fn below(dice: &mut ChaCha8Rng, limit: usize) -> usize {
    dice.random_range(0..limit.max(1))
}

/// Pieces that lie: counts, indices and numbers no small file can mean.
const LIES: [&[u8]; 14] = [
    b"4000000000",
    b"4294967295",
    b"18446744073709551615",
    b"-9223372036854775808",
    b"99999999999999999999999",
    b"-1",
    b"0",
    b"nan",
    b"1e999",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\\\n",
    b"((((((((",
    b"\n",
];

fn mutate(file: &[u8], dice: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..1 + below(dice, 3) {
        let at = below(dice, bytes.len());
        match below(dice, 6) {
            0 => bytes.truncate(at),
            1 if !bytes.is_empty() => bytes[at] ^= 1 << below(dice, 8),
            2 if !bytes.is_empty() => bytes[at] = below(dice, 256) as u8,
            3 => {
                // In the place of a whole word, where numbers stand.
                let word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'.' || *b == b'-';
                let start = at - bytes[..at].iter().rev().take_while(|b| word(b)).count();
                let end = at + bytes[at..].iter().take_while(|b| word(b)).count();
                bytes.splice(start..end, LIES[below(dice, LIES.len())].iter().copied());
            }
            4 => {
                let end = at + below(dice, bytes.len() - at);
                bytes.drain(at..end);
            }
            _ => {
                let piece = bytes[at..at + below(dice, bytes.len() - at).min(64)].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    bytes
}

/// Runs `work` and says how many bytes it held at most.
fn peak_bytes(work: impl FnOnce()) -> usize {
    allocation_counter::measure(work).bytes_max as usize
}

fn ply(format: &str, big: bool) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element extra 1\nproperty list uchar short a\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    if format == "ascii" {
        file.extend(b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 5 6\n4 0 1 2 3\n3 0 1 2\n");
        return file;
    }
    let mut push = |bytes: &[u8]| {
        if big {
            file.extend(bytes.iter().rev())
        } else {
            file.extend(bytes)
        }
    };
    [0f32, 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]
        .iter()
        .for_each(|x| push(&x.to_le_bytes()));
    push(&[1]);
    push(&7i16.to_le_bytes());
    for corners in [&[0i32, 1, 2, 3][..], &[0, 1, 2]] {
        push(&[corners.len() as u8]);
        corners.iter().for_each(|corner| push(&corner.to_le_bytes()));
    }
    file
}

fn npy(descr: &str, order: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    [
        b"\x93NUMPY\x01\x00",
        &(text.len() as u16).to_le_bytes()[..],
        text.as_bytes(),
        values,
    ]
    .concat()
}

#[test]
fn mutated_files_neither_panic_nor_take_memory_they_cannot_justify() {
    let path = Path::new("hostile");
    let obj =
        b"# c\nv 0 0 0\nv 1 0 0 1 1 1\nv 1 1 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1 \\\n 4/1\nf -4//1 -3//1 -1//1\nl 1 2\n";
    let off = b"COFF\n# c\n4 2 0\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n3 0 1 2 255 0 0\n";
    let meshes = [
        ("a.obj", obj.to_vec()),
        ("a.off", off.to_vec()),
        ("a.ply", ply("ascii", false)),
        ("a.ply", ply("binary_little_endian", false)),
        ("a.ply", ply("binary_big_endian", true)),
    ];
    let mut dice = ChaCha8Rng::seed_from_u64(0x5EED);
    for (name, file) in &meshes {
        let path = Path::new(name);
        let whole = PolygonMesh::parse(file, path).expect("the file is good before it is damaged");
        assert_eq!(whole.face_count(), 2);
        let mut refused = 0;
        for _ in 0..ROUNDS {
            let bytes = mutate(file, &mut dice);
            let peak = peak_bytes(|| refused += usize::from(PolygonMesh::parse(&bytes, path).is_err()));
            let shown = String::from_utf8_lossy(&bytes);
            assert!(
                peak <= FIXED_BYTES + BYTES_PER_BYTE * bytes.len(),
                "{name}: {peak} bytes for {shown}"
            );
        }
        assert!(
            refused > ROUNDS / 4,
            "{name}: the mutations hardly damage ({refused} refused)"
        );
    }

    let floats: Vec<u8> = [0f32, 0., 0., 1., 0., 0., 0., 1., 0.]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let positions = npy("<f4", "False", "(2, 3, 3)", &[floats.clone(), floats].concat());
    let faces = npy("<i4", "True", "(1, 3)", &[0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [positions_path, faces_path] = ["positions.npy", "faces.npy"].map(|name| folder.path().join(name));
    for (file, damaged_path) in [(&positions, &positions_path), (&faces, &faces_path)] {
        fs::write(&positions_path, &positions).expect("written");
        fs::write(&faces_path, &faces).expect("written");
        read_sequence(folder.path(), &Choice::default(), &mut |_, _| {})
            .expect("the files are good before one is damaged");
        for round in 0..ROUNDS {
            let bytes = mutate(file, &mut dice);
            let peak = peak_bytes(|| drop(NpyArray::parse(bytes.clone(), path)));
            assert!(
                peak <= FIXED_BYTES + bytes.len(),
                "{peak} bytes for {}",
                String::from_utf8_lossy(&bytes)
            );
            // The file system is slow: through files only some of them.
            if round % 8 == 0 {
                fs::write(damaged_path, &bytes).expect("written");
                let peak = peak_bytes(|| drop(read_sequence(folder.path(), &Choice::default(), &mut |_, _| {})));
                let bound = 2 * FIXED_BYTES + BYTES_PER_BYTE * (bytes.len() + positions.len() + faces.len());
                assert!(peak <= bound, "{peak} bytes for {}", String::from_utf8_lossy(&bytes));
            }
        }
    }
}
