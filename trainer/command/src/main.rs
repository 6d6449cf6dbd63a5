//! The `sinew` command: learns deformation components from mesh sequences, measures them, packages them.
//!
//! Context is added to errors here and in `commands`, nowhere below; every refusal ends with exit code 2.

mod commands;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use sinew_command::console::Console;
use sinew_command::inputs::Failure;

/// Learns a small, readable set of deformation components from a mesh sequence, coarse to fine.
///
/// A first look:   sinew demo
/// Your meshes:    sinew train FOLDER -o model.sinew
///                 sinew evaluate model.sinew FOLDER
///                 sinew inspect model.sinew
///                 sinew frame model.sinew --set c0=0.5 -o pose.obj
///
/// A sequence is a folder of OBJ, PLY or OFF files of one connectivity (the first in natural order is the reference), or
/// of positions.npy (shapes x vertices x 3) and faces.npy (faces x 3), or a file in which a mesh moves:
/// `sinew convert --help` lists the formats, `sinew inspect FILE` what a file holds.
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
    /// Write the weights of the shapes of a sequence
    Encode(commands::encode::EncodeArguments),
    /// Show what is in a package (the tree of components, sizes, where it comes from) or in a file of another program (meshes, clips)
    Inspect(commands::inspect::InspectArguments),
    /// Give components names of your own
    Rename(commands::rename::RenameArguments),
    /// Write one pose as a mesh
    Frame(commands::frame::FrameArguments),
    /// Write bones, clips and sliders as glTF, for engines
    Export(commands::export::ExportArguments),
    /// Write a sequence in another program's format
    Convert(commands::convert::ConvertArguments),
    /// Prepare a compact package for the frame path of an engine
    Bake(commands::bake::BakeArguments),
    /// Make a sequence to try things on: a flag, a bar, a creature
    Synthesize(commands::synthesize::SynthesizeArguments),
    /// The whole chain on a made-up creature, with an illustrated report
    Demo(commands::demo::DemoArguments),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let console = Console::new(cli.quiet);
    Failure::exit_code(match cli.command {
        Command::Train(arguments) => commands::train::run(&arguments, &console),
        Command::Evaluate(arguments) => commands::evaluate::run(&arguments, &console),
        Command::Encode(arguments) => commands::encode::run(&arguments, &console),
        Command::Inspect(arguments) => commands::inspect::run(&arguments),
        Command::Rename(arguments) => commands::rename::run(&arguments, &console),
        Command::Frame(arguments) => commands::frame::run(&arguments, &console),
        Command::Export(arguments) => commands::export::run(&arguments, &console),
        Command::Convert(arguments) => commands::convert::run(&arguments, &console),
        Command::Bake(arguments) => commands::bake::run(&arguments, &console),
        Command::Synthesize(arguments) => commands::synthesize::run(&arguments, &console),
        Command::Demo(arguments) => commands::demo::run(&arguments, &console),
    })
}
