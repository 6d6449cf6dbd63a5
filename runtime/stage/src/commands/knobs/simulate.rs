//! `sinew-stage knobs simulate`: a knob box without hardware, so that all of this can be tried.

use core::time::Duration;
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Instant;

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_simulator::{BoxSettings, COMMANDS, Command, Dialect, KnobBox, Port, Script, Simulator};

use crate::commands::{Failure, catch_interrupts, interrupted, parse_duration};
use crate::count::count;

/// What stands below the options: the commands are the simulator's own list.
fn help() -> String {
    let commands: String = COMMANDS.lines().map(|line| format!("  {line}\n")).collect();
    format!(
        "Without a script the knobs wander by themselves. Commands are taken on standard input, one a line, and from a script, \
         where each may have a time in front (since the beginning), `wait TIME` stands between, and `repeat` at the end begins \
         anew:\n\n{commands}\nExamples:\n  sinew-stage knobs simulate\n  sinew-stage knobs simulate --speak packets --path \
         /tmp/box --script show.txt"
    )
}

/// Arguments of `sinew-stage knobs simulate`.
#[derive(Args)]
#[command(after_help = help())]
pub struct SimulateArguments {
    /// What it speaks: deej, csv, labels, packets, encoders, midi, midi14, firmata, osc
    #[arg(long, value_name = "DIALECT", default_value = "deej", value_parser = parse_dialect)]
    speak: Dialect,
    /// How many knobs it has
    #[arg(long, value_name = "COUNT", default_value_t = 8)]
    count: u16,
    /// Reports a second
    #[arg(long, value_name = "HERTZ", default_value_t = 100)]
    rate: u32,
    /// Seed of noise, garbage and wandering
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Path to open the box by; without it, sinew-knobs in the folder for temporary files
    #[arg(long)]
    path: Option<PathBuf>,
    /// Commands to run
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// End after this time; without it, with Ctrl-C
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration)]
    time: Option<Duration>,
}

fn parse_dialect(name: &str) -> Result<Dialect, String> {
    Dialect::parse_name(name).ok_or_else(|| {
        let names: Vec<_> = Dialect::ALL.iter().map(|dialect| dialect.name()).collect();
        format!("no box speaks `{name}`: it is one of {}", names.join(", "))
    })
}

/// Runs `sinew-stage knobs simulate`.
pub fn run(arguments: &SimulateArguments, quiet: bool) -> Result<(), Failure> {
    catch_interrupts();
    let settings = BoxSettings {
        dialect: arguments.speak,
        knob_count: arguments.count,
        rate_hz: arguments.rate,
        seed: arguments.seed,
    };
    let script = arguments.script.as_deref().map(read_script).transpose()?;
    let knobs = KnobBox::new(settings).map_err(|error| miette!("{error}"))?;
    let path = arguments
        .path
        .clone()
        .unwrap_or_else(|| std::env::temp_dir().join("sinew-knobs"));
    let port = Port::open(&path).map_err(|error| miette!("{error}"))?;
    let mut simulator = Simulator::new(knobs, port);
    match script {
        Some(script) => simulator.run_script(script),
        None => simulator.command(Command::Wander(true)),
    }
    if !quiet {
        eprintln!(
            "a box with {} that speaks {} is at {}",
            count(arguments.count.into(), "knob"),
            arguments.speak.name(),
            path.display()
        );
        eprintln!("play it:  sinew-stage play model.sinew --serial {}", path.display());
        eprintln!("type a command, for example `unplug 2s`, or `help`; Ctrl-C ends");
    }
    let typed = typed_lines().into_diagnostic()?;
    let started = Instant::now();
    let mut plugged = true;
    while !interrupted() && arguments.time.is_none_or(|time| started.elapsed() < time) {
        obey(&mut simulator, &typed);
        simulator.step().map_err(|error| miette!("{error}"))?;
        let status = simulator.status();
        if status.is_plugged != plugged && !quiet {
            plugged = status.is_plugged;
            eprintln!(
                "{}",
                if plugged {
                    "the cable is back"
                } else {
                    "the cable is out"
                }
            );
        }
        thread::sleep(Duration::from_millis(1));
    }
    let status = simulator.status();
    if !quiet {
        eprintln!(
            "{} sent, {} heard, {} that nobody read; unplugged {}",
            count(status.sent_bytes, "byte"),
            status.heard_bytes,
            status.lost_bytes,
            count(status.unplugs, "time")
        );
    }
    if interrupted() {
        return Err(Failure::Stopped(String::new()));
    }
    Ok(())
}

fn read_script(path: &Path) -> Result<Script, Report> {
    let text = std::fs::read_to_string(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", path.display()))?;
    Script::parse(&text).map_err(|error| miette!("{}: {error}", path.display()))
}

fn obey(simulator: &mut Simulator, typed: &Receiver<String>) {
    for line in typed.try_iter() {
        match Command::parse(&line) {
            _ if line.trim() == "help" => eprintln!("{COMMANDS}"),
            Ok(Some(command)) => simulator.command(command),
            Ok(None) => {}
            Err(error) => eprintln!("{error}"),
        }
    }
}

/// Lines of standard input, from a thread that ends with it.
fn typed_lines() -> std::io::Result<Receiver<String>> {
    let (sender, lines): (Sender<String>, _) = channel();
    let read = move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    };
    thread::Builder::new().name("sinew-typed".to_owned()).spawn(read)?;
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_lists_every_command_and_dialect() {
        use clap::CommandFactory;
        #[derive(clap::Parser)]
        struct Cli {
            #[command(flatten)]
            arguments: SimulateArguments,
        }
        let help = Cli::command().render_long_help().to_string();
        for line in COMMANDS.lines() {
            assert!(help.contains(line), "{line}");
        }
        for dialect in Dialect::ALL {
            assert!(help.contains(dialect.name()), "{}", dialect.name());
            assert_eq!(parse_dialect(dialect.name()), Ok(dialect));
        }
        assert!(parse_dialect("dmx").unwrap_err().contains("deej"));
    }
}
