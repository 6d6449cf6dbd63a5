//! `sinew bake`: a compact package made ready for the frame path.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::{BakedView, FastView, PackageKind, save_package};
use sinew_trainer::bake::{BakeOptions, FastNodes, bake_bytes_with};

use super::console::Console;
use super::{Failure, check_output, load_package};

/// Arguments of `sinew bake`.
#[derive(Args)]
#[command(
    after_help = "A compact package is what you keep and send; a baked one holds the folded components and the factored solver, \
larger but ready: the runtime opens it without allocating. Bake anew whenever the compact package changes.

Besides the exact tier it holds a fast one, for crowds and small devices: some vertices are solved for and the others follow \
them. Fewer nodes are faster and less exact; by how much is measured, printed, and kept in the package (`sinew inspect`).

Examples:
  sinew bake walk.sinew -o walk.baked.sinew
  sinew bake walk.sinew -o walk.baked.sinew --fast-nodes V/16"
)]
pub struct BakeArguments {
    /// Compact package
    package: PathBuf,
    /// Baked package to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Nodes of the fast tier: `V/8` is one to every eight vertices, `none` leaves the tier out
    #[arg(long, value_name = "COUNT", default_value = "V/8")]
    fast_nodes: FastNodes,
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
    let options = BakeOptions {
        fast_nodes: arguments.fast_nodes,
    };
    let baked = bake_bytes_with(&bytes, &options)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot bake {name}"))?;
    save_package(&arguments.output, &baked).into_diagnostic()?;
    console.say(&format!(
        "{}: {:.2} MB (compact {:.2} MB)",
        arguments.output.display(),
        baked.len() as f64 / 1e6,
        bytes.len() as f64 / 1e6
    ));
    if let Some(fast) = BakedView::open(&baked).into_diagnostic()?.fast() {
        console.say(&describe(&fast));
    }
    Ok(())
}

/// What a fast tier is and how good.
pub fn describe(fast: &FastView<'_>) -> String {
    let error = fast.error();
    let percent = |share: f32| 100.0 * share;
    format!(
        "fast tier: {} nodes; from the exact one {:.3} % of the bounding box (rms), {:.2} % at most for 99 of 100 vertices, \
         {:.2} % at worst; normals {:.1} degrees (rms)",
        fast.nodes().node_count(),
        percent(error.mixed_rms),
        percent(error.mixed_p99),
        percent(error.mixed_max.max(error.single_max)),
        error.normal_rms.to_degrees()
    )
}
