//! USD as text, in binary and in a package: the same mesh, skinned, with blend shapes and a shape between, as OpenUSD itself bakes it;
//! and damaged files.

mod common;

use common::{bits, flips, prefixes, read, tent, torment};
use sinew_interchange::{Choice, Motion, Space, UpAxis, read_contents, write_sequence};
use std::fs;
use std::io::Write;
use std::path::PathBuf;

/// World positions of `tent.usdc` in its five frames by `UsdSkelBakeSkinning`.
const BAKED: [[[f32; 3]; 5]; 5] = [
    [
        [0.5, 0.0, 0.5],
        [1.5, 0.0, 0.5],
        [1.5, 1.0, 0.5],
        [0.5, 1.0, 0.5],
        [1.0, 0.5, 0.75],
    ],
    [
        [0.625, 0.0, 0.75],
        [1.636334, -0.0, 0.565165],
        [1.647667, 1.0, 0.38033],
        [0.625, 1.0, 0.75],
        [1.628014, 0.5, 2.029099],
    ],
    [
        [0.75, 0.0, 1.0],
        [1.73715, -0.0, 0.554391],
        [1.7243, 1.0, 0.108782],
        [0.75, 1.0, 1.0],
        [2.761851, 0.5, 3.307552],
    ],
    [
        [0.875, 0.0, 1.25],
        [1.815565, -0.0, 0.523888],
        [1.75613, 1.0, -0.202223],
        [0.875, 1.0, 1.25],
        [2.902804, 0.5, 1.615585],
    ],
    [
        [1.0, 0.0, 1.5],
        [1.885738, 0.0, 0.528983],
        [1.771476, 1.0, -0.442035],
        [1.0, 1.0, 1.5],
        [2.687137, 0.5, -0.255677],
    ],
];

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

/// The binary file in a package, as the one layer or behind compression.
fn package(path: &PathBuf, method: zip::CompressionMethod) {
    let mut archive = zip::ZipWriter::new(fs::File::create(path).unwrap());
    let options = zip::write::SimpleFileOptions::default().compression_method(method);
    archive.start_file("tent.usdc", options).unwrap();
    archive.write_all(&fs::read(fixture("tent.usdc")).unwrap()).unwrap();
    archive.finish().unwrap();
}

#[test]
fn text_binary_and_package_give_what_openusd_bakes() {
    let folder = tempfile::tempdir().unwrap();
    let packed = folder.path().join("tent.usdz");
    package(&packed, zip::CompressionMethod::Stored);
    for path in [fixture("tent.usda"), fixture("tent.usdc"), packed.clone()] {
        let contents = read_contents(&path, &Choice::default()).unwrap();
        let mesh = &contents.meshes[0];
        assert_eq!(
            (mesh.name.as_str(), mesh.vertex_count, mesh.face_count),
            ("Root/Top/Tent", 5, 4)
        );
        assert_eq!((mesh.joint_count, mesh.motion), (2, Motion::Deforms));
        assert_eq!(mesh.morphs, ["side", "up"]);
        assert_eq!((contents.up, contents.unit_metres), (Some(UpAxis::Z), Some(0.01)));
        assert_eq!(contents.others, [("spheres, cubes and the like".to_string(), 1)]);
        let found = read(&path, &Choice::default())
            .unwrap_or_else(|error| panic!("{error}"))
            .sequence;
        assert_eq!((found.shape_count(), found.fps), (5, Some(24.0)));
        for (shape, baked) in found.shapes.iter().zip(&BAKED) {
            for (p, q) in shape.iter().zip(baked) {
                let apart = (0..3).map(|c| (p[c] - q[c]).abs()).fold(0.0, f32::max);
                assert!(apart < 2e-6, "{}: {p:?} {q:?}", path.display());
            }
        }
        assert_eq!(found.dress.materials, ["cloth", "rope"]);
        assert_eq!(found.dress.face_materials, [0, 1, 0, 1]);
        let skin = found.dress.skin.as_ref().unwrap();
        assert_eq!((skin.joints[1].name.as_str(), skin.joints[1].parent), ("b", Some(0)));
        assert_eq!(skin.of_vertex(1), [(0, 0.75), (1, 0.25)]);
        assert_eq!(found.render.as_ref().map(|render| render.vertices.len()), Some(12));
        let local = Choice {
            space: Space::Local,
            fps: Some(48.0),
            ..Choice::default()
        };
        assert_eq!(read(&path, &local).unwrap().sequence.shape_count(), 9);
    }
    package(&packed, zip::CompressionMethod::Deflated);
    let error = read(&packed, &Choice::default()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("not compressed"), "{error}");
}

#[test]
fn damaged_usd_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::copy(fixture("tent.usdc"), at("a.usdc")).unwrap();
    package(&at("a.usdz"), zip::CompressionMethod::Stored);
    for name in ["a.usdc", "a.usdz"] {
        let accepted = torment(&at(name));
        assert!(accepted > 0, "{name}");
    }
    for name in ["a.usda", "b.usda"] {
        if name == "a.usda" {
            fs::copy(fixture("tent.usda"), at(name)).unwrap();
        } else {
            write_sequence(&at(name), &tent()).unwrap();
        }
        let whole = fs::metadata(at(name)).unwrap().len() as usize;
        prefixes(&at(name), |length| {
            // Behind the last bracket stands white space alone.
            assert!(
                read(&at(name), &Choice::default()).is_err() || length + 2 >= whole,
                "{name}: {length} bytes"
            );
        });
        flips(&at(name), 1, || drop(read(&at(name), &Choice::default())));
    }
}

#[test]
fn what_is_not_followed_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.usda");
    let refusal = |text: &str| {
        fs::write(&path, text).unwrap();
        read(&path, &Choice::default()).map(|_| ()).unwrap_err().to_string()
    };
    let mesh = |points: &str, indices: &str| {
        format!(
            "#usda 1.0\ndef Mesh \"m\"\n{{\n    point3f[] points.timeSamples = {{ {points} }}\n    int[] faceVertexCounts = [3]\n    \
             int[] faceVertexIndices = {indices}\n}}\n"
        )
    };
    let still = "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]";
    for (text, words) in [
        (
            "#usda 1.0\ndef Xform \"a\" (\n    references = @b.usd@</b>\n)\n{\n}\n".to_string(),
            "references, which are not followed",
        ),
        (
            "#usda 1.0\ndef BasisCurves \"a\"\n{\n}\n".to_string(),
            "groups of curves",
        ),
        (
            "#usda 1.0\ndef Xform \"a\"\n{\n    float x = [1\n}\n".to_string(),
            "line",
        ),
        (
            mesh(&format!("0: {still}, 1: [(0, 0, 0)]"), "[0, 1, 2]"),
            "has 1 vertices, but 3",
        ),
        (
            mesh(
                &format!("0: {still}, 1: [(nan, 0, 0), (1, 0, 0), (0, 1, 0)]"),
                "[0, 1, 2]",
            ),
            "vertex 0",
        ),
        (mesh(&format!("0: {still}, 1: {still}"), "[0, 1, 3]"), "vertex 3"),
        (mesh(&format!("0: {still}, 1: {still}"), "[0, 1, 2, 0]"), "4 corners"),
        (mesh(&format!("0: {still}, 1: {still}"), "[0, 1, x]"), "`x`"),
    ] {
        let found = refusal(&text);
        assert!(found.contains(words), "{found}");
    }
    // Samples in another order than their times are sorted.
    fs::write(
        &path,
        mesh(
            "2: [(0, 0, 2), (1, 0, 0), (0, 1, 0)], 1: [(0, 0, 1), (1, 0, 0), (0, 1, 0)]",
            "[0, 1, 2]",
        ),
    )
    .unwrap();
    let found = read(&path, &Choice::default()).unwrap().sequence;
    assert_eq!(bits(&found)[2], 1f32.to_bits());
}
