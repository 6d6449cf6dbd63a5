//! `sinew convert`: a sequence from one program's format to another's, frame by frame, so that it need not fit into memory.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_interchange::{DEFAULT_FPS, Format, OpenSequence, OutputSurface, create_writer, format_table};
use sinew_trainer::learn::Reporter;

use sinew_command::choice::ChoiceArguments;
use sinew_command::console::Console;
use sinew_command::inputs::Failure;

/// Arguments of `sinew convert`.
#[derive(Args)]
#[command(
    after_help = formats_help(),
    after_long_help = formats_help(),
)]
pub struct ConvertArguments {
    /// Folder of meshes or arrays, or a file with a moving mesh
    input: PathBuf,
    /// File or folder to write; its ending says the format, without one it is a folder of OBJ files
    output: PathBuf,
    #[command(flatten)]
    choice: ChoiceArguments,
    /// Keep vertices apart that the file splits along seams of texture and normals, instead of welding them
    #[arg(long)]
    keep_split: bool,
}

fn formats_help() -> String {
    format!(
        "Formats by the endings of names:\n{}\n\
Polygons are written as triangles. What a format can hold of texture coordinates, materials, colours and skin is written too. A cache \
(pc2, mdd, npy) holds points alone: the mesh for it is one frame of the same sequence, for example\n  \
sinew convert walk.abc walk.obj --frames 0..0\n\n\
Examples:\n  \
sinew convert robot.glb dance.abc --mesh all --clip Dance\n  \
sinew convert walk.abc walk.pc2 --frames 0..99:2\n  \
sinew convert shapes/ shapes.usda",
        format_table()
    )
}

/// Runs `sinew convert`.
pub fn run(arguments: &ConvertArguments, console: &Console) -> Result<(), Failure> {
    let mut choice = arguments.choice.choice();
    choice.keep_split = arguments.keep_split;
    let refuse = || format!("cannot use {} as a sequence", arguments.input.display());
    let mut sequence = OpenSequence::open(&arguments.input, &choice)
        .into_diagnostic()
        .wrap_err_with(refuse)?;
    for notice in sequence.notices() {
        console.say(&format!("note: {notice}"));
    }
    if is_same(arguments) {
        return Err(miette!("{} is read and cannot be written at once", arguments.input.display()).into());
    }
    let name = sequence.name();
    let name = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
    let dress = sequence.dress().clone();
    let (faces, render) = (sequence.faces().to_vec(), sequence.render().cloned());
    let frame_count = sequence.frame_count();
    let surface = OutputSurface {
        render: render.as_ref(),
        dress: &dress,
        keep_split: arguments.keep_split,
        fps: sequence.fps().unwrap_or(DEFAULT_FPS),
        unit_metres: sequence.contents().unit_metres,
        up: sequence.contents().up,
        frame_count: Some(frame_count),
        ..OutputSurface::bare(name, sequence.vertex_count(), &faces)
    };
    say_assumed(&surface, arguments, console);
    let mut writer = create_writer(&arguments.output, &surface).into_diagnostic()?;
    console.catch_interrupts();
    console.stage("writing frames", frame_count as u64);
    let mut positions = vec![[0.0; 3]; sequence.vertex_count()];
    for frame in 0..frame_count {
        if console.stop_requested() {
            console.finish();
            return Err(Failure::Stopped(format!(
                "stopped before frame {frame}; of a folder or a series of files those before it are kept, of one file nothing"
            )));
        }
        sequence
            .frame(frame, &mut positions)
            .into_diagnostic()
            .wrap_err_with(refuse)?;
        writer.frame(&positions).into_diagnostic()?;
        console.advance(frame as u64 + 1, "");
    }
    writer.finish().into_diagnostic()?;
    console.finish();
    console.say(&format!(
        "{}: {frame_count} frames of {} vertices and {} triangles, {} frames a second",
        arguments.output.display(),
        positions.len(),
        faces.len(),
        surface.fps
    ));
    Ok(())
}

/// Says what is taken for granted where a format must state what the source does not.
fn say_assumed(surface: &OutputSurface<'_>, arguments: &ConvertArguments, console: &Console) {
    let format = Format::of_path(&arguments.output).map_or("", |format| format.name);
    if !["glTF", "USD"].contains(&format) {
        return;
    }
    if surface.unit_metres.is_none() {
        console.say(&format!(
            "note: the source states no unit; {format} is written with 1 unit as 1 m"
        ));
    }
    if surface.up.is_none() {
        console.say(&format!(
            "note: the source states no axis that points up; {format} is written with y up"
        ));
    }
}

/// Whether a file would be written over itself.
fn is_same(arguments: &ConvertArguments) -> bool {
    let real = |path: &PathBuf| std::fs::canonicalize(path).ok();
    real(&arguments.input).is_some_and(|input| real(&arguments.output) == Some(input))
}
