//! Everything that is written reads back: same vertices in the same order, same frames, same faces and what they wear.

mod common;

use common::{bits, read, tent};
use sinew_interchange::{
    Choice, Dress, Joint, JointPose, MeshSequence, OutputSurface, Puppet, PuppetClip, Skin, UpAxis, WriteError,
    create_writer, skinned, write_puppet, write_sequence,
};
use std::fs;

/// The texture coordinates of all corners of all triangles.
fn corner_uvs(sequence: &MeshSequence) -> Vec<[f32; 2]> {
    let render = sequence.render.as_ref().expect("texture coordinates");
    render
        .faces
        .as_flattened()
        .iter()
        .map(|&r| render.uvs[r as usize])
        .collect()
}

/// The name of each face's material.
fn materials(sequence: &MeshSequence) -> Vec<&str> {
    sequence
        .dress
        .face_materials
        .iter()
        .map(|&material| sequence.dress.materials[material as usize].as_str())
        .collect()
}

#[test]
fn what_is_written_reads_back_to_the_same_bits() {
    let tent = tent();
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("caches")).unwrap();
    // Caches hold no faces: a mesh beside them does.
    let mut rest = create_writer(
        &folder.path().join("caches/a.obj"),
        &OutputSurface {
            frame_count: Some(1),
            ..OutputSurface::of_sequence(&tent)
        },
    )
    .unwrap();
    rest.frame(&tent.shapes[0]).unwrap();
    rest.finish().unwrap();
    for name in [
        "shapes",
        "caches/a.pc2",
        "caches/a.mdd",
        "a.abc",
        "a.usda",
        "b.usd",
        "arrays/positions.npy",
    ] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        write_sequence(&path, &tent).unwrap();
        let back = read(&path, &Choice::default())
            .unwrap_or_else(|error| panic!("{error}"))
            .sequence;
        assert_eq!(bits(&back), bits(&tent), "{name}");
        assert_eq!(back.faces, tent.faces, "{name}");
        if !name.ends_with("npy") {
            assert_eq!(corner_uvs(&back), corner_uvs(&tent), "{name}");
            assert_eq!(materials(&back), materials(&tent), "{name}");
            assert_eq!(back.dress.colors, tent.dress.colors, "{name}");
        }
        if ["mdd", "abc", "usda"].iter().any(|ending| name.ends_with(ending)) {
            assert_eq!(back.fps, Some(24.0), "{name}");
        }
    }
    let left: Vec<_> = fs::read_dir(folder.path().join("caches"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 3, "temporary files left: {left:?}");
}

#[test]
fn render_vertices_are_written_as_points_where_they_are_wanted() {
    let tent = tent();
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.npy", "a.pc2", "a.mdd"] {
        let surface = OutputSurface {
            keep_split: true,
            ..OutputSurface::of_sequence(&tent)
        };
        let mut writer = create_writer(&folder.path().join(name), &surface).unwrap();
        tent.shapes.iter().for_each(|shape| writer.frame(shape).unwrap());
        writer.finish().unwrap();
        fs::write(
            folder.path().join("mesh.off"),
            "OFF\n6 1 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 0\n1 0 1\n3 0 1 2\n",
        )
        .unwrap();
        let choice = Choice {
            surface: Some(folder.path().join("mesh.off")),
            ..Choice::default()
        };
        let back = read(&folder.path().join(name), &choice).unwrap().sequence;
        let render = tent.render.as_ref().unwrap();
        for (shape, back) in tent.shapes.iter().zip(&back.shapes) {
            let expected: Vec<[f32; 3]> = render.vertices.iter().map(|&v| shape[v as usize]).collect();
            assert_eq!(back, &expected[..], "{name}");
        }
    }
}

#[test]
fn what_points_up_is_turned_where_a_format_has_a_custom() {
    let mut tent = tent();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.abc");
    for (up, expected) in [
        (UpAxis::Y, [0.5, 0.5, 0.1]),
        (UpAxis::Z, [0.5, 0.1, -0.5]),
        (UpAxis::X, [-0.5, 0.5, 0.1]),
    ] {
        tent.up = Some(up);
        write_sequence(&path, &tent).unwrap();
        let back = read(&path, &Choice::default()).unwrap().sequence;
        let off: f32 = (0..3).map(|c| (back.shapes[0][4][c] - expected[c]).abs()).sum();
        assert!(off < 1e-6, "{up}: {:?}", back.shapes[0][4]);
    }
}

#[test]
fn names_that_say_no_format_and_frames_of_another_length_are_refused() {
    let tent = tent();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.blend");
    let error = write_sequence(&path, &tent).unwrap_err().to_string();
    assert!(error.contains(".abc") && error.contains(".pc2"), "{error}");
    for name in ["a.abc", "a.pc2", "a.mdd", "a.npy", "a.obj", "a.ply"] {
        let mut writer = create_writer(&folder.path().join(name), &OutputSurface::of_sequence(&tent)).unwrap();
        let short = writer.frame(&tent.shapes[0][1..]);
        assert!(
            matches!(
                short,
                Err(WriteError::LengthDiffers {
                    found: 4,
                    expected: 5,
                    ..
                })
            ),
            "{name}: {short:?}"
        );
        drop(writer);
        assert!(!folder.path().join(name).exists(), "{name}");
    }
    assert!(write_sequence(&folder.path().join("missing/a.abc"), &tent).is_err());
}

#[test]
fn a_gltf_file_plays_what_was_written() {
    let tent = tent();
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.glb", "a.gltf"] {
        let path = folder.path().join(name);
        write_sequence(&path, &tent).unwrap();
        let back = read(&path, &Choice::default())
            .unwrap_or_else(|error| panic!("{error}"))
            .sequence;
        assert_eq!((back.shape_count(), back.vertex_count()), (tent.shape_count(), 5));
        assert_eq!(back.fps, Some(24.0));
        // Faces are grouped by their materials.
        let mut faces = back.faces.clone();
        faces.sort();
        let mut expected = tent.faces.clone();
        expected.sort();
        assert_eq!(faces, expected, "{name}");
        let mut worn = materials(&back);
        worn.sort();
        assert_eq!(worn, ["cloth", "cloth", "rope", "rope"]);
        assert_eq!(back.dress.colors, tent.dress.colors);
        let mut uvs = corner_uvs(&back);
        let mut expected = corner_uvs(&tent);
        uvs.sort_by(|a, b| a.partial_cmp(b).unwrap());
        expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(uvs, expected);
        for (shape, expected) in back.shapes.iter().zip(&tent.shapes) {
            let apart = |(p, q): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
            let apart = shape.iter().zip(expected).map(apart).fold(0.0, f32::max);
            assert!(apart <= 2e-7, "{name}: {apart}");
        }
    }
}

#[test]
fn a_puppet_plays_as_its_joints_say() {
    let tent = tent();
    let folder = tempfile::tempdir().unwrap();
    let rest = &tent.shapes[0];
    let at = |x: f32, angle: f32, scale: f32| JointPose {
        translation: [x, 0.5 * x, -x],
        rotation: [0.0, (0.5 * angle).sin(), 0.0, (0.5 * angle).cos()],
        scale: [scale, 1.0, 1.0 / scale],
    };
    let joints = [at(0.25, 0.75, 1.0), at(-1.0, 0.0, 1.0)];
    let mut skin = Skin {
        joints: (joints.iter().enumerate())
            .map(|(j, pose)| Joint {
                name: format!("joint{j}"),
                parent: None,
                bind: pose.bind(),
            })
            .collect(),
        ..Skin::default()
    };
    for v in 0..rest.len() {
        skin.influences.extend([(0, v as f32), (1, 1.0)]);
        skin.end_vertex();
    }
    let dress = Dress {
        skin: Some(skin),
        ..tent.dress.clone()
    };
    let poses: Vec<Vec<JointPose>> = (0..9)
        .map(|n| {
            let t = n as f32;
            vec![at(0.25 * t, 0.75 + t, 1.0 + 0.1 * t), joints[1]]
        })
        .collect();
    let clip = PuppetClip::of_poses("swing", 24.0, &joints, &poses, &[4.0, 4.0], 1e-6);
    assert!(clip.tracks.iter().all(|track| track.joint == 0), "the other one rests");
    let raised: Vec<[f32; 3]> = rest.iter().map(|&[x, y, z]| [x, y + 1.0, z]).collect();
    let lifted = PuppetClip {
        weights: vec![vec![0.0], vec![-2.0], vec![0.5]],
        tracks: Vec::new(),
        frame_count: 3,
        name: "lift".into(),
        ..clip.clone()
    };
    let puppet = Puppet {
        surface: OutputSurface {
            dress: &dress,
            unit_metres: Some(0.5),
            up: Some(UpAxis::Y),
            ..OutputSurface::of_sequence(&tent)
        },
        rest,
        targets: vec![("raised".into(), raised)],
        clips: vec![clip.clone(), lifted],
        extras: serde_json::json!({ "of": "a test" }),
    };
    for name in ["a.glb", "a.gltf"] {
        let path = folder.path().join(name);
        write_puppet(&path, &puppet).unwrap();
        let of_clip = |clip: &str| {
            let choice = Choice {
                clip: Some(clip.into()),
                ..Choice::default()
            };
            read(&path, &choice).unwrap_or_else(|error| panic!("{error}")).sequence
        };
        let played = of_clip("swing");
        assert_eq!(played.shape_count(), poses.len());
        for (n, shape) in played.shapes.iter().enumerate() {
            let wanted = skinned(&dress, rest, &clip.pose(n, &joints));
            for (found, wanted) in shape.iter().zip(&wanted) {
                let far = (0..3).map(|c| (found[c] - 0.5 * wanted[c]).abs()).fold(0.0, f32::max);
                assert!(far < 1e-5, "{name}, frame {n}: {found:?}, {wanted:?}");
            }
        }
        let lifted = of_clip("lift");
        for (found, rest) in lifted.shapes[1].iter().zip(rest) {
            assert!((found[1] - 0.5 * (rest[1] - 2.0)).abs() < 1e-5, "{found:?}, {rest:?}");
        }
    }
    assert!(matches!(
        write_puppet(&folder.path().join("a.abc"), &puppet),
        Err(WriteError::NotGltf { .. })
    ));
}
