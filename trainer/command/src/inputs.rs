//! What commands read and how they fail: sequences, packages, configurations, times.

use core::time::Duration;
use std::path::Path;
use std::process::ExitCode;

use clap::ValueEnum;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::{AlignedBytes, CompactView, read_package};
use sinew_interchange::{Choice, MeshSequence, read_sequence};
use sinew_trainer::config::{Recipe, TrainConfig};
use sinew_trainer::learn::Reporter;

use crate::console::Console;

/// How a command ends when it does not succeed.
#[derive(Debug)]
pub enum Failure {
    /// Something in the input or the options is wrong; the report says what and what to do.
    Refused(Report),
    /// The user stopped it; the text says what was kept.
    Stopped(String),
}

impl Failure {
    /// Says how a command ended, on standard error, and gives its exit code: 0, 2 where it was refused, 130 where it was stopped.
    pub fn exit_code(outcome: Result<(), Self>) -> ExitCode {
        match outcome {
            Ok(()) => ExitCode::SUCCESS,
            Err(Self::Stopped(message)) => {
                eprintln!("{message}");
                ExitCode::from(130)
            }
            Err(Self::Refused(report)) => {
                eprintln!("{report:?}");
                ExitCode::from(2)
            }
        }
    }
}

impl From<Report> for Failure {
    fn from(report: Report) -> Self {
        Self::Refused(report)
    }
}

/// The names of [`Recipe`]s on a command line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum RecipeName {
    /// This project's: a closed-form start, local mixes, a loss on what is finally seen
    #[default]
    Local,
    /// The paper's: a random start, all training shapes themselves, every block for itself, 10,000 passes
    Paper,
}

impl From<RecipeName> for Recipe {
    fn from(name: RecipeName) -> Self {
        match name {
            RecipeName::Local => Self::Local,
            RecipeName::Paper => Self::Paper,
        }
    }
}

/// Reads a sequence with a bar, and says what is unusual about it.
pub fn load_sequence(path: &Path, choice: &Choice, console: &Console) -> Result<MeshSequence, Report> {
    let mut started = false;
    let read = read_sequence(path, choice, &mut |done, total| {
        if !started {
            console.stage("reading shapes", total as u64);
            started = true;
        }
        console.advance(done as u64, "");
    })
    .into_diagnostic()
    .wrap_err_with(|| format!("cannot use {} as a sequence", path.display()))?;
    console.finish();
    for notice in &read.notices {
        console.say(&format!("note: {notice}"));
    }
    Ok(read.sequence)
}

/// Reads the bytes of a package file. The error names it.
pub fn load_package(path: &Path) -> Result<AlignedBytes, Report> {
    read_package(path).into_diagnostic()
}

/// A recipe with what a file of settings changes.
pub fn read_config(recipe: Recipe, path: Option<&Path>) -> Result<TrainConfig, Report> {
    let Some(path) = path else {
        return Ok(recipe.config());
    };
    let text = std::fs::read_to_string(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", path.display()))?;
    recipe
        .config()
        .with_toml(&text)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} is not a usable configuration", path.display()))
}

/// The folder a file is to be written to must exist, so that hours of work do not end in a message.
pub fn check_output(path: &Path) -> Result<(), Report> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if path.is_dir() {
        return Err(miette!("{} is a folder: name a file to write", path.display()));
    }
    // Whether one may write shows only by writing.
    tempfile::Builder::new()
        .prefix(".sinew-check")
        .tempfile_in(folder)
        .map(drop)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write into the folder {}", folder.display()))
}

/// Makes a folder for output, where it is not there yet.
pub fn make_folder(folder: &Path) -> Result<(), Report> {
    std::fs::create_dir_all(folder)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make the folder {}", folder.display()))
}

/// Which shapes are for training, from the two ways to say so.
pub fn chosen_shapes(every: usize, list: Option<&Path>, shape_count: usize) -> Result<Vec<usize>, Report> {
    let Some(list) = list else {
        return Ok((0..shape_count).step_by(every.max(1)).collect());
    };
    let text = std::fs::read_to_string(list)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", list.display()))?;
    let mut shapes = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or("");
        for word in content
            .split(|c: char| c.is_whitespace() || c == ',')
            .filter(|word| !word.is_empty())
        {
            let index: usize = word.parse().ok().filter(|&index| index < shape_count).ok_or_else(|| {
                miette!(
                    "{}:{}: `{word}` is not a shape of this sequence: expected numbers from 0 to {}",
                    list.display(),
                    number + 1,
                    shape_count.saturating_sub(1)
                )
            })?;
            shapes.push(index);
        }
    }
    shapes.sort_unstable();
    shapes.dedup();
    Ok(shapes)
}

/// `5m`, `90s`, `1h 30m`: a positive time.
pub fn parse_duration(text: &str) -> Result<Duration, String> {
    match humantime::parse_duration(text) {
        Ok(time) if time > Duration::ZERO => Ok(time),
        Ok(_) => Err("a time must be longer than nothing".to_owned()),
        Err(error) => Err(format!("{error}: write for example 90s, 5m or 1h30m")),
    }
}

/// The configuration that a package was trained with.
pub fn config_of(view: &CompactView<'_>) -> Result<TrainConfig, Report> {
    TrainConfig::from_toml(view.provenance().config)
        .into_diagnostic()
        .wrap_err("the configuration in the package cannot be read: it was written by another version")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_as_people_write_them() {
        let seconds = |text| parse_duration(text).map(|d| d.as_secs_f64());
        assert_eq!(seconds("5m"), Ok(300.0));
        assert_eq!(seconds("1h30m"), Ok(5400.0));
        assert_eq!(seconds("2.5s"), Ok(2.5));
        for wrong in ["", "m", "5x", "-3s", "0s", "1..2s", "12"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
