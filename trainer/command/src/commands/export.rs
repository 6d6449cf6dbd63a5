//! `sinew export`: a package as a file that engines play without code of ours: bones, clips, sliders.

mod morphs;
mod played;
mod rig;

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use serde_json::{Value, json};
use sinew_formats::package::{AlignedBytes, PackageKind};
use sinew_interchange::{DEFAULT_FPS, OutputSurface, Puppet, UpAxis, write_puppet};
use sinew_runtime::{Basis, Workspace, WorkspaceLayout};
use sinew_trainer::bake::{BakeOptions, BoneCount, BoneOptions, Influences, bake_bytes_with};
use sinew_trainer::evaluate::Player;
use sinew_trainer::learn::Reporter;
use sinew_trainer::learn::draft::bounding_diagonal;

use morphs::{Morphs, fit_morphs};
use played::{ClipReport, ClipSettings};
use rig::Rig;
use sinew_command::console::Console;
use sinew_command::inputs::{Failure, check_output, load_package};
use sinew_command::weight_table::read_weights;

/// Arguments of `sinew export`.
#[derive(Args)]
#[command(
    after_help = "The file holds the mesh with its texture coordinates, a skeleton of bones without parents, an animation for every \
--clip, and the names, ranges and tree of the components in `extras.sinew` of the root node. Engines play it as any skinned \
character; bones that translate, rotate and scale leave shear out, so it is not quite the runtime: how far it is from the exact \
tier is printed, and kept in the file.

With --morphs, components whose straight blend stays near enough to their true movement become morph targets, which are sliders \
in every engine; the others are named. Clips move the bones, and where there are none, the morph targets.

Poses over time as points instead of bones: `sinew frame --weights` writes Alembic, USD, PC2, MDD.

Examples:
  sinew encode walk.sinew walk/ -o walk.csv
  sinew export walk.sinew --clip walk.csv -o walk.glb
  sinew export walk.sinew --clip slow=walk.csv --fps 12 --bones 64 -o walk.glb
  sinew export face.sinew --bones none --morphs 0.5 -o face.glb"
)]
pub struct ExportArguments {
    /// Compact package, or a baked one with bones
    package: PathBuf,
    /// File to write: .glb, or .gltf with its .bin beside it
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Weights over time, a row a frame, as `sinew encode` writes (.csv or .npy), and a name other than the file's; may be repeated
    #[arg(long = "clip", value_name = "[NAME=]FILE")]
    clips: Vec<PathBuf>,
    /// Frames a second of the clips
    #[arg(long, value_name = "RATE", default_value_t = DEFAULT_FPS, value_parser = super::parse_rate)]
    fps: f64,
    /// Bones, at most 250 and at most as many as vertices, or `none` [default: 128, or those of a baked package]
    #[arg(long, value_name = "COUNT")]
    bones: Option<BoneCount>,
    /// Keys of clips that move no vertex by more than this are left out, in % of the bounding box' diagonal
    #[arg(long, value_name = "PERCENT", default_value_t = 0.01, value_parser = parse_percent)]
    tolerance: f64,
    /// Components as morph targets, where no vertex is farther from the true movement anywhere in the control's range than this, in % of
    /// the bounding box' diagonal
    #[arg(long, value_name = "PERCENT", value_parser = parse_percent)]
    morphs: Option<f64>,
    /// The axis of the package that points up; glTF's is y, and the file is turned to it
    #[arg(long, value_name = "AXIS", value_parser = parse_up, default_value = "y")]
    up: UpAxis,
    /// Length of the package's unit in metres, which are glTF's
    #[arg(long, value_name = "METRES", value_parser = super::parse_rate, default_value = "1")]
    unit: f64,
}

fn parse_percent(text: &str) -> Result<f64, String> {
    match text.trim_end_matches('%').parse::<f64>() {
        Ok(percent) if percent.is_finite() && percent >= 0.0 => Ok(percent),
        _ => Err(format!("`{text}` is not a percentage of 0 or more")),
    }
}

fn parse_up(text: &str) -> Result<UpAxis, String> {
    match text {
        "x" => Ok(UpAxis::X),
        "y" => Ok(UpAxis::Y),
        "z" => Ok(UpAxis::Z),
        _ => Err(format!("`{text}` is none of x, y, z")),
    }
}

/// Runs `sinew export`.
pub fn run(arguments: &ExportArguments, console: &Console) -> Result<(), Failure> {
    check_output(&arguments.output)?;
    let path = arguments.package.display();
    let baked = baked(arguments)?;
    let basis = Basis::open(&baked)
        .into_diagnostic()
        .wrap_err_with(|| format!("{path} is no usable package"))?;
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut player = Player::new(&basis, Workspace::new(&basis, &mut memory).into_diagnostic()?);
    let rest: Vec<[f32; 3]> = basis
        .slot_from_vertex()
        .iter()
        .map(|slot| basis.rest_positions()[slot as usize])
        .collect();
    let diagonal = f64::from(bounding_diagonal(&rest));
    let names: Vec<&str> = basis.components().map(|component| component.name).collect();
    let rig = match (basis.bones(), arguments.bones) {
        (Some(_), Some(BoneCount(None))) | (None, _) => None,
        (Some(_), _) => Some(Rig::new(&basis, &rest)),
    };
    console.catch_interrupts();

    let morphs = match arguments.morphs {
        Some(percent) => fit_morphs(&basis, &rest, 0.01 * percent * diagonal, console)?,
        None => Morphs::default(),
    };
    if rig.is_none() && morphs.of_component.iter().all(Option::is_none) {
        return Err(miette!(
            help = "leave `--bones none` out, or allow a larger error with --morphs",
            "without bones and without morph targets nothing moves"
        )
        .into());
    }

    let settings = ClipSettings {
        fps: arguments.fps,
        tolerance: 0.01 * arguments.tolerance * diagonal,
        diagonal,
        console,
    };
    let (mut clips, mut reports) = (Vec::new(), Vec::new());
    for clip in &arguments.clips {
        let (name, file) = named(clip);
        let rows = read_weights(file, &names)?;
        console.stage(&format!("clip {name}"), rows.len() as u64);
        let (clip, report) = match &rig {
            Some(rig) => rig.clip(&name, &rows, &basis, &mut player, &settings)?,
            None => morphs.clip(&name, &rows, &basis, &mut player, &rest, &settings)?,
        };
        console.finish();
        clips.push(clip);
        reports.push(report);
    }

    let faces = basis.faces().to_vec();
    let render = super::render_surface(&basis);
    let dress = rig.as_ref().map(|rig| rig.dress.clone()).unwrap_or_default();
    let stem = arguments.package.file_stem().and_then(|stem| stem.to_str());
    let puppet = Puppet {
        surface: OutputSurface {
            render: render.as_ref(),
            dress: &dress,
            fps: arguments.fps,
            unit_metres: Some(arguments.unit),
            up: Some(arguments.up),
            ..OutputSurface::bare(stem.unwrap_or("mesh"), basis.vertex_count(), &faces)
        },
        rest: &rest,
        extras: extras(&basis, rig.as_ref(), &morphs, &reports),
        targets: morphs.targets,
        clips,
    };
    write_puppet(&arguments.output, &puppet).into_diagnostic()?;
    let size = std::fs::metadata(&arguments.output).map_or(0, |file| file.len());
    console.say(&format!(
        "{}: {:.2} MB, {} vertices, {} bones, {} morph targets, {} clips",
        arguments.output.display(),
        size as f64 / 1e6,
        basis.vertex_count(),
        rig.as_ref().map_or(0, |rig| rig.rest.len()),
        puppet.targets.len(),
        puppet.clips.len()
    ));
    for report in &reports {
        console.say(&report.describe());
    }
    if arguments.morphs.is_some() {
        let left: Vec<&str> = names
            .iter()
            .zip(&morphs.of_component)
            .filter(|(_, index)| index.is_none())
            .map(|(name, _)| *name)
            .collect();
        if !left.is_empty() {
            console.say(&format!("no morph target, too far from straight: {}", left.join(", ")));
        }
    }
    Ok(())
}
/// The package as it is played: its own bytes, or baked here with the bones that were asked for.
fn baked(arguments: &ExportArguments) -> Result<AlignedBytes, Failure> {
    let bytes = load_package(&arguments.package)?;
    let refuse = || format!("{} is no usable package", arguments.package.display());
    match PackageKind::of(&bytes).into_diagnostic().wrap_err_with(refuse)? {
        PackageKind::Compact => {
            let mut options = BakeOptions::default();
            if let Some(BoneCount(count)) = arguments.bones {
                options.bones = count.map(|count| BoneOptions {
                    count,
                    influences: Influences::Four,
                });
            }
            Ok(bake_bytes_with(&bytes, &options)
                .into_diagnostic()
                .wrap_err_with(refuse)?)
        }
        _ => {
            let own = Basis::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
            let own = own.bones().map(|bones| bones.count());
            if let Some(BoneCount(Some(wanted))) = arguments.bones
                && own != Some(usize::from(wanted))
            {
                return Err(miette!(
                    help = "give the compact package that it was baked from",
                    "{} is baked already, with {} bones",
                    arguments.package.display(),
                    own.unwrap_or(0)
                )
                .into());
            }
            Ok(bytes)
        }
    }
}

/// A name and a file.
fn named(clip: &Path) -> (String, &Path) {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match clip.to_str().and_then(|text| text.split_once('=')) {
        Some((name, file)) if !clip.exists() && !name.is_empty() => (name.to_owned(), Path::new(file)),
        _ => (stem(clip), clip),
    }
}
/// What the file says of itself to programs that know it.
fn extras(basis: &Basis<'_>, rig: Option<&Rig>, morphs: &Morphs, reports: &[ClipReport]) -> Value {
    let names: Vec<&str> = basis.components().map(|component| component.name).collect();
    let components: Vec<Value> = basis
        .components()
        .enumerate()
        .map(|(k, component)| {
            let target = morphs.of_component.get(k).copied().flatten();
            json!({
                "name": component.name, "minimum": component.minimum, "maximum": component.maximum,
                "parent": component.parent.map(|parent| names[parent]), "level": component.level,
                "target": target.map(|(target, _)| target),
                "targetError": target.map(|(_, error)| error),
            })
        })
        .collect();
    let clips: Vec<Value> = reports
        .iter()
        .map(|report| json!({ "name": report.name, "rms": report.rms, "max": report.max, "measuredBy": report.tier }))
        .collect();
    let bones = rig.and_then(|_| basis.bones()).map(|bones| {
        let (sliders, shapes) = (bones.error().sliders_scaled, bones.error().shapes_scaled);
        json!({
            "count": bones.count(), "influences": bones.influences(),
            "sliderPoses": { "rms": sliders.rms, "p99": sliders.p99, "max": sliders.max },
            "trainingShapes": { "rms": shapes.rms, "p99": shapes.p99, "max": shapes.max },
        })
    });
    let id: String = basis.compact_id().iter().map(|byte| format!("{byte:02x}")).collect();
    json!({ "sinew": { "package": id, "components": components, "bones": bones, "clips": clips } })
}
