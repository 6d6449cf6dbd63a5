//! `sinew encode`: weights of the shapes of a sequence, for plots, clips, regressions and other programs.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::CompactView;
use sinew_interchange::write_npy_matrix;
use sinew_trainer::evaluate::{EncodeInput, WeightFit, encode};
use sinew_trainer::learn::Reporter;

use sinew_command::choice::ChoiceArguments;
use sinew_command::console::Console;
use sinew_command::inputs::{Failure, check_output, config_of, load_package, load_sequence};
use sinew_command::weight_table::write_csv;

/// Arguments of `sinew encode`.
#[derive(Args)]
#[command(
    after_help = "Shapes may be any of the package's mesh, trained on or not, anywhere in space: where a shape stands and how it is turned does not \
matter. Weights are those that --set of `sinew frame` and the runtime take, in the order of `sinew inspect`; they are not held \
within the stops of the controls.

  encoder    one pass, no search: quickest
  features   a search for the weights whose features come nearest, from there
  positions  a search for the weights whose vertices come nearest, from there: best

Examples:
  sinew encode walk.sinew walk/ -o weights.csv
  sinew encode walk.sinew other-walk.abc -o weights.npy --fit positions
  sinew frame walk.sinew --weights weights.npy -o played.abc"
)]
pub struct EncodeArguments {
    /// Compact package
    package: PathBuf,
    /// Shapes of the same mesh
    sequence: PathBuf,
    /// File to write: .csv (a line a shape, under the names of the components) or .npy (shapes x components, f32)
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// How weights are found
    #[arg(long, value_enum, default_value_t = Fit::Encoder)]
    fit: Fit,
    #[command(flatten)]
    choice: ChoiceArguments,
}

/// The names of [`WeightFit`]s on a command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Fit {
    Encoder,
    Features,
    Positions,
}

/// Runs `sinew encode`.
pub fn run(arguments: &EncodeArguments, console: &Console) -> Result<(), Failure> {
    let extension = arguments
        .output
        .extension()
        .and_then(|text| text.to_str())
        .unwrap_or("");
    let as_csv = match extension.to_ascii_lowercase().as_str() {
        "csv" => true,
        "npy" => false,
        _ => {
            return Err(miette!(
                help = "name it weights.csv or weights.npy",
                "{} ends neither in .csv nor in .npy",
                arguments.output.display()
            )
            .into());
        }
    };
    check_output(&arguments.output)?;
    let bytes = load_package(&arguments.package)?;
    let refuse = || format!("{} is no usable compact package", arguments.package.display());
    let view = CompactView::open(&bytes).into_diagnostic().wrap_err_with(refuse)?;
    let config = config_of(&view)?;
    let sequence = load_sequence(&arguments.sequence, &arguments.choice.choice(), console)?;
    console.stage("finding weights", sequence.shape_count() as u64);
    let input = EncodeInput {
        package: &bytes,
        sequence: &sequence,
        fit: match arguments.fit {
            Fit::Encoder => WeightFit::Encoder,
            Fit::Features => WeightFit::Features,
            Fit::Positions => WeightFit::Positions,
        },
        settings: config.features,
        encoder: config.encoder_settings(),
    };
    let weights = encode(&input, &|done| console.advance(done as u64, "")).into_diagnostic()?;
    console.finish();
    if as_csv {
        let names: Vec<&str> = view.components().map(|component| component.name).collect();
        write_csv(&arguments.output, &names, &sequence.shape_names, &weights)?;
    } else {
        let flat: Vec<f32> = weights.iter().flatten().map(|&x| x as f32).collect();
        write_npy_matrix(&arguments.output, &flat, view.component_count()).into_diagnostic()?;
    }
    console.say(&format!(
        "{}: {} shapes, {} weights each",
        arguments.output.display(),
        weights.len(),
        view.component_count()
    ));
    Ok(())
}
