//! Damaged files of every format that scenes come in: every prefix is refused, files with flipped bits are read or refused, and
//! nothing panics.

mod common;

use common::{bits, read, tent, torment};
use sinew_interchange::{Choice, SequenceError, read_contents, write_sequence, write_sequence_npy};
use std::fs;

#[test]
fn damaged_alembic_archives_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.abc");
    write_sequence(&path, &tent()).unwrap();
    let whole = fs::metadata(&path).unwrap().len() as usize;
    let accepted = torment(&path);
    assert!(
        accepted > 0 && accepted < whole,
        "{accepted} of {whole} flips were accepted"
    );
    for (bytes, word) in [
        (&b"\x89HDF\r\n\x1a\n0123456789"[..], "HDF5"),
        (b"Ogawa\x00\x00\x010123456789", "finished"),
        (b"", "Ogawa"),
    ] {
        fs::write(&path, bytes).unwrap();
        let error = read(&path, &Choice::default()).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn packed_arrays_read_like_loose_ones() {
    let folder = tempfile::tempdir().unwrap();
    write_sequence_npy(folder.path(), &tent()).unwrap();
    let path = folder.path().join("a.npz");
    for method in [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated] {
        let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        for name in ["faces.npy", "positions.npy"] {
            archive.start_file(name, options).unwrap();
            std::io::Write::write_all(&mut archive, &fs::read(folder.path().join(name)).unwrap()).unwrap();
        }
        archive.finish().unwrap();
        let back = read(&path, &Choice::default()).unwrap().sequence;
        assert_eq!((bits(&back), back.faces), (bits(&tent()), tent().faces));
        assert_eq!(read_contents(&path, &Choice::default()).unwrap().format, "npz");
    }
    torment(&path);
    fs::write(&path, b"PK\x05\x06not an archive").unwrap();
    let error = read(&path, &Choice::default()).unwrap_err();
    assert!(matches!(error, SequenceError::Parse { .. }), "{error}");
}

#[test]
fn damaged_gltf_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut small = tent();
    small.shapes = small.shapes.first(3);
    for name in ["a.glb", "a.gltf"] {
        let path = folder.path().join(name);
        write_sequence(&path, &small).unwrap();
        let accepted = torment(&path);
        let whole = fs::metadata(&path).unwrap().len() as usize;
        assert!(
            accepted > 0 && accepted < whole,
            "{accepted} of {whole} flips were accepted"
        );
    }
    fs::remove_file(folder.path().join("a.bin")).unwrap();
    let error = read(&folder.path().join("a.gltf"), &Choice::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("a.bin"), "{error}");
}

/// A square of two triangles that is moved by `nodes`, with more of the document behind it.
fn square(nodes: &str, more: &str) -> String {
    // Positions of four vertices, then six 16-bit indices, then two times and two translations.
    let floats = [0f32, 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]
        .map(f32::to_le_bytes)
        .concat();
    let indices = [0u16, 1, 2, 0, 2, 3].map(u16::to_le_bytes).concat();
    let motion = [0f32, 1., 0., 0., 0., 0., 0., 5.].map(f32::to_le_bytes).concat();
    let buffer = [floats, indices, motion].concat();
    let base64 = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &buffer);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":{nodes},
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "animations":[{{"channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}],"samplers":[{{"input":2,"output":3}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
            {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}},
            {{"bufferView":2,"componentType":5126,"count":2,"type":"SCALAR"}},
            {{"bufferView":2,"byteOffset":8,"componentType":5126,"count":2,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}},
            {{"buffer":0,"byteOffset":60,"byteLength":32}}],
        "buffers":[{{"byteLength":92,"uri":"data:application/octet-stream;base64,{base64}"}}]{more}}}"#
    )
}

#[test]
fn nodes_move_what_hangs_from_them_and_faults_of_the_tree_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let read_with = |nodes: &str, more: &str| {
        fs::write(&path, square(nodes, more)).unwrap();
        read(&path, &Choice::default())
    };
    let tree = r#"[{"children":[1]},{"scale":[2,2,2],"mesh":0,"name":"sail"}]"#;
    let moved = read_with(tree, "").unwrap().sequence;
    assert_eq!((moved.shape_count(), moved.fps), (25, Some(24.0)));
    assert_eq!(
        (moved.shapes[0][2], moved.shapes[24][2]),
        ([2.0, 2.0, 0.0], [2.0, 2.0, 5.0])
    );
    for (nodes, more, word) in [
        (r#"[{"children":[1]},{"children":[0],"mesh":0}]"#, "", "above itself"),
        (r#"[{"children":[0],"mesh":0}]"#, "", "above itself"),
        (
            r#"[{"children":[2]},{"children":[2]},{"mesh":0}]"#,
            "",
            "below two others",
        ),
        (r#"[{"children":[7]},{"mesh":0}]"#, "", "node 7"),
        (r#"[{"mesh":3}]"#, "", "node 0"),
        (tree, r#","extensionsRequired":["KHR_draco_mesh_compression"]"#, "Draco"),
        (tree, r#","extensionsRequired":["EXT_unheard"]"#, "EXT_unheard"),
    ] {
        let error = read_with(nodes, more).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn a_pointer_in_place_of_a_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("shapes")).unwrap();
    fs::write(folder.path().join("shapes/b.obj"), "v 0 0 0\n").unwrap();
    for name in ["a.abc", "a.glb", "a.mdd", "shapes/a.obj"] {
        let path = folder.path().join(name);
        fs::write(
            &path,
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n",
        )
        .unwrap();
        let place = if name.ends_with("obj") {
            path.parent().unwrap()
        } else {
            &path
        };
        let choice = Choice {
            surface: Some(folder.path().join("a.abc")),
            ..Choice::default()
        };
        let error = read(place, &choice).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("git lfs pull"), "{error}");
    }
}

/// A square of two triangles that turns into a roof, in two frames; triangles wind clockwise, as the format has it.
fn roof_as_md2() -> Vec<u8> {
    let (points, textures, triangles, frames) = (4_i32, 4_i32, 2_i32, 2_i32);
    let frame_bytes = 40 + 4 * points;
    let textures_at = 68;
    let triangles_at = textures_at + 4 * textures;
    let frames_at = triangles_at + 12 * triangles;
    let end = frames_at + frames * frame_bytes;
    let header = [
        8,
        64,
        32,
        frame_bytes,
        0,
        points,
        textures,
        triangles,
        0,
        frames,
        68,
        textures_at,
        triangles_at,
        frames_at,
        end,
        end,
    ];
    let mut bytes = b"IDP2".to_vec();
    bytes.extend(header.iter().flat_map(|n: &i32| n.to_le_bytes()));
    for uv in [[0_i16, 32], [64, 32], [64, 0], [0, 0]] {
        bytes.extend(uv.iter().flat_map(|x| x.to_le_bytes()));
    }
    for triangle in [[0_u16, 2, 1], [0, 3, 2]] {
        bytes.extend(triangle.iter().chain(&triangle).flat_map(|n| n.to_le_bytes()));
    }
    for (name, height) in [("stand01", 0), ("stand02", 100_u8)] {
        bytes.extend(
            [0.5_f32, 0.5, 0.01, -1.0, 0.0, 2.0]
                .iter()
                .flat_map(|x| x.to_le_bytes()),
        );
        let mut padded = [0; 16];
        padded[..name.len()].copy_from_slice(name.as_bytes());
        bytes.extend(padded);
        for point in [[0, 0, 0], [2, 0, 0], [2, 2, height], [0, 2, height]] {
            bytes.extend([point[0], point[1], point[2], 0]);
        }
    }
    bytes
}

#[test]
fn quake_models_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("roof.md2");
    let whole = roof_as_md2();
    fs::write(&path, &whole).unwrap();
    let sequence = read(&path, &Choice::default()).unwrap().sequence;
    assert_eq!(sequence.faces, [[0, 1, 2], [0, 2, 3]], "counter-clockwise");
    assert_eq!(sequence.shapes[0].to_vec()[2], [0.0, 1.0, 2.0]);
    assert_eq!(sequence.shapes[1].to_vec()[2], [0.0, 1.0, 3.0]);
    let render = sequence.render.expect("texture coordinates");
    assert!(render.uvs.contains(&[0.0, 0.0]) && render.uvs.contains(&[1.0, 1.0]));
    let contents = read_contents(&path, &Choice::default()).unwrap();
    assert_eq!((contents.format, contents.clips[0].times.len()), ("MD2", 2));
    assert!(torment(&path) > 0);
    let other = |at: usize, value: i32, said: &str| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        fs::write(&path, bytes).unwrap();
        let error = read(&path, &Choice::default()).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    };
    other(0, 0, "IDP2");
    other(4, 9, "version 8");
    other(24, -1, "count of vertices");
    other(24, 2, "index below 2");
    other(24, 1_000_000, "frames with vertices");
    other(32, i32::MAX, "triangles that the file holds");
    other(40, i32::MAX, "frames that the file holds");
    other(40, 0, "frames with vertices");
}
