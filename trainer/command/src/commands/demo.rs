//! `sinew demo`: the whole chain on a made-up creature, with an illustrated report.

use core::time::Duration;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use miette::{IntoDiagnostic, Report};
use sinew_command::report::illustrate::{Subject as ReportSubject, illustrate};
use sinew_formats::package::{CompactView, save_package};
use sinew_interchange::write_sequence_npy;
use sinew_trainer::bake::{BakeOptions, bake_with};
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{EvaluationInput, evaluate};
use sinew_trainer::learn::prepare::Prepared;
use sinew_trainer::learn::{LearnError, Reporter, RunOptions, Silent, learn};
use sinew_trainer::synthesize::{Settings, Subject};

use super::evaluate::{Split, print_table, split};
use sinew_command::console::Console;
use sinew_command::inputs::{Failure, make_folder};

/// Shapes of the demonstration; one in ten is trained on.
const FRAMES: usize = 101;
/// Vertices of the demonstration.
const VERTICES: usize = 2500;
/// Optimiser steps: a taste, not a full training.
const STEPS: usize = 240;
/// Ends training on slow machines.
const TIME_BUDGET: Duration = Duration::from_secs(110);

/// Arguments of `sinew demo`.
#[derive(Args)]
#[command(
    after_help = "It makes a walking creature, learns from one shape in ten, packages, plays the other shapes through the \
runtime and draws what came of it. Look at report.html first."
)]
pub struct DemoArguments {
    /// Folder to write
    #[arg(long, short, value_name = "DIR", default_value = "sinew-demo")]
    output: PathBuf,
}

/// Runs `sinew demo`.
pub fn run(arguments: &DemoArguments, console: &Console) -> Result<(), Failure> {
    let started = Instant::now();
    let folder = &arguments.output;
    make_folder(folder)?;
    console.catch_interrupts();
    console.stage("synthesizing a creature", 1);
    let settings = Settings {
        frames: FRAMES,
        vertices: VERTICES,
        seed: 0,
    };
    let sequence = Subject::Creature.synthesize(&settings).into_diagnostic()?;
    let sequence_folder = folder.join("creature");
    write_sequence_npy(&sequence_folder, &sequence).into_diagnostic()?;

    let train_shapes: Vec<usize> = (0..sequence.shape_count()).step_by(10).collect();
    let mut config = TrainConfig::default();
    config.fit.steps = STEPS;
    let options = RunOptions {
        time_budget: Some(TIME_BUDGET),
        work_folder: None,
    };
    let learned = match learn(&sequence, &train_shapes, &config, &options, console) {
        Ok(learned) => learned,
        Err(LearnError::Stopped) => {
            console.finish();
            return Err(Failure::Stopped(format!(
                "stopped; {} holds the sequence alone",
                folder.display()
            )));
        }
        Err(error) => return Err(Report::from_err(error).into()),
    };
    let trained = started.elapsed();
    let package = folder.join("creature.sinew");
    save_package(&package, &learned.package).into_diagnostic()?;
    let view = CompactView::open(&learned.package).into_diagnostic()?;
    let baked = bake_with(&view, &BakeOptions::default()).into_diagnostic()?;
    save_package(&folder.join("creature.baked.sinew"), &baked).into_diagnostic()?;

    let Split { test, .. } = split(&sequence, &view, None)?;
    console.stage("measuring shapes", test.len() as u64);
    let input = EvaluationInput {
        package: &learned.package,
        sequence: &sequence,
        test_shapes: &test,
        trained_shapes: &[],
        settings: learned.config.features,
        encoder: learned.config.encoder_settings(),
    };
    let (evaluation, shapes) = evaluate(&input, &|done| console.advance(done as u64, "")).into_diagnostic()?;

    let prepared = Prepared::new(&sequence, &train_shapes, &learned.config, &[], &Silent).into_diagnostic()?;
    let subject = ReportSubject {
        sequence: &sequence,
        prepared: &prepared,
        learned: &learned,
        baked: &baked,
        test_shapes: &test,
        evaluation: &evaluation,
        shapes: &shapes,
        facts: vec![(
            "Time to the package".to_owned(),
            format!("{:.0} s", trained.as_secs_f64()),
        )],
    };
    let report = illustrate(
        subject,
        "A creature and its components",
        "Learned from one shape in ten of a synthetic walk; every picture and figure below was played by the runtime.",
        console,
    )
    .into_diagnostic()?;
    let page = folder.join("report.html");
    report.write(&page).into_diagnostic()?;
    console.finish();
    print_table(&evaluation);
    let package = package.display();
    println!();
    println!("Look at        {}", page.display());
    println!("Then try       sinew inspect {package}");
    println!(
        "               sinew frame {package} --set c0={:.2} -o pose.obj",
        view.component(0).maximum.max(0.1)
    );
    println!("Your own       sinew train FOLDER_OF_MESHES -o model.sinew --train-every 10");
    Ok(())
}
