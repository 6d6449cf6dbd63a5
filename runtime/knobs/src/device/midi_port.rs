//! MIDI ports of the system. The system's MIDI does not tell when a device goes, so a thread of its own looks whether the
//! port is still there, and for it when it is not; what arrives is read in the thread of the MIDI library.

use core::fmt;
use core::time::Duration;
use std::string::{String, ToString};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use std::vec::Vec;

use crossbeam::channel::{Sender, bounded};
use midir::{Ignore, MidiInput, MidiInputConnection, MidiInputPort};

use super::feeder::{Device, Feeder, feeder};
use super::status::DeviceStatus;
use super::worker::{Halt, Worker};
use super::{Clock, QUEUE_EVENTS};
use crate::protocol::{DecoderSettings, Protocol};
use crate::{ControlSource, SourceEvent};

/// What other programs see this one as.
const CLIENT: &str = "sinew";
/// How often what waits for the frame is moved on.
const TICK: Duration = Duration::from_millis(5);
/// How often the list of ports is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// How a MIDI port is read.
#[derive(Debug, Clone, Copy)]
pub struct MidiPortSettings {
    /// Encoders and pairs of controllers.
    pub decoding: DecoderSettings,
    /// Whether to begin without the device and wait for it. Default no.
    pub wait: bool,
    /// Events that may wait for the frame. Default [`QUEUE_EVENTS`].
    pub queue_events: usize,
}

impl Default for MidiPortSettings {
    fn default() -> Self {
        Self {
            decoding: DecoderSettings::default(),
            wait: false,
            queue_events: QUEUE_EVENTS,
        }
    }
}

/// Why a MIDI port is not read.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MidiError {
    /// No port has such a name.
    Missing {
        /// The part of a name that was asked for.
        wanted: String,
        /// Names of the ports that there are.
        found: Vec<String>,
    },
    /// The port did not open.
    NotOpened {
        /// Its name.
        name: String,
        /// What the system says.
        reason: String,
    },
    /// The system has no MIDI: on Linux no ALSA sequencer (`/dev/snd/seq`).
    NoMidi {
        /// What the system says.
        reason: String,
    },
    /// The thread did not start.
    NoThread {
        /// What the system says.
        reason: String,
    },
}

impl core::error::Error for MidiError {}

impl fmt::Display for MidiError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { wanted, found } => {
                write!(out, "no MIDI port has \"{wanted}\" in its name")?;
                if found.is_empty() {
                    return out.write_str("; this machine has none");
                }
                out.write_str("; there are:")?;
                found.iter().try_for_each(|name| write!(out, "\n  {name}"))
            }
            Self::NotOpened { name, reason } => write!(out, "the MIDI port {name} did not open: {reason}"),
            Self::NoMidi { reason } => write!(out, "this system has no MIDI: {reason}"),
            Self::NoThread { reason } => write!(out, "the thread that watches the MIDI port did not start: {reason}"),
        }
    }
}

fn client() -> Result<MidiInput, MidiError> {
    let mut input = MidiInput::new(CLIENT).map_err(|error| MidiError::NoMidi {
        reason: error.to_string(),
    })?;
    // Clock and active sensing come many times a second and say nothing of knobs.
    input.ignore(Ignore::All);
    Ok(input)
}

/// Names of the MIDI ports that can be read, in the system's order.
///
/// # Errors
/// [`MidiError::NoMidi`].
pub fn midi_ports() -> Result<Vec<String>, MidiError> {
    let input = client()?;
    Ok(input
        .ports()
        .iter()
        .filter_map(|port| input.port_name(port).ok())
        .collect())
}

/// A knob box on a MIDI port of the system. Dropping it closes the port and ends its thread.
#[derive(Debug)]
pub struct MidiSource {
    device: Device,
}

impl MidiSource {
    /// Opens the first port with `name` in its name, whatever the case; an empty name takes the first port. Times are those of
    /// `clock`.
    ///
    /// # Errors
    /// [`MidiError`]; with [`MidiPortSettings::wait`] only [`MidiError::NoMidi`] and [`MidiError::NoThread`].
    pub fn open(name: &str, settings: MidiPortSettings, clock: Clock) -> Result<Self, MidiError> {
        let protocol = Some(Protocol::Midi);
        let (feeder, reader, board) = feeder(
            protocol,
            settings.decoding,
            clock,
            settings.queue_events,
            name.to_string(),
        );
        let wanted = name.to_lowercase();
        let (answer, opened) = bounded(1);
        // The whole life of the port is in one thread: not every system lets it move to another.
        let worker = Worker::start("sinew-midi", move |halt| {
            watch(wanted, settings.wait, feeder, &answer, &halt)
        });
        let worker = worker.map_err(|error| MidiError::NoThread {
            reason: error.to_string(),
        })?;
        let no_answer = |_| MidiError::NoThread {
            reason: "it ended at once".into(),
        };
        opened.recv().map_err(no_answer)??;
        Ok(Self {
            device: Device::new(reader, board, worker),
        })
    }

    /// Everything that is known of the device, for people; takes a lock and allocates, so not for the frame.
    pub fn device_status(&self) -> DeviceStatus {
        self.device.status()
    }
}

impl ControlSource for MidiSource {
    fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        self.device.poll(now_us, sink);
    }
}

/// A port that is open.
struct Opened {
    id: String,
    name: String,
    _connection: MidiInputConnection<()>,
}

/// The feeder is shared by the watching thread and the MIDI library's; the frame never waits for either.
type SharedFeeder = Arc<Mutex<Feeder>>;

fn locked(feeder: &SharedFeeder) -> MutexGuard<'_, Feeder> {
    feeder.lock().unwrap_or_else(PoisonError::into_inner)
}

fn watch(wanted: String, wait: bool, feeder: Feeder, answer: &Sender<Result<(), MidiError>>, halt: &Halt) {
    let feeder = Arc::new(Mutex::new(feeder));
    let list = match client() {
        Ok(list) => list,
        Err(error) => return drop(answer.send(Err(error))),
    };
    let mut port = None;
    match open(&list, &wanted, None, &feeder) {
        Ok(opened) => port = Some(opened),
        Err(error) if wait => locked(&feeder).failed(error.to_string()),
        Err(error) => return drop(answer.send(Err(error))),
    }
    if answer.send(Ok(())).is_err() {
        return; // the source is gone already
    }
    let mut known = port.as_ref().map(|port| port.name.clone());
    let mut looked = Instant::now();
    while !halt.asked() {
        halt.sleep(TICK);
        locked(&feeder).idle();
        if looked.elapsed() < LOOK_EVERY {
            continue;
        }
        looked = Instant::now();
        if let Some(opened) = port.take() {
            if list.find_port_by_id(&opened.id).is_some() {
                port = Some(opened);
                continue;
            }
            drop(opened); // first: nothing more comes in
            locked(&feeder).lost("the device was unplugged".into());
        }
        match open(&list, &wanted, known.as_deref(), &feeder) {
            Ok(opened) => {
                known = Some(opened.name.clone());
                port = Some(opened);
            }
            Err(error) => locked(&feeder).failed(error.to_string()),
        }
    }
}

/// Opens the port of the `known` name if there is one, else the first that has the `wanted` letters in its name.
fn open(list: &MidiInput, wanted: &str, known: Option<&str>, feeder: &SharedFeeder) -> Result<Opened, MidiError> {
    let named = |port: MidiInputPort| Some((list.port_name(&port).ok()?, port));
    let ports: Vec<(String, MidiInputPort)> = list.ports().into_iter().filter_map(named).collect();
    let same = ports.iter().find(|(name, _)| Some(name.as_str()) == known);
    let found = same.or_else(|| ports.iter().find(|(name, _)| name.to_lowercase().contains(wanted)));
    let Some((name, port)) = found else {
        return Err(MidiError::Missing {
            wanted: wanted.into(),
            found: ports.into_iter().map(|(name, _)| name).collect(),
        });
    };
    // Told first, so that the frame hears of the device before it hears its knobs.
    let sink = feeder.clone();
    let mut told = locked(feeder);
    let connection = client()?.connect(port, "knobs", move |_, bytes, ()| locked(&sink).feed(bytes), ());
    let connection = connection.map_err(|error| MidiError::NotOpened {
        name: name.clone(),
        reason: error.to_string(),
    })?;
    told.opened(name, None);
    drop(told);
    Ok(Opened {
        id: port.id(),
        name: name.clone(),
        _connection: connection,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_not_there_is_named_with_those_that_are() {
        let wanted = "No Such Box";
        let error = MidiSource::open(wanted, MidiPortSettings::default(), Clock::start()).unwrap_err();
        match (midi_ports(), &error) {
            (Ok(ports), MidiError::Missing { found, .. }) => {
                assert_eq!(found, &ports);
                assert!(error.to_string().contains(&wanted.to_lowercase()), "{error}");
            }
            // A machine without a sequencer says so, and does not wait for one.
            (Err(listed), MidiError::NoMidi { .. }) => assert_eq!(listed, error),
            other => panic!("{other:?}"),
        }
    }
}
