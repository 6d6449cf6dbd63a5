//! The subcommands, one file each, and what they share: how they fail, Ctrl-C, times.

pub mod knobs;
pub mod play;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::path::Path;

use miette::Report;

use crate::config::{DeviceChoice, KnobsFile};
use crate::device::DeviceArguments;

/// How a command ends when it does not succeed.
#[derive(Debug)]
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

impl From<crate::config::ConfigError> for Failure {
    fn from(error: crate::config::ConfigError) -> Self {
        Self::Refused(error.into())
    }
}

/// Set by the first Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on the first Ctrl-C (or SIGTERM) asks the command to end; a second one ends the program at once.
pub fn catch_interrupts() -> &'static AtomicBool {
    // A handler can be set once in a process; a second call finds it set.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    });
    &INTERRUPTED
}

/// Whether Ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// The mapping file that was named, or one that says nothing; and the device of both it and the options.
///
/// # Errors
/// The file's.
fn read_choice(knobs: Option<&Path>, device: &DeviceArguments) -> Result<(KnobsFile, DeviceChoice), Report> {
    let file = knobs.map_or(Ok(KnobsFile::default()), KnobsFile::read)?;
    let choice = device.over(&file.device);
    Ok((file, choice))
}

/// `500ms`, `5m`, `90s`, `1h30m`: a positive time.
fn parse_duration(text: &str) -> Result<Duration, String> {
    let refuse = || format!("`{text}` is not a time: write for example 500ms, 90s, 5m or 1h30m");
    if let Some(milliseconds) = text.strip_suffix("ms") {
        let milliseconds: u64 = milliseconds.parse().map_err(|_| refuse())?;
        return if milliseconds > 0 {
            Ok(Duration::from_millis(milliseconds))
        } else {
            Err(refuse())
        };
    }
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
        Ok(Duration::from_secs_f64(seconds))
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
        assert_eq!(seconds("250ms"), Ok(0.25));
        assert_eq!(seconds("2.5"), Ok(2.5));
        for wrong in ["", "m", "5x", "-3s", "0s", "0ms", "1..2s", "1.5ms"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
