//! Real files of other programs against what those programs say is in them.

mod common;

#[cfg(feature = "fbx")]
use common::diagonal;
use common::{Array, error, formats, local, read};
use sinew_interchange::{Choice, MeshSequence, SequenceError, Space, read_contents};
use std::fs;

/// Largest vertex error that is allowed, over the diagonal.
const ERROR_MAX: f64 = 1e-5;

fn sequence(name: &str, choice: &Choice) -> MeshSequence {
    match read(&formats().join(name), choice) {
        Ok(read) => read.sequence,
        Err(error) => panic!("{name}: {error}"),
    }
}

fn assert_close(what: &str, error: f64) {
    println!("{what}: largest vertex error {error:.1e} of the diagonal");
    assert!(error <= ERROR_MAX, "{what}: {error:e}");
}

fn npy(path: std::path::PathBuf) -> Array {
    Array::of_npy(&fs::read(path).unwrap())
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn alembic_archives() {
    // Blender's own z points up; in Alembic y does.
    let mut truth = npy(formats().join("blender/flag100.npy"));
    truth
        .values
        .as_chunks_mut()
        .0
        .iter_mut()
        .for_each(|[_, y, z]| (*y, *z) = (*z, -*y));
    let flag = sequence("blender/flag100.abc", &local(&[]));
    assert_close("flag100.abc", error(&flag, &truth, |m| m));

    let truth = npy(formats().join("../dembones_bone/positions.npy"));
    let bone = sequence("alembic/Bone_Anim.abc", &local(&[]));
    assert_eq!(bone.shape_count(), truth.shape[0]);
    assert_close("Bone_Anim.abc", error(&bone, &truth, |m| m));

    let name = "alembic/testUsdAbcIsConstant.abc";
    let beside = formats().join(format!("{name}.truth.npz"));
    for mesh in ["transform1", "sphere1"] {
        let truth = Array::of_npz(&beside, mesh);
        let found = sequence(name, &local(&[mesh]));
        assert_eq!(found.shape_count(), truth.shape[0]);
        assert_close(
            &format!("testUsdAbcIsConstant.abc, {mesh}"),
            error(&found, &truth, |m| m),
        );
    }
    let both = sequence(name, &local(&["all"]));
    assert_eq!((both.vertex_count(), both.fps), (532, Some(24.0)));
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn point_caches() {
    let truth = npy(formats().join("blender/flag100.npy"));
    for name in ["blender/flag100.pc2", "blender/flag100.mdd"] {
        let choice = Choice {
            surface: Some(formats().join("blender/flag_f50.obj")),
            ..local(&[])
        };
        assert_close(name, error(&sequence(name, &choice), &truth, |m| m));
    }
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn gltf_files() {
    // The truth stands on its z axis.
    let mut truth = npy(formats().join("../cesium_man/positions.npy"));
    let upright = |p: &mut [f64; 3]| *p = [p[0], p[2], -p[1]];
    truth.values.as_chunks_mut().0.iter_mut().for_each(upright);
    let man = sequence("gltf/cesium_man.gltf", &Choice::default());
    assert_eq!(man.shape_count(), truth.shape[0]);
    assert_close("cesium_man.gltf", error(&man, &truth, |m| m));

    // Eight keys of Blender's on the mean of the frames, by their weights.
    let [frames, keys, weights] =
        ["", "_sk_basis", "_sk_weights"].map(|name| npy(formats().join(format!("blender/flag100{name}.npy"))));
    let (frame_count, width, key_count) = (frames.shape[0], 3 * frames.shape[1], keys.shape[0]);
    let value = |m: usize, i: usize| {
        let mean = (0..frame_count).map(|m| frames.values[m * width + i]).sum::<f64>() / frame_count as f64;
        let moved = (0..key_count).map(|k| weights.values[m * key_count + k] * keys.values[k * width + i]);
        mean + moved.sum::<f64>()
    };
    let truth = Array {
        values: (0..frame_count)
            .flat_map(|m| (0..width).map(move |i| (m, i)))
            .map(|(m, i)| value(m, i))
            .collect(),
        shape: frames.shape.clone(),
    };
    let flag = sequence("blender/flag100_sk.glb", &Choice::default());
    assert_close("flag100_sk.glb", error(&flag, &truth, |m| m));

    let names = ["IndexOutOfRange", "AllIndicesOutOfRange"];
    for name in names {
        let refusal = read(
            &formats().join(format!("gltf/IndexOutOfRange/{name}.gltf")),
            &Choice::default(),
        );
        let refusal = refusal.map(|_| ()).unwrap_err().to_string();
        assert!(refusal.contains("out of range"), "{refusal}");
    }
    let clips = read(&formats().join("gltf/Fox.glb"), &Choice::default())
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(
        ["Survey", "Walk", "Run"].iter().all(|name| clips.contains(name)),
        "{clips}"
    );
    for (name, meshes, clip, counts) in [
        ("gltf/Fox.glb", "", "Walk", [18, 290]),
        ("gltf/RobotExpressive.glb", "all", "Dance", [81, 1820]),
        ("gltf/AnimatedMorphCube/glTF/AnimatedMorphCube.gltf", "", "", [127, 8]),
        ("gltf/SimpleMorph/glTF/SimpleMorph.gltf", "", "", [97, 3]),
    ] {
        let named = |name: &str| (!name.is_empty()).then(|| name.to_string());
        let choice = Choice {
            meshes: named(meshes).into_iter().collect(),
            clip: named(clip),
            ..Choice::default()
        };
        let found = sequence(name, &choice);
        assert_eq!([found.shape_count(), found.vertex_count()], counts, "{name}");
    }
    // An avatar without a clip: its meshes and joints are listed, but nothing moves.
    let avatar = formats().join("vrm/cryptovoxels.vrm");
    let contents = read_contents(&avatar, &Choice::default()).unwrap();
    assert!(contents.meshes.iter().any(|mesh| mesh.joint_count > 0), "{contents:?}");
    let refusal = read(
        &avatar,
        &Choice {
            meshes: vec!["all".into()],
            ..Choice::default()
        },
    );
    assert!(matches!(refusal, Err(SequenceError::OneShapeOnly { .. })));
}

/// Truth in mesh space, put into the world by its own matrices (of rows).
fn in_world(mut truth: Array, to_world: &Array) -> Array {
    let (frames, width) = (truth.shape[0], truth.shape[1] * 3);
    for m in 0..frames {
        let t = &to_world.values[16 * m..16 * (m + 1)];
        for p in truth.values[m * width..(m + 1) * width].as_chunks_mut::<3>().0 {
            *p = core::array::from_fn(|c| p[0] * t[c] + p[1] * t[4 + c] + p[2] * t[8 + c] + t[12 + c]);
        }
    }
    truth
}

#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn usd_files() {
    let world = |mesh: &str| Choice {
        space: Space::World,
        ..local(&[mesh])
    };
    for (name, meshes) in [
        ("HIK_Export.usda", &["Fight_Dummy_Fight/Fight_Dummy_Mesh"][..]),
        (
            "lbs.usda",
            &["Root/Mesh", "Root/MeshWithFaceVaryingNormals", "Root/MeshWithNormals"],
        ),
        (
            "lbs.baked.usda",
            &["Root/Mesh", "Root/MeshWithFaceVaryingNormals", "Root/MeshWithNormals"],
        ),
        ("sphereAnimatedRadius.usda", &["pSphere1"]),
        (
            "CesiumMan.usdz",
            &["CesiumMan/Geom/Z_UP/Armature/Skeleton_torso_joint_1_3/Cesium_Man_2"],
        ),
    ] {
        let beside = formats().join(format!("usd/{}.truth.npz", name.replace(".baked", "")));
        for mesh in meshes {
            let key = mesh.replace('/', "__");
            let truth = Array::of_npz(&beside, &key);
            let found = sequence(&format!("usd/{name}"), &local(&[mesh]));
            assert_eq!(found.shape_count(), truth.shape[0], "{name}");
            assert_close(&format!("{name}, {mesh}"), error(&found, &truth, |m| m));
            let truth = in_world(truth, &Array::of_npz(&beside, &format!("{key}__localToWorld")));
            let found = sequence(&format!("usd/{name}"), &world(mesh));
            assert_close(&format!("{name}, {mesh}, in the world"), error(&found, &truth, |m| m));
        }
    }
    let man = sequence("usd/CesiumMan.usdz", &Choice::default());
    assert!(
        man.render.is_some() && man.dress.skin.is_some() && man.vertex_count() < 3273,
        "{}",
        man.vertex_count()
    );
}

/// Positions of an OBJ file's vertices.
#[cfg(feature = "fbx")]
fn obj(name: &str) -> Vec<[f64; 3]> {
    let text = fs::read_to_string(formats().join(name)).unwrap();
    let numbers = text.lines().filter_map(|line| line.strip_prefix("v "));
    let vector = |line: &str| {
        let mut words = line.split_whitespace().map(|word| word.parse().unwrap());
        core::array::from_fn(|_| words.next().unwrap())
    };
    numbers.map(vector).collect()
}

#[cfg(feature = "fbx")]
#[test]
#[ignore = "needs SINEW_DATA, a folder of real files"]
fn fbx_files() {
    let all = Choice {
        meshes: vec!["all".into()],
        ..Choice::default()
    };
    let truth_of = |name: &str| {
        let points = obj(name);
        Array {
            shape: vec![1, points.len(), 3],
            values: points.into_iter().flatten().collect(),
        }
    };
    let axes = sequence("fbx/maya_axes_anim_7700_ascii.fbx", &all);
    for frame in [0, 5, 8] {
        let truth = truth_of(&format!("fbx/maya_axes_anim_{frame}.obj"));
        // The third mesh is a skin with vertices whose weights sum to 0.998: Maya leaves that so, here as in ufbx it is made 1.
        for (what, vertices, most) in [
            ("caches, shapes, nodes", [0..58, 86..128], ERROR_MAX),
            ("skin", [58..86, 0..0], 4e-4),
        ] {
            let apart = |v: usize| {
                let (p, q) = (axes.shapes[frame][v], truth.frame(0)[v]);
                (0..3).map(|c| (f64::from(p[c]) - q[c]).powi(2)).sum::<f64>().sqrt()
            };
            let largest = vertices.into_iter().flatten().map(apart).fold(0.0, f64::max) / diagonal(truth.frame(0));
            println!(
                "maya_axes_anim_7700_ascii.fbx, frame {frame}, {what}: largest vertex error {largest:.1e} of the diagonal"
            );
            assert!(largest <= most, "{largest:e}");
        }
    }
    // The skin of one file, the clip of another; the truth is in metres and stands on its z axis, behind a T pose.
    let walk = Choice {
        clip: Some(formats().join("fbx/walk.fbx").to_string_lossy().into_owned()),
        ..Choice::default()
    };
    let man = sequence("fbx/arnaud.fbx", &walk);
    assert_eq!((man.shape_count(), man.fps), (41, Some(30.0)));
    let mut truth = npy(formats().join("../humanoid_pab/positions.npy"));
    let upright = |p: &mut [f64; 3]| *p = [100.0 * p[0], 100.0 * p[2], -100.0 * p[1]];
    truth.values.as_chunks_mut().0.iter_mut().for_each(upright);
    assert_close("arnaud.fbx by walk.fbx", error(&man, &truth, |m| m + 1));
    // Vertices of the truth are in another order, with four digits.
    let cache = sequence("pc2/max_cache_box_7500_binary.fbx", &all);
    for frame in [44, 48] {
        let truth = obj(&format!("pc2/max_cache_box_{frame}.obj"));
        let apart = |p: &[f32; 3], q: &[f64; 3]| (0..3).map(|c| (f64::from(p[c]) - q[c]).powi(2)).sum::<f64>().sqrt();
        let nearest = |p: &[f32; 3]| truth.iter().map(|q| apart(p, q)).fold(f64::MAX, f64::min);
        let largest = cache.shapes[frame].iter().map(nearest).fold(0.0, f64::max);
        assert_close(
            &format!("max_cache_box_7500_binary.fbx, frame {frame}"),
            largest / diagonal(&truth),
        );
    }
}
