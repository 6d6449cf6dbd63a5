//! `sinew-lab ablate`: what each choice of the method is worth, on one sequence.

use core::time::Duration;
use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, WrapErr};
use sinew_lab::ablate::page::AblationPage;
use sinew_lab::ablate::plan::Group;
use sinew_lab::ablate::{AblateError, Ablation, AblationInput, AblationSettings, Outcome, ablate};
use sinew_trainer::learn::LearnError;

use sinew_command::choice::ChoiceArguments;
use sinew_command::console::Console;
use sinew_command::inputs::{
    Failure, RecipeName, check_output, chosen_shapes, load_sequence, make_folder, parse_duration, read_config,
};

/// Shapes that a quick ablation measures at most.
const QUICK_SHAPES: usize = 12;

/// Arguments of `sinew-lab ablate`.
#[derive(Args)]
#[command(
    after_help = "Each row of the tables is one training with one choice changed, so the whole takes some thirty trainings. Finished \
rows are kept in the work folder: the same command goes on where it was stopped, and adds what is new.

Examples:
  sinew-lab ablate walk/ --quick --report walk-ablation
  sinew-lab ablate walk/ --only attention,recipe --time-budget 10m --json walk.json"
)]
pub struct AblateArguments {
    /// Folder of meshes or arrays, or a file with a moving mesh (see `sinew convert --help`)
    sequence: PathBuf,
    /// Train on every Nth shape, the first included, and measure on the others
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..))]
    train_every: u32,
    /// Tables to make
    #[arg(long, value_enum, value_name = "GROUP[,GROUP...]", value_delimiter = ',', default_values_t = Group::ALL)]
    only: Vec<Group>,
    /// Fewer and shorter trainings, and at most 12 shapes measured: rough comparisons
    #[arg(long)]
    quick: bool,
    /// What every row changes one choice of
    #[arg(long, value_enum, value_name = "NAME", default_value_t = RecipeName::Local)]
    recipe: RecipeName,
    /// TOML file with settings that all rows share
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Seed of what is random [default: 0]
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    /// Stop each training after this time, for example 90s or 5m; such rows cannot be repeated exactly
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    time_budget: Option<Duration>,
    /// Folder for finished rows [default: NAME.ablation here, NAME the sequence's]
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write index.html with tables and curves into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    choice: ChoiceArguments,
}

/// Runs `sinew-lab ablate`.
pub fn run(arguments: &AblateArguments, console: &Console) -> Result<(), Failure> {
    let mut base = read_config(arguments.recipe.into(), arguments.config.as_deref())?;
    if let Some(seed) = arguments.seed {
        base.seed = seed;
    }
    if let Some(path) = &arguments.json {
        check_output(path)?;
    }
    if let Some(folder) = &arguments.report {
        make_folder(folder)?;
        check_output(&folder.join("index.html"))?;
    }
    let sequence = load_sequence(&arguments.sequence, &arguments.choice.choice(), console)?;
    let train_shapes = chosen_shapes(arguments.train_every as usize, None, sequence.shape_count())?;
    let mut test_shapes: Vec<usize> = (1..sequence.shape_count())
        .filter(|m| !train_shapes.contains(m))
        .collect();
    if arguments.quick {
        let step = test_shapes.len().div_ceil(QUICK_SHAPES).max(1);
        test_shapes = test_shapes.into_iter().step_by(step).collect();
    }
    let work = arguments
        .work
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.ablation", sequence.name)));
    let mut groups = arguments.only.clone();
    groups.sort();
    groups.dedup();
    let settings = AblationSettings {
        base,
        recipe: arguments.recipe.into(),
        groups,
        quick: arguments.quick,
        time_budget: arguments.time_budget,
        work_folder: Some(work.clone()),
    };
    console.catch_interrupts();
    let input = AblationInput {
        sequence: &sequence,
        train_shapes: &train_shapes,
        test_shapes: &test_shapes,
        settings: &settings,
    };
    let ablated = ablate(&input, console);
    console.finish();
    let ablation = match ablated {
        Ok(ablation) => ablation,
        Err(AblateError::Learn(LearnError::Stopped)) => {
            return Err(Failure::Stopped(format!(
                "stopped; finished rows are kept in {}. The same command goes on.",
                work.display()
            )));
        }
        Err(error) => return Err(miette::Report::from_err(error).into()),
    };
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&ablation).into_diagnostic()?;
        std::fs::write(path, text + "\n")
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(folder) = &arguments.report {
        AblationPage::new(&ablation)
            .write(&folder.join("index.html"))
            .into_diagnostic()?;
    }
    print_tables(&ablation);
    console.say(&format!("rows are kept in {}", work.display()));
    Ok(())
}

fn print_tables(ablation: &Ablation) {
    println!(
        "{}: {} vertices; {} shapes for training, {} measured; seed {}{}",
        ablation.sequence,
        ablation.vertices,
        ablation.train_shapes,
        ablation.test_shapes,
        ablation.seed,
        if ablation.quick {
            "; trainings cut short: rough comparisons only"
        } else {
            ""
        }
    );
    for group in Group::ALL {
        let mut rows = ablation.rows.iter().filter(|row| row.group == group).peekable();
        if rows.peek().is_none() {
            continue;
        }
        println!();
        println!(
            "{:<34} {:>7} {:>16} {:>16} {:>16} {:>7} {:>7} {:>6} {:>7}",
            group.title(),
            "K",
            "encoder",
            "features",
            "positions",
            "trained",
            "unseen",
            "steps",
            "s"
        );
        for row in rows {
            let name = format!("{}{}", if row.is_base { "* " } else { "  " }, row.name);
            match &row.outcome {
                Outcome::Failed(why) => println!("{name:<34} failed: {why}"),
                Outcome::Measured(f) => {
                    print!("{name:<34} {:>7}", format!("{}/{}", f.components, f.components_asked));
                    for scores in [&f.encoder, &f.feature_projection, &f.position_projection] {
                        print!(" {:>8.3} {:>7.4}", scores.e_rms, scores.sted);
                    }
                    println!(
                        " {:>7.4} {:>7.4} {:>6} {:>7.1}",
                        f.missed_training, f.missed_unseen, f.steps, f.training_seconds
                    );
                }
            }
        }
    }
    println!();
    println!(
        "* what the others change one choice of. Pairs: E_rms and STED of unseen shapes. K: components kept of those asked for."
    );
    println!(
        "trained, unseen: max-percentage error, the share of feature energy that the encoder misses, of the worst shape"
    );
}
