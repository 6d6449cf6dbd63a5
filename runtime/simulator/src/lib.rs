//! A knob box without hardware. It speaks every protocol that the runtime reads and has the faults of real boxes: noise, a
//! sagging supply, garbage, cut messages, bursts, frozen readings, a cable that is pulled. For trying a show out, for tests,
//! and for makers of boxes.
//!
//! Path of data: [`Script`] and [`Command`]s -> [`KnobBox`] (positions -> readings -> bytes, by a seed the same in every run) ->
//! [`Port`] (a pseudo-terminal under a path that stays) -> whatever reads serial ports. [`Simulator`] drives the two in real time.

mod dialect;
mod knob_box;
#[cfg(unix)]
mod port;
mod script;
#[cfg(unix)]
mod simulator;

pub use dialect::Dialect;
pub use knob_box::{BoxError, BoxSettings, KnobBox, Output};
#[cfg(unix)]
pub use port::{Port, PortError};
pub use script::{COMMANDS, Command, Script, ScriptError};
#[cfg(unix)]
pub use simulator::{Running, Simulator, SimulatorStatus};
