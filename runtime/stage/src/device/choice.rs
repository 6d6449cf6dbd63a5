//! Which device: the options of a command, what `knobs.toml` says, and the two together.

use core::net::{Ipv4Addr, SocketAddr};

use clap::Args;
use miette::{Report, miette};
use sinew_knobs::device::{Clock, DeviceStatus};
use sinew_knobs::{DecoderSettings, FullScale, Protocol};

use super::Device;
use crate::config::DeviceChoice;

/// Options that choose the device; they go before what `knobs.toml` says.
#[derive(Debug, Clone, Default, Args)]
pub struct DeviceArguments {
    /// Serial port: auto, a path such as /dev/ttyACM0 or COM3, VENDOR:PRODUCT such as 2341:0043, or serial=NUMBER
    #[arg(long, value_name = "PORT", conflicts_with_all = ["midi", "osc"])]
    pub serial: Option<String>,
    /// MIDI port whose name contains this; needs a build with --features midi
    #[arg(long, value_name = "NAME", conflicts_with = "osc")]
    pub midi: Option<String>,
    /// UDP port to take OSC on, from this machine; 0.0.0.0:PORT lets others in, a tablet for one
    #[arg(long, value_name = "PORT", value_parser = parse_osc)]
    pub osc: Option<SocketAddr>,
    /// What the device speaks, instead of finding out: lines (deej, CSV), packets, midi, firmata, osc
    #[arg(long, value_name = "NAME", value_parser = parse_protocol)]
    pub protocol: Option<Protocol>,
    /// Baud rate of the serial port, instead of trying the usual ones
    #[arg(long, value_name = "RATE")]
    pub baud: Option<u32>,
    /// Largest reading of a knob, instead of learning it: 1023 for ten bits
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u16).range(1..))]
    pub full_scale: Option<u16>,
}

fn parse_protocol(name: &str) -> Result<Protocol, String> {
    Protocol::parse_name(name).ok_or_else(|| {
        let names: Vec<_> = Protocol::ALL.iter().map(|protocol| protocol.name()).collect();
        format!("there is no protocol `{name}`: it is one of {}", names.join(", "))
    })
}

/// `9000` or `0.0.0.0:9000`.
///
/// # Errors
/// What a person should write.
pub fn parse_osc(text: &str) -> Result<SocketAddr, String> {
    let port = text
        .parse()
        .ok()
        .map(|port: u16| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    let address = port.or_else(|| text.parse().ok()).filter(|address| address.port() > 0);
    address.ok_or_else(|| {
        format!("`{text}` is neither a port, such as 9000, nor an address with one, such as 0.0.0.0:9000")
    })
}

impl DeviceArguments {
    /// Whether a device was asked for by name.
    pub fn names_one(&self) -> bool {
        self.serial.is_some() || self.midi.is_some() || self.osc.is_some()
    }

    /// These options over a file's.
    pub fn over(&self, file: &DeviceChoice) -> DeviceChoice {
        let mut choice = file.clone();
        if self.names_one() {
            choice.serial = self
                .serial
                .clone()
                .map(|value| crate::config::keys::Found { value, span: 0..0 });
            choice.midi = self.midi.clone();
            choice.osc = self.osc;
        }
        choice.protocol = self.protocol.or(choice.protocol);
        choice.baud = self.baud.or(choice.baud);
        if let Some(full_scale) = self.full_scale {
            choice.full_scale = FullScale::Fixed(full_scale);
        }
        choice
    }
}

/// Opens the device of a choice. With `wait`, a port that is not there yet is waited for.
///
/// # Errors
/// The port is not there, is busy or forbidden; this build has no such devices.
pub fn open(choice: &DeviceChoice, clock: Clock, wait: bool) -> Result<Box<dyn Device>, Report> {
    let decoding = DecoderSettings {
        full_scale: choice.full_scale,
        midi: choice.midi_settings,
        ..DecoderSettings::default()
    };
    if let Some(name) = &choice.midi {
        return open_midi(name, decoding, clock, wait);
    }
    if let Some(address) = choice.osc {
        return open_osc(address, decoding, clock);
    }
    open_serial(choice, decoding, clock, wait)
}

#[cfg(feature = "serial")]
fn open_serial(
    choice: &DeviceChoice,
    decoding: DecoderSettings,
    clock: Clock,
    wait: bool,
) -> Result<Box<dyn Device>, Report> {
    use sinew_knobs::device::{SerialSelector, SerialSettings, SerialSource};
    let selector = choice
        .serial
        .as_ref()
        .map_or(Ok(SerialSelector::Auto), |serial| serial.value.parse());
    let Ok(selector) = selector;
    let settings = SerialSettings {
        protocol: choice.protocol,
        decoding,
        baud: choice.baud,
        wait,
        ..SerialSettings::default()
    };
    let source = SerialSource::open(selector, settings, clock).map_err(|error| miette!("{error}"))?;
    Ok(Box::new(source))
}

#[cfg(not(feature = "serial"))]
fn open_serial(_: &DeviceChoice, _: DecoderSettings, _: Clock, _: bool) -> Result<Box<dyn Device>, Report> {
    Err(miette!(
        "this build reads no serial ports: build it with --features serial"
    ))
}

#[cfg(feature = "midi")]
fn open_midi(name: &str, decoding: DecoderSettings, clock: Clock, wait: bool) -> Result<Box<dyn Device>, Report> {
    use sinew_knobs::device::{MidiPortSettings, MidiSource};
    let settings = MidiPortSettings {
        decoding,
        wait,
        ..MidiPortSettings::default()
    };
    let source = MidiSource::open(name, settings, clock).map_err(|error| miette!("{error}"))?;
    Ok(Box::new(source))
}

#[cfg(not(feature = "midi"))]
fn open_midi(_: &str, _: DecoderSettings, _: Clock, _: bool) -> Result<Box<dyn Device>, Report> {
    Err(miette!("this build reads no MIDI ports: build it with --features midi"))
}

#[cfg(feature = "osc")]
fn open_osc(address: SocketAddr, decoding: DecoderSettings, clock: Clock) -> Result<Box<dyn Device>, Report> {
    use sinew_knobs::device::{OscSettings, OscSource};
    let settings = OscSettings {
        address,
        decoding,
        ..OscSettings::default()
    };
    let source = OscSource::open(settings, clock).map_err(|error| miette!("{error}"))?;
    Ok(Box::new(source))
}

#[cfg(not(feature = "osc"))]
fn open_osc(_: SocketAddr, _: DecoderSettings, _: Clock) -> Result<Box<dyn Device>, Report> {
    Err(miette!("this build takes no OSC: build it with --features osc"))
}

/// What a device is known by in the file of calibrations: its USB identity if it has one, so that it may move to another
/// port, else its port.
pub fn identity(choice: &DeviceChoice, status: &DeviceStatus) -> String {
    if choice.midi.is_some() {
        return format!("midi {}", status.port);
    }
    if choice.osc.is_some() {
        return format!("osc {}", status.port);
    }
    usb_identity(&status.port).unwrap_or_else(|| format!("serial {}", status.port))
}

#[cfg(feature = "serial")]
fn usb_identity(path: &str) -> Option<String> {
    let ports = sinew_knobs::device::serial_ports().ok()?;
    let usb = ports.into_iter().find(|port| port.path == path)?.usb?;
    let number = usb.serial_number.map_or(String::new(), |number| format!(" {number}"));
    Some(format!("usb {:04x}:{:04x}{number}", usb.vendor_id, usb.product_id))
}

#[cfg(not(feature = "serial"))]
fn usb_identity(_: &str) -> Option<String> {
    None
}
