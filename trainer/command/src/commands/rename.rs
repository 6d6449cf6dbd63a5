//! `sinew rename`: names of one's own for the components of a package.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::{CompactView, PackageKind, save_package};
use sinew_trainer::components::anatomy::Anatomy;
use sinew_trainer::components::rename::{RenameError, is_place, new_names, renamed};

use super::Standing;
use sinew_command::console::Console;
use sinew_command::inputs::{Failure, check_output, load_package};

/// Arguments of `sinew rename`.
#[derive(Args)]
#[command(
    after_help = "The old name may be the place in the tree too: c0.1 is the second child of c0 whatever it is called. Names are made of letters, \
digits, `-`, `_` and `.`, and are unique; names such as c0.1 are kept for the component at that place.

A name is that of the control: --set, mapping files of knobs and takes use it. A take that was recorded before names what it \
moves by the old one. Bake anew after renaming.

Examples:
  sinew rename walk.sinew c0=stride c0.1=left-fore-swing
  sinew rename walk.sinew --labels -o named.sinew
  sinew rename walk.sinew stride=c0"
)]
pub struct RenameArguments {
    /// Compact package
    package: PathBuf,
    /// A component and its new name
    #[arg(value_name = "OLD=NEW", value_parser = parse_pair)]
    pairs: Vec<(String, String)>,
    /// Call every other component that has no name of its own by its label, as `sinew inspect` prints it
    #[arg(long)]
    labels: bool,
    /// Package to write [default: PACKAGE itself]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    standing: Standing,
}

fn parse_pair(text: &str) -> Result<(String, String), String> {
    let (old, new) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` is not OLD=NEW, for example c0.1=left-arm"))?;
    Ok((old.to_owned(), new.to_owned()))
}

/// Runs `sinew rename`.
pub fn run(arguments: &RenameArguments, console: &Console) -> Result<(), Failure> {
    let bytes = load_package(&arguments.package)?;
    let shown = arguments.package.display();
    let refuse = || format!("{shown} is no usable package");
    if PackageKind::of(&bytes).into_diagnostic().wrap_err_with(refuse)? == PackageKind::Baked {
        return Err(miette!(
            help = "rename the compact package that it was baked from, and bake that again",
            "{shown} is baked"
        )
        .into());
    }
    let view = CompactView::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
    if arguments.pairs.is_empty() && !arguments.labels {
        return Err(miette!(
            help = "give pairs such as c0.1=left-arm, or --labels",
            "there is nothing to rename"
        )
        .into());
    }
    let output = arguments.output.as_ref().unwrap_or(&arguments.package);
    check_output(output)?;
    let mut names = new_names(&view, &arguments.pairs).map_err(|error| {
        let help = match &error {
            RenameError::Unknown(_) => "`sinew inspect` lists names and places",
            _ => "nothing was written",
        };
        miette!(help = help, "{error}")
    })?;
    if arguments.labels {
        let labels = Anatomy::of(&view, arguments.standing.axes()?).labels;
        // Those that are named by the user, now or before, keep their names, and labels make way.
        let kept: Vec<String> = names.iter().filter(|name| !is_place(name)).cloned().collect();
        for ((name, label), component) in names.iter_mut().zip(labels).zip(view.components()) {
            let unnamed = is_place(name) && *name == component.name;
            if unnamed && !kept.contains(&label) {
                *name = label;
            }
        }
    }
    let count = names
        .iter()
        .zip(view.components())
        .filter(|(name, c)| **name != c.name)
        .count();
    let written = renamed(&view, &names).into_diagnostic()?;
    save_package(output, &written).into_diagnostic()?;
    console.say(&format!("{}: {count} components renamed", output.display()));
    Ok(())
}
