//! The `sinew-lab` command: measures Sinew beside the systems of the literature, and what its choices are worth.

mod commands;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use sinew_command::console::Console;
use sinew_command::inputs::Failure;
use sinew_lab::compare::memory::CountingAllocator;

/// For the peak memory of every method's training.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Measures Sinew beside the systems of the literature, and what each choice of its method is worth.
///
/// A sequence is what `sinew train` takes: a folder of meshes of one connectivity, or of positions.npy and faces.npy.
///
/// Exit codes: 0 done; 2 something in the input or the options is wrong, and nothing was written; 130 stopped by Ctrl-C.
#[derive(Parser)]
#[command(
    name = "sinew-lab",
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
    /// Measure this project beside the systems of the literature, trained on the same shapes
    Compare(commands::compare::CompareArguments),
    /// Measure what each choice of the method is worth: the paper's ablations
    Ablate(commands::ablate::AblateArguments),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let console = Console::new(cli.quiet);
    Failure::exit_code(match cli.command {
        Command::Compare(arguments) => commands::compare::run(&arguments, &console),
        Command::Ablate(arguments) => commands::ablate::run(&arguments, &console),
    })
}
