//! `sinew-stage play --replay`: a take on the package it was played on, or on a retrained one.

use std::path::Path;
use std::sync::Arc;

use crossbeam::channel::bounded;
use miette::{IntoDiagnostic, WrapErr, miette};
use sinew_formats::package::AlignedBytes;
use sinew_knobs::device::Clock;
use sinew_knobs::take::Take;
use sinew_knobs::{ControlMap, SurfaceLayout};
use sinew_runtime::Basis;

use super::{PlayArguments, Watcher, draws, finish_streams, say, start_page, start_streams, title};
use crate::commands::{Failure, catch_interrupts};
use crate::count::count;
use crate::export::WeightsTable;
use crate::play::{Replay, Scene, SceneMemory, TakeParts};
use crate::snapshot::{Board, Labels, REQUESTS_MAX};

/// More frames than a take can be meant to have: two days at sixty a second.
const FRAMES_MAX: f64 = 1e7;

/// Runs it.
pub fn run(
    arguments: &PlayArguments,
    package: &Arc<AlignedBytes>,
    basis: &Basis<'_>,
    path: &Path,
    quiet: bool,
) -> Result<(), Failure> {
    let bytes = std::fs::read(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", path.display()))?;
    let take = Take::open(&bytes)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} cannot be replayed", path.display()))?;
    if let Some(fps) = arguments.fps {
        check_length(&take, fps, path)?;
    }
    let parts = TakeParts::new(&take, basis);
    describe(&take, basis, &parts, path, quiet);
    let map = ControlMap::new(*basis, &parts.knobs, &parts.bindings, &parts.buttons, take.tree())
        .into_diagnostic()
        .wrap_err("the take does not fit this package")?;

    let mut memory = SceneMemory::for_basis(basis);
    let mut scene = Scene::new(basis, &mut memory)?;
    let names = || basis.components().map(|component| component.name.to_owned()).collect();
    let table = arguments
        .export
        .as_ref()
        .map(|path| WeightsTable::new(path, names()))
        .transpose()?;
    let streams = start_streams(arguments, basis)?;
    let tree = take.tree().map(|tree| (tree.coarse_knobs, tree.fine_knobs));
    let labels = Labels::new(
        format!(
            "{}, take {}",
            title(arguments.package.as_deref(), basis),
            path.display()
        ),
        basis,
        &parts.knobs,
        map.page_count(),
        tree,
    );
    let board = Arc::new(Board::new(
        parts.knobs.len(),
        SurfaceLayout::for_map(&map).slot_count,
        basis.component_count(),
    ));
    let (ask, requests) = bounded(REQUESTS_MAX);
    let watched = draws(arguments);
    let page = start_page(arguments, package, &board, &labels, &ask)?;
    let watcher = Watcher::start(arguments, &board, labels, &ask, quiet || !watched)?;
    let mut replay = Replay {
        clock: Clock::start(),
        // Files take every frame as fast as they can; whoever watches or listens wants to see them in time.
        paced: watched || page.is_some() || arguments.streams.iter().any(|spec| !spec.is_file()),
        fps: arguments.fps,
        requests,
        streams,
        board: Arc::clone(&board),
        interrupted: catch_interrupts(),
        table,
    };
    let outcome = replay.run(&take, &map, &mut scene);
    watcher.end(&board);
    if let Some(page) = page {
        say(quiet, &page.finish().to_string());
    }
    let outcome = outcome?;
    let cut = if outcome.cut { ", not to its end" } else { "" };
    say(quiet, &format!("replayed {}{cut}", outcome.checksum));
    if outcome.skipped > 0 {
        say(
            quiet,
            &format!(
                "{} records left out: this package has no such component",
                outcome.skipped
            ),
        );
    }
    if let Some(table) = &replay.table {
        let rows = table.finish()?;
        say(
            quiet,
            &format!(
                "{} of weights written to {}",
                count(rows as u64, "frame"),
                arguments.export.as_deref().unwrap_or(path).display()
            ),
        );
    }
    finish_streams(replay.streams, quiet)?;
    if outcome.interrupted {
        return Err(Failure::Stopped("stopped".to_owned()));
    }
    Ok(())
}

/// Frames of one's own fill the whole time between the first and the last record, whatever a damaged take says that is.
fn check_length(take: &Take<'_>, fps: f64, path: &Path) -> Result<(), Failure> {
    let mut times = take.records().map(|stamped| stamped.at_us);
    let first = times.next().unwrap_or(0);
    let seconds = times.max().unwrap_or(first).saturating_sub(first) as f64 * 1e-6;
    if seconds * fps > FRAMES_MAX {
        return Err(miette!(
            "{} says that it lasts {:.0} hours, which is too long for frames of one's own: leave --fps out",
            path.display(),
            seconds / 3600.0
        )
        .into());
    }
    Ok(())
}

fn describe(take: &Take<'_>, basis: &Basis<'_>, parts: &TakeParts<'_>, path: &Path, quiet: bool) {
    say(
        quiet,
        &format!(
            "{}: {} of {}",
            path.display(),
            count(take.record_count() as u64, "record"),
            take.device()
        ),
    );
    if !take.is_closed() {
        let lost = match take.lost_bytes() {
            0 => "nothing that was written is lost".to_owned(),
            lost => format!(
                "what was behind the last whole piece is lost, {}",
                count(lost as u64, "byte")
            ),
        };
        say(quiet, &format!("note: the take was not closed; {lost}"));
    } else if take.lost_bytes() > 0 {
        say(
            quiet,
            &format!(
                "note: what is behind its end is not read, {}",
                count(take.lost_bytes() as u64, "byte")
            ),
        );
    }
    if take.compact_id() != basis.compact_id() {
        say(quiet, "note: played on another package; components are found by name");
    }
    if !parts.missing.is_empty() {
        let message = format!(
            "note: this package has no {}; what moved them is left out",
            parts.missing.join(", ")
        );
        say(quiet, &message);
    }
}
