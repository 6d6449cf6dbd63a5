//! A take again: on the package it was played on to the bit, on another by the names of its components.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::Arc;
use std::thread;

use crossbeam::channel::Receiver;
use miette::{IntoDiagnostic, Report, WrapErr};
use sinew_knobs::device::Clock;
use sinew_knobs::take::{Take, TakeFrames};
use sinew_knobs::{Binding, Button, Command, ControlMap, ControlSurface, Knob, OnPage, SurfaceBuffers};
use sinew_runtime::Basis;

use super::scene::Scene;
use crate::checksum::WeightsChecksum;
use crate::export::WeightsTable;
use crate::snapshot::{Board, Rates, Request};
use crate::stream::Stream;

/// What a take has for a package, and what that package lacks.
pub struct TakeParts<'t> {
    /// Its knobs.
    pub knobs: Vec<Knob<'t>>,
    /// Its bindings whose components are there.
    pub bindings: Vec<Binding>,
    /// Its buttons whose components and pages are there.
    pub buttons: Vec<Button>,
    /// Names of components that are missing, each once.
    pub missing: Vec<&'t str>,
}

impl<'t> TakeParts<'t> {
    /// Sorts a take's parts out for a package.
    pub fn new(take: &Take<'t>, basis: &Basis<'_>) -> Self {
        let mut missing: Vec<&str> = Vec::new();
        let mut lack = |name| {
            if !missing.contains(&name) {
                missing.push(name);
            }
        };
        let mut bindings = Vec::new();
        for binding in take.bindings(basis) {
            match binding {
                Ok(binding) => bindings.push(binding),
                Err(error) => lack(error.name),
            }
        }
        let pages = bindings.iter().map(|binding| match binding.page {
            OnPage::Every => 1,
            OnPage::Only(page) => page.saturating_add(1),
        });
        let page_count = pages.max().unwrap_or(1);
        let mut buttons = Vec::new();
        for button in take.buttons(basis) {
            match button {
                Ok(Button {
                    command: Command::Page(page),
                    ..
                }) if page >= page_count => {}
                Ok(button) => buttons.push(button),
                Err(error) => lack(error.name),
            }
        }
        // A tree moves every component, whatever is bound.
        if take.tree().is_some() {
            take.component_names()
                .filter(|name| basis.component_named(name).is_none())
                .for_each(lack);
        }
        Self {
            knobs: take.knobs().collect(),
            bindings,
            buttons,
            missing,
        }
    }
}

/// Everything that a replay needs beside the take and the mesh.
pub struct Replay<'l> {
    /// A clock, for its pace.
    pub clock: Clock,
    /// Whether frames wait for their time.
    pub paced: bool,
    /// Frames a second of one's own; `None`: those of the take.
    pub fps: Option<f64>,
    /// What people ask for; only to end it.
    pub requests: Receiver<Request>,
    /// Where the mesh goes.
    pub streams: Vec<Stream>,
    /// Who watches.
    pub board: Arc<Board>,
    /// Set by Ctrl-C.
    pub interrupted: &'l AtomicBool,
    /// Where the weights go.
    pub table: Option<WeightsTable>,
}

/// How a replay went.
#[derive(Debug, Default)]
pub struct ReplayOutcome {
    /// Frames, and the checksum of all weights.
    pub checksum: WeightsChecksum,
    /// Records that this package has no component for.
    pub skipped: usize,
    /// Ended before the take did.
    pub cut: bool,
    /// Ended by Ctrl-C.
    pub interrupted: bool,
}

impl Replay<'_> {
    /// Plays the take.
    ///
    /// # Errors
    /// A map that does not fit the package; weights that overflow.
    pub fn run(
        &mut self,
        take: &Take<'_>,
        map: &ControlMap<'_>,
        scene: &mut Scene<'_>,
    ) -> Result<ReplayOutcome, Report> {
        let mut buffers = SurfaceBuffers::for_map(map);
        let mut surface = ControlSurface::new(*map, take.settings(), buffers.memory()).into_diagnostic()?;
        let mut frames = match self.fps {
            Some(fps) => TakeFrames::new(take, (1e6 / fps).round() as u64),
            None => TakeFrames::recorded(take),
        };
        let mut outcome = ReplayOutcome::default();
        let mut rates = Rates::default();
        // The take's clock and this one; a stop in between would show as a jump of the take's.
        let mut origin: Option<(u64, u64)> = None;
        while let Some(at_us) = frames.next_frame(&mut surface, &mut scene.controls).into_diagnostic()? {
            let (first_us, started_us) = *origin.get_or_insert((at_us, self.clock.now_us()));
            let due_us = started_us.saturating_add(at_us.saturating_sub(first_us));
            if !self.wait(due_us) {
                outcome.cut = true;
                outcome.interrupted = self.interrupted.load(Ordering::SeqCst);
                break;
            }
            let before_us = self.clock.now_us();
            outcome.checksum.frame(scene.controls.weights());
            if let Some(table) = &mut self.table {
                table.frame(at_us, scene.controls.weights());
            }
            scene
                .solve()
                .into_diagnostic()
                .wrap_err("a frame of the take cannot be played")?;
            for stream in &mut self.streams {
                let wait = !self.paced;
                stream.offer(
                    outcome.checksum.frames(),
                    at_us,
                    &scene.positions,
                    scene.controls.weights(),
                    wait,
                );
            }
            let now_us = self.clock.now_us();
            rates.frame(now_us, now_us - before_us, surface.status().events, &self.board);
            self.board.publish(|snapshot| {
                snapshot.take_surface(&surface, scene.controls.weights());
                snapshot.now_us = at_us;
                snapshot.frames = outcome.checksum.frames();
            });
        }
        outcome.skipped = frames.skipped();
        Ok(outcome)
    }

    /// Waits for a frame's time, if frames wait; false once somebody wants to end. In slices: a take may say that its next
    /// frame is tomorrow.
    fn wait(&self, due_us: u64) -> bool {
        loop {
            if self.interrupted.load(Ordering::SeqCst)
                || self.requests.try_iter().any(|request| request == Request::Quit)
            {
                return false;
            }
            let left_us = due_us.saturating_sub(self.clock.now_us());
            if !self.paced || left_us == 0 {
                return true;
            }
            thread::sleep(Duration::from_micros(left_us.min(50_000)));
        }
    }
}
