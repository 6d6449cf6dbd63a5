//! `sinew-stage knobs learn`: turn a knob, say what it moves; the mapping file is written for you.

use core::fmt::Write as _;
use core::time::Duration;
use std::io::{BufRead, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::save_package;
use sinew_knobs::Protocol;
use sinew_knobs::device::DeviceStatus;
use sinew_runtime::Basis;

use super::{Listener, knob_words, protocol};
use crate::calibration::quoted;
use crate::commands::{Failure, catch_interrupts, interrupted, parse_duration, read_choice};
use crate::config::keys::WholeOrText;
use crate::config::{COMMANDS, KnobsFile, Place, midi_words};
use crate::count::count;
use crate::device::{DeviceArguments, Touch};
use crate::model;
use crate::wiring::{resolve, unknown_component};

/// Arguments of `sinew-stage knobs learn`.
#[derive(Args)]
#[command(
    after_help = "Turn a knob: it is named, and you say which component it is to move. Enter takes the one proposed (coarse ones first), \
        `-` skips the knob, `done` writes the file. For a button write stop, release, next, previous, into, out or next-fine.

With --auto nothing is asked: the first knob turned gets the first coarse component, the second the second, and so on until \
        there are no components left, or Enter, or the time is up.

The file is a beginning: docs/knobs.toml shows what else may stand in it."
)]
pub struct LearnArguments {
    /// Compact or baked package
    package: PathBuf,
    /// Mapping file to write; it must not be there yet
    #[arg(long, short, value_name = "FILE", default_value = "knobs.toml")]
    output: PathBuf,
    #[command(flatten)]
    device: DeviceArguments,
    /// Assign components in the order in which knobs are turned
    #[arg(long)]
    auto: bool,
    /// End after this time
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration)]
    time: Option<Duration>,
}

/// What a knob was given.
enum Given {
    Component(String),
    Command(&'static str),
}

/// Runs `sinew-stage knobs learn`.
pub fn run(arguments: &LearnArguments, quiet: bool) -> Result<(), Failure> {
    catch_interrupts();
    if arguments.output.exists() {
        return Err(miette!(
            help = "name another with -o",
            "{} is there already, and would be written over",
            arguments.output.display()
        )
        .into());
    }
    let bytes = model::load(&arguments.package)?;
    let basis = model::open(&bytes, &arguments.package)?;
    let (_, choice) = read_choice(None, &arguments.device)?;
    let mut listener = Listener::open(&choice, arguments.time)?;
    if arguments.auto {
        listener.end_at_enter();
    }
    if !quiet {
        eprintln!("turn a knob");
    }
    let mut touch = Touch::default();
    let mut learned: Vec<(u16, Given)> = Vec::new();
    let mut skipped: Vec<u16> = Vec::new();
    loop {
        let mut turned = None;
        let goes_on = listener.step(|_, event| turned = touch.event(event).or(turned));
        let new = turned.filter(|knob| !skipped.contains(knob) && !learned.iter().any(|(known, _)| known == knob));
        if let Some(knob) = new {
            let status = listener.device.device_status();
            let proposed = proposal(&basis, &learned);
            let name = knob_words(&status, knob);
            if arguments.auto {
                let Some(component) = proposed else { break };
                if !quiet {
                    eprintln!("{name} moves {component}");
                }
                learned.push((knob, Given::Component(component)));
                if proposal(&basis, &learned).is_none() {
                    break;
                }
            } else {
                match ask(&basis, &name, proposed.as_deref(), &learned)? {
                    Answer::Given(given) => learned.push((knob, given)),
                    Answer::Skip => skipped.push(knob),
                    Answer::Done => break,
                }
                // What was turned while the question stood is no answer to the next.
                listener.step(|_, event| {
                    let _ = touch.event(event);
                });
                touch.settle();
                eprintln!("turn the next knob");
            }
        }
        if !goes_on {
            break;
        }
    }
    if interrupted() {
        return Err(Failure::Stopped("stopped; nothing was written".to_owned()));
    }
    if learned.is_empty() {
        return Err(miette!(
            help = "`sinew-stage knobs monitor` shows what arrives",
            "no knob was turned; nothing was written"
        )
        .into());
    }
    let status = listener.device.device_status();
    let text = mapping(&arguments.package, &arguments.device, &status, &learned);
    // What is written must be readable: the pair of the reader.
    let file = KnobsFile::parse(&arguments.output, text)?;
    resolve(&file, &basis, &[], None)?;
    save_package(&arguments.output, file.text.as_bytes()).into_diagnostic()?;
    if !quiet {
        eprintln!(
            "{} written to {}",
            count(learned.len() as u64, "knob"),
            arguments.output.display()
        );
    }
    Ok(())
}

/// The next component that no knob has, coarse ones first.
fn proposal(basis: &Basis<'_>, learned: &[(u16, Given)]) -> Option<String> {
    let taken = |name: &str| {
        learned
            .iter()
            .any(|(_, given)| matches!(given, Given::Component(own) if own == name))
    };
    let mut components: Vec<_> = basis.components().collect();
    components.sort_by_key(|component| component.level);
    components
        .into_iter()
        .map(|component| component.name)
        .find(|name| !taken(name))
        .map(str::to_owned)
}

enum Answer {
    Given(Given),
    Skip,
    Done,
}

/// Asks until the answer makes sense.
fn ask(basis: &Basis<'_>, knob: &str, proposed: Option<&str>, learned: &[(u16, Given)]) -> Result<Answer, Report> {
    let proposal = proposed.map_or(String::new(), |name| format!(" [{name}]"));
    loop {
        eprint!("{knob}: which component?{proposal} ");
        std::io::stderr().flush().into_diagnostic()?;
        let mut line = String::new();
        let read = std::io::stdin().lock().read_line(&mut line);
        if read.into_diagnostic().wrap_err("cannot read the answer")? == 0 {
            return Ok(Answer::Done);
        }
        let word = line.trim();
        let word = if word.is_empty() { proposed.unwrap_or("") } else { word };
        if let Some((command, _)) = COMMANDS.iter().find(|(command, _)| *command == word) {
            return Ok(Answer::Given(Given::Command(command)));
        }
        match word {
            "" | "-" => return Ok(Answer::Skip),
            "done" | "q" => return Ok(Answer::Done),
            _ => {}
        }
        let taken = learned
            .iter()
            .any(|(_, given)| matches!(given, Given::Component(own) if own == word));
        if taken {
            eprintln!("another knob has {word} already");
        } else if basis.component_named(word).is_some() {
            return Ok(Answer::Given(Given::Component(word.to_owned())));
        } else {
            let (message, help) = unknown_component(basis, word);
            eprintln!("{message}; {help}");
        }
    }
}

/// The file. Knobs with names are known by them, MIDI knobs by their messages, others by their numbers.
fn mapping(package: &Path, device: &DeviceArguments, status: &DeviceStatus, learned: &[(u16, Given)]) -> String {
    // Writing to a string cannot fail.
    let mut text = format!(
        "# Learned by `sinew-stage knobs learn` for {}.\n",
        package.display().to_string().replace('\n', " ")
    );
    text.push_str("# docs/knobs.toml shows what else may stand here.\n");
    let chosen = [
        device.serial.as_ref().map(|port| format!("serial = {}", quoted(port))),
        device.midi.as_ref().map(|name| format!("midi = {}", quoted(name))),
        device
            .osc
            .as_ref()
            .map(|address| format!("osc = {}", quoted(&address.to_string()))),
        device.protocol.map(|protocol| format!("protocol = \"{protocol}\"")),
        device.baud.map(|baud| format!("baud = {baud}")),
        device.full_scale.map(|full_scale| format!("full_scale = {full_scale}")),
    ];
    let chosen: Vec<String> = chosen.into_iter().flatten().collect();
    if !chosen.is_empty() {
        let _ = write!(text, "\n[device]\n{}\n", chosen.join("\n"));
    }
    for (knob, given) in learned {
        let named = status
            .names
            .iter()
            .find(|named| named.knob == *knob)
            .map(|named| named.name.as_str());
        // A device may call a knob "cc 21", which a file reads as a MIDI message.
        let is_name = |name: &&str| matches!(Place::of(WholeOrText::Text(name)), Ok(Place::Name(_)));
        let name = named.filter(is_name).map(quoted);
        let midi = (protocol(status) == Some(Protocol::Midi)).then(|| quoted(&midi_words(*knob)));
        let place = name.or(midi).unwrap_or_else(|| knob.to_string());
        let _ = match given {
            Given::Component(component) => {
                write!(text, "\n[[knob]]\nknob = {place}\ncomponent = {}\n", quoted(component))
            }
            Given::Command(command) => write!(text, "\n[[button]]\nknob = {place}\ncommand = \"{command}\"\n"),
        };
    }
    text
}
