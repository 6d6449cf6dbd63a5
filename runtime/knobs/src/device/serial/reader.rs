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
use crate::Counters;
use crate::device::feeder::Feeder;
use crate::device::worker::Halt;
use crate::protocol::{FIRMATA_BAUD, Greeting, OPENING_BYTES_MAX, Protocol};

/// Longest that a read waits, and so what dropping a source may take.
const READ_TIMEOUT: Duration = Duration::from_millis(5);
/// The same while readings wait for the frame.
const READ_TIMEOUT_BEHIND: Duration = Duration::from_millis(1);
/// Bytes of a read: what a pseudo-terminal gives at most.
const READ_BYTES: usize = 4096;
/// Time between looks for a port that is gone: doubled from the first to the last.
const LOOK_AGAIN_FIRST: Duration = Duration::from_millis(20);
const LOOK_AGAIN_LAST: Duration = Duration::from_secs(1);
/// How long a box may talk at a baud rate without making sense.
const BAUD_TRIAL: Duration = Duration::from_secs(2);
/// Talk with gaps shorter than this counts as going on.
const TALK_GAP: Duration = Duration::from_millis(250);
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

/// Tries one baud rate after the other until bytes make sense. Only the time in which the box talks counts: one that speaks when
/// it is turned may rest for minutes.
struct BaudSearch {
    rates: &'static [u32],
    current: usize,
    proven: bool,
    /// Bytes, good and bad messages when this rate's trial began.
    base: (u64, u64, u64),
    talked: Duration,
    /// When bytes last came, and how many there were then.
    heard: Option<(Instant, u64)>,
}

impl BaudSearch {
    fn baud(&self) -> u32 {
        self.rates[self.current]
    }

    fn begin(&mut self, totals: &Counters) {
        self.base = (totals.bytes, totals.good, totals.bad);
        (self.talked, self.heard) = (Duration::ZERO, None);
    }

    /// Whether the rate has had its chance; moves on to the next.
    fn is_over(&mut self, now: Instant, totals: &Counters) -> bool {
        if self.proven || self.rates.len() < 2 {
            return false;
        }
        let (good, bad) = (totals.good - self.base.1, totals.bad - self.base.2);
        self.proven = good >= BAUD_PROOF && good > bad;
        match self.heard {
            Some((_, bytes)) if bytes == totals.bytes => {}
            Some((at, _)) => {
                self.talked += now.duration_since(at).min(TALK_GAP);
                self.heard = Some((now, totals.bytes));
            }
            None if totals.bytes > self.base.0 => self.heard = Some((now, totals.bytes)),
            None => {}
        }
        // What makes more sense than nonsense is given more time.
        let over = !self.proven && self.talked > BAUD_TRIAL && good <= bad;
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
    greeting: Greeting,
    /// Where the clock of the greetings begins.
    begun: Instant,
}

impl PortReader {
    pub(super) fn new(selector: SerialSelector, settings: SerialSettings, feeder: Feeder) -> Self {
        let search = BaudSearch {
            rates: baud_rates(settings.protocol),
            current: 0,
            proven: settings.baud.is_some(),
            base: (0, 0, 0),
            talked: Duration::ZERO,
            heard: None,
        };
        Self {
            selector,
            settings,
            feeder,
            search,
            known: None,
            port: None,
            greeting: Greeting::default(),
            begun: Instant::now(),
        }
    }

    fn greet_anew(&mut self) {
        self.greeting = Greeting::new(self.feeder.decoder());
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
                    self.search.begin(&self.feeder.totals());
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
            if self.search.is_over(Instant::now(), &self.feeder.totals()) {
                let baud = self.search.baud();
                if let Err(error) = port.set_baud_rate(baud) {
                    return Some(format!("the port does not take {baud} baud: {error}"));
                }
                self.feeder.restart(baud);
                self.search.begin(&self.feeder.totals());
                self.greet_anew();
            }
        }
        None
    }

    /// Sends what the protocol's devices wait for, until they have answered.
    fn greet(&mut self, port: &mut Port) {
        let now_us = self.begun.elapsed().as_micros() as u64;
        let mut opening = [0; OPENING_BYTES_MAX];
        let due = self.greeting.due(self.feeder.decoder(), now_us, &mut opening);
        if !due.is_empty() {
            // A port that takes no bytes now is greeted again; one that is gone, the next read tells.
            let _ = port.write(due);
        }
    }
}

/// Errors that mean: nothing yet.
fn is_patience(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search() -> BaudSearch {
        BaudSearch {
            rates: baud_rates(None),
            current: 0,
            proven: false,
            base: (0, 0, 0),
            talked: Duration::ZERO,
            heard: None,
        }
    }

    #[test]
    fn a_box_that_speaks_only_when_turned_keeps_its_baud_rate() {
        let (mut search, mut totals) = (search(), Counters::NONE);
        let begun = Instant::now();
        let at = |ms: u64| begun + Duration::from_millis(ms);
        assert!(!search.is_over(at(0), &totals));
        // First touched after a minute; a knob is nudged now and then, and the first line is always cut.
        for n in 0..3_u64 {
            for ms in (60_000 + 5_000 * n..).step_by(5).take(40) {
                totals.bytes += 5;
                totals.partial += u64::from(totals.partial == 0);
                assert!(!search.is_over(at(ms), &totals), "{ms}");
            }
            totals.good += 1;
        }
        totals.good += 1;
        assert!(!search.is_over(at(90_000), &totals));
        assert!(search.proven);
        assert_eq!(search.baud(), 9_600);
    }

    #[test]
    fn two_seconds_of_nonsense_are_enough() {
        let (mut search, mut totals) = (search(), Counters::NONE);
        let begun = Instant::now();
        let mut tried = std::vec![search.baud()];
        for ms in (0..7_000).step_by(10) {
            totals.bytes += 12;
            totals.bad += u64::from(ms % 100 == 0);
            if search.is_over(begun + Duration::from_millis(ms), &totals) {
                tried.push(search.baud());
                search.begin(&totals);
            }
        }
        assert_eq!(tried, [9_600, 115_200, FIRMATA_BAUD, 31_250]);
    }
}
