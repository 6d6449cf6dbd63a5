//! The `sinew` command: learns deformation components from mesh sequences, measures them, packages them.
//!
//! Context is added to errors here and in `commands`, nowhere below; every refusal ends with exit code 2.

mod commands;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use commands::Failure;

/// For the peak memory that `sinew compare` prints.
#[global_allocator]
static ALLOCATOR: sinew_trainer::compare::memory::CountingAllocator = sinew_trainer::compare::memory::CountingAllocator;

/// Learns a small, readable set of deformation components from a mesh sequence, coarse to fine.
///
/// A first look:   sinew demo
/// Your meshes:    sinew train FOLDER -o model.sinew
///                 sinew evaluate model.sinew FOLDER
///                 sinew inspect model.sinew
///                 sinew frame model.sinew --set c0=0.5 -o pose.obj
///
/// A sequence is a folder of OBJ, PLY or OFF files of one connectivity (the first in natural order is the reference), or
/// of positions.npy (shapes x vertices x 3) and faces.npy (faces x 3).
///
/// Exit codes: 0 done; 2 something in the input or the options is wrong, and nothing was written; 130 stopped by Ctrl-C.
#[derive(Parser)]
#[command(
    name = "sinew",
    version,
    verbatim_doc_comment,
    propagate_version = true,
    max_term_width = 110
)]
struct Cli {
    /// Say nothing but results and errors.
    #[arg(long, short, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Learn components from a sequence and write one compact package
    Train(commands::train::TrainArguments),
    /// Measure a package on the shapes it was not trained on
    Evaluate(commands::evaluate::EvaluateArguments),
    /// Measure this project beside the systems of the literature, trained on the same shapes
    Compare(commands::compare::CompareArguments),
    /// Measure what each choice of the method is worth: the paper's ablations
    Ablate(commands::ablate::AblateArguments),
    /// Show what is in a package: the tree of components, sizes, where it comes from
    Inspect(commands::inspect::InspectArguments),
    /// Give components names of your own
    Rename(commands::rename::RenameArguments),
    /// Write one pose as a mesh
    Frame(commands::frame::FrameArguments),
    /// Prepare a compact package for the frame path of an engine
    Bake(commands::bake::BakeArguments),
    /// Make a sequence to try things on: a flag, a bar, a creature
    Synthesize(commands::synthesize::SynthesizeArguments),
    /// The whole chain on a made-up creature, with an illustrated report
    Demo(commands::demo::DemoArguments),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let console = commands::console::Console::new(cli.quiet);
    let outcome = match cli.command {
        Command::Train(arguments) => commands::train::run(&arguments, &console),
        Command::Evaluate(arguments) => commands::evaluate::run(&arguments, &console),
        Command::Compare(arguments) => commands::compare::run(&arguments, &console),
        Command::Ablate(arguments) => commands::ablate::run(&arguments, &console),
        Command::Inspect(arguments) => commands::inspect::run(&arguments),
        Command::Rename(arguments) => commands::rename::run(&arguments, &console),
        Command::Frame(arguments) => commands::frame::run(&arguments, &console),
        Command::Bake(arguments) => commands::bake::run(&arguments, &console),
        Command::Synthesize(arguments) => commands::synthesize::run(&arguments, &console),
        Command::Demo(arguments) => commands::demo::run(&arguments, &console),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Stopped(message)) => {
            eprintln!("{message}");
            ExitCode::from(130)
        }
        Err(Failure::Refused(report)) => {
            eprintln!("{report:?}");
            ExitCode::from(2)
        }
    }
}
