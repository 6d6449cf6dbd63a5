//! FBX: a small file by hand, damaged ones, and what a build without the reader says.

mod common;

use common::read;
use sinew_interchange::Choice;
use std::fs;

/// A square that goes five units along x in a second, linearly.
#[cfg(feature = "fbx")]
const SAIL: &str = r#"; FBX 7.4.0 project file
FBXHeaderExtension:  {
    FBXVersion: 7400
}
GlobalSettings:  {
    Properties70:  {
        P: "UpAxis", "int", "Integer", "",2
        P: "UpAxisSign", "int", "Integer", "",1
        P: "FrontAxis", "int", "Integer", "",1
        P: "FrontAxisSign", "int", "Integer", "",-1
        P: "CoordAxis", "int", "Integer", "",0
        P: "CoordAxisSign", "int", "Integer", "",1
        P: "UnitScaleFactor", "double", "Number", "",100
        P: "TimeMode", "enum", "", "",11
    }
}
Objects:  {
    Geometry: 1, "Geometry::sail", "Mesh" {
        Vertices: *12 {
            a: 0,0,0,1,0,0,1,1,0,0,1,0
        }
        PolygonVertexIndex: *4 {
            a: 0,1,2,-4
        }
    }
    Model: 2, "Model::sail", "Mesh" {
        Version: 232
    }
    AnimationStack: 3, "AnimStack::sway", "" {
        Properties70:  {
            P: "LocalStart", "KTime", "Time", "",0
            P: "LocalStop", "KTime", "Time", "",46186158000
        }
    }
    AnimationLayer: 4, "AnimLayer::base", "" {
    }
    AnimationCurveNode: 5, "AnimCurveNode::T", "" {
        Properties70:  {
            P: "d|X", "Number", "", "A",0
            P: "d|Y", "Number", "", "A",0
            P: "d|Z", "Number", "", "A",0
        }
    }
    AnimationCurve: 6, "AnimCurve::", "" {
        Default: 0
        KeyVer: 4008
        KeyTime: *2 {
            a: 0,46186158000
        }
        KeyValueFloat: *2 {
            a: 0,5
        }
        KeyAttrFlags: *1 {
            a: 4
        }
        KeyAttrDataFloat: *4 {
            a: 0,0,0,0
        }
        KeyAttrRefCount: *1 {
            a: 2
        }
    }
}
Connections:  {
    C: "OO",1,2
    C: "OO",2,0
    C: "OO",4,3
    C: "OO",5,4
    C: "OP",5,2, "Lcl Translation"
    C: "OP",6,5, "d|X"
}
"#;

#[cfg(feature = "fbx")]
#[test]
fn a_moving_mesh_and_a_clip_in_a_second_file() {
    use sinew_interchange::{Motion, UpAxis, read_contents};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fbx");
    fs::write(&path, SAIL).unwrap();
    let contents = read_contents(&path, &Choice::default()).unwrap();
    assert_eq!((contents.up, contents.unit_metres), (Some(UpAxis::Z), Some(1.0)));
    assert_eq!(
        (contents.meshes[0].name.as_str(), contents.meshes[0].motion),
        ("sail", Motion::Whole)
    );
    assert_eq!(
        (contents.clips[0].name.as_str(), contents.clips[0].fps),
        ("sway", Some(24.0))
    );
    let found = read(&path, &Choice::default()).unwrap().sequence;
    assert_eq!(
        (found.shape_count(), found.vertex_count(), found.faces.len()),
        (25, 4, 2)
    );
    for (m, shape) in found.shapes.iter().enumerate() {
        assert!(
            (shape[2][0] - 1.0 - 5.0 * m as f32 / 24.0).abs() < 1e-5,
            "{m}: {:?}",
            shape[2]
        );
    }
    // The mesh of one file, the clip of another: twice as far.
    let beside = folder.path().join("far.fbx");
    fs::write(&beside, SAIL.replace("a: 0,5\n", "a: 0,10\n")).unwrap();
    let choice = Choice {
        clip: Some(beside.to_string_lossy().into_owned()),
        ..Choice::default()
    };
    let found = read(&path, &choice).unwrap().sequence;
    assert!(
        (found.shapes[24][0][0] - 10.0).abs() < 1e-5,
        "{:?}",
        found.shapes[24][0]
    );
    for word in ["walk", "nowhere.fbx"] {
        let choice = Choice {
            clip: Some(word.into()),
            ..Choice::default()
        };
        let error = read(&path, &choice).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("sway"), "{error}");
    }
}

#[cfg(feature = "fbx")]
#[test]
fn damaged_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fbx");
    fs::write(&path, SAIL).unwrap();
    let mut accepted = 0;
    common::prefixes(&path, |_| {
        // A text may end behind any of its objects: then the mesh is whole, or there is none.
        if let Ok(found) = read(&path, &Choice::default()) {
            assert_eq!(found.sequence.vertex_count(), 4);
            accepted += 1;
        }
    });
    assert!(
        accepted < SAIL.len() / 3,
        "{accepted} of {} prefixes were read",
        SAIL.len()
    );
    common::flips(&path, 1, || drop(read(&path, &Choice::default())));
    fs::write(&path, b"Kaydara FBX Binary  \0\x1a\0\xe8\x1c\0\0 and nothing else").unwrap();
    let error = read(&path, &Choice::default()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("a.fbx"), "{error}");
}

#[cfg(not(feature = "fbx"))]
#[test]
fn a_build_without_the_reader_names_the_feature() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fbx");
    fs::write(&path, "; FBX 7.4.0 project file\n").unwrap();
    let error = read(&path, &Choice::default()).map(|_| ()).unwrap_err().to_string();
    assert!(
        error.contains("feature `fbx`") && error.contains("C compiler"),
        "{error}"
    );
}
