//! `knobs.toml`: which device, which knob moves what, and how it feels. Text -> [`KnobsFile`], checked as far as that goes
//! without a package -> [`super::wiring`], which knows the components.

mod error;
pub mod keys;
mod parse;
mod place;

use core::net::SocketAddr;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr};
use sinew_knobs::protocol::MidiSettings;
use sinew_knobs::{Centre, Command, Curve, Failsafe, FullScale, Protocol, Smoothing, Takeover};
use toml::de::DeTable;

pub use error::ConfigError;
use keys::{Fault, Found};
use parse::parse;
pub use place::{Place, midi_words};

/// A mapping file, without a package to hold it against.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KnobsFile {
    /// Where it came from, for messages.
    pub path: PathBuf,
    /// All of it, for messages.
    pub text: String,
    /// The device.
    pub device: DeviceChoice,
    /// What happens when it does not behave.
    pub failsafe: Failsafe,
    /// How everything answers that does not say otherwise.
    pub defaults: Feel,
    /// Smoothing of knobs that do not say otherwise.
    pub smoothing: Smoothing,
    /// Knobs that follow the component tree.
    pub tree: Option<TreeEntry>,
    /// Knobs with controls of their own.
    pub knobs: Vec<KnobEntry>,
    /// Buttons.
    pub buttons: Vec<ButtonEntry>,
}

/// Which device, and what it cannot say of itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DeviceChoice {
    /// A serial port, as after `--serial`.
    pub serial: Option<Found<String>>,
    /// A MIDI port whose name contains this.
    pub midi: Option<String>,
    /// Where OSC is taken over UDP.
    pub osc: Option<SocketAddr>,
    /// What it speaks, if it is not to be found out.
    pub protocol: Option<Protocol>,
    /// Baud rate of the serial port.
    pub baud: Option<u32>,
    /// Largest reading.
    pub full_scale: FullScale,
    /// Encoders and pairs of controllers.
    pub midi_settings: MidiSettings,
    /// Whether a reading far from the last waits for a second; `None`: where nothing checks the bytes.
    pub spike_guard: Option<bool>,
}

impl DeviceChoice {
    /// Whether a reading far from the last waits for a second: on serial lines, unless the file says otherwise or names a protocol
    /// with checksums. MIDI ports and datagrams come whole or not at all.
    pub fn guards_against_spikes(&self) -> bool {
        let is_serial = self.midi.is_none() && self.osc.is_none();
        let checks = matches!(self.protocol, Some(Protocol::Packets));
        self.spike_guard.unwrap_or(is_serial && !checks)
    }
}

/// How a control answers, as far as it was said.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Feel {
    /// Clockwise lowers.
    pub inverted: Option<bool>,
    /// Shape.
    pub curve: Option<Curve>,
    /// Where rest stands.
    pub centre: Option<Centre>,
    /// Fastest change, weight a second.
    pub slew: Option<f32>,
    /// What happens when the control stands elsewhere.
    pub takeover: Option<Takeover>,
}

impl Feel {
    /// This one, and `under` where it says nothing.
    pub fn over(self, under: Self) -> Self {
        Self {
            inverted: self.inverted.or(under.inverted),
            curve: self.curve.or(under.curve),
            centre: self.centre.or(under.centre),
            slew: self.slew.or(under.slew),
            takeover: self.takeover.or(under.takeover),
        }
    }
}

/// `[tree]`.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeEntry {
    /// Knobs for coarse components; `None`: by the number of knobs.
    pub coarse: Option<u16>,
    /// Knobs for their children; `None`: by the number of knobs.
    pub fine: Option<u16>,
    /// Whether a turn brings the children.
    pub follow_touch: bool,
    /// Its knobs, coarse ones first; empty: those found, in order.
    pub knobs: Vec<Found<Place>>,
    /// How its controls answer.
    pub feel: Feel,
    /// Where it stands.
    pub span: core::ops::Range<usize>,
}

/// `[[knob]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct KnobEntry {
    /// Which.
    pub place: Found<Place>,
    /// Name for people; empty: the device's.
    pub name: String,
    /// Travel of an encoder's step.
    pub step: Option<f32>,
    /// How many times further a step goes when the encoder is spun.
    pub acceleration: Option<f32>,
    /// How it is smoothed.
    pub smoothing: Option<Smoothing>,
    /// What it moves.
    pub controls: Vec<ControlEntry>,
}

/// `[[knob.control]]`, or the knob's own `component`.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlEntry {
    /// Name of the component.
    pub component: Found<String>,
    /// Page from 1; `None`: every page.
    pub page: Option<u16>,
    /// Share of the component's range; negative: inverted.
    pub scale: Option<f32>,
    /// Weight at the lower end.
    pub minimum: Option<f32>,
    /// Weight at the upper end.
    pub maximum: Option<f32>,
    /// How it answers.
    pub feel: Feel,
    /// Where it stands.
    pub span: core::ops::Range<usize>,
}

/// `[[button]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct ButtonEntry {
    /// Which.
    pub place: Found<Place>,
    /// What it does.
    pub command: ButtonCommand,
}

/// What a button does, by name.
#[derive(Debug, Clone, PartialEq)]
pub enum ButtonCommand {
    /// Needs no component.
    Plain(Command),
    /// Brings the children of a component.
    Focus(Found<String>),
    /// Turns to a page, from 1.
    Page(Found<u16>),
}

/// The words for commands that need nothing more; also those of standard input.
pub const COMMANDS: [(&str, Command); 7] = [
    ("stop", Command::Stop),
    ("release", Command::Release),
    ("next", Command::Next),
    ("previous", Command::Previous),
    ("into", Command::Into),
    ("out", Command::Out),
    ("next-fine", Command::NextFine),
];

impl KnobsFile {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or [`KnobsFile::parse`] refuses it.
    pub fn read(path: &Path) -> Result<Self, Report> {
        let text = std::fs::read_to_string(path)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot read {}", path.display()))?;
        Ok(Self::parse(path, text)?)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn parse(path: &Path, text: String) -> Result<Self, ConfigError> {
        match parse(&text) {
            Ok(file) => Ok(Self {
                path: path.to_path_buf(),
                text,
                ..file
            }),
            Err(fault) => Err(ConfigError::new(path, &text, fault)),
        }
    }

    /// Puts a fault that was found later into the file.
    pub fn error(&self, fault: Fault) -> ConfigError {
        ConfigError::new(&self.path, &self.text, fault)
    }
}

/// The root table of a TOML text.
///
/// # Errors
/// What TOML refuses.
pub fn parse_toml(text: &str) -> Result<DeTable<'_>, Fault> {
    let table = DeTable::parse(text).map_err(|error| {
        let span = error.span().unwrap_or(0..0);
        Fault::new(span, error.message().to_owned())
    })?;
    Ok(table.into_inner())
}

#[cfg(test)]
mod tests;
