//! `sinew-stage knobs`: everything about a knob box but playing it.

mod list;

use clap::Subcommand;

use super::Failure;

/// Subcommands of `sinew-stage knobs`.
#[derive(Subcommand)]
pub enum KnobsCommand {
    /// Show the ports that a box may be on
    List,
}

/// Runs one of them.
///
/// # Errors
/// What was refused, or that Ctrl-C ended it.
pub fn run(command: &KnobsCommand, quiet: bool) -> Result<(), Failure> {
    let _ = quiet;
    match command {
        KnobsCommand::List => list::run(),
    }
}
