//! `sinew synthesize`: sequences to try things on.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_interchange::{write_sequence_npy, write_sequence_obj};
use sinew_trainer::synthesize::{Settings, Subject};

use sinew_command::console::Console;
use sinew_command::inputs::Failure;

/// What can be synthesized.
#[derive(Clone, Copy, ValueEnum)]
enum SubjectName {
    /// Cloth in gusty wind, pinned along one edge
    Flag,
    /// A closed bar that bends and twists
    Bar,
    /// A four-legged creature that walks
    Creature,
}

/// How shapes are written.
#[derive(Clone, Copy, ValueEnum)]
enum Layout {
    /// positions.npy and faces.npy
    Npy,
    /// One OBJ file a shape
    Obj,
}

/// Arguments of `sinew synthesize`.
#[derive(Args)]
#[command(after_help = "Examples:
  sinew synthesize creature -o walk
  sinew synthesize flag -o flag --frames 200 --vertices 4000 --layout obj")]
pub struct SynthesizeArguments {
    /// What to make
    subject: SubjectName,
    /// Folder to write; must be empty or not exist
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Shapes, the rest pose included [default: 60]
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// Vertices, about [default: flag 1600, bar 1200, creature 2500]
    #[arg(long, value_name = "V")]
    vertices: Option<usize>,
    /// Seed of wind, gestures and gait
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Files to write
    #[arg(long, value_enum, default_value_t = Layout::Npy)]
    layout: Layout,
}

/// Runs `sinew synthesize`.
pub fn run(arguments: &SynthesizeArguments, console: &Console) -> Result<(), Failure> {
    let subject = match arguments.subject {
        SubjectName::Flag => Subject::Flag,
        SubjectName::Bar => Subject::Bar,
        SubjectName::Creature => Subject::Creature,
    };
    let defaults = subject.default_settings();
    let settings = Settings {
        frames: arguments.frames.unwrap_or(defaults.frames),
        vertices: arguments.vertices.unwrap_or(defaults.vertices),
        seed: arguments.seed,
    };
    let folder = &arguments.output;
    if std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(miette!(
            "{} is not empty: name a new folder, so that nothing is mixed up",
            folder.display()
        )
        .into());
    }
    let sequence = subject.synthesize(&settings).into_diagnostic()?;
    let written = match arguments.layout {
        Layout::Npy => write_sequence_npy(folder, &sequence),
        Layout::Obj => write_sequence_obj(folder, &sequence),
    };
    written
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", folder.display()))?;
    console.say(&format!(
        "{}: {} shapes of {} vertices and {} faces",
        folder.display(),
        sequence.shape_count(),
        sequence.vertex_count(),
        sequence.faces.len()
    ));
    console.say(&format!(
        "next: sinew train {} -o {}.sinew --train-every 10",
        folder.display(),
        subject.name()
    ));
    Ok(())
}
