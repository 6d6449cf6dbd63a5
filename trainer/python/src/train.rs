//! Learning: the trainer runs on a thread of its own, the interpreter listens: to progress, to Ctrl-C, to other Python threads.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use sinew_formats::package::AlignedBytes;
use sinew_interchange::MeshSequence;
use sinew_trainer::components::painted::PaintedRegion;
use sinew_trainer::config::{Recipe, TrainConfig};
use sinew_trainer::learn::{LearnError, Reporter, RunOptions, learn};

use crate::errors::{refuse, refused};
use crate::package::Package;
use crate::sequence::{FaceArray, Positions, faces_of, sequence_of, vertex_count_of, warn};

/// How often Ctrl-C is looked for.
const LISTENING: Duration = Duration::from_millis(50);

/// What the trainer's thread says.
enum Event {
    Progress(String, u64, u64, String),
    Notice(String),
}

/// The trainer's side of the wire.
struct Wire {
    events: Mutex<Sender<Event>>,
    stage: Mutex<(String, u64)>,
    stop: AtomicBool,
}

impl Wire {
    fn send(&self, event: Event) {
        // Nobody listens once the interpreter has given up, and then nothing is to be said.
        if let Ok(events) = self.events.lock() {
            let _ = events.send(event);
        }
    }
}

impl Reporter for Wire {
    fn stage(&self, name: &str, total: u64) {
        if let Ok(mut stage) = self.stage.lock() {
            *stage = (name.into(), total);
        }
        self.send(Event::Progress(name.into(), 0, total, String::new()));
    }

    fn advance(&self, done: u64, note: &str) {
        let Ok((name, total)) = self.stage.lock().map(|stage| stage.clone()) else {
            return;
        };
        self.send(Event::Progress(name, done, total, note.into()));
    }

    fn notice(&self, text: &str) {
        self.send(Event::Notice(text.into()));
    }

    fn stop_requested(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// See the stub file.
#[pyfunction]
#[pyo3(signature = (positions, faces, *, shapes=None, components=None, seed=None, epochs=None, recipe="local", config=None,
    paint=None, time_budget=None, progress=None))]
pub fn train(
    py: Python<'_>,
    positions: Positions<'_>,
    faces: FaceArray<'_>,
    shapes: Option<Vec<usize>>,
    components: Option<Vec<usize>>,
    seed: Option<u64>,
    epochs: Option<usize>,
    recipe: &str,
    config: Option<&str>,
    paint: Option<BTreeMap<String, Vec<u32>>>,
    time_budget: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Package> {
    let mut settings = match recipe {
        "local" => Recipe::Local,
        "paper" => Recipe::Paper,
        _ => return Err(refuse(format!("recipe must be \"local\" or \"paper\", not {recipe:?}"))),
    }
    .config();
    if let Some(text) = config {
        settings = settings.with_toml(text).map_err(refused)?;
    }
    if let Some(components) = components {
        settings.components = components;
    }
    if let Some(epochs) = epochs {
        settings.fit.steps = epochs;
    }
    if let Some(seed) = seed {
        settings.seed = seed;
    }
    for (name, vertices) in paint.unwrap_or_default() {
        let text: Vec<String> = vertices.iter().map(u32::to_string).collect();
        settings.start.painted.push(PaintedRegion {
            name,
            vertices: text.join(" ").parse().map_err(refused)?,
        });
    }
    settings.check().map_err(refused)?;
    let time_budget = time_budget
        .map(|seconds| {
            Duration::try_from_secs_f64(seconds)
                .ok()
                .filter(|time| !time.is_zero())
                .ok_or_else(|| refuse(format!("time_budget must be seconds above 0, not {seconds}")))
        })
        .transpose()?;
    let faces = faces_of(&faces, vertex_count_of(&positions))?;
    let sequence = sequence_of(&positions, faces)?;
    let shape_count = sequence.shape_count();
    let mut chosen = shapes.unwrap_or_else(|| (0..shape_count).collect());
    chosen.sort_unstable();
    chosen.dedup();
    if let Some(&last) = chosen.last().filter(|&&last| last >= shape_count) {
        return Err(refuse(format!(
            "shapes names shape {last}, but there are {shape_count}"
        )));
    }
    let options = RunOptions {
        time_budget,
        work_folder: None,
    };
    let bytes = listen(py, &sequence, &chosen, &settings, &options, progress.as_ref())?;
    Package::new(bytes)
}

/// Runs the trainer and passes on what it says, until it is done.
fn listen(
    py: Python<'_>,
    sequence: &MeshSequence,
    chosen: &[usize],
    settings: &TrainConfig,
    options: &RunOptions,
    progress: Option<&Py<PyAny>>,
) -> PyResult<AlignedBytes> {
    let (sender, mut events) = channel();
    let wire = Wire {
        events: Mutex::new(sender),
        stage: Mutex::new((String::new(), 0)),
        stop: AtomicBool::new(false),
    };
    let wire = &wire;
    let mut raised = None;
    let learned = thread::scope(|scope| {
        let trainer = scope.spawn(move || learn(sequence, chosen, settings, options, wire));
        while !trainer.is_finished() {
            if let Err(error) = hear(py, &mut events, progress) {
                wire.stop.store(true, Ordering::Relaxed);
                raised.get_or_insert(error);
            }
        }
        // What was said last.
        while let Ok(event) = events.try_recv() {
            if raised.is_none()
                && let Err(error) = pass_on(py, event, progress)
            {
                raised = Some(error);
            }
        }
        py.detach(|| trainer.join())
    });
    if let Some(error) = raised {
        return Err(error);
    }
    match learned {
        Ok(Ok(learned)) => Ok(learned.package),
        Ok(Err(LearnError::Stopped)) => Err(refuse("stopped")),
        Ok(Err(error)) => Err(refused(error)),
        Err(_) => Err(PyRuntimeError::new_err(
            "the trainer came upon a fault of its own; please report it",
        )),
    }
}

/// Waits for a word of the trainer, and for Ctrl-C.
fn hear(py: Python<'_>, events: &mut Receiver<Event>, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    // A receiver may go to another thread, but not be seen by two: the reference moves.
    let heard = py.detach(move || events.recv_timeout(LISTENING));
    py.check_signals()?;
    match heard {
        Ok(event) => pass_on(py, event, progress),
        Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => Ok(()),
    }
}

fn pass_on(py: Python<'_>, event: Event, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    match (event, progress) {
        (Event::Progress(stage, done, total, note), Some(progress)) => {
            progress.call1(py, (stage, done, total, note)).map(drop)
        }
        (Event::Progress(..), None) => Ok(()),
        (Event::Notice(text), _) => {
            let text = CString::new(text.replace('\0', " "))?;
            warn(py, &text)
        }
    }
}
