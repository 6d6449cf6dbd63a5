//! `sinew evaluate`: a package against the shapes it was not trained on.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::CompactView;
use sinew_interchange::{MeshSequence, write_npy_f32, write_npy_u32};
use sinew_trainer::evaluate::{Evaluation, EvaluationInput, MaxPercentageError, Scores, evaluate};
use sinew_trainer::learn::Reporter;

use sinew_command::choice::ChoiceArguments;
use sinew_command::console::Console;
use sinew_command::inputs::{Failure, config_of, load_package, load_sequence, make_folder};

/// Arguments of `sinew evaluate`.
#[derive(Args)]
#[command(
    after_help = "Three ways to find the weights of an unseen shape, all with the same components and all played by the runtime:
  encoder              one pass, no search: what `sinew encode` does (of --recipe paper: the paper's, block by block)
  feature projection   least squares on features and, to first order, positions
  position projection  Gauss-Newton on positions, from there: what the components can do
and the round trip: positions to features and back, without components. What it misses is lost in the features; only weights fitted
in positions can win some of it back.

E_rms   root mean square error of a coordinate, in thousandths of the radius of the ball around the reference; every shape is first
        laid onto the truth by a rigid motion (Kavan 2010)
STED    how unevenly edges are longer or shorter than the truth's: the spread of the relative differences around every vertex, and
        along its way from shape to shape (Vasa and Skala 2011)
Perc    share of a shape's feature energy that an encoder misses, worst shape

Any other scorer can check: --save writes the arrays."
)]
pub struct EvaluateArguments {
    /// Compact package
    package: PathBuf,
    /// The sequence it was trained on, with the same choice of meshes, clip and frames
    sequence: PathBuf,
    /// Measure on all shapes but every Nth; refused where the package was trained on one of them [default: all shapes but
    /// those the package was trained on]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    train_every: Option<u32>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write truth.npy, faces.npy, encoder.npy, feature_projection.npy and position_projection.npy here
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
    #[command(flatten)]
    choice: ChoiceArguments,
}

/// Shapes of a sequence by what the package knows of them. The reference is neither: it costs nothing to give back.
#[derive(Debug)]
pub struct Split {
    /// To be measured; none was trained on.
    pub test: Vec<usize>,
    /// Trained on.
    pub trained: Vec<usize>,
    /// Whether the sequence has as many shapes as the one that the package was trained on. Another one is unseen as a whole.
    pub is_same: bool,
}

/// Splits a sequence for measuring: all shapes but those trained on, or all but every `train_every`th.
/// Errors: no shape is left; a shape to be measured was trained on.
pub fn split(sequence: &MeshSequence, view: &CompactView<'_>, train_every: Option<u32>) -> Result<Split, Report> {
    let shape_count = sequence.shape_count();
    let provenance = view.provenance();
    let is_same = provenance.shape_count as usize == shape_count;
    let trained: Vec<usize> = match is_same {
        true => provenance
            .train_shapes
            .iter()
            .map(|&m| m as usize)
            .filter(|&m| m != 0)
            .collect(),
        false => Vec::new(),
    };
    let test: Vec<usize> = match train_every {
        Some(every) => (1..shape_count).filter(|m| m % every as usize != 0).collect(),
        None => (1..shape_count).filter(|m| !trained.contains(m)).collect(),
    };
    if test.is_empty() {
        return Err(miette!(
            help = "train with --train-every 10: every tenth shape teaches, the others are left to measure on",
            "all {shape_count} shapes were trained on: none is left to measure"
        ));
    }
    let seen: Vec<String> = test
        .iter()
        .filter(|m| trained.contains(m))
        .map(usize::to_string)
        .collect();
    if let Some(first) = seen.first() {
        let count = seen.len();
        return Err(miette!(
            help = "leave --train-every out: the package knows which shapes it was trained on",
            "{count} of the shapes that --train-every leaves to measure were trained on, shape {first} the first of them: \
             figures on them would say nothing about unseen shapes"
        ));
    }
    Ok(Split { test, trained, is_same })
}

/// Runs `sinew evaluate`.
pub fn run(arguments: &EvaluateArguments, console: &Console) -> Result<(), Failure> {
    let bytes = load_package(&arguments.package)?;
    let refuse = || format!("{} is no usable compact package", arguments.package.display());
    let view = CompactView::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
    let config = config_of(&view)?;
    let sequence = load_sequence(&arguments.sequence, &arguments.choice.choice(), console)?;
    let Split { test, trained, is_same } = split(&sequence, &view, arguments.train_every)?;
    if !is_same {
        console.say(&format!(
            "note: {} has {} shapes and the package was trained on a sequence of {}: all of them are taken as unseen",
            sequence.name,
            sequence.shape_count(),
            view.provenance().shape_count
        ));
    }
    console.stage("measuring shapes", test.len() as u64);
    let input = EvaluationInput {
        package: &bytes,
        sequence: &sequence,
        test_shapes: &test,
        trained_shapes: &trained,
        settings: config.features,
        encoder: config.encoder_settings(),
    };
    let (evaluation, shapes) = evaluate(&input, &|done| console.advance(done as u64, "")).into_diagnostic()?;
    console.finish();
    if let Some(folder) = &arguments.save {
        make_folder(folder)?;
        let arrays = [
            ("truth.npy", &shapes.truth),
            ("encoder.npy", &shapes.encoder),
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
    let rows: [(&str, &Scores); 4] = [
        ("encoder", &evaluation.encoder),
        ("feature projection", &evaluation.feature_projection),
        ("position projection", &evaluation.position_projection),
        ("round trip", &evaluation.round_trip),
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
        "Perc, worst of the {shapes}: coarse alone {:.4}, all levels {:.4}",
        perc.one_level, perc.two_level
    );
}
