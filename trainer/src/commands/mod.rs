//! The subcommands, one file each, and what they share: how they fail, how they read sequences and packages.

pub mod ablate;
pub mod bake;
pub mod compare;
pub mod console;
pub mod demo;
pub mod evaluate;
pub mod frame;
pub mod inspect;
pub mod rename;
pub mod synthesize;
pub mod train;

use std::path::Path;

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::interchange::{MeshSequence, read_sequence};
use sinew_formats::package::{AlignedBytes, read_package};
use sinew_trainer::components::labels::{Axes, Axis};
use sinew_trainer::config::{Recipe, TrainConfig};
use sinew_trainer::learn::Reporter;

use console::Console;

/// How a command ends when it does not succeed.
pub enum Failure {
    /// Something in the input or the options is wrong; the report says what and what to do.
    Refused(Report),
    /// The user stopped it; the text says what was kept.
    Stopped(String),
}

impl From<Report> for Failure {
    fn from(report: Report) -> Self {
        Self::Refused(report)
    }
}

/// Which way the rest shape stands, for labels.
#[derive(Args)]
struct Standing {
    /// The axis that points up, for labels [default: y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<Axis>,
    /// The axis that points to the front, for labels [default: z; where z is up, -y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    front: Option<Axis>,
}

impl Standing {
    fn axes(&self) -> Result<Axes, Report> {
        Axes::new(self.up, self.front).into_diagnostic()
    }
}

/// Reads a sequence with a bar, and says what is unusual about it.
fn load_sequence(path: &Path, console: &Console) -> Result<MeshSequence, Report> {
    let mut started = false;
    let read = read_sequence(path, &mut |done, total| {
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
fn load_package(path: &Path) -> Result<AlignedBytes, Report> {
    read_package(path).into_diagnostic()
}

/// A recipe with what a file of settings changes.
fn read_config(recipe: Recipe, path: Option<&Path>) -> Result<TrainConfig, Report> {
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
fn check_output(path: &Path) -> Result<(), Report> {
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
fn make_folder(folder: &Path) -> Result<(), Report> {
    std::fs::create_dir_all(folder)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make the folder {}", folder.display()))
}

/// Which shapes are for training, from the two ways to say so.
fn chosen_shapes(every: usize, list: Option<&Path>, shape_count: usize) -> Result<Vec<usize>, Report> {
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

/// `5m`, `90s`, `1h30m`: a positive time.
fn parse_duration(text: &str) -> Result<core::time::Duration, String> {
    let refuse = || format!("`{text}` is not a time: write for example 90s, 5m or 1h30m");
    let mut seconds = 0.0;
    let mut number = String::new();
    for c in text.chars() {
        if c.is_ascii_digit() || c == '.' {
            number.push(c);
            continue;
        }
        let unit = match c {
            's' => 1.0,
            'm' => 60.0,
            'h' => 3600.0,
            _ => return Err(refuse()),
        };
        seconds += unit * number.parse::<f64>().map_err(|_| refuse())?;
        number.clear();
    }
    if !number.is_empty() {
        seconds += number.parse::<f64>().map_err(|_| refuse())?;
    }
    if seconds > 0.0 && seconds < 1e9 {
        Ok(core::time::Duration::from_secs_f64(seconds))
    } else {
        Err(refuse())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_as_people_write_them() {
        let seconds = |text| parse_duration(text).map(|d| d.as_secs_f64());
        assert_eq!(seconds("5m"), Ok(300.0));
        assert_eq!(seconds("1h30m"), Ok(5400.0));
        assert_eq!(seconds("2.5"), Ok(2.5));
        for wrong in ["", "m", "5x", "-3s", "0s", "1..2s"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
