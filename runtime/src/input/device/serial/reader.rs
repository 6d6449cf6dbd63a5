//! The thread that reads a serial port: opens it, reads it, finds its baud rate, greets the device, and looks for it when it
//! is gone.

use core::time::Duration;
use std::boxed::Box;
use std::format;
use std::io::{self, Read, Write};
use std::string::{String, ToString};
use std::time::Instant;
use std::vec;

use super::SerialSettings;
use super::ports::{self, Known, SerialError, SerialSelector};
use crate::input::device::feeder::Feeder;
use crate::input::device::worker::Halt;
use crate::input::protocol::{FIRMATA_BAUD, Protocol};

/// Longest that a read waits, and so what dropping a source may take.
const READ_TIMEOUT: Duration = Duration::from_millis(5);
/// The same while readings wait for the frame.
const READ_TIMEOUT_BEHIND: Duration = Duration::from_millis(1);
/// Bytes of a read: what a pseudo-terminal gives at most.
const READ_BYTES: usize = 4096;
/// Time between looks for a port that is gone: doubled from the first to the last.
const LOOK_AGAIN_FIRST: Duration = Duration::from_millis(20);
const LOOK_AGAIN_LAST: Duration = Duration::from_secs(1);
/// A board that was reset when its port opened does not hear the first greeting.
const GREET_EVERY: Duration = Duration::from_secs(1);
const GREETINGS_MAX: u32 = 10;
/// How long a baud rate may make no sense.
const BAUD_TRIAL: Duration = Duration::from_secs(2);
/// Good messages that prove a baud rate, if they outnumber the bad.
const BAUD_PROOF: u64 = 4;

type Port = Box<dyn serialport::SerialPort>;

/// Baud rates of a protocol, the most usual first.
const fn baud_rates(protocol: Option<Protocol>) -> &'static [u32] {
    match protocol {
        None => &[9_600, 115_200, FIRMATA_BAUD, 31_250, 38_400, 19_200],
        Some(Protocol::Lines) => &[9_600, 115_200, 57_600, 38_400, 19_200],
        Some(Protocol::Packets) => &[115_200, 57_600, 9_600],
        Some(Protocol::Midi) => &[31_250, 115_200],
        Some(Protocol::Firmata) => &[FIRMATA_BAUD, 115_200],
        Some(Protocol::Osc) => &[115_200, 57_600, 9_600],
    }
}

/// Tries one baud rate after the other until bytes make sense.
struct BaudSearch {
    rates: &'static [u32],
    current: usize,
    proven: bool,
    since: Instant,
    /// Bytes, good and bad messages when this rate's trial began.
    base: (u64, u64, u64),
}

impl BaudSearch {
    fn baud(&self) -> u32 {
        self.rates[self.current]
    }

    fn begin(&mut self, feeder: &Feeder) {
        let totals = feeder.totals();
        (self.since, self.base) = (Instant::now(), (totals.bytes, totals.good, totals.bad));
    }

    /// Whether the rate has had its chance; moves on to the next.
    fn is_over(&mut self, feeder: &Feeder) -> bool {
        if self.proven || self.rates.len() < 2 {
            return false;
        }
        let totals = feeder.totals();
        let (bytes, good, bad) = (
            totals.bytes - self.base.0,
            totals.good - self.base.1,
            totals.bad - self.base.2,
        );
        self.proven = good >= BAUD_PROOF && good > bad;
        // A box that says nothing may be resting: without bytes there is nothing to judge.
        let over = !self.proven && bytes > 0 && self.since.elapsed() > BAUD_TRIAL;
        if over {
            self.current = (self.current + 1) % self.rates.len();
        }
        over
    }
}

/// Reads one port for as long as its source lives.
pub(super) struct PortReader {
    selector: SerialSelector,
    settings: SerialSettings,
    feeder: Feeder,
    search: BaudSearch,
    known: Option<Known>,
    port: Option<Port>,
    greeted: Option<Instant>,
    greetings: u32,
    /// Events when the device was last to be greeted anew; more of them are its answer.
    events_before: u64,
}

impl PortReader {
    pub(super) fn new(selector: SerialSelector, settings: SerialSettings, feeder: Feeder) -> Self {
        let search = BaudSearch {
            rates: baud_rates(settings.protocol),
            current: 0,
            proven: settings.baud.is_some(),
            since: Instant::now(),
            base: (0, 0, 0),
        };
        Self {
            selector,
            settings,
            feeder,
            search,
            known: None,
            port: None,
            greeted: None,
            greetings: 0,
            events_before: 0,
        }
    }

    fn greet_anew(&mut self) {
        (self.greeted, self.greetings, self.events_before) = (None, 0, self.feeder.totals().events);
    }

    fn baud(&self) -> u32 {
        self.settings.baud.unwrap_or_else(|| self.search.baud())
    }

    /// Opens the first of the ports in question that opens.
    pub(super) fn open(&mut self) -> Result<(), SerialError> {
        // A port asked for by its path needs no list, and a system that cannot list its ports is no obstacle to it.
        let by_path = matches!(self.selector, SerialSelector::Path(_));
        let ports = match ports::serial_ports() {
            Ok(ports) => ports,
            Err(_) if by_path => vec![],
            Err(error) => return self.fail(error),
        };
        let paths = match ports::candidates(&self.selector, self.known.as_ref(), &ports) {
            Ok(paths) => paths,
            Err(error) => return self.fail(error),
        };
        let mut first_error = None;
        for path in paths {
            let opened = serialport::new(path.as_str(), self.baud())
                .timeout(READ_TIMEOUT)
                .dtr_on_open(self.settings.dtr)
                .open();
            match opened {
                Ok(port) => {
                    self.known = Some(Known::of(&path));
                    self.port = Some(port);
                    self.greet_anew();
                    self.search.begin(&self.feeder);
                    self.feeder.opened(&path, Some(self.baud()));
                    return Ok(());
                }
                Err(error) => {
                    first_error.get_or_insert_with(|| SerialError::of_opening(&path, &error));
                }
            }
        }
        match first_error {
            Some(error) => self.fail(error),
            None => Ok(()),
        }
    }

    fn fail(&mut self, error: SerialError) -> Result<(), SerialError> {
        self.feeder.failed(error.to_string());
        Err(error)
    }

    pub(super) fn run(mut self, halt: &Halt) {
        let mut wait = LOOK_AGAIN_FIRST;
        while !halt.asked() {
            let Some(port) = self.port.take() else {
                let until = Instant::now() + wait;
                while Instant::now() < until && !halt.asked() {
                    halt.sleep(READ_TIMEOUT);
                    self.feeder.idle();
                }
                // Why it failed is in the status.
                let _ = self.open();
                wait = (2 * wait).min(LOOK_AGAIN_LAST);
                continue;
            };
            let before = self.feeder.totals().bytes;
            let why = self.listen(port, halt);
            if self.feeder.totals().bytes > before {
                wait = LOOK_AGAIN_FIRST;
            }
            if let Some(why) = why {
                self.feeder.lost(why);
            }
        }
    }

    /// Reads until the port is gone, and says why; `None` when the thread shall stop.
    fn listen(&mut self, mut port: Port, halt: &Halt) -> Option<String> {
        let mut buffer = vec![0; READ_BYTES];
        let mut timeout = READ_TIMEOUT;
        while !halt.asked() {
            match port.read(&mut buffer) {
                // Some systems' word for a device that is gone.
                Ok(0) => return Some("the device was unplugged".into()),
                Ok(count) => self.feeder.feed(&buffer[..count]),
                Err(error) if is_patience(&error) => {}
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                    return Some("the device was unplugged".into());
                }
                Err(error) => return Some(format!("the port failed: {error}")),
            }
            self.feeder.idle();
            let wanted = if self.feeder.is_behind() {
                READ_TIMEOUT_BEHIND
            } else {
                READ_TIMEOUT
            };
            if wanted != timeout && port.set_timeout(wanted).is_ok() {
                timeout = wanted;
            }
            self.greet(&mut port);
            if self.search.is_over(&self.feeder) {
                let baud = self.search.baud();
                if let Err(error) = port.set_baud_rate(baud) {
                    return Some(format!("the port does not take {baud} baud: {error}"));
                }
                self.feeder.restart(baud);
                self.search.begin(&self.feeder);
                self.greet_anew();
            }
        }
        None
    }

    /// Sends what the protocol's devices wait for, until they have answered.
    fn greet(&mut self, port: &mut Port) {
        let decoder = self.feeder.decoder();
        let answered = match decoder.protocol() {
            Some(Protocol::Packets) => decoder.knob_count().is_some() && self.greetings > 0,
            Some(_) => self.feeder.totals().events > self.events_before && self.greetings > 0,
            None => return,
        };
        let due = self.greeted.is_none_or(|at| at.elapsed() >= GREET_EVERY);
        if answered || !due || self.greetings >= GREETINGS_MAX {
            return;
        }
        let mut opening = [0; 64];
        let protocol = decoder.protocol();
        if let Some(Ok(count @ 1..)) = protocol.map(|protocol| protocol.write_opening(&mut opening)) {
            // A port that takes no bytes now is greeted again; one that is gone, the next read tells.
            let _ = port.write(&opening[..count]);
        }
        (self.greeted, self.greetings) = (Some(Instant::now()), self.greetings + 1);
    }
}

/// Errors that mean: nothing yet.
fn is_patience(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
    )
}
