//! What a performance shows: filled by the frame loop, read by the terminal view and the status lines. The frame never waits
//! for a reader: a snapshot that is being read stays as it was for one frame.

use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use sinew_knobs::device::DeviceStatus;
use sinew_knobs::{Assignment, Command, ControlSurface, Knob, SurfaceStatus, TreeView};
use sinew_runtime::Basis;

/// Requests that wait at most, and that a frame takes at most: who asks more waits or is refused, and no flood of them holds a frame.
pub const REQUESTS_MAX: usize = 4096;

/// What somebody wants of the frame loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// A command to the surface.
    Command(Command),
    /// Stop, or release if stopped.
    StopOrRelease,
    /// A weight, past the knobs: the control goes there in a fraction of a second, no faster than its slew limit.
    Weight {
        /// Index of the component.
        control: u16,
        /// Clamped to its range.
        weight: f32,
    },
    /// Everything eases to rest, and goes on from there.
    Rest,
    /// Begin to record, or end it.
    Record,
    /// End.
    Quit,
}

/// A component's name and stops.
#[derive(Debug, Clone, PartialEq)]
pub struct ComponentLabel {
    /// Its name.
    pub name: String,
    /// Lower stop.
    pub minimum: f32,
    /// Upper stop.
    pub maximum: f32,
}

/// What does not change while a performance runs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Labels {
    /// The package, and what plays it.
    pub title: String,
    /// Names of the knobs.
    pub knobs: Vec<String>,
    /// The components.
    pub components: Vec<ComponentLabel>,
    /// Pages of the bindings.
    pub page_count: u16,
    /// Coarse and fine knobs of the tree.
    pub tree: Option<(u16, u16)>,
}

impl Labels {
    /// Labels of a map; a knob without a name is called by its number.
    pub fn new(
        title: String,
        basis: &Basis<'_>,
        knobs: &[Knob<'_>],
        page_count: u16,
        tree: Option<(u16, u16)>,
    ) -> Self {
        let own = crate::config::Place::OWN_ADDRESSES;
        let knob_label = |(n, knob): (usize, &Knob<'_>)| match (knob.name, knob.address) {
            ("", address) if address >= own => format!("knob {}", n + 1),
            ("", address) => format!("knob {address}"),
            (name, _) => name.to_owned(),
        };
        let components = basis.components().map(|component| ComponentLabel {
            name: component.name.to_owned(),
            minimum: component.minimum,
            maximum: component.maximum,
        });
        Self {
            title,
            knobs: knobs.iter().enumerate().map(knob_label).collect(),
            components: components.collect(),
            page_count,
            tree,
        }
    }
}

/// A recording that runs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recording {
    /// The file.
    pub file: String,
    /// Frames in it.
    pub frames: u64,
}

/// A moment of a performance.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Its time, µs.
    pub now_us: u64,
    /// Where each knob stands. Shape: `[knobs]`.
    pub positions: Vec<Option<f32>>,
    /// What each knob moves on this page.
    pub assignments: Vec<Assignment>,
    /// Shape: `[K]`.
    pub weights: Vec<f32>,
    /// Page of the bindings, from 0.
    pub page: u16,
    /// What the tree's knobs show.
    pub view: TreeView,
    /// Whether a stop holds.
    pub stopped: bool,
    /// The surface's counts and health.
    pub surface: SurfaceStatus,
    /// The device, a few times a second.
    pub device: Option<DeviceStatus>,
    /// Frames so far.
    pub frames: u64,
    /// Frames left out because one took too long.
    pub missed: u64,
    /// Frames of the last second.
    pub fps: f32,
    /// Time that a frame took, mean of the last second, µs.
    pub frame_us: f32,
    /// The longest of the last second, µs.
    pub frame_us_max: u64,
    /// Events a second.
    pub event_rate: f32,
    /// The recording.
    pub recording: Option<Recording>,
    /// Frames that streams left out.
    pub stream_dropped: u64,
    /// Why a stream, a recording or a line of standard input failed.
    pub trouble: Option<String>,
}

/// Where the frame loop leaves its snapshot.
#[derive(Default)]
pub struct Board {
    snapshot: Mutex<Snapshot>,
    over: AtomicBool,
    wake: OnceLock<Box<dyn Fn() + Send + Sync>>,
}

impl fmt::Debug for Board {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Board")
            .field("snapshot", &self.snapshot)
            .finish_non_exhaustive()
    }
}

impl Board {
    /// A board with room for what a surface shows.
    pub fn new(knob_count: usize, slot_count: usize, component_count: usize) -> Self {
        let snapshot = Snapshot {
            positions: vec![None; knob_count],
            assignments: Vec::with_capacity(slot_count),
            weights: vec![0.0; component_count],
            ..Snapshot::default()
        };
        Self {
            snapshot: Mutex::new(snapshot),
            ..Self::default()
        }
    }

    /// Changes the snapshot unless somebody reads it. Allocates nothing itself.
    pub fn publish(&self, change: impl FnOnce(&mut Snapshot)) {
        if let Ok(mut snapshot) = self.snapshot.try_lock() {
            change(&mut snapshot);
        }
        self.wake();
    }

    /// Calls `wake` after every change from now on. It must neither wait nor take long. Only the first caller is heard.
    pub fn on_publish(&self, wake: impl Fn() + Send + Sync + 'static) {
        let _ = self.wake.set(Box::new(wake));
    }

    /// Does what a change would, without one.
    pub fn wake(&self) {
        if let Some(wake) = self.wake.get() {
            wake();
        }
    }

    /// A copy.
    pub fn read(&self) -> Snapshot {
        self.snapshot.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The performance is over: readers end.
    pub fn close(&self) {
        self.over.store(true, Ordering::SeqCst);
    }

    /// Whether it is.
    pub fn is_closed(&self) -> bool {
        self.over.load(Ordering::SeqCst)
    }
}

impl Snapshot {
    /// Takes over what a surface shows.
    pub fn take_surface(&mut self, surface: &ControlSurface<'_>, weights: &[f32]) {
        for (knob, position) in self.positions.iter_mut().enumerate() {
            *position = surface.position(knob);
        }
        self.assignments.clear();
        self.assignments.extend(surface.assignments());
        self.weights.copy_from_slice(weights);
        self.page = surface.page();
        self.view = surface.view();
        self.stopped = surface.is_stopped();
        self.surface = surface.status();
    }

    /// Age of the newest reading, µs.
    pub fn age_us(&self) -> Option<u64> {
        self.surface.last_event_us.map(|last| self.now_us.saturating_sub(last))
    }
}

/// Frames, times and events of whole seconds.
#[derive(Debug, Clone, Copy, Default)]
pub struct Rates {
    since_us: u64,
    frames: u32,
    frame_us_sum: u64,
    frame_us_max: u64,
    events_before: u64,
}

impl Rates {
    /// Counts a frame; once a second the snapshot gets the figures. Returns whether it did.
    pub fn frame(&mut self, now_us: u64, frame_us: u64, events: u64, board: &Board) -> bool {
        if self.frames == 0 && self.since_us == 0 {
            self.since_us = now_us;
        }
        self.frames += 1;
        self.frame_us_sum += frame_us;
        self.frame_us_max = self.frame_us_max.max(frame_us);
        let passed_us = now_us.saturating_sub(self.since_us);
        if passed_us < 1_000_000 {
            return false;
        }
        let seconds = passed_us as f32 * 1e-6;
        let rates = *self;
        board.publish(|snapshot| {
            snapshot.fps = rates.frames as f32 / seconds;
            snapshot.frame_us = rates.frame_us_sum as f32 / rates.frames as f32;
            snapshot.frame_us_max = rates.frame_us_max;
            // A new surface counts from 0.
            snapshot.event_rate = events.saturating_sub(rates.events_before) as f32 / seconds;
        });
        *self = Self {
            since_us: now_us,
            events_before: events,
            ..Self::default()
        };
        true
    }
}
