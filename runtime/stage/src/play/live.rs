//! The live loop. A frame: what the device said -> surface -> weights -> mesh -> streams, all of it into the take. Nothing in it
//! waits or allocates, but for the device's words, twice a second.

use core::sync::atomic::{AtomicBool, Ordering};
use std::path::PathBuf;
use std::sync::Arc;

use crossbeam::channel::Receiver;
use miette::{IntoDiagnostic, Report, WrapErr};
use sinew_knobs::device::Clock;
use sinew_knobs::take::{Record, TakeWriter};
use sinew_knobs::{
    Command, ControlMap, ControlSurface, KnobEvent, Reading, SourceEvent, SurfaceBuffers, SurfaceSettings, TreeView,
};
use sinew_runtime::Basis;

use super::follow::Follow;
use super::scene::Scene;
use super::take_file::{CHUNK_BYTES, TakeFile, TakeSummary, free_name};
use crate::checksum::WeightsChecksum;
use crate::device::Device;
use crate::pace::Pace;
use crate::snapshot::{Board, REQUESTS_MAX, Rates, Recording, Request};
use crate::stream::Stream;
use crate::wiring::Router;

/// Time between two looks at the device's words, µs.
const WORDS_US: u64 = 500_000;
/// Room for the events of a frame.
const EVENTS: usize = 4096;

/// Everything that a live performance needs beside the map and the mesh.
pub struct Live<'l> {
    /// The clock of the device, too.
    pub clock: Clock,
    /// The device, if there is one.
    pub device: Option<Box<dyn Device>>,
    /// Its addresses.
    pub router: Router,
    /// What people and scripts ask for.
    pub requests: Receiver<Request>,
    /// Where the mesh goes.
    pub streams: Vec<Stream>,
    /// Who watches.
    pub board: Arc<Board>,
    /// Set by Ctrl-C.
    pub interrupted: &'l AtomicBool,
    /// Frames a second.
    pub fps: f64,
    /// When to end, µs; `None`: when asked.
    pub until_us: Option<u64>,
    /// The file to record to from the first frame on.
    pub record: Option<PathBuf>,
    /// The file for a recording that is asked for later.
    pub record_later: PathBuf,
    /// What a take calls the device.
    pub device_name: String,
}

/// How a performance went.
#[derive(Debug, Default)]
pub struct LiveOutcome {
    /// Takes that were recorded.
    pub takes: Vec<TakeSummary>,
    /// Frames, and the checksum of all weights.
    pub checksum: WeightsChecksum,
    /// Frames left out.
    pub missed: u64,
    /// Ended by Ctrl-C.
    pub interrupted: bool,
    /// Recordings that could not be begun or finished. The show went on.
    pub faults: Vec<String>,
}

/// Why the loop left a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// The performance is over.
    Over,
    /// A recording begins or ends, which needs a new surface.
    Record,
}

/// What a new surface must be told to stand where the last one stood.
struct Carried {
    page: u16,
    view: TreeView,
    stopped: bool,
    lost: bool,
    /// Last reading of every knob, by its address in the map.
    readings: Vec<(u16, Option<Reading>)>,
}

impl Carried {
    fn new(map: &ControlMap<'_>) -> Self {
        Self {
            page: 0,
            view: TreeView::default(),
            stopped: false,
            lost: false,
            readings: map.knobs().iter().map(|knob| (knob.address, None)).collect(),
        }
    }

    fn note(&mut self, event: SourceEvent) {
        match event {
            SourceEvent::Knob(KnobEvent {
                knob,
                reading: reading @ Reading::Position { .. },
            }) => {
                if let Some((_, last)) = self.readings.iter_mut().find(|(address, _)| *address == knob) {
                    *last = Some(reading);
                }
            }
            SourceEvent::Knob(_) | SourceEvent::Named { .. } => {}
            SourceEvent::Unplugged => {
                self.lost = true;
                self.readings.iter_mut().for_each(|(_, last)| *last = None);
            }
            SourceEvent::Replugged => self.lost = false,
        }
    }

    /// What happened, in an order that leads there.
    fn records(&self, basis: &Basis<'_>, tree: Option<(u16, u16)>) -> Vec<Record> {
        let mut records = Vec::new();
        let mut command = |command| records.push(Record::Command(command));
        if self.page > 0 {
            command(Command::Page(self.page));
        }
        if let Some((coarse, fine)) = tree {
            let mut path: Vec<u16> = Vec::new();
            let mut at = self.view.parent;
            while let Some(k) = at {
                path.push(k);
                at = basis.component(k.into()).parent.map(|parent| parent as u16);
            }
            for &k in path.iter().rev() {
                command(Command::Focus(k));
                command(Command::Into);
            }
            for _ in 0..self.view.first / coarse.max(1) {
                command(Command::Next);
            }
            if let Some(focus) = self.view.focus {
                command(Command::Focus(focus));
                for _ in 0..self.view.first_fine / fine.max(1) {
                    command(Command::NextFine);
                }
            }
        }
        if self.stopped {
            command(Command::Stop);
        }
        for &(knob, reading) in &self.readings {
            if let Some(reading) = reading {
                records.push(Record::Source(SourceEvent::Knob(KnobEvent { knob, reading })));
            }
        }
        if self.lost {
            records.push(Record::Source(SourceEvent::Unplugged));
        }
        records
    }
}

impl Live<'_> {
    /// Plays until it is over.
    ///
    /// # Errors
    /// The take that was to be recorded from the first frame on cannot be begun; controls that the map's basis does not know.
    pub fn run(
        &mut self,
        map: &ControlMap<'_>,
        settings: SurfaceSettings,
        tree: Option<(u16, u16)>,
        scene: &mut Scene<'_>,
    ) -> Result<LiveOutcome, Report> {
        let mut carried = Carried::new(map);
        let mut follow = Follow::new(map.basis().component_count());
        let mut outcome = LiveOutcome::default();
        let mut pace = Pace::new(self.clock, self.fps);
        let mut events = Vec::with_capacity(EVENTS);
        let mut wanted = self.record.clone();
        let mut asked_later = false;
        loop {
            let mut buffers = SurfaceBuffers::for_map(map);
            let mut surface = ControlSurface::new(*map, settings, buffers.memory()).into_diagnostic()?;
            let file = match wanted.take().map(|path| TakeFile::create(&path)).transpose() {
                // Asked for in the middle of a show, which must not end for it.
                Err(report) if asked_later => {
                    outcome.faults.push(report.to_string());
                    None
                }
                created => created?,
            };
            let mut buffer = vec![0; CHUNK_BYTES];
            let mut take = match &file {
                None => None,
                Some(file) => {
                    let sink = |bytes: &[u8]| file.append(bytes);
                    let writer = TakeWriter::new(&self.device_name, map, &settings, &mut buffer, sink);
                    Some(writer.into_diagnostic().wrap_err("the take cannot be begun")?)
                }
            };
            let now_us = self.clock.now_us();
            if let Some(take) = &mut take {
                take.weights(now_us, scene.controls.weights());
            }
            for record in carried.records(map.basis(), tree) {
                give(&mut surface, now_us, record);
                if let Some(take) = &mut take {
                    take.record(now_us, record);
                }
            }
            let mut performance = Segment {
                live: self,
                surface: &mut surface,
                scene,
                take: &mut take,
                file: file.as_ref(),
                carried: &mut carried,
                follow: &mut follow,
                checksum: WeightsChecksum::default(),
                whole: &mut outcome.checksum,
                fault: outcome.faults.last().map(String::as_str),
                rates: Rates::default(),
                words_us: 0,
            };
            let end = performance.run(&mut pace, &mut events)?;
            let checksum = performance.checksum.to_string();
            (carried.page, carried.view) = (surface.page(), surface.view());
            if let Some(take) = take {
                take.finish();
            }
            let was_recording = file.is_some();
            match file.map(TakeFile::finish) {
                None => {}
                Some(Ok(path)) => outcome.takes.push(TakeSummary { path, frames: checksum }),
                Some(Err(report)) => outcome.faults.push(report.to_string()),
            }
            if end == End::Over {
                break;
            }
            if !was_recording {
                wanted = Some(free_name(&self.record_later));
                asked_later = true;
            }
        }
        outcome.missed = pace.missed();
        outcome.interrupted = self.interrupted.load(Ordering::SeqCst);
        Ok(outcome)
    }
}

/// Applies what is no frame and no weight.
fn give(surface: &mut ControlSurface<'_>, at_us: u64, record: Record) {
    match record {
        Record::Source(event) => surface.source_event(at_us, event),
        Record::Command(command) => surface.command(command),
        Record::Weight { .. } | Record::Frame => {}
    }
}

/// The frames of one surface.
struct Segment<'p, 'l, 'm, 's, 'b, S: FnMut(&[u8])> {
    live: &'p mut Live<'l>,
    surface: &'p mut ControlSurface<'m>,
    scene: &'p mut Scene<'s>,
    take: &'p mut Option<TakeWriter<'b, S>>,
    file: Option<&'p TakeFile>,
    carried: &'p mut Carried,
    follow: &'p mut Follow,
    checksum: WeightsChecksum,
    whole: &'p mut WeightsChecksum,
    /// What went wrong with the last recording.
    fault: Option<&'p str>,
    rates: Rates,
    words_us: u64,
}

impl<S: FnMut(&[u8])> Segment<'_, '_, '_, '_, '_, S> {
    fn run(&mut self, pace: &mut Pace, events: &mut Vec<(u64, SourceEvent)>) -> Result<End, Report> {
        loop {
            pace.wait();
            let now_us = self.live.clock.now_us();
            let over = self.live.until_us.is_some_and(|until| now_us >= until);
            if over || self.live.interrupted.load(Ordering::SeqCst) {
                return Ok(End::Over);
            }
            if let Some(end) = self.requests(now_us) {
                return Ok(end);
            }
            self.follow(now_us);
            self.device_events(now_us, events);
            self.surface
                .advance(now_us, &mut self.scene.controls)
                .into_diagnostic()?;
            self.record(now_us, Record::Frame);
            self.checksum.frame(self.scene.controls.weights());
            self.whole.frame(self.scene.controls.weights());
            // Weights within their ranges do not overflow; typed ones are clamped to them. The rest shape is shown otherwise.
            let solved = self.scene.solve();
            let frame = self.whole.frames();
            for stream in &mut self.live.streams {
                stream.offer(
                    frame,
                    now_us,
                    &self.scene.positions,
                    self.scene.controls.weights(),
                    false,
                );
            }
            let trouble = solved.err().map(|error| error.to_string());
            self.show(now_us, pace.missed(), trouble);
        }
    }

    fn record(&mut self, at_us: u64, record: Record) {
        if let Some(take) = self.take {
            take.record(at_us, record);
        }
    }

    fn requests(&mut self, now_us: u64) -> Option<End> {
        for _ in 0..REQUESTS_MAX {
            let Ok(request) = self.live.requests.try_recv() else {
                break;
            };
            match request {
                Request::Quit => return Some(End::Over),
                Request::Record => return Some(End::Record),
                Request::Command(command) => self.command(now_us, command),
                Request::StopOrRelease if self.carried.stopped => self.command(now_us, Command::Release),
                Request::StopOrRelease => self.command(now_us, Command::Stop),
                Request::Weight { control, weight } => self.follow.ask(control, weight, &self.scene.controls),
                // A stop that is released at once: everything eases to rest, and goes on from there.
                Request::Rest => {
                    self.command(now_us, Command::Stop);
                    self.command(now_us, Command::Release);
                }
            }
        }
        None
    }

    fn command(&mut self, now_us: u64, command: Command) {
        match command {
            Command::Stop => self.carried.stopped = true,
            Command::Release => self.carried.stopped = false,
            _ => {}
        }
        self.surface.command(command);
        self.record(now_us, Record::Command(command));
    }

    /// What people asked for past the knobs.
    fn follow(&mut self, now_us: u64) {
        if self.surface.is_stopped() {
            self.follow.forget();
        }
        let (surface, take) = (&*self.surface, &mut *self.take);
        let slew = |control| surface.slew_limit(control);
        self.follow
            .advance(now_us, &mut self.scene.controls, slew, |control, weight| {
                if let Some(take) = take {
                    take.record(now_us, Record::Weight { control, weight });
                }
            });
    }

    fn device_events(&mut self, now_us: u64, events: &mut Vec<(u64, SourceEvent)>) {
        let Some(device) = &mut self.live.device else { return };
        events.clear();
        device.poll(now_us, &mut |at_us, event| events.push((at_us, event)));
        for &(at_us, event) in &*events {
            let event = match event {
                SourceEvent::Named { knob, name } => {
                    self.live.router.name(knob, name.as_str());
                    continue;
                }
                SourceEvent::Knob(event) => {
                    let knob = self.live.router.route(event);
                    SourceEvent::Knob(KnobEvent { knob, ..event })
                }
                other => other,
            };
            self.carried.note(event);
            self.surface.source_event(at_us, event);
            if let Some(take) = self.take {
                take.record(at_us, Record::Source(event));
            }
        }
    }

    /// The board, the rates and, once a second, what is on the disk.
    fn show(&mut self, now_us: u64, missed: u64, mut trouble: Option<String>) {
        let frame_us = self.live.clock.now_us().saturating_sub(now_us);
        let events = self.surface.status().events;
        if self.rates.frame(now_us, frame_us, events, &self.live.board)
            && let Some(take) = self.take
        {
            take.flush();
        }
        let due = now_us.saturating_sub(self.words_us) >= WORDS_US || self.words_us == 0;
        let mut words = None;
        if due {
            self.words_us = now_us.max(1);
            words = self.live.device.as_ref().map(|device| device.device_status());
            trouble = trouble.or_else(|| self.file.and_then(TakeFile::fault));
            trouble = trouble.or_else(|| self.live.streams.iter().find_map(Stream::trouble));
            trouble = trouble.or_else(|| self.fault.map(str::to_owned));
        }
        let dropped = self.live.streams.iter().map(Stream::dropped).sum();
        let frames = self.whole.frames();
        let recorded = self.checksum.frames();
        self.live.board.publish(|snapshot| {
            snapshot.take_surface(self.surface, self.scene.controls.weights());
            snapshot.now_us = now_us;
            snapshot.frames = frames;
            snapshot.missed = missed;
            snapshot.stream_dropped = dropped;
            if due {
                snapshot.device = words;
                snapshot.trouble = trouble;
            }
            match (self.file, &mut snapshot.recording) {
                (None, recording) => *recording = None,
                (Some(_), Some(recording)) => recording.frames = recorded,
                (Some(file), recording) => {
                    *recording = Some(Recording {
                        file: file.path().display().to_string(),
                        frames: recorded,
                    });
                }
            }
        });
    }
}
