//! `sinew evaluate`: a package against the shapes it was not trained on.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::interchange::{MeshSequence, write_npy_f32, write_npy_u32};
use sinew_formats::package::CompactView;
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{Evaluation, EvaluationInput, MaxPercentageError, Scores, evaluate};
use sinew_trainer::learn::Reporter;

use super::console::Console;
use super::{Failure, chosen_shapes, load_package, load_sequence, make_folder};

/// Arguments of `sinew evaluate`.
#[derive(Args)]
#[command(
    after_help = "Four ways to find the weights of an unseen shape, all with the same components and all played by the runtime:
  network's encoder    level by level as the paper has it, attention shares out what is left
  linear encoder       one least-squares step from rest: the pseudo-inverse of the decoder there
  feature projection   least squares on features and, to first order, positions, from there
  position projection  Gauss-Newton on positions, from there: what the components can do
and the round trip: features to positions without components, below which no figure can fall.

E_rms   position error, per mille of the bounding ball (Kavan 2010)
STED    difference of edge lengths in space and time (Vasa and Skala 2011); what the eye sees
Perc    share of a shape's feature energy that an encoder misses, worst shape

Any other scorer can check: --save writes the arrays."
)]
pub struct EvaluateArguments {
    /// Compact package
    package: PathBuf,
    /// The sequence it was trained on
    sequence: PathBuf,
    /// Measure on all shapes but every Nth [default: all shapes but those the package was trained on]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    train_every: Option<u32>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write truth.npy, faces.npy, encoder.npy, linear_encoder.npy, feature_projection.npy and position_projection.npy here
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
}

/// The configuration that a package was trained with.
pub fn config_of(view: &CompactView<'_>) -> Result<TrainConfig, Report> {
    TrainConfig::from_toml(view.provenance().config)
        .into_diagnostic()
        .wrap_err("the configuration in the package cannot be read: it was written by another version")
}

/// Shapes of the sequence that are not for training, the reference excluded where it is one of them.
pub fn test_shapes(
    sequence: &MeshSequence,
    view: &CompactView<'_>,
    train_every: Option<u32>,
) -> Result<Vec<usize>, Report> {
    let train = match train_every {
        Some(every) => chosen_shapes(every as usize, None, sequence.shape_count())?,
        None => view.provenance().train_shapes.iter().map(|&m| m as usize).collect(),
    };
    let test: Vec<usize> = (1..sequence.shape_count()).filter(|m| !train.contains(m)).collect();
    if test.is_empty() {
        return Err(miette!(
            help = "train with --train-every 10, or name another split with --train-every",
            "all {} shapes were trained on: none is left to measure",
            sequence.shape_count()
        ));
    }
    Ok(test)
}

/// Runs `sinew evaluate`.
pub fn run(arguments: &EvaluateArguments, console: &Console) -> Result<(), Failure> {
    let bytes = load_package(&arguments.package)?;
    let refuse = || format!("{} is no usable compact package", arguments.package.display());
    let view = CompactView::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
    let config = config_of(&view)?;
    let sequence = load_sequence(&arguments.sequence, console)?;
    let test = test_shapes(&sequence, &view, arguments.train_every)?;
    let trained: Vec<usize> = (1..sequence.shape_count()).filter(|m| !test.contains(m)).collect();
    console.stage("measuring shapes", test.len() as u64);
    let input = EvaluationInput {
        package: &bytes,
        sequence: &sequence,
        test_shapes: &test,
        trained_shapes: &trained,
        settings: config.features,
        encoder: config.encoder(),
    };
    let (evaluation, shapes) = evaluate(&input, &|done| console.advance(done as u64, "")).into_diagnostic()?;
    console.finish();
    if let Some(folder) = &arguments.save {
        make_folder(folder)?;
        let arrays = [
            ("truth.npy", &shapes.truth),
            ("encoder.npy", &shapes.encoder),
            ("linear_encoder.npy", &shapes.linear_encoder),
            ("feature_projection.npy", &shapes.feature_projection),
            ("position_projection.npy", &shapes.position_projection),
        ];
        for (name, shapes) in arrays {
            write_npy_f32(&folder.join(name), shapes).into_diagnostic()?;
        }
        write_npy_u32(&folder.join("faces.npy"), &sequence.faces).into_diagnostic()?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&evaluation).into_diagnostic()?);
    } else {
        print_table(&evaluation);
    }
    Ok(())
}

/// The figures as a table.
pub fn print_table(evaluation: &Evaluation) {
    println!(
        "{} shapes of {} vertices, {} + {} components",
        evaluation.shapes, evaluation.vertices, evaluation.components.coarse, evaluation.components.fine
    );
    println!(
        "{:<22} {:>8} {:>8} {:>8} {:>8}",
        "", "E_rms", "STED", "STED_s", "STED_t"
    );
    let rows: [(&str, &Scores); 5] = [
        ("network's encoder", &evaluation.encoder),
        ("linear encoder", &evaluation.linear_encoder),
        ("feature projection", &evaluation.feature_projection),
        ("position projection", &evaluation.position_projection),
        ("round trip (floor)", &evaluation.round_trip),
    ];
    for (name, scores) in rows {
        println!(
            "{name:<22} {:>8.3} {:>8.4} {:>8.4} {:>8.4}",
            scores.e_rms, scores.sted, scores.sted_s, scores.sted_t
        );
    }
    print_missed("unseen shapes", &evaluation.max_percentage_error);
    if let Some(trained) = &evaluation.trained_max_percentage_error {
        print_missed("trained shapes", trained);
    }
}

fn print_missed(shapes: &str, perc: &MaxPercentageError) {
    println!(
        "Perc, worst of the {shapes}: network's encoder, coarse alone {:.4}, all levels {:.4}; linear encoder {:.4}",
        perc.one_level, perc.two_level, perc.linear
    );
}
