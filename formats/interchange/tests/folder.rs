//! Folders as users have them: each refusal with its file and place, what is handled with a notice, and round trips.

use sinew_interchange::{
    Choice, Dress, MeshSequence, Notice, OutputSurface, Place, PolygonMesh, RenderSurface, SequenceError, SequenceRead,
    WriteError, read_sequence, write_npy_f32, write_npy_u32, write_npy_vertices, write_obj, write_ply,
    write_sequence_npy, write_sequence_obj,
};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

fn read(path: &Path) -> Result<SequenceRead, SequenceError> {
    read_sequence(path, &Choice::default(), &mut |_, _| {})
}

fn refused(files: &[(&str, &str)]) -> SequenceError {
    let folder = folder(files);
    match read(folder.path()) {
        Err(error) => error,
        Ok(read) => panic!("accepted: {read:?}"),
    }
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const SECOND: &str = "v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n";

#[test]
fn no_sequence_at_all() {
    assert!(matches!(refused(&[]), SequenceError::EmptyFolder { .. }));
    assert!(matches!(
        refused(&[("a.txt", ""), (".b.obj", "")]),
        SequenceError::EmptyFolder { .. }
    ));
    assert!(matches!(
        refused(&[("a.obj", TRIANGLE)]),
        SequenceError::OneShapeOnly { .. }
    ));
    let outer = tempfile::tempdir().unwrap();
    fs::create_dir(outer.path().join("empty")).unwrap();
    write_sequence_obj(&outer.path().join("text"), &sequence()).unwrap();
    let error = read(outer.path()).unwrap_err();
    assert!(error.to_string().ends_with("text?"), "{error}");
    let folder = folder(&[("a.obj", TRIANGLE), ("a.txt", "")]);
    assert!(matches!(
        read(&folder.path().join("b")),
        Err(SequenceError::NoSuchPath { .. })
    ));
    assert!(matches!(
        read(&folder.path().join("a.obj/b")),
        Err(SequenceError::NoSuchPath { .. })
    ));
    assert!(matches!(
        read(&folder.path().join("a.obj")),
        Err(SequenceError::OneShapeOnly { .. })
    ));
    assert!(matches!(
        read(&folder.path().join("a.txt")),
        Err(SequenceError::UnknownKind { .. })
    ));
}

#[test]
fn two_kinds_are_named() {
    let error = refused(&[("a.obj", TRIANGLE), ("b.PLY", "ply"), ("c.mtl", "")]).to_string();
    for part in ["OBJ", "PLY", "`a.obj`", "`b.PLY`"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn shapes_that_do_not_fit_the_first() {
    let more_vertices = format!("v 9 9 9\n{SECOND}");
    match refused(&[("a2.obj", TRIANGLE), ("a10.obj", &more_vertices)]) {
        SequenceError::VertexCountDiffers {
            path,
            reference,
            expected: 3,
            found: 4,
        } => {
            assert!(path.ends_with("a10.obj") && reference == "a2.obj");
        }
        other => panic!("{other}"),
    }
    let more_faces = format!("{SECOND}f 3 2 1\n");
    let error = refused(&[("a.obj", TRIANGLE), ("b.obj", &more_faces)]);
    assert!(
        matches!(
            error,
            SequenceError::FaceCountDiffers {
                expected: 1,
                found: 2,
                ..
            }
        ),
        "{error}"
    );
    let two = |last: &str| format!("{TRIANGLE}f {last}\n");
    match refused(&[("a.obj", &two("1 3 2")), ("b.obj", &two("3 2 1"))]) {
        SequenceError::FacesDiffer {
            face: 1,
            expected,
            found,
            ..
        } => {
            assert_eq!((expected, found), (vec![0, 2, 1], vec![2, 1, 0]));
        }
        other => panic!("{other}"),
    }
}

#[test]
fn broken_shapes_name_file_and_line() {
    for (broken, message) in [
        ("v 0 0 0\nv 1 x 0\n", "b.obj: line 2: expected a number, found `x`"),
        ("v 0 0 0\nv 1 inf 0\n", "b.obj: line 2: coordinate `inf`"),
        ("v 0 0 0\nf 1 2 3\n", "b.obj: line 2: vertex index 3 is out of range"),
        ("v 0 0 0\n", "b.obj: has no faces"),
    ] {
        let error = refused(&[("a.obj", TRIANGLE), ("b.obj", broken)]).to_string();
        assert!(error.contains(message), "{error}");
    }
    let point = "v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n";
    assert!(matches!(
        refused(&[("a.obj", point), ("b.obj", TRIANGLE)]),
        SequenceError::ZeroArea { .. }
    ));
    let line = "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n";
    assert!(matches!(
        refused(&[("a.obj", line), ("b.obj", TRIANGLE)]),
        SequenceError::ZeroArea { .. }
    ));
}

#[test]
fn odd_but_usable_folders_are_read_with_notices() {
    let shape = |z: i32| {
        format!("v 0 0 {z}\nv 2 0 {z}\nv 2 1 {z}\nv 0 1 {z}\nv 0 0 {z}\nv 7 7 {z}\nl 1 2\nf 1 2 3 4\nf 5 5 2\n")
    };
    let names = ["frame2.obj", "frame10.obj", "frame1.obj"];
    let texts: Vec<String> = (0..3).map(shape).collect();
    let mut files: Vec<(&str, &str)> = names.iter().copied().zip(texts.iter().map(String::as_str)).collect();
    files.extend([("m.mtl", ""), ("facts.json", "{}")]);
    let folder = folder(&files);
    let SequenceRead { sequence, notices } = read(folder.path()).unwrap();
    assert_eq!(sequence.shape_names, ["frame1.obj", "frame2.obj", "frame10.obj"]);
    assert_eq!(
        sequence.shapes.iter().map(|shape| shape[0][2]).collect::<Vec<_>>(),
        [2.0, 0.0, 1.0]
    );
    assert_eq!(sequence.name, folder.path().file_name().unwrap().to_string_lossy());
    assert_eq!(sequence.faces.len(), 2);
    assert_eq!(
        notices,
        [
            Notice::IgnoredFiles {
                count: 2,
                example: "facts.json".into()
            },
            Notice::PolygonsTriangulated {
                count: 1,
                triangle_count: 2
            },
            Notice::CollapsedTriangles { count: 1 },
            Notice::IgnoredElements { count: 1 },
            Notice::IsolatedVertices { count: 2, first: 4 },
            Notice::DuplicateVertices { count: 1, first: 4 },
        ]
    );
}

#[test]
fn polygons_are_split_by_the_first_shape_in_every_shape() {
    let quad = |x: f32| format!("OFF\n4 1 0\n0 0 0\n1 0 0\n{x} {x} 0\n0 1 0\n4 0 1 2 3\n");
    let folder = folder(&[("a.off", &quad(0.3)), ("b.off", &quad(2.0))]);
    // Concave at vertex 2, so the first shape allows the diagonal 0-2 only; the second's shorter one would be 1-3.
    assert_eq!(read(folder.path()).unwrap().sequence.faces, [[0, 1, 2], [0, 2, 3]]);
}

fn sequence() -> MeshSequence {
    // Numbers whose text is long or tiny, among large ones.
    let z = [1e-40, -0.0, 16777217.0, 1.1e-7];
    let shape = |m: usize| {
        (0..4)
            .map(|v| [0.1 + m as f32, (v * v) as f32 * 1e7 / 3.0, z[v]])
            .collect()
    };
    let shape_names = ["a", "b", "c"].map(String::from).to_vec();
    MeshSequence {
        name: "s".into(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        shapes: (0..3).map(shape).collect(),
        shape_names,
        ..MeshSequence::default()
    }
}

fn bits<'a>(shapes: impl IntoIterator<Item = &'a [[f32; 3]]>) -> Vec<u32> {
    shapes.into_iter().flatten().flatten().map(|x| x.to_bits()).collect()
}

#[test]
fn written_sequences_read_back_to_the_same_bits() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    write_sequence_obj(&folder.path().join("deep/text"), &sequence).unwrap();
    let text = read(&folder.path().join("deep/text")).unwrap().sequence;
    write_sequence_npy(&folder.path().join("arrays"), &sequence).unwrap();
    let from_folder = read(&folder.path().join("arrays")).unwrap().sequence;
    let from_file = read(&folder.path().join("arrays/positions.npy")).unwrap().sequence;
    assert_eq!((text.name.as_str(), from_file.name.as_str()), ("text", "arrays"));
    for back in [text, from_folder, from_file] {
        assert_eq!(back.faces, sequence.faces);
        assert_eq!(bits(back.shapes.iter()), bits(sequence.shapes.iter()));
    }
    let left: Vec<_> = fs::read_dir(folder.path().join("arrays"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 2, "temporary files left: {left:?}");
}

#[test]
fn texture_coordinates_are_read_with_the_reference_and_written_again() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let textured = format!("{square}vt 0 0\nvt 1 0\nvt 1 1\nvt .5 .5\nf 1/1 2/2 3/3\nf 1/4 3/3 4/4\n");
    let plain = format!("{square}f 1 2 3\nf 1 3 4\n");
    // Only the reference's count, so the others may have none.
    let first = folder(&[("a.obj", &textured), ("b.obj", &plain.replace("1 1 0", "1 1 1"))]);
    let sequence = read(first.path()).unwrap().sequence;
    let render = sequence.render.clone().unwrap();
    assert_eq!((&render.vertices[..], render.faces.len()), (&[0, 1, 2, 0, 3][..], 2));
    assert_eq!(render.uvs[3], [0.5, 0.5]);
    let again = tempfile::tempdir().unwrap();
    write_sequence_obj(again.path(), &sequence).unwrap();
    assert_eq!(read(again.path()).unwrap().sequence.render, Some(render));

    let second = folder(&[("a.obj", &plain), ("b.obj", &textured)]);
    assert_eq!(read(second.path()).unwrap().sequence.render, None);
    let broken = textured.replace("vt 1 1", "vt 1 up");
    let third = folder(&[("a.obj", &broken), ("b.obj", &plain)]);
    let odd = read(third.path()).unwrap();
    assert_eq!(odd.sequence.render, None);
    assert_eq!(
        odd.notices,
        [Notice::TextureIgnored {
            problem: "the reference's line 7 has one that is no finite number, or an index of none".into()
        }]
    );

    let path = again.path().join("x.obj");
    let render = RenderSurface {
        vertices: vec![0, 0],
        uvs: vec![[0.0; 2], [1.0; 2]],
        faces: vec![[0, 1, 0]],
    };
    let surface = OutputSurface {
        render: Some(&render),
        ..OutputSurface::bare("x", 0, &[])
    };
    let error = write_obj(&path, &[], &surface).unwrap_err();
    assert!(error.to_string().contains("texture faces") && !path.exists());
}

#[test]
fn written_ply_reads_back_whatever_stands_beside_the_positions() {
    let MeshSequence { faces, shapes, .. } = sequence();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let normals = [[0.0f32, 0.0, 1.0]; 4];
    let colors = Dress {
        colors: vec![[0.2, 0.4, 0.6, 1.0]; 4],
        ..Dress::EMPTY
    };
    let plain = OutputSurface::bare("a", 4, &faces);
    let colored = OutputSurface {
        dress: &colors,
        ..plain
    };
    for (normals, surface) in [
        (None, plain),
        (Some(&normals[..]), plain),
        (Some(&normals[..]), colored),
    ] {
        write_ply(&path, &shapes[0], normals, &surface).unwrap();
        let mesh = PolygonMesh::parse(&fs::read(&path).unwrap(), &path).unwrap();
        assert_eq!(bits([&mesh.positions[..]]), bits([&shapes[0]]));
        assert_eq!(mesh.corners, faces.as_flattened());
    }
    let short = write_ply(&path, &shapes[0], Some(&normals[..3]), &plain);
    assert!(matches!(
        short,
        Err(WriteError::LengthDiffers {
            found: 3,
            expected: 4,
            ..
        })
    ));
}

#[test]
fn arrays_are_refused_with_their_place() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let (positions, faces) = (folder.path().join("positions.npy"), folder.path().join("faces.npy"));
    write_npy_vertices(&positions, &sequence.shapes[0]).unwrap();
    assert!(matches!(read(folder.path()), Err(SequenceError::OneShapeOnly { .. })));
    write_npy_f32(&positions, [&sequence.shapes[0]]).unwrap();
    assert!(matches!(read(folder.path()), Err(SequenceError::OneShapeOnly { .. })));
    write_npy_f32(&positions, sequence.shapes.iter()).unwrap();
    assert!(matches!(read(folder.path()), Err(SequenceError::MissingFaces { .. })));
    write_npy_u32(&faces, &[[0, 1, 2], [1, 2, 4]]).unwrap();
    let error = read(folder.path());
    assert!(matches!(
        error,
        Err(SequenceError::IndexOutOfRange {
            place: Place::Face(1),
            index: 4,
            ..
        })
    ));
    write_npy_u32(&faces, &[]).unwrap();
    assert!(matches!(read(folder.path()), Err(SequenceError::NoFaces { .. })));
    write_npy_vertices(&faces, &sequence.shapes[0]).unwrap();
    assert!(matches!(read(folder.path()), Err(SequenceError::Parse { .. })));
    write_npy_u32(&faces, &sequence.faces).unwrap();
    let mut broken: Vec<Vec<_>> = sequence.shapes.iter().map(<[_]>::to_vec).collect();
    broken[2][1][0] = f32::NAN;
    write_npy_f32(&positions, &broken).unwrap();
    match read(&positions) {
        Err(SequenceError::NonFiniteVertex {
            frame,
            vertex: 1,
            found,
            ..
        }) => {
            assert_eq!(frame, "positions.npy[2]");
            assert!(found.contains("NaN"));
        }
        other => panic!("{other:?}"),
    }
    broken[2].pop();
    assert!(matches!(
        write_npy_f32(&positions, &broken),
        Err(WriteError::LengthDiffers { .. })
    ));
}

#[test]
fn arrays_go_before_mesh_files_beside_them() {
    let folder = folder(&[("a.obj", TRIANGLE), ("b.obj", SECOND), ("facts.json", "{}")]);
    write_sequence_npy(folder.path(), &sequence()).unwrap();
    let read = read(folder.path()).unwrap();
    assert_eq!(read.sequence.vertex_count(), 4);
    assert_eq!(
        read.notices[0],
        Notice::IgnoredFiles {
            count: 3,
            example: "a.obj".into()
        }
    );
}

#[test]
fn an_unwritable_place_is_named_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("missing/a.obj");
    let nothing = OutputSurface::bare("a", 0, &[]);
    let error = write_obj(&path, &[], &nothing).unwrap_err().to_string();
    assert!(error.contains("missing/a.obj"), "{error}");
    assert!(!folder.path().join("missing").exists());
    // A folder stands where the file should go.
    assert!(write_obj(folder.path(), &[], &nothing).is_err());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
