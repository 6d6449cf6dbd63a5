//! `sinew-lab compare`: this project beside the systems of the literature, on one sequence.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::CompactView;
use sinew_lab::compare::page::comparison_page;
use sinew_lab::compare::{CompareError, CompareInput, CompareSettings, Comparison, LOCAL_RADIUS, OwnPackage, compare};
use sinew_trainer::config::TrainConfig;
use sinew_trainer::learn::LearnError;

use sinew_command::choice::ChoiceArguments;
use sinew_command::console::Console;
use sinew_command::inputs::{
    Failure, check_output, chosen_shapes, config_of, load_package, load_sequence, make_folder,
};

/// Arguments of `sinew-lab compare`.
#[derive(Args)]
#[command(
    after_help = "All methods train on the same shapes with the same number of components and are measured on the others:
  PCA                     on positions and on this project's features
  SPLOCS                  Neumann et al. 2013, on positions and on features
  Local factors           Bernard et al. 2016, on positions
  Deformation gradients   Huang et al. 2014
  Lengths and angles      Wang et al. 2017
  One-level autoencoder   Tan et al. 2018
  Sinew                   this project, or each --ours PACKAGE

Weights of unseen shapes are found by a network in one pass, by the pseudo-inverse of its decoder (a linear map), by least squares \
in features (which count what they do to positions too, for every method), or by least squares in positions: compare like \
with like. Less is better in E_rms and STED; more is better in locality.

Examples:
  sinew-lab compare horse/ --train-every 10 --report horse-comparison
  sinew-lab compare horse/ --ours horse.sinew --json horse.json"
)]
pub struct CompareArguments {
    /// Folder of meshes or arrays, or a file with a moving mesh (see `sinew convert --help`)
    sequence: PathBuf,
    /// Train on every Nth shape, the first included, and measure on the others
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..))]
    train_every: u32,
    /// Components of every method, coarse and fine ones together
    #[arg(long, value_name = "K", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=512))]
    components: u32,
    /// Seed of what is random
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Epochs of the one-level autoencoder at most: it ends when its loss stays level
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    epochs: u32,
    /// A package trained on the same shapes, to stand for this project's own training; may be repeated, for one of --recipe paper
    /// beside it
    #[arg(long, value_name = "PACKAGE")]
    ours: Vec<PathBuf>,
    /// Leave out what takes longest: peers fitted in positions, and control points
    #[arg(long)]
    quick: bool,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write index.html with tables, plots and heat maps into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    choice: ChoiceArguments,
}

/// Runs `sinew-lab compare`.
pub fn run(arguments: &CompareArguments, console: &Console) -> Result<(), Failure> {
    if let Some(path) = &arguments.json {
        check_output(path)?;
    }
    if let Some(folder) = &arguments.report {
        make_folder(folder)?;
        check_output(&folder.join("index.html"))?;
    }
    let sequence = load_sequence(&arguments.sequence, &arguments.choice.choice(), console)?;
    let train_shapes = chosen_shapes(arguments.train_every as usize, None, sequence.shape_count())?;
    let mut config = TrainConfig::default();
    let mut ours = Vec::new();
    for path in &arguments.ours {
        let bytes = load_package(path)?;
        let name = match &arguments.ours[..] {
            [_] => "Sinew".to_owned(),
            paths => {
                let stem = path.file_stem().unwrap_or_default();
                let alone = paths.iter().filter(|other| other.file_stem() == Some(stem)).count() == 1;
                let name = if alone { Path::new(stem) } else { path };
                format!("Sinew, {}", name.display())
            }
        };
        ours.push((path, name, bytes));
    }
    for (n, (path, _, bytes)) in ours.iter().enumerate() {
        let refuse = || format!("{} is no usable compact package", path.display());
        let view = CompactView::open(bytes).into_diagnostic().wrap_err_with(refuse)?;
        let trained_on = view.provenance().train_shapes;
        if !trained_on.iter().map(|&m| m as usize).eq(train_shapes.iter().copied()) {
            return Err(miette!(
                help = "train it with the same --train-every, or leave --ours out",
                "{} was trained on other shapes than the peers would be",
                path.display()
            )
            .into());
        }
        if n == 0 {
            config = config_of(&view)?;
        }
    }
    config.seed = arguments.seed;
    let settings = CompareSettings {
        component_count: arguments.components as usize,
        epochs: arguments.epochs as usize,
        quick: arguments.quick,
        config,
    };
    let ours: Vec<OwnPackage<'_>> = ours.iter().map(|(_, name, bytes)| OwnPackage { name, bytes }).collect();
    console.catch_interrupts();
    let input = CompareInput {
        sequence: &sequence,
        train_shapes: &train_shapes,
        ours: &ours,
        settings: &settings,
    };
    let compared = compare(input, console);
    console.finish();
    let (comparison, shapes) = match compared {
        Ok(compared) => compared,
        Err(CompareError::Learn(LearnError::Stopped)) => {
            return Err(Failure::Stopped("stopped; nothing was written".to_owned()));
        }
        Err(error) => return Err(miette::Report::from_err(error).into()),
    };
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&comparison).into_diagnostic()?;
        std::fs::write(path, text + "\n")
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(folder) = &arguments.report {
        let page = comparison_page(&comparison, &shapes, &sequence).into_diagnostic()?;
        page.write(&folder.join("index.html")).into_diagnostic()?;
    }
    print_table(&comparison);
    Ok(())
}

fn print_table(comparison: &Comparison) {
    println!(
        "{}: {} vertices; {} shapes for training, {} measured; {} components; seed {}",
        comparison.sequence,
        comparison.vertices,
        comparison.train_shapes,
        comparison.test_shapes,
        comparison.components,
        comparison.seed
    );
    println!(
        "{:<22} {:<10} {:>4} {:>8} {:>8} {:>8} {:>6} {:>8} {:>8} {:>10} {:>10}",
        "method", "fitted in", "K", "E_rms", "STED", "Perc", "local", "train s", "peak MB", "f32 bytes", "f16 bytes"
    );
    for method in &comparison.methods {
        for (row, projection) in method.projections.iter().enumerate() {
            let perc = projection
                .max_percentage_error
                .map_or_else(|| "-".to_owned(), |x| format!("{x:.4}"));
            print!(
                "{:<22} {:<10} {:>4} {:>8.3} {:>8.4} {perc:>8}",
                if row == 0 { method.name.as_str() } else { "" },
                projection.kind.name(),
                if row == 0 {
                    method.components.to_string()
                } else {
                    String::new()
                },
                projection.scores.e_rms,
                projection.scores.sted,
            );
            if row == 0 {
                let seconds = method
                    .training_seconds
                    .map_or_else(|| "-".to_owned(), |s| format!("{s:.1}"));
                let peak = method
                    .peak_bytes
                    .map_or_else(|| "-".to_owned(), |bytes| format!("{:.1}", bytes as f64 / 1e6));
                print!(
                    " {:>6.2} {seconds:>8} {peak:>8} {:>10} {:>10}",
                    method.locality, method.basis_bytes_f32, method.basis_bytes_f16
                );
            }
            println!();
        }
    }
    let features = &comparison.round_trip;
    println!(
        "{:<22} {:<10} {:>4} {:>8.3} {:>8.4}",
        "features alone", "", "", features.e_rms, features.sted
    );
    println!("local: share of a component's energy within {LOCAL_RADIUS} of the longest distance from its centre");
    println!("peak: most memory that training held at once, the sequence and its features not counted but in Sinew's");
    for (method, note) in comparison.methods.iter().filter_map(|m| Some((m, m.note.as_ref()?))) {
        println!("{}: {note}", method.name);
    }
    if !comparison.control_points.is_empty() {
        println!();
        print!("{:<22}", "E_rms, control points");
        comparison.control_points.iter().for_each(|count| print!(" {count:>8}"));
        println!();
        for method in &comparison.methods {
            print!("{:<22}", method.name);
            method
                .control_point_e_rms
                .iter()
                .for_each(|error| print!(" {error:>8.2}"));
            println!();
        }
    }
}
