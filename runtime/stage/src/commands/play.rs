//! `sinew-stage play`: a package moved by knobs, by typed lines, or by a take.

mod again;

use core::time::Duration;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;

use clap::Args;
use crossbeam::channel::{Sender, bounded};
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use sinew_formats::package::AlignedBytes;
use sinew_knobs::SurfaceLayout;
use sinew_knobs::device::Clock;
use sinew_runtime::Basis;

use super::{Failure, catch_interrupts, interrupted, parse_duration, read_choice};
use crate::calibration::{Calibrations, default_path};
use crate::count::count;
use crate::demo;
use crate::device::{Device, DeviceArguments, identity, listen, open};
use crate::model;
use crate::page::{PageAddress, Served, Server};
use crate::play::{Live, LiveOutcome, Scene, SceneMemory, start_typed_lines};
use crate::snapshot::{Board, Labels, REQUESTS_MAX, Request};
use crate::stream::{Stream, StreamSpec};
use crate::view;
use crate::wiring::{HeardKnob, Router, resolve};

/// Arguments of `sinew-stage play`.
#[derive(Args)]
#[command(
    after_help = "Without --knobs the knobs found follow the component tree: coarse components on the first ones, and on the others \
        the children of the coarse knob turned last. A knob moves its component once it has passed the place where that stands, so \
        that nothing jumps; the view says which way to turn.

Without a device, or beside one, --typed takes lines such as `c0 0.5`, `rest`, `stop`, `release`, `next`, `previous`, `into`, \
        `out`, `next-fine`, `focus c0`, `page 2`, `record` and `quit` on standard input.

With --page the mesh is seen, and its components are moved, in a browser; a telephone is a remote control, and \
        `?view=mesh&background=transparent` behind the page's address is a browser source for OBS. As many pages as you like.

Streams: obj:FILE replaces one OBJ file at every frame, obj:FOLDER/ numbers them; raw and raw:FILE write floats; udp:PORT \
        and udp-weights:PORT send datagrams to this machine. docs/streams.md has the layouts.

A take holds what the knobs said, not what the mesh did: --replay plays it to the bit on the package it was played on, and \
        by the names of its components on another. With --fps, a replay has frames of its own, for keys at 24 a second.

Examples:
  sinew-stage play --demo --page                               nothing at hand: a built-in worm, in a browser
  sinew-stage play walk.sinew --page                           plug a box in, turn, and look at http://127.0.0.1:8080
  sinew-stage play walk.sinew --knobs show.toml --record show.take
  sinew-stage play walk.sinew --replay show.take --export weights.csv --fps 24
  sinew-stage play walk.sinew --osc 9000 --stream udp:9001
  echo 'c0 0.5' | sinew-stage play walk.sinew --typed --headless --for 1s --stream obj:pose.obj"
)]
pub struct PlayArguments {
    /// Compact or baked package
    #[arg(required_unless_present = "demo")]
    package: Option<PathBuf>,
    /// Play a built-in sea worm instead of a package
    #[arg(long, conflicts_with = "package")]
    demo: bool,
    #[command(flatten)]
    device: DeviceArguments,
    /// Which knob moves what, and how: see docs/knobs.toml
    #[arg(long, value_name = "FILE")]
    knobs: Option<PathBuf>,
    /// What `knobs calibrate` measured; without it, the file in the user's settings
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Record a take from the first frame on; the file must not be there yet
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    record: Option<PathBuf>,
    /// Play a take instead of a device
    #[arg(long, value_name = "FILE", conflicts_with_all = ["serial", "midi", "osc", "knobs", "typed"])]
    replay: Option<PathBuf>,
    /// Write the weights of every frame of the replay: .csv (with times and names) or .npy (frames x components)
    #[arg(long, value_name = "FILE", requires = "replay")]
    export: Option<PathBuf>,
    /// Where the moving mesh goes; may be repeated
    #[arg(long = "stream", value_name = "KIND[:TARGET]")]
    streams: Vec<StreamSpec>,
    /// Serve a page that shows the mesh and moves it by mouse and touch, to any browser; without ADDRESS:PORT to this machine
    /// alone, at 127.0.0.1:8080. At another address the page's URL holds a token, and only who has it may come
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, default_missing_value = "8080")]
    page: Option<PageAddress>,
    /// Status lines on standard error instead of the view; so it is, too, where standard output is no terminal
    #[arg(long)]
    headless: bool,
    /// Take lines on standard input
    #[arg(long)]
    typed: bool,
    /// Frames a second; 60 unless said, and those of the take for a replay
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// End after this time
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration)]
    time: Option<Duration>,
}

fn parse_fps(text: &str) -> Result<f64, String> {
    let fps: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if (1.0..=1000.0).contains(&fps) {
        Ok(fps)
    } else {
        Err("frames a second must be from 1 to 1000".to_owned())
    }
}

/// Runs `sinew-stage play`.
///
/// # Errors
/// What was refused, or that Ctrl-C ended it.
pub fn run(arguments: &PlayArguments, quiet: bool) -> Result<(), Failure> {
    catch_interrupts();
    let path = arguments.package.as_deref();
    let bytes = Arc::new(path.map_or_else(demo::package, model::load)?);
    let basis = model::open(&bytes, path.unwrap_or(Path::new(demo::NAME)))?;
    match &arguments.replay {
        Some(take) => again::run(arguments, &bytes, &basis, take, quiet),
        None => live(arguments, &bytes, &basis, quiet),
    }
}

fn say(quiet: bool, text: &str) {
    if !quiet {
        eprintln!("{text}");
    }
}

fn start_streams(arguments: &PlayArguments, basis: &Basis<'_>) -> Result<Vec<Stream>, Report> {
    let stdout = arguments
        .streams
        .iter()
        .filter(|spec| **spec == StreamSpec::Raw(None))
        .count();
    if stdout > 1 {
        return Err(miette!(
            "standard output takes one raw stream: give the others a file, raw:FILE"
        ));
    }
    let faces = basis.faces().to_vec();
    let start = |spec: &StreamSpec| Stream::start(spec.clone(), basis.vertex_count(), basis.component_count(), &faces);
    arguments.streams.iter().map(start).collect()
}

fn title(path: Option<&Path>, basis: &Basis<'_>) -> String {
    let file = path.and_then(Path::file_name);
    let name = file.map_or(demo::NAME.to_owned(), |name| name.to_string_lossy().into_owned());
    format!(
        "{name}: {} vertices, {} components",
        basis.vertex_count(),
        basis.component_count()
    )
}

/// The page, if one was asked for; where it is is said even to who wants quiet: nobody could open it otherwise.
fn start_page(
    arguments: &PlayArguments,
    package: &Arc<AlignedBytes>,
    board: &Arc<Board>,
    labels: &Labels,
    requests: &Sender<Request>,
) -> Result<Option<Server>, Report> {
    let Some(address) = arguments.page else { return Ok(None) };
    let served = Served {
        package: Arc::clone(package),
        labels: labels.clone(),
        board: Arc::clone(board),
        requests: requests.clone(),
        is_replay: arguments.replay.is_some(),
    };
    let server = Server::start(address, served)?;
    eprintln!("page: {}", server.url());
    Ok(Some(server))
}

/// The view or the status lines, until the board is closed.
enum Watcher {
    View(JoinHandle<std::io::Result<()>>),
    Lines(JoinHandle<()>),
}

impl Watcher {
    fn start(
        arguments: &PlayArguments,
        board: &Arc<Board>,
        labels: Labels,
        requests: &Sender<Request>,
        quiet: bool,
    ) -> Result<Self, Report> {
        let board = Arc::clone(board);
        if draws(arguments) {
            let started = view::start_terminal(board, labels, requests.clone());
            let view = started
                .into_diagnostic()
                .wrap_err("the terminal cannot be drawn on: try --headless")?;
            Ok(Self::View(view))
        } else {
            Ok(Self::Lines(
                view::start_status_lines(board, labels, quiet).into_diagnostic()?,
            ))
        }
    }

    fn end(self, board: &Board) {
        board.close();
        match self {
            Self::View(view) => match view.join() {
                Ok(Ok(())) => {}
                Ok(Err(error)) => eprintln!("the view ended: {error}"),
                Err(_) => eprintln!("the view failed"),
            },
            // A status line that failed has said so.
            Self::Lines(lines) => drop(lines.join()),
        }
    }
}

/// Whether there is a terminal to draw on.
fn draws(arguments: &PlayArguments) -> bool {
    let raw = arguments.streams.contains(&StreamSpec::Raw(None));
    !arguments.headless && !arguments.typed && !raw && std::io::stdout().is_terminal() && std::io::stdin().is_terminal()
}

/// The device, its knobs and what it is called.
struct Heard {
    device: Option<Box<dyn Device>>,
    knobs: Vec<HeardKnob>,
    name: String,
    identity: Option<String>,
}

fn live(arguments: &PlayArguments, bytes: &Arc<AlignedBytes>, basis: &Basis<'_>, quiet: bool) -> Result<(), Failure> {
    let clock = Clock::start();
    let (file, choice) = read_choice(arguments.knobs.as_deref(), &arguments.device)?;
    // Names and ranges are checked before anything is opened: a mistake in a file costs no three seconds.
    resolve(&file, basis, &[], None)?;
    let mut heard = Heard {
        device: None,
        knobs: Vec::new(),
        name: "typed".to_owned(),
        identity: None,
    };
    let in_file = choice.serial.is_some() || choice.midi.is_some() || choice.osc.is_some();
    if arguments.device.names_one() || in_file || !arguments.typed {
        // A box that comes later is welcome; one that was asked for by name and is not there is a mistake.
        let mut device = open(&choice, clock, !arguments.device.names_one())?;
        let status = device.device_status();
        if status.link == sinew_knobs::device::Link::Open {
            say(quiet, &format!("listening to {} ...", status.port));
            heard.knobs = listen(device.as_mut(), clock, &interrupted);
        } else {
            say(
                quiet,
                "no knob box yet: plug one in, or see `sinew-stage knobs list`; going on without",
            );
        }
        let status = device.device_status();
        heard.identity = (status.link == sinew_knobs::device::Link::Open).then(|| identity(&choice, &status));
        heard.name = heard.identity.clone().unwrap_or(status.port);
        heard.device = Some(device);
    }
    let path = arguments.calibration.clone().map_or_else(default_path, Ok);
    let calibrations = match path {
        Ok(path) => Calibrations::read(&path)?,
        // Without a home there is nothing to read.
        Err(_) => Calibrations::default(),
    };
    let calibration = heard.identity.as_deref().and_then(|identity| calibrations.of(identity));
    let wiring = resolve(&file, basis, &heard.knobs, calibration)?;
    let knobs = wiring.borrowed_knobs();
    let map = wiring.map(*basis, &knobs).into_diagnostic()?;
    if heard.device.is_some() {
        let found = heard.knobs.len() as u64;
        let calibrated = if calibration.is_some() { ", calibrated" } else { "" };
        say(
            quiet,
            &format!("{}: {} heard{calibrated}", heard.name, count(found, "knob")),
        );
    }

    let mut memory = SceneMemory::for_basis(basis);
    let mut scene = Scene::new(basis, &mut memory)?;
    let streams = start_streams(arguments, basis)?;
    let tree = wiring.tree.map(|tree| (tree.coarse_knobs, tree.fine_knobs));
    let labels = Labels::new(
        title(arguments.package.as_deref(), basis),
        basis,
        &knobs,
        map.page_count(),
        tree,
    );
    let board = Arc::new(Board::new(
        knobs.len(),
        SurfaceLayout::for_map(&map).slot_count,
        basis.component_count(),
    ));
    let (ask, requests) = bounded(REQUESTS_MAX);
    if arguments.typed {
        start_typed_lines(basis, ask.clone()).into_diagnostic()?;
    }
    let mut router = Router::new(wiring.routes.clone());
    for knob in &heard.knobs {
        router.name(knob.address, knob.name.as_deref().unwrap_or(""));
    }
    let page = start_page(arguments, bytes, &board, &labels, &ask)?;
    let watcher = Watcher::start(arguments, &board, labels, &ask, quiet)?;
    let mut live = Live {
        clock,
        device: heard.device,
        router,
        requests,
        streams,
        board: Arc::clone(&board),
        interrupted: catch_interrupts(),
        fps: arguments.fps.unwrap_or(60.0),
        until_us: arguments
            .time
            .map(|time| clock.now_us().saturating_add(time.as_micros() as u64)),
        record: arguments.record.clone(),
        record_later: arguments.record.clone().unwrap_or_else(|| PathBuf::from("sinew.take")),
        device_name: heard.name,
    };
    let outcome = live.run(&map, wiring.settings, tree, &mut scene);
    watcher.end(&board);
    if let Some(page) = page {
        say(quiet, &page.finish().to_string());
    }
    let outcome = outcome?;
    summarize(&outcome, live, quiet)
}

fn summarize(outcome: &LiveOutcome, live: Live<'_>, quiet: bool) -> Result<(), Failure> {
    say(quiet, &format!("played {}", outcome.checksum));
    if outcome.missed > 0 {
        say(
            quiet,
            &format!(
                "{} left out because one before took too long",
                count(outcome.missed, "frame")
            ),
        );
    }
    if let Some(device) = &live.device {
        let status = device.device_status();
        let counts = status.counters;
        let reason = counts
            .last_fault
            .filter(|_| counts.bad > 0)
            .map_or(String::new(), |fault| format!(" (the last: {fault})"));
        say(
            quiet,
            &format!(
                "{}: {}, {} of them too late to matter; {} refused{reason}; unplugged {}, back {}",
                status.port,
                count(counts.events, "reading"),
                status.replaced,
                count(counts.bad, "message"),
                count(status.unplugs, "time"),
                count(status.replugs, "time")
            ),
        );
    }
    for take in &outcome.takes {
        say(quiet, &take.to_string());
    }
    finish_streams(live.streams, quiet)?;
    if !outcome.faults.is_empty() {
        return Err(miette!("{}", outcome.faults.join("\n")).into());
    }
    if outcome.interrupted {
        return Err(Failure::Stopped("stopped".to_owned()));
    }
    Ok(())
}

/// Ends the streams; one that ended before the show did is an error.
fn finish_streams(streams: Vec<Stream>, quiet: bool) -> Result<(), Report> {
    let summaries: Vec<_> = streams.into_iter().map(Stream::finish).collect();
    for summary in &summaries {
        say(quiet, &summary.to_string());
    }
    match summaries.into_iter().find(|summary| summary.ended) {
        Some(failed) => Err(miette!("{failed}")),
        None => Ok(()),
    }
}
