//! The `sinew-stage` command: performs packages that `sinew` made. Ends with exit code 2 for every refusal.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use sinew_stage::commands::{self, Failure};

/// Performs Sinew packages live: a knob box, a phone or a script moves the mesh.
///
/// A first look:    sinew-stage play --demo --page    (open http://127.0.0.1:8080 and drag)
/// Your package:    sinew-stage play model.sinew --page
/// Without a box:   sinew-stage knobs simulate        (in another terminal; it says what to play)
/// Your box:        sinew-stage knobs list
///                  sinew-stage knobs calibrate       turn every knob once
///                  sinew-stage knobs learn model.sinew -o knobs.toml
///                  sinew-stage play model.sinew --knobs knobs.toml --record show.take
///
/// Text lines (deej, CSV, Arduino's plotter), MIDI, OSC, Firmata and Sinew's own packets are recognised by what they send.
///
/// Exit codes: 0 done; 2 something in the input or the options is wrong; 130 stopped by Ctrl-C (what was recorded is kept).
#[derive(Parser)]
#[command(
    name = "sinew-stage",
    version,
    verbatim_doc_comment,
    propagate_version = true,
    max_term_width = 110
)]
struct Cli {
    /// Say nothing but results, warnings and errors.
    #[arg(long, short, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Play a package: live from knobs, or from a take
    Play(Box<commands::play::PlayArguments>),
    /// Find, watch, measure, assign and imitate knob boxes
    #[command(subcommand)]
    Knobs(commands::knobs::KnobsCommand),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match &cli.command {
        Command::Play(arguments) => commands::play::run(arguments, cli.quiet),
        Command::Knobs(command) => commands::knobs::run(command, cli.quiet),
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
