//! `sinew bake`: a compact package made ready for the frame path.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::{PackageKind, save_package};
use sinew_trainer::bake::bake_bytes;

use super::console::Console;
use super::{Failure, check_output, load_package};

/// Arguments of `sinew bake`.
#[derive(Args)]
#[command(
    after_help = "A compact package is what you keep and send; a baked one holds the folded components and the factored solver, \
larger but ready: the runtime opens it without allocating. Bake anew whenever the compact package changes.

Example:
  sinew bake walk.sinew -o walk.baked.sinew"
)]
pub struct BakeArguments {
    /// Compact package
    package: PathBuf,
    /// Baked package to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
}

/// Runs `sinew bake`.
pub fn run(arguments: &BakeArguments, console: &Console) -> Result<(), Failure> {
    let bytes = load_package(&arguments.package)?;
    let name = arguments.package.display();
    let kind = PackageKind::of(&bytes)
        .into_diagnostic()
        .wrap_err_with(|| format!("{name} is no usable package"))?;
    if kind == PackageKind::Baked {
        return Err(miette!(
            help = "bake the compact package that `sinew train` wrote",
            "{name} is baked already"
        )
        .into());
    }
    check_output(&arguments.output)?;
    let baked = bake_bytes(&bytes)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot bake {name}"))?;
    save_package(&arguments.output, &baked).into_diagnostic()?;
    console.say(&format!(
        "{}: {:.2} MB (compact {:.2} MB)",
        arguments.output.display(),
        baked.len() as f64 / 1e6,
        bytes.len() as f64 / 1e6
    ));
    Ok(())
}
