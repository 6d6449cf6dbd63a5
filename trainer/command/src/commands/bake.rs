//! `sinew bake`: a compact package made ready for the frame path.

use core::fmt::Write as _;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::{BakedView, BonesView, PackageKind, PoseError, save_package};
use sinew_runtime::Basis;
use sinew_trainer::bake::{BakeOptions, BoneCount, BoneOptions, Influences, bake_bytes_with};

use sinew_command::console::Console;
use sinew_command::inputs::{Failure, check_output, load_package};

/// Arguments of `sinew bake`.
#[derive(Args)]
#[command(
    after_help = "A compact package is what you keep and send; a baked one holds the folded components and the factored solver, \
larger but ready: the runtime opens it without allocating. Bake anew whenever the compact package changes.

Besides the exact tier, which solves for all vertices, a package has bones: affine maps that the processor poses in \
microseconds and that a GPU skins the mesh by, for crowds, engines and small devices. They are fitted to about a thousand \
poses of the exact tier. How far they are from it is measured, printed, and kept in the package (`sinew inspect`): on slider \
poses, in which half of the controls stand anywhere within 70 % of their ranges, and on poses like the training shapes'; with \
bones as affine maps, and as joints that translate, rotate and scale.

More bones are nearer and cost more: 64 take about a third of the time of 128. No engine takes more than 250.

Examples:
  sinew bake walk.sinew -o walk.baked.sinew
  sinew bake walk.sinew -o walk.baked.sinew --bones 64
  sinew bake walk.sinew -o crowd.sinew --bones-only"
)]
pub struct BakeArguments {
    /// Compact package
    package: PathBuf,
    /// Baked package to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Bones of the package, at most 250 and at most as many as vertices, or `none`
    #[arg(long, value_name = "COUNT", default_value = "128")]
    bones: BoneCount,
    /// Bones that a vertex follows at most: all engines skin by 4, some by 8
    #[arg(long, value_name = "COUNT", value_enum, default_value = "4")]
    influences: InfluenceCount,
    /// Leave the exact tier out: a small package that plays by its bones alone
    #[arg(long)]
    bones_only: bool,
}

/// A choice of `--influences`.
#[derive(Clone, Copy, ValueEnum)]
enum InfluenceCount {
    #[value(name = "4")]
    Four,
    #[value(name = "8")]
    Eight,
}

impl BakeArguments {
    fn options(&self) -> Result<BakeOptions, Failure> {
        let influences = match self.influences {
            InfluenceCount::Four => Influences::Four,
            InfluenceCount::Eight => Influences::Eight,
        };
        let bones = self.bones.0.map(|count| BoneOptions { count, influences });
        if bones.is_none() && self.bones_only {
            return Err(miette!(
                help = "say how many bones, or leave --bones-only out",
                "--bones none and --bones-only together leave nothing to play"
            )
            .into());
        }
        Ok(BakeOptions {
            exact: !self.bones_only,
            bones,
        })
    }
}

/// Runs `sinew bake`.
pub fn run(arguments: &BakeArguments, console: &Console) -> Result<(), Failure> {
    let options = arguments.options()?;
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
    if let Some(bones) = BakedView::open(&baked).into_diagnostic()?.bones() {
        console.say(&describe(&bones));
        let still = without_bones(&Basis::open(&baked).into_diagnostic()?);
        if !still.is_empty() {
            console.say(&format!("no bone moves with {}", still.join(", ")));
        }
    }
    Ok(())
}

/// Bytes of the bones in a package.
fn bytes_of(bones: &BonesView<'_>) -> usize {
    let tables = size_of_val(bones.turns) + size_of_val(bones.pulls) + size_of_val(bones.slides);
    let skin = size_of_val(bones.skin.bones) + size_of_val(bones.skin.weights) + size_of_val(bones.skin.rest_normals);
    tables + skin + size_of_val(bones.patches.values)
}

/// What the bones of a package are and how far from the exact tier.
pub fn describe(bones: &BonesView<'_>) -> String {
    let error = &bones.error;
    let mut text = format!(
        "{} bones made of {} nodes, {} influences, {:.2} MB; from the exact tier, in % of the bounding box' diagonal:\n  \
         {:<40} {:>7} {:>7} {:>7}  {}",
        bones.rest_places.len(),
        bones.node_count,
        bones.skin.influences,
        bytes_of(bones) as f64 / 1e6,
        "",
        "rms",
        "99 %",
        "most",
        "normals, degrees (rms)"
    );
    let rows: [(&str, &PoseError); 4] = [
        ("slider poses, affine", &error.sliders),
        ("slider poses, translate-rotate-scale", &error.sliders_scaled),
        ("training shapes, affine", &error.shapes),
        ("training shapes, translate-rotate-scale", &error.shapes_scaled),
    ];
    for (poses, error) in rows.into_iter().filter(|row| row.1.poses > 0) {
        let percent = |share: f32| 100.0 * share;
        // Writing to a text does not fail.
        let _ = write!(
            text,
            "\n  {poses:<40} {:>7.3} {:>7.3} {:>7.2}  {:.2}",
            percent(error.rms),
            percent(error.p99),
            percent(error.max),
            error.normal_rms.to_degrees()
        );
    }
    text
}

/// Names of the components that no bone moves with.
fn without_bones(basis: &Basis<'_>) -> Vec<String> {
    let Some(bones) = basis.bones() else {
        return Vec::new();
    };
    let still = basis.components().enumerate().filter(|&(k, _)| !bones.moves(k));
    still.map(|(_, component)| component.name.to_owned()).collect()
}
