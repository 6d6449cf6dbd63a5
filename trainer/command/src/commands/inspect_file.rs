//! `sinew inspect FILE` where the file is another program's: what it holds, to choose from.

use core::fmt::Write as _;
use std::path::Path;

use miette::{IntoDiagnostic, Report};
use serde_json::json;
use sinew_interchange::{Choice, ClipEntry, Contents, Format, MeshEntry, Motion, read_contents};

/// Whether a path is a sequence rather than a package, by its ending, or because it is a folder.
pub fn is_sequence(path: &Path) -> bool {
    path.is_dir() || Format::of_path(path).is_some()
}

/// What a file holds, as a table or as JSON.
pub fn describe(path: &Path, choice: &Choice, as_json: bool) -> Result<String, Report> {
    let contents = read_contents(path, choice).into_diagnostic()?;
    if as_json {
        return Ok(format!("{:#}\n", as_value(&contents)));
    }
    let mut out = String::new();
    print(&mut out, path, &contents);
    Ok(out)
}

fn range(clip: &ClipEntry) -> Option<(f64, f64)> {
    clip.times
        .first()
        .copied()
        .zip(clip.times.last().copied())
        .filter(|_| clip.is_timed)
}

fn motion_word(motion: Motion) -> &'static str {
    match motion {
        Motion::Still => "still",
        Motion::Whole => "whole",
        Motion::Deforms => "deforms",
    }
}

fn as_value(contents: &Contents) -> serde_json::Value {
    let mesh = |mesh: &MeshEntry| {
        json!({
            "name": mesh.name, "vertices": mesh.vertex_count, "faces": mesh.face_count, "joints": mesh.joint_count,
            "morph_targets": mesh.morphs, "motion": motion_word(mesh.motion),
        })
    };
    let clip = |clip: &ClipEntry| {
        let (from, to) = range(clip).unzip();
        json!({ "name": clip.name, "frames": clip.times.len(), "from_seconds": from, "to_seconds": to, "fps": clip.fps })
    };
    let others: serde_json::Map<_, _> = contents
        .others
        .iter()
        .map(|(kind, count)| (kind.clone(), json!(count)))
        .collect();
    json!({
        "kind": "sequence",
        "format": contents.format,
        "unit_metres": contents.unit_metres,
        "up": contents.up.map(|up| up.to_string()),
        "meshes": contents.meshes.iter().map(mesh).collect::<Vec<_>>(),
        "clips": contents.clips.iter().map(clip).collect::<Vec<_>>(),
        "others": others,
        "notices": contents.notices.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn print(out: &mut String, path: &Path, contents: &Contents) {
    let unit = match contents.unit_metres {
        Some(metres) => format!("1 unit is {metres} m"),
        None => "length of a unit not stated".into(),
    };
    let up = match contents.up {
        Some(up) => format!("{up} points up"),
        None => "which axis points up not stated".into(),
    };
    let _ = writeln!(out, "{}: {}; {unit}; {up}", path.display(), contents.format);
    for notice in &contents.notices {
        let _ = writeln!(out, "  note: {notice}");
    }
    for (kind, count) in &contents.others {
        let _ = writeln!(out, "  besides: {count} {kind}");
    }
    let width = |names: &mut dyn Iterator<Item = &String>| names.map(|name| name.chars().count()).fold(8, usize::max);
    let wide = width(&mut contents.meshes.iter().map(|mesh| &mesh.name));
    let _ = writeln!(
        out,
        "\n{:<wide$} {:>9} {:>9} {:>7} {:>7}  motion",
        "mesh", "vertices", "faces", "joints", "morphs"
    );
    for mesh in &contents.meshes {
        let _ = writeln!(
            out,
            "{:<wide$} {:>9} {:>9} {:>7} {:>7}  {}",
            mesh.name,
            mesh.vertex_count,
            mesh.face_count,
            mesh.joint_count,
            mesh.morphs.len(),
            mesh.motion
        );
    }
    if contents.clips.is_empty() {
        let _ = writeln!(out, "\nno clip: nothing moves");
        return;
    }
    let wide = width(&mut contents.clips.iter().map(|clip| &clip.name));
    let _ = writeln!(
        out,
        "\n{:<wide$} {:>7} {:>20} {:>8}",
        "clip", "frames", "seconds", "fps"
    );
    for clip in &contents.clips {
        let seconds = range(clip).map_or_else(|| "-".into(), |(from, to)| format!("{from:.3} .. {to:.3}"));
        let fps = clip.fps.map_or_else(|| "-".into(), |fps| fps.to_string());
        let _ = writeln!(
            out,
            "{:<wide$} {:>7} {seconds:>20} {fps:>8}",
            clip.name,
            clip.times.len()
        );
    }
}
