//! The box at its port, in real time: on the caller's thread, or on one of its own.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use crate::knob_box::{KnobBox, Output};
use crate::port::{Port, PortError};
use crate::script::{Command, Script};

/// Between two looks at the clock.
const TICK: Duration = Duration::from_millis(1);
/// A step makes up for no more than this: a laptop that slept does not flood its host when it wakes.
const STEP_MAX: Duration = Duration::from_millis(100);

/// What a simulator did so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SimulatorStatus {
    /// Bytes that a host can read, or has.
    pub sent_bytes: u64,
    /// Bytes that went nowhere: no host had the port open, or it did not read.
    pub lost_bytes: u64,
    /// Bytes that the host wrote.
    pub heard_bytes: u64,
    /// Times the cable was pulled.
    pub unplugs: u64,
    /// Whether the cable is in.
    pub is_plugged: bool,
}

/// A box at a port.
#[derive(Debug)]
pub struct Simulator {
    knobs: KnobBox,
    port: Port,
    looked: Instant,
    now: Duration,
    status: SimulatorStatus,
}

impl Simulator {
    /// Its time begins now.
    pub fn new(knobs: KnobBox, port: Port) -> Self {
        Self {
            knobs,
            port,
            looked: Instant::now(),
            now: Duration::ZERO,
            status: SimulatorStatus {
                is_plugged: true,
                ..SimulatorStatus::default()
            },
        }
    }

    /// The port.
    pub const fn port(&self) -> &Port {
        &self.port
    }

    /// The box.
    pub const fn knobs(&self) -> &KnobBox {
        &self.knobs
    }

    /// What it did so far.
    pub const fn status(&self) -> SimulatorStatus {
        self.status
    }

    /// Has a command carried out now.
    pub fn command(&mut self, command: Command) {
        self.knobs.command(self.now_us(), command);
    }

    /// Runs a script from now on.
    pub fn run_script(&mut self, script: Script) {
        self.knobs.run_script(self.now_us(), script);
    }

    /// Whether a script still has something to do.
    pub fn has_agenda(&self) -> bool {
        self.knobs.has_agenda()
    }

    /// Time of the box, µs.
    pub const fn now_us(&self) -> u64 {
        self.now.as_micros() as u64
    }

    /// Does everything that is due, and hears the host.
    ///
    /// # Errors
    /// [`PortError`] if the cable could not be put back.
    pub fn step(&mut self) -> Result<(), PortError> {
        let looked = Instant::now();
        self.now += (looked - self.looked).min(STEP_MAX);
        self.looked = looked;
        let mut buffer = [0; 256];
        let heard = self.port.receive(&mut buffer);
        self.status.heard_bytes += heard.len() as u64;
        self.knobs.heard(heard);
        let (port, status) = (&mut self.port, &mut self.status);
        let mut result = Ok(());
        self.knobs
            .advance(self.now.as_micros() as u64, &mut |output| match output {
                Output::Bytes(bytes) => {
                    let sent = port.send(bytes);
                    status.sent_bytes += sent as u64;
                    status.lost_bytes += (bytes.len() - sent) as u64;
                }
                Output::Unplug => {
                    port.unplug();
                    status.unplugs += 1;
                }
                Output::Plug => {
                    if let Err(error) = port.plug() {
                        result = Err(error);
                    }
                }
            });
        self.status.is_plugged = self.port.is_plugged();
        result
    }

    /// Steps until told to stop.
    ///
    /// # Errors
    /// As [`Simulator::step`].
    pub fn run(&mut self, stop: &AtomicBool) -> Result<(), PortError> {
        while !stop.load(Ordering::Relaxed) {
            self.step()?;
            thread::sleep(TICK);
        }
        Ok(())
    }

    /// Runs on a thread of its own.
    pub fn spawn(self) -> Running {
        let (commands, orders) = channel();
        let shared = Arc::new(Shared {
            stop: AtomicBool::new(false),
            status: Mutex::new(self.status),
        });
        let own = shared.clone();
        let thread = thread::spawn(move || self.serve(&orders, &own));
        Running {
            commands,
            shared,
            thread: Some(thread),
        }
    }

    fn serve(mut self, orders: &Receiver<Order>, shared: &Shared) -> Result<Self, PortError> {
        while !shared.stop.load(Ordering::Relaxed) {
            for order in orders.try_iter() {
                match order {
                    Order::Command(command) => self.command(command),
                    Order::Script(script) => self.run_script(script),
                }
            }
            self.step()?;
            *shared.status.lock().unwrap_or_else(PoisonError::into_inner) = self.status;
            thread::sleep(TICK);
        }
        Ok(self)
    }
}

#[derive(Debug)]
struct Shared {
    stop: AtomicBool,
    status: Mutex<SimulatorStatus>,
}

#[derive(Debug)]
enum Order {
    Command(Command),
    Script(Script),
}

/// A simulator on a thread of its own. Dropping it ends the thread and unplugs the box.
#[derive(Debug)]
pub struct Running {
    commands: Sender<Order>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Result<Simulator, PortError>>>,
}

impl Running {
    /// Has a command carried out now. After a failure nobody obeys; [`Running::stop`] says why.
    pub fn command(&self, command: Command) {
        let _ = self.commands.send(Order::Command(command));
    }

    /// Runs a script from now on.
    pub fn run_script(&self, script: Script) {
        let _ = self.commands.send(Order::Script(script));
    }

    /// What it did so far.
    pub fn status(&self) -> SimulatorStatus {
        *self.shared.status.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether it has ended by itself, which only a failure makes it do.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the thread and gives the simulator back.
    ///
    /// # Errors
    /// [`PortError`]: what ended it before.
    pub fn stop(mut self) -> Result<Simulator, PortError> {
        self.shared.stop.store(true, Ordering::Relaxed);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => unreachable!("only this and the drop take the thread"),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // What failed, nobody asked for.
            let _ = thread.join();
        }
    }
}
