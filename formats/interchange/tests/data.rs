//! Real sequences and real files of other programs (SINEW_DATA): read, or refused as their names say.

use sinew_interchange::{Choice, MeshSequence, Place, PolygonMesh, SequenceError, read_sequence, write_sequence_npy};
use std::fs;
use std::path::{Path, PathBuf};

const SEQUENCES: [&str; 10] = [
    "cactus",
    "cesium_man",
    "dembones_bone",
    "flag_sim",
    "his_cheburashka",
    "his_wolf",
    "horse",
    "humanoid_pab",
    "ict_face_front",
    "skirt_sim",
];

fn data() -> PathBuf {
    std::env::var_os("SINEW_DATA")
        .expect("SINEW_DATA names the folder with real files")
        .into()
}

fn read(path: &Path) -> Result<MeshSequence, SequenceError> {
    read_sequence(path, &Choice::default(), &mut |_, _| {}).map(|read| read.sequence)
}

fn read_mesh(path: &Path) -> Result<PolygonMesh, SequenceError> {
    let bytes = fs::read(path).expect("the data set is complete");
    PolygonMesh::parse(&bytes, path)
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn horse_text_equals_horse_array_bit_for_bit() {
    let data = data();
    let mut calls = Vec::new();
    let text = read_sequence(&data.join("horse/obj"), &Choice::default(), &mut |done, total| {
        calls.push((done, total))
    })
    .unwrap();
    assert_eq!(calls, (1..=49).map(|done| (done, 49)).collect::<Vec<_>>());
    let array = read(&data.join("horse")).unwrap();
    assert_eq!(text.sequence.faces, array.faces);
    assert!(text.sequence.shapes == array.shapes, "positions differ");
    assert_eq!(
        (array.shape_count(), array.vertex_count(), array.faces.len()),
        (49, 8431, 16843)
    );
    assert_eq!(
        (array.name.as_str(), array.shape_names[12].as_str()),
        ("horse", "positions.npy[12]")
    );
    assert_eq!(text.sequence.shape_names[1], "horse-gallop-01.obj");
}

/// A permutation of V vertices.
fn scattered(vertex_count: usize) -> impl Fn(usize) -> usize {
    let coprime = |a: usize| {
        let (mut a, mut b) = (a, vertex_count);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    let step = (vertex_count * 618 / 1000..vertex_count)
        .find(|&step| coprime(step))
        .expect("V - 1 and V are coprime");
    move |v| (v * step + 1) % vertex_count
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn every_sequence_passes_and_is_refused_once_one_shape_is_reordered() {
    let data = data();
    let folder = tempfile::tempdir().unwrap();
    for name in SEQUENCES {
        let mut sequence = read(&data.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        // The reference and two shapes suffice, and keep the test short.
        sequence.shapes = sequence.shapes.first(3);
        let right = sequence.shapes[2].to_vec();
        let n = right.len();
        let scattered = scattered(n);
        let half = |v: usize| {
            if v < n / 2 {
                v
            } else {
                n / 2 + (scattered(v) % (n - n / 2))
            }
        };
        let orders: [(&str, &dyn Fn(usize) -> usize); 4] = [
            ("scattered", &scattered),
            ("halves swapped", &|v| (v + n / 2) % n),
            ("second half scattered", &half),
            ("every tenth vertex exchanged", &|v| {
                if v % 10 == 0 {
                    (v / 10 * 7 % n.div_ceil(10)) * 10
                } else {
                    v
                }
            }),
        ];
        for (order_name, order) in orders {
            (0..n).for_each(|v| sequence.shapes[2][v] = right[order(v)]);
            write_sequence_npy(folder.path(), &sequence).unwrap();
            match read(folder.path()) {
                Err(SequenceError::VertexOrderDiffers {
                    shape: 2,
                    name: shape_name,
                    torn,
                    ..
                }) => {
                    assert_eq!(shape_name, "positions.npy[2]");
                    assert!(torn > 0);
                }
                other => panic!(
                    "{name}, {order_name}: {:?}",
                    other.map(|sequence| sequence.shape_count())
                ),
            }
        }
    }
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn obj_files_of_other_programs() {
    let data = data();
    let read = |name: &str| read_mesh(&data.join("formats/obj").join(name));
    let counts =
        |name: &str| read(name).map(|mesh| (mesh.positions.len(), mesh.face_count(), mesh.ignored_element_count));
    assert_eq!(counts("box_longline.obj").unwrap(), (8, 6, 0));
    assert_eq!(counts("box_without_lineending.obj").unwrap(), (8, 6, 0));
    assert_eq!(counts("multiple_spaces.obj").unwrap(), (4, 1, 0));
    assert_eq!(read("multiple_spaces.obj").unwrap().positions[1], [2.0, 3.0, 1.0]);
    assert_eq!(counts("testmixed.obj").unwrap(), (8, 6, 12));
    assert_eq!(counts("concave_polygon.obj").unwrap().1, 1);
    assert_eq!(read("concave_polygon.obj").unwrap().face(0).len(), 66);
    let cat = read("blender_lowpoly_cat.obj").unwrap();
    assert!(cat.face_count() > 300 && cat.ignored_element_count == 0);
    assert!(matches!(read("point_cloud.obj"), Err(SequenceError::NoFaces { .. })));
    // Its line 11 has `3.1+e2`, which is no number in any notation; guessing 3.1 would bend a shape silently.
    match read("number_formats.obj") {
        Err(SequenceError::Parse {
            place: Place::Line(11),
            found,
            ..
        }) => assert_eq!(found, "`3.1+e2`"),
        other => panic!("{other:?}"),
    }
    let text = fs::read_to_string(data.join("formats/obj/number_formats.obj")).unwrap();
    let mended = text.replace("+e", "e+").replace("-e", "e-");
    let mesh = PolygonMesh::parse(mended.as_bytes(), Path::new("mended.obj")).unwrap();
    assert_eq!(mesh.positions[2], [1.0, 2.0, 3.0]);
    assert_eq!(mesh.positions[7], [100.0, 20.0, 310.0]);
    assert_eq!(mesh.positions[10], [0.01, 0.2, 0.031]);
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn ply_and_off_files_of_other_programs() {
    let data = data();
    let read = |name: &str| read_mesh(&data.join("formats").join(name));
    let counts = |name: &str| read(name).map(|mesh| (mesh.positions.len(), mesh.face_count()));
    assert_eq!(counts("ply/Wuson.ply").unwrap(), (11184, 3732));
    assert_eq!(counts("ply/cube_binary.ply").unwrap(), (8, 12));
    assert_eq!(
        read("ply/cube_binary.ply").unwrap(),
        read("ply/cube_binary_header_with_RN_newline.ply").unwrap()
    );
    assert_eq!(read("ply/float-color.ply").unwrap().positions[2], [200.0, 200.0, 0.0]);
    assert_eq!(counts("off/Cube.off").unwrap(), (8, 6));
    assert_eq!(counts("off/Wuson.off").unwrap(), (3205, 3732));
    // A carriage return stands between a face's count and its vertex.
    match read("off/invalid.off") {
        Err(SequenceError::Parse {
            place: Place::Line(7), ..
        }) => {}
        other => panic!("{other:?}"),
    }
}

/// Blender's OBJ and ascii PLY hold fewer digits than its binary PLY.
const TEXT_DIGITS_TOLERANCE: f32 = 1e-5;

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn one_blender_frame_in_three_writings() {
    let data = data();
    let read = |name: &str| read_mesh(&data.join("formats/blender").join(name)).unwrap();
    let (binary, ascii, obj) = (read("flag_f50.ply"), read("flag_f50_ascii.ply"), read("flag_f50.obj"));
    assert_eq!((binary.positions.len(), binary.face_count()), (1200, 1131));
    assert_eq!(binary.corners, ascii.corners);
    for (a, b) in binary
        .positions
        .as_flattened()
        .iter()
        .zip(ascii.positions.as_flattened())
    {
        assert!((a - b).abs() < TEXT_DIGITS_TOLERANCE);
    }
    // OBJ keeps Blender's own vertices and faces, though it may turn the axes.
    assert_eq!((obj.positions.len(), obj.face_count()), (1200, 1131));
}
