//! `sinew frame`: one pose, played through the runtime, as a mesh file.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::interchange::{write_npy_vertices, write_obj, write_ply, write_textured_obj};
use sinew_formats::package::{AlignedBytes, PackageKind};
use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};
use sinew_trainer::bake::bake_bytes;

use super::console::Console;
use super::{Failure, check_output, load_package};

/// Arguments of `sinew frame`.
#[derive(Args)]
#[command(
    after_help = "Controls that are not named stay at rest (0). A value beyond a control's range is clamped to its stop, and \
said; `sinew inspect` lists names and ranges.

Examples:
  sinew frame walk.sinew --set c0=1.5 --set c0.2=-0.4 -o pose.obj
  sinew frame walk.sinew -o rest.ply"
)]
pub struct FrameArguments {
    /// Compact or baked package
    package: PathBuf,
    /// A control and its weight; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = parse_setting, allow_hyphen_values = true)]
    settings: Vec<(String, f32)>,
    /// Mesh to write: .obj (with texture coordinates where the package has some), .ply (with normals) or .npy (positions alone)
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
}

fn parse_setting(text: &str) -> Result<(String, f32), String> {
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` is not NAME=VALUE, for example c0=0.5"))?;
    let value: f32 = value.trim().parse().map_err(|_| format!("`{value}` is not a number"))?;
    if !value.is_finite() {
        return Err(format!("{name} must be a finite number, not {value}"));
    }
    Ok((name.trim().to_owned(), value))
}

/// The bytes of a baked package: the file's own, or baked here from a compact one.
pub fn load_baked(path: &Path) -> Result<AlignedBytes, Report> {
    let bytes = load_package(path)?;
    let refuse = || format!("{} is no usable package", path.display());
    match PackageKind::of(&bytes).into_diagnostic().wrap_err_with(refuse)? {
        PackageKind::Compact => bake_bytes(&bytes).into_diagnostic().wrap_err_with(refuse),
        _ => Ok(bytes),
    }
}

/// Runs `sinew frame`.
pub fn run(arguments: &FrameArguments, console: &Console) -> Result<(), Failure> {
    let extension = arguments
        .output
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or("")
        .to_ascii_lowercase();
    if !["obj", "ply", "npy"].contains(&extension.as_str()) {
        return Err(miette!(
            "{}: the file name must end in .obj, .ply or .npy, which says what is written",
            arguments.output.display()
        )
        .into());
    }
    check_output(&arguments.output)?;
    let baked = load_baked(&arguments.package)?;
    let basis = Basis::open(&baked)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} is no usable package", arguments.package.display()))?;
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).into_diagnostic()?;
    for (name, value) in &arguments.settings {
        let k = basis
            .component_named(name)
            .ok_or_else(|| unknown_control(&basis, name))?;
        let taken = controls
            .set(k, *value)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot set {name}"))?;
        if taken != *value {
            let range = basis.component(k);
            console.say(&format!(
                "note: {name}={value} was clamped to {taken}; its range is {} to {}",
                range.minimum, range.maximum
            ));
        }
    }
    let mut memory = vec![0_u8; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory).into_diagnostic()?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = vec![[0.0; 3]; basis.vertex_count()];
    Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    }
    .run(&mut workspace)
    .into_diagnostic()
    .wrap_err("the pose cannot be played")?;
    let written = match extension.as_str() {
        "obj" => {
            let (output, faces, render) = (&arguments.output, basis.faces(), basis.render_mesh());
            if render.vertices.is_empty() {
                write_obj(output, &positions, faces)
            } else {
                write_textured_obj(output, &positions, faces, render.uvs, render.faces)
            }
        }
        "ply" => write_ply(&arguments.output, &positions, basis.faces(), Some(&normals), None),
        _ => write_npy_vertices(&arguments.output, &positions),
    };
    written.into_diagnostic()?;
    console.say(&format!("{}: {} vertices", arguments.output.display(), positions.len()));
    Ok(())
}

fn unknown_control(basis: &Basis<'_>, name: &str) -> Report {
    const SHOWN: usize = 12;
    let names: Vec<&str> = basis.components().map(|component| component.name).collect();
    let shown = names.iter().take(SHOWN).copied().collect::<Vec<_>>().join(", ");
    let more = if names.len() > SHOWN {
        format!(", and {} more: see `sinew inspect`", names.len() - SHOWN)
    } else {
        String::new()
    };
    miette!(
        help = format!("it has {shown}{more}"),
        "the package has no control `{name}`"
    )
}
