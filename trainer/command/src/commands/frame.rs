//! `sinew frame`: a pose, or poses over time, played through the runtime into any format that is written.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::{AlignedBytes, PackageKind};
use sinew_interchange::{DEFAULT_FPS, OutputSurface, create_writer, write_npy_vertices, write_obj, write_ply};
use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};
use sinew_trainer::bake::bake_bytes;
use sinew_trainer::learn::Reporter;

use sinew_command::console::Console;
use sinew_command::inputs::{Failure, check_output, load_package};
use sinew_command::weight_table::read_weights;

/// Arguments of `sinew frame`.
#[derive(Args)]
#[command(
    after_help = "Controls that are not named stay at rest (0). A value beyond a control's range is clamped to its stop, and \
said; `sinew inspect` lists names and ranges. Weights of a table are played as they stand there.

Examples:
  sinew frame walk.sinew --set c0=1.5 --set c0.2=-0.4 -o pose.obj
  sinew frame walk.sinew -o rest.ply
  sinew encode walk.sinew other-walk.abc -o weights.csv
  sinew frame walk.sinew --weights weights.csv -o played.abc"
)]
pub struct FrameArguments {
    /// Compact or baked package
    package: PathBuf,
    /// A control and its weight; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = parse_setting, allow_hyphen_values = true)]
    settings: Vec<(String, f32)>,
    /// Poses over time: a table of weights, a row a frame, as `sinew encode` writes (.csv or .npy); --set then holds for all of them
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Frames a second of poses over time, where the format holds them
    #[arg(long, value_name = "RATE", default_value_t = DEFAULT_FPS, value_parser = super::parse_rate)]
    fps: f64,
    /// File to write: a pose as .obj (with texture coordinates where the package has some), .ply (with normals) or .npy (positions
    /// alone); poses over time, or one, in every format that `sinew convert` writes, without an ending a folder of OBJ files
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
    let fixed: Vec<(usize, f32)> = arguments
        .settings
        .iter()
        .filter_map(|(name, _)| basis.component_named(name))
        .map(|k| (k, controls.weights()[k]))
        .collect();
    let names: Vec<&str> = basis.components().map(|component| component.name).collect();
    let rows = match &arguments.weights {
        Some(path) => Some(read_weights(path, &names)?),
        None => None,
    };
    let mut memory = vec![0_u8; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory).into_diagnostic()?;
    let faces = basis.faces().to_vec();
    let render = super::render_surface(&basis);
    let stem = arguments.package.file_stem().and_then(|stem| stem.to_str());
    let surface = OutputSurface {
        render: render.as_ref(),
        fps: arguments.fps,
        frame_count: Some(rows.as_ref().map_or(1, Vec::len)),
        ..OutputSurface::bare(stem.unwrap_or("pose"), basis.vertex_count(), &faces)
    };
    let Some(rows) = rows else {
        return write_pose(arguments, console, &basis, &controls, &mut workspace, &surface);
    };
    let mut writer = create_writer(&arguments.output, &surface).into_diagnostic()?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    console.catch_interrupts();
    console.stage("playing", rows.len() as u64);
    for (n, row) in rows.iter().enumerate() {
        if console.stop_requested() {
            console.finish();
            return Err(Failure::Stopped(format!(
                "stopped before frame {n}; of a folder or a series of files those before it are kept, of one file nothing"
            )));
        }
        for (k, &weight) in row.iter().enumerate() {
            controls.set_unclamped(k, weight).into_diagnostic()?;
        }
        for &(k, weight) in &fixed {
            controls.set_unclamped(k, weight).into_diagnostic()?;
        }
        Frame {
            basis: &basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        }
        .run(&mut workspace)
        .into_diagnostic()
        .wrap_err_with(|| format!("frame {n} cannot be played"))?;
        writer.frame(&positions).into_diagnostic()?;
        console.advance(n as u64 + 1, "");
    }
    writer.finish().into_diagnostic()?;
    console.finish();
    console.say(&format!(
        "{}: {} frames of {} vertices",
        arguments.output.display(),
        rows.len(),
        positions.len()
    ));
    Ok(())
}

/// One pose, with what its format can hold of it.
fn write_pose(
    arguments: &FrameArguments,
    console: &Console,
    basis: &Basis<'_>,
    controls: &Controls<'_>,
    workspace: &mut Workspace<'_>,
    surface: &OutputSurface<'_>,
) -> Result<(), Failure> {
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = vec![[0.0; 3]; basis.vertex_count()];
    Frame {
        basis,
        controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    }
    .run(workspace)
    .into_diagnostic()
    .wrap_err("the pose cannot be played")?;
    let extension = arguments
        .output
        .extension()
        .and_then(|text| text.to_str())
        .unwrap_or("");
    match extension.to_ascii_lowercase().as_str() {
        "obj" => write_obj(&arguments.output, &positions, surface).into_diagnostic()?,
        "ply" => write_ply(&arguments.output, &positions, Some(&normals), surface).into_diagnostic()?,
        "npy" => write_npy_vertices(&arguments.output, &positions).into_diagnostic()?,
        _ => {
            let mut writer = create_writer(&arguments.output, surface).into_diagnostic()?;
            writer.frame(&positions).into_diagnostic()?;
            writer.finish().into_diagnostic()?;
        }
    }
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
