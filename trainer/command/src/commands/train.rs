//! `sinew train`: a folder of meshes in, one compact package out.

use core::time::Duration;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::save_package;
use sinew_trainer::components::kept::KeptComponent;
use sinew_trainer::components::painted::{PaintedRegion, VerticesError};
use sinew_trainer::learn::{LearnError, RunOptions, learn};

use sinew_command::choice::ChoiceArguments;
use sinew_command::console::Console;
use sinew_command::inputs::{
    Failure, RecipeName, check_output, chosen_shapes, load_sequence, parse_duration, read_config,
};

/// Arguments of `sinew train`.
#[derive(Args)]
#[command(
    after_help = "Stopping with Ctrl-C keeps the run beside the output, in OUTPUT.training: the same command with --resume goes on \
where it stopped, and ends with the same package as if it had never been stopped.

Examples:
  sinew train scans/ -o face.sinew
  sinew train walk/ -o walk.sinew --train-every 10 --time-budget 5m
  sinew train robot.glb -o robot.sinew --mesh all --clip Dance --frames 0..79:2
  sinew train flag/ -o flag.sinew --components 6,4,3
  sinew train face/ -o face.sinew --paint left-brow.txt --paint right-brow.txt
  sinew train face/ -o face2.sinew --components 12,5 --keep face.sinew:c3=smile
  sinew train walk/ -o paper.sinew --train-every 10 --recipe paper --time-budget 1h"
)]
pub struct TrainArguments {
    /// Folder of meshes or arrays, or a file with a moving mesh (see `sinew convert --help`)
    sequence: PathBuf,
    /// Package to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Train on every Nth shape, the first included; the others are left for `sinew evaluate`
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    train_every: u32,
    /// Train on the shapes whose numbers, from 0, this text file lists
    #[arg(long, value_name = "FILE", conflicts_with = "train_every")]
    train_list: Option<PathBuf>,
    /// Components of each level, coarse to fine: 10,5 makes 10 coarse ones with 5 fine ones under each [default: 10,5]
    #[arg(long, value_name = "K[,K...]", value_delimiter = ',')]
    components: Option<Vec<usize>>,
    /// Text file with the numbers of vertices, from 0 (`3 10-25`, in any lines): a coarse component of the file's name lives
    /// there, and its fine ones below it; may be repeated
    #[arg(long, value_name = "FILE")]
    paint: Vec<PathBuf>,
    /// Keep a component of an older package of the same mesh as it is, as a coarse one: OLD.sinew:left-brow, or under another name,
    /// OLD.sinew:c3=left-brow; may be repeated
    #[arg(long, value_name = "FILE:COMPONENT[=NAME]")]
    keep: Vec<KeptComponent>,
    /// Way to train; --config changes what its file names
    #[arg(long, value_enum, value_name = "NAME", default_value_t = RecipeName::Local)]
    recipe: RecipeName,
    /// Steps of the optimiser, each on fresh mixes; under --recipe paper passes over all training shapes, 256 shapes a step
    /// [default: 0, which refines the closed-form start alone; paper: 10000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32))]
    epochs: Option<u32>,
    /// Seed of every random choice [default: 0]
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    /// Stop training after this time, for example 90s, 5m or 1h30m; such a run cannot be repeated to the byte
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    time_budget: Option<Duration>,
    /// TOML file with settings; `sinew inspect --config` shows those of a package
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Go on with a run that was stopped
    #[arg(long)]
    resume: bool,
    /// Throw away a run that was stopped and start anew
    #[arg(long, conflicts_with = "resume")]
    restart: bool,
    #[command(flatten)]
    choice: ChoiceArguments,
}

fn read_painted(path: &Path) -> Result<PaintedRegion, Report> {
    let text = std::fs::read_to_string(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", path.display()))?;
    let vertices = text.parse().map_err(|VerticesError { line, word }| {
        miette!(
            help = "write vertex numbers from 0, one by one or as runs: 3 10-25; # begins a remark",
            "{}:{line}: `{word}` is no vertex number",
            path.display()
        )
    })?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(PaintedRegion { name, vertices })
}

/// Runs `sinew train`.
pub fn run(arguments: &TrainArguments, console: &Console) -> Result<(), Failure> {
    let mut config = read_config(arguments.recipe.into(), arguments.config.as_deref())?;
    if let Some(components) = &arguments.components {
        config.components.clone_from(components);
    }
    if let Some(epochs) = arguments.epochs {
        config.fit.steps = epochs as usize;
    }
    if let Some(seed) = arguments.seed {
        config.seed = seed;
    }
    for path in &arguments.paint {
        config.start.painted.push(read_painted(path)?);
    }
    config.start.kept.extend(arguments.keep.iter().cloned());
    config.check().into_diagnostic()?;
    check_output(&arguments.output)?;

    let sequence = load_sequence(&arguments.sequence, &arguments.choice.choice(), console)?;
    let train_shapes = chosen_shapes(
        arguments.train_every as usize,
        arguments.train_list.as_deref(),
        sequence.shape_count(),
    )?;
    console.say(&format!(
        "{}: {} shapes of {} vertices and {} faces; training on {}",
        sequence.name,
        sequence.shape_count(),
        sequence.vertex_count(),
        sequence.faces.len(),
        train_shapes.len()
    ));
    let mut work_folder = arguments.output.clone().into_os_string();
    work_folder.push(".training");
    let work_folder = PathBuf::from(work_folder);
    if arguments.restart && work_folder.exists() {
        std::fs::remove_dir_all(&work_folder)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot remove {}", work_folder.display()))?;
    }
    if work_folder.exists() && !arguments.resume {
        return Err(miette!(
            help = "add --resume to go on with it, or --restart to throw it away",
            "{} holds a run that was stopped",
            work_folder.display()
        )
        .into());
    }
    let farewell = format!(
        "stopped; what is kept of the run is in {}. The same command with --resume goes on.",
        work_folder.display()
    );
    console.catch_interrupts_at_once(&farewell);
    let options = RunOptions {
        time_budget: arguments.time_budget,
        work_folder: Some(work_folder.clone()),
    };
    let learned = match learn(&sequence, &train_shapes, &config, &options, console) {
        Ok(learned) => learned,
        Err(LearnError::Stopped) => {
            console.finish();
            return Err(Failure::Stopped(farewell));
        }
        Err(error) => {
            return Err(Report::from_err(error).wrap_err("cannot train on this sequence").into());
        }
    };
    console.finish();
    save_package(&arguments.output, &learned.package)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", arguments.output.display()))?;
    // The package is safe; a left-over folder would only ask a needless question next time.
    let _ = std::fs::remove_dir_all(&work_folder);
    console.say(&format!(
        "{}: {} components, {:.2} MB, {} steps ({})",
        arguments.output.display(),
        learned.component_count,
        learned.package.len() as f64 / 1e6,
        learned.steps_run,
        learned.stop_reason
    ));
    console.say(&format!(
        "next: sinew inspect {0}   or   sinew evaluate {0} {1}",
        arguments.output.display(),
        arguments.sequence.display()
    ));
    Ok(())
}
