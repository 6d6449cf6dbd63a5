//! The `sinew` command as its user meets it: what it writes, what it refuses, with which words and which exit code.

mod common;

use std::path::Path;

use common::{SMALL, path, refused, run, sinew};

#[test]
fn the_chain_from_shapes_to_a_pose() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    run(&[
        "synthesize",
        "bar",
        "-o",
        &at("bar"),
        "--frames",
        "12",
        "--vertices",
        "150",
        "--layout",
        "obj",
        "-q",
    ]);
    std::fs::write(at("small.toml"), SMALL).expect("a file in the temporary folder");
    let (config, model) = (at("small.toml"), at("bar.sinew"));
    run(&[
        "train",
        &at("bar"),
        "-o",
        &model,
        "--train-every",
        "3",
        "--config",
        &config,
        "-q",
    ]);
    assert!(
        !Path::new(&at("bar.sinew.training")).exists(),
        "a finished run leaves nothing behind"
    );

    let json: serde_json::Value = serde_json::from_str(&run(&["inspect", &model, "--json"])).expect("JSON");
    let components = json["components"].as_array().expect("a list");
    assert!(!components.is_empty());
    let names: Vec<&str> = components.iter().filter_map(|c| c["name"].as_str()).collect();
    assert!(names.contains(&"c0"), "{names:?}");
    let labels: Vec<&str> = components.iter().filter_map(|c| c["label"].as_str()).collect();
    assert!(labels.len() == names.len() && json["mirror_plane"]["share"].is_number() && json["duplicates"].is_array());
    let kept = run(&["inspect", &model, "--config"]);
    assert!(kept.contains("per_step = 4"), "{kept}");

    let saved = at("saved");
    let json = run(&["evaluate", &model, &at("bar"), "--json", "--save", &saved]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["shapes"], 8);
    // Every second shape but the first: shapes 3 and 9 were trained on.
    refused(
        &["evaluate", &model, &at("bar"), "--train-every", "2", "-q"],
        &["2 of the shapes", "were trained on, shape 3", "leave --train-every out"],
    );
    for key in ["encoder", "feature_projection", "position_projection", "round_trip"] {
        for figure in ["e_rms", "sted", "sted_s", "sted_t"] {
            assert!(
                json[key][figure].as_f64().is_some_and(|x| x.is_finite() && x >= 0.0),
                "{key}.{figure}: {json}"
            );
        }
    }
    assert!(json["max_percentage_error"]["two_level"].is_number() && json["components"]["coarse"].is_number());
    for name in ["truth", "faces", "encoder", "feature_projection", "position_projection"] {
        assert!(
            folder.path().join("saved").join(format!("{name}.npy")).exists(),
            "{name}"
        );
    }

    // Weights of all shapes, and of those the encoder is the quickest way.
    for (name, fit) in [
        ("weights.csv", "encoder"),
        ("weights.npy", "features"),
        ("best.csv", "positions"),
    ] {
        run(&["encode", &model, &at("bar"), "-o", &at(name), "--fit", fit, "-q"]);
    }
    let table = std::fs::read_to_string(at("weights.csv")).expect("the weights were written");
    let lines: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        (lines.len(), lines[0].len()),
        (13, 1 + names.len()),
        "a line of names, a line a shape"
    );
    assert_eq!(lines[0][1..], names[..]);
    let weight = |line: &[&str]| {
        line[1..]
            .iter()
            .map(|x| x.parse::<f64>().expect("a number").abs())
            .sum::<f64>()
    };
    assert!(
        weight(&lines[1]) < 1e-3 && weight(&lines[4]) > 0.1,
        "the reference is at rest, others are not"
    );
    assert_eq!(
        std::fs::metadata(at("weights.npy")).expect("written").len(),
        128 + 12 * 4 * names.len() as u64
    );
    refused(
        &["encode", &model, &at("bar"), "-o", &at("weights.txt")],
        &[".csv", ".npy"],
    );

    // A pose from the compact and from the baked package is the same pose.
    let baked = at("bar.baked.sinew");
    run(&["bake", &model, "-o", &baked, "-q"]);
    run(&["frame", &model, "--set", "c0=0.1", "-o", &at("a.obj"), "-q"]);
    run(&["frame", &baked, "--set", "c0=0.1", "-o", &at("b.obj"), "-q"]);
    let read = |name: &str| std::fs::read(at(name)).expect("the pose was written");
    assert_eq!(read("a.obj"), read("b.obj"));
    run(&["frame", &model, "-o", &at("rest.ply"), "-q"]);
    // Names are the user's; the movement stays.
    let named = at("named.sinew");
    run(&["rename", &model, "c0=main-swing", "-o", &named, "-q"]);
    run(&["frame", &named, "--set", "main-swing=0.1", "-o", &at("c.obj"), "-q"]);
    assert_eq!(read("a.obj"), read("c.obj"));
    run(&["rename", &named, "--labels", "--up", "z", "--front", "-x", "-q"]);
    let table = run(&["inspect", &named, "--up", "z", "--front", "-x"]);
    assert!(table.contains("main-swing (c0)") && table.contains("(c1)"), "{table}");
    refused(&["rename", &model, "c0=c1", "-q"], &["c0", "c1"]);
    refused(&["rename", &model, "nose=jaw", "-q"], &["nose", "inspect"]);
    refused(&["rename", &model], &["nothing to rename"]);
    refused(&["rename", &baked, "c0=jaw"], &["compact"]);
    refused(&["inspect", &model, "--up", "x", "--front", "x"], &["axis"]);
    // Far beyond its stop: clamped, and said.
    let output = sinew(&["frame", &model, "--set", "c0=1000", "-o", &at("far.npy")]);
    assert!(output.status.success() && String::from_utf8_lossy(&output.stderr).contains("clamped"));

    refused(&["frame", &model, "--set", "c0=nan", "-o", &at("nan.obj")], &["finite"]);
    refused(
        &["frame", &model, "--set", "nose=1", "-o", &at("nose.obj")],
        &["nose", "c0"],
    );
    refused(&["frame", &model, "-o", &at("pose.stl")], &[".obj"]);
    // What was encoded is played again, into a cache of another program; a frame of it is that pose.
    run(&[
        "frame",
        &baked,
        "--weights",
        &at("weights.csv"),
        "--fps",
        "30",
        "-o",
        &at("played.abc"),
        "-q",
    ]);
    run(&["encode", &model, &at("bar"), "-o", &at("same.npy"), "-q"]);
    run(&[
        "frame",
        &model,
        "--weights",
        &at("same.npy"),
        "-o",
        &at("again.abc"),
        "-q",
    ]);
    run(&["convert", &at("played.abc"), &at("played"), "-q"]);
    run(&["convert", &at("again.abc"), &at("again"), "-q"]);
    let frames = |name: &str| -> Vec<Vec<u8>> {
        let folder = std::fs::read_dir(at(name)).expect("a folder of frames");
        let mut paths: Vec<_> = folder.map(|entry| entry.expect("a frame").path()).collect();
        paths.sort();
        paths.iter().map(|path| std::fs::read(path).expect("a frame")).collect()
    };
    assert!(frames("played").len() == 12 && frames("played") == frames("again"));
    std::fs::write(at("wrong.csv"), "c0,nose\n0,0\n").expect("written");
    refused(
        &["frame", &model, "--weights", &at("wrong.csv"), "-o", &at("wrong.abc")],
        &["nose", "c0"],
    );
    assert!(!folder.path().join("wrong.abc").exists());
    refused(&["frame", &model, "-o", &at("missing/pose.obj")], &["missing"]);
    refused(&["bake", &baked, "-o", &at("again.sinew")], &["baked already"]);
    refused(&["evaluate", &baked, &at("bar")], &["compact"]);
    for name in ["nan.obj", "nose.obj", "pose.stl", "again.sinew"] {
        assert!(!folder.path().join(name).exists(), "{name} was written all the same");
    }
    let mut bytes = read("bar.sinew");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(at("flipped.sinew"), &bytes).expect("a file in the temporary folder");
    refused(&["inspect", &at("flipped.sinew")], &["flipped.sinew"]);
    std::fs::write(at("cut.sinew"), &bytes[..middle]).expect("a file in the temporary folder");
    refused(&["inspect", &at("cut.sinew")], &["cut.sinew"]);
}

#[test]
fn input_that_cannot_be_used_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    let out = at("model.sinew");
    let write = |name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().expect("a folder")).expect("a folder in the temporary folder");
        std::fs::write(file, text).expect("a file in the temporary folder");
    };
    const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::create_dir(at("empty")).expect("a folder");
    refused(&["train", &at("empty"), "-o", &out], &["empty"]);
    refused(&["train", &at("nowhere"), "-o", &out], &["nowhere"]);
    write("one/a.obj", CUBE);
    refused(&["train", &at("one"), "-o", &out], &["one"]);
    write("nan/a.obj", CUBE);
    write("nan/b.obj", &CUBE.replace("v 1 0 0", "v nan 0 0"));
    refused(&["train", &at("nan"), "-o", &out], &["b.obj", "2"]);
    write("faces/a.obj", CUBE);
    write("faces/b.obj", &CUBE.replace("f 2 3 4", "f 2 4 3"));
    refused(&["train", &at("faces"), "-o", &out], &["b.obj"]);
    write(
        "flat/a.obj",
        &CUBE
            .replace("v 1 0 0", "v 0 0 0")
            .replace("v 0 1 0", "v 0 0 0")
            .replace("v 0 0 1", "v 0 0 0"),
    );
    write("flat/b.obj", CUBE);
    refused(&["train", &at("flat"), "-o", &out], &["a.obj"]);
    write("good/a.obj", CUBE);
    write("good/b.obj", &CUBE.replace("v 1 0 0", "v 1.2 0 0"));
    refused(
        &["train", &at("good"), "-o", &at("no/such/folder/model.sinew")],
        &["folder"],
    );
    refused(
        &["train", &at("good"), "-o", &out, "--components", "0"],
        &["components"],
    );
    refused(&["train", &at("good"), "-o", &out, "--time-budget", "soon"], &["soon"]);
    write("bad.toml", "seed = 1\n[fit]\nspeed = 3\n");
    refused(
        &["train", &at("good"), "-o", &out, "--config", &at("bad.toml")],
        &["bad.toml", "speed"],
    );
    write("list.txt", "0\n1 # both\n7\n");
    refused(
        &["train", &at("good"), "-o", &out, "--train-list", &at("list.txt")],
        &["list.txt:3", "7"],
    );
    refused(&["synthesize", "flag", "-o", &at("good")], &["not empty"]);
    refused(&["synthesize", "flag", "-o", &at("tiny"), "--vertices", "3"], &["3"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn both_recipes_train_and_are_kept_in_the_package() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    run(&[
        "synthesize",
        "bar",
        "-o",
        &at("bar"),
        "--frames",
        "9",
        "--vertices",
        "120",
        "-q",
    ]);
    let (bar, model) = (at("bar"), at("paper.sinew"));
    let paper = ["--recipe", "paper", "--epochs", "7", "--components", "3,2", "-q"];
    let mut arguments = vec!["train", &bar, "-o", &model, "--train-every", "3"];
    arguments.extend(paper);
    run(&arguments);
    let kept = run(&["inspect", &model, "--config"]);
    for line in [
        "steps = 7",
        "kind = \"random\"",
        "per_step = 0",
        "block_weight = 1.0",
        "unit_rows = false",
    ] {
        assert!(kept.contains(line), "`{line}` is not in: {kept}");
    }
    let json: serde_json::Value = serde_json::from_str(&run(&["evaluate", &model, &bar, "--json"])).expect("JSON");
    assert!(json["encoder"]["e_rms"].is_number(), "{json}");
    refused(
        &["train", &bar, "-o", &at("no.sinew"), "--recipe", "theirs"],
        &["theirs", "local", "paper"],
    );
    refused(
        &[
            "train",
            &bar,
            "-o",
            &at("no.sinew"),
            "--recipe",
            "paper",
            "--epochs",
            "0",
        ],
        &["fit.steps", "random start"],
    );
}

#[test]
fn sequences_are_converted_listed_and_chosen_from() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| path(folder.path(), name);
    let (bar, model) = (at("bar"), at("bar.sinew"));
    run(&[
        "synthesize",
        "bar",
        "-o",
        &bar,
        "--frames",
        "9",
        "--vertices",
        "120",
        "-q",
    ]);
    for name in ["a.abc", "a.glb", "shapes", "a.pc2", "a.mdd"] {
        run(&["convert", &bar, &at(name), "-q"]);
    }
    run(&["convert", &at("a.abc"), &at("rest.obj"), "--frames", "0..0", "-q"]);
    let listed = |arguments: &[&str]| -> serde_json::Value { serde_json::from_str(&run(arguments)).expect("JSON") };
    let json = listed(&["inspect", &at("a.glb"), "--json"]);
    assert_eq!((&json["kind"], &json["format"]), (&"sequence".into(), &"glTF".into()));
    assert_eq!(json["clips"][0]["frames"], 9);
    assert_eq!(json["meshes"][0]["motion"], "deforms");
    let json = listed(&["inspect", &at("a.pc2"), "--surface", &at("rest.obj"), "--json"]);
    assert_eq!(json["clips"][0]["frames"], 9);
    let table = run(&["inspect", &at("a.abc")]);
    assert!(
        table.contains("Alembic") && table.contains("deforms") && table.contains("24"),
        "{table}"
    );
    assert!(run(&["inspect", &at("rest.obj")]).contains("nothing moves"));

    // Whatever lies between, the same frames come back.
    let read = |name: &str| std::fs::read(at(name)).expect("the file was written");
    run(&[
        "convert",
        &at("a.mdd"),
        &at("b.npy"),
        "--surface",
        &at("rest.obj"),
        "-q",
    ]);
    assert!(read("b.npy") == read("bar/positions.npy") && read("faces.npy") == read("bar/faces.npy"));
    run(&[
        "convert",
        &at("a.abc"),
        &at("few.npy"),
        "--frames",
        "1..7:3",
        "--pose",
        "8",
        "-q",
    ]);
    assert!(String::from_utf8_lossy(&read("few.npy")).contains("(4, "));
    run(&["convert", &at("a.abc"), &at("many.npy"), "--fps", "48", "-q"]);
    assert!(String::from_utf8_lossy(&read("many.npy")).contains("(17, "));

    std::fs::write(at("small.toml"), SMALL).expect("a file in the temporary folder");
    let small = at("small.toml");
    run(&[
        "train",
        &at("a.glb"),
        "-o",
        &model,
        "--frames",
        "..7",
        "--train-every",
        "3",
        "--config",
        &small,
        "-q",
    ]);
    let json = listed(&["inspect", &model, "--json"]);
    assert_eq!(json["provenance"]["shapes"], 8);
    let json = listed(&["evaluate", &model, &at("a.abc"), "--frames", "0..7", "--json"]);
    assert_eq!(json["shapes"], 5);

    refused(
        &["train", &at("rest.obj"), "-o", &at("no.sinew")],
        &["rest.obj", "one shape"],
    );
    refused(&["convert", &at("a.abc"), &at("b.blend")], &["b.blend", ".abc"]);
    refused(&["convert", &at("a.abc"), &at("a.abc")], &["a.abc", "at once"]);
    refused(
        &["convert", &at("a.abc"), &at("b.abc"), "--clip", "run"],
        &["run", "a.abc"],
    );
    refused(
        &["convert", &at("a.abc"), &at("b.abc"), "--mesh", "nose"],
        &["nose", "--mesh"],
    );
    refused(
        &["convert", &at("a.abc"), &at("b.abc"), "--frames", "3..20"],
        &["20", "9 frames"],
    );
    refused(
        &["convert", &at("a.abc"), &at("b.abc"), "--frames", "3-4"],
        &["FROM..TO"],
    );
    refused(
        &[
            "convert",
            &at("a.pc2"),
            &at("b.abc"),
            "--fps",
            "24",
            "--surface",
            &at("rest.obj"),
        ],
        &["--fps"],
    );
    refused(&["inspect", &at("a.abc"), "--config"], &["--config"]);
    refused(&["inspect", &model, "--surface", &at("rest.obj")], &["--surface"]);
    assert!(!Path::new(&at("b.abc")).exists());
}
