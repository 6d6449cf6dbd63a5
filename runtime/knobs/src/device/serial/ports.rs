//! Which port: by path, by what its USB says, or the first that fits. And why it did not open, in words that say the cure.

use core::fmt;
use core::str::FromStr;
use std::fs;
use std::string::{String, ToString};
use std::vec::Vec;

use serialport::{ErrorKind, SerialPortType};

/// Which serial port to read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SerialSelector {
    /// The first USB port that opens, in order of their paths. Other ports, built in or of Bluetooth, open on many machines and never
    /// say a word; they are read when they are named.
    Auto,
    /// The port of this path or name: `/dev/ttyACM0`, `COM3`.
    Path(String),
    /// The first port of this kind of USB device.
    Usb {
        /// Vendor.
        vendor_id: u16,
        /// Product.
        product_id: u16,
    },
    /// The port whose USB serial number this is: one box among equal ones.
    SerialNumber(String),
}

impl FromStr for SerialSelector {
    type Err = core::convert::Infallible;

    /// `auto`; `2341:0043`, vendor and product in four hexadecimal digits each; `serial=NUMBER`; else a path.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let hexadecimal = |text: &str| {
            let digits = text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
            digits.then(|| u16::from_str_radix(text, 16).ok()).flatten()
        };
        if text.eq_ignore_ascii_case("auto") {
            return Ok(Self::Auto);
        }
        if let Some(number) = text.strip_prefix("serial=") {
            return Ok(Self::SerialNumber(number.into()));
        }
        let ids = text
            .split_once(':')
            .and_then(|(vendor, product)| Some((hexadecimal(vendor)?, hexadecimal(product)?)));
        Ok(match ids {
            Some((vendor_id, product_id)) => Self::Usb { vendor_id, product_id },
            None => Self::Path(text.into()),
        })
    }
}

impl fmt::Display for SerialSelector {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => out.write_str("auto"),
            Self::Path(path) => out.write_str(path),
            Self::Usb { vendor_id, product_id } => write!(out, "{vendor_id:04x}:{product_id:04x}"),
            Self::SerialNumber(number) => write!(out, "serial={number}"),
        }
    }
}

/// A port of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialPort {
    /// Path or name to open it by.
    pub path: String,
    /// What it is on USB.
    pub usb: Option<UsbIdentity>,
    /// Manufacturer and product, as the device says.
    pub description: String,
    /// Which socket it is plugged into, where the system says so: on Linux its name in `/dev/serial/by-path`.
    pub socket: Option<String>,
}

/// What a device says of itself on USB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsbIdentity {
    /// Vendor.
    pub vendor_id: u16,
    /// Product.
    pub product_id: u16,
    /// Serial number, if it has one.
    pub serial_number: Option<String>,
}

impl fmt::Display for SerialPort {
    /// One line: path, identity, description.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.path)?;
        if let Some(usb) = &self.usb {
            write!(out, "  {:04x}:{:04x}", usb.vendor_id, usb.product_id)?;
            if let Some(number) = &usb.serial_number {
                write!(out, "  serial={number}")?;
            }
        }
        if !self.description.is_empty() {
            write!(out, "  {}", self.description)?;
        }
        Ok(())
    }
}

/// The serial ports of this machine, USB ports first, each kind in order of their paths. Pseudo-terminals are not listed.
///
/// # Errors
/// [`SerialError::NotListed`].
pub fn serial_ports() -> Result<Vec<SerialPort>, SerialError> {
    let listed = serialport::available_ports().map_err(|error| SerialError::NotListed {
        reason: error.to_string(),
    })?;
    let mut ports: Vec<SerialPort> = listed
        .into_iter()
        .map(|port| {
            let (usb, words) = match port.port_type {
                SerialPortType::UsbPort(info) => (
                    Some(UsbIdentity {
                        vendor_id: info.vid,
                        product_id: info.pid,
                        serial_number: info.serial_number,
                    }),
                    [info.manufacturer, info.product],
                ),
                SerialPortType::BluetoothPort => (None, [Some("Bluetooth".into()), None]),
                SerialPortType::PciPort => (None, [Some("built in".into()), None]),
                SerialPortType::Unknown => (None, [None, None]),
            };
            let words: Vec<String> = words.into_iter().flatten().collect();
            SerialPort {
                socket: socket_of(&port.port_name),
                path: port.port_name,
                usb,
                description: words.join(" "),
            }
        })
        .collect();
    ports.sort_by(|a, b| (a.usb.is_none(), &a.path).cmp(&(b.usb.is_none(), &b.path)));
    Ok(ports)
}

/// The socket of a port: the link to it among those that the system names by their way through the machine.
fn socket_of(path: &str) -> Option<String> {
    let real = fs::canonicalize(path).ok()?;
    let links = fs::read_dir("/dev/serial/by-path").ok()?;
    let same = |link: &fs::DirEntry| fs::canonicalize(link.path()).is_ok_and(|target| target == real);
    links.flatten().find(same)?.file_name().into_string().ok()
}

/// Why a serial port is not read.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum SerialError {
    /// There is no such port.
    Missing {
        /// What was asked for.
        wanted: String,
        /// The ports that there are, one line each.
        found: Vec<String>,
    },
    /// The user may not open it.
    Denied {
        /// Its path.
        path: String,
    },
    /// Another program has it.
    Busy {
        /// Its path.
        path: String,
    },
    /// It did not open for another reason.
    NotOpened {
        /// Its path.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// The system does not say which ports it has.
    NotListed {
        /// What the system says.
        reason: String,
    },
    /// The reader thread did not start.
    NoThread {
        /// What the system says.
        reason: String,
    },
}

impl core::error::Error for SerialError {}

impl fmt::Display for SerialError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { wanted, found } => {
                match wanted.as_str() {
                    "auto" => out.write_str("no knob box is plugged into USB")?,
                    wanted => write!(out, "there is no serial port {wanted}")?,
                }
                if found.is_empty() {
                    return out
                        .write_str("; this machine has none (is the box plugged in, and does its cable carry data?)");
                }
                write!(out, "; there are:")?;
                found.iter().try_for_each(|port| write!(out, "\n  {port}"))?;
                if wanted == "auto" {
                    out.write_str("\n(to read one of these, name it)")?;
                }
                Ok(())
            }
            Self::Denied { path } => write!(
                out,
                "{path}: permission denied; on Linux add yourself to the group that owns it, usually `sudo usermod -aG \
                 dialout $USER`, then log in again"
            ),
            Self::Busy { path } => write!(
                out,
                "{path} is in use by another program; close the serial monitor or whatever else reads it"
            ),
            Self::NotOpened { path, reason } => write!(out, "{path} did not open: {reason}"),
            Self::NotListed { reason } => write!(out, "the serial ports cannot be listed: {reason}"),
            Self::NoThread { reason } => write!(out, "the thread that reads the port did not start: {reason}"),
        }
    }
}

impl SerialError {
    /// What an error of the serial library means for the port of this path.
    pub(super) fn of_opening(path: &str, error: &serialport::Error) -> Self {
        use std::io::ErrorKind as Io;
        let path = String::from(path);
        match error.kind() {
            ErrorKind::Io(Io::NotFound) => Self::missing(path),
            ErrorKind::Io(Io::PermissionDenied) => Self::Denied { path },
            // The library's word for a port that somebody else has locked; on Windows for one that is not there, too.
            ErrorKind::NoDevice if fs::exists(&path).unwrap_or(false) || cfg!(not(unix)) => Self::Busy { path },
            ErrorKind::NoDevice => Self::missing(path),
            _ => Self::NotOpened {
                path,
                reason: error.to_string(),
            },
        }
    }

    fn missing(wanted: String) -> Self {
        let ports = serial_ports().unwrap_or_default();
        let found = ports.iter().map(ToString::to_string).collect();
        Self::Missing { wanted, found }
    }
}

/// A port that was read, so that it is known again under another name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Known {
    pub(super) path: String,
    pub(super) usb: Option<UsbIdentity>,
    pub(super) socket: Option<String>,
}

impl Known {
    /// What is known of the port of a path, which may be a link to it.
    pub(super) fn of(path: &str) -> Self {
        let real = fs::canonicalize(path).ok();
        let real = real.as_ref().and_then(|real| real.to_str()).unwrap_or(path);
        let listed = serial_ports().unwrap_or_default();
        let port = listed.into_iter().find(|port| port.path == path || port.path == real);
        let (usb, socket) = port.map_or((None, None), |port| (port.usb, port.socket));
        Self {
            path: path.into(),
            usb,
            socket,
        }
    }

    /// Whether a port is this one again. A serial number tells; boxes without one, of which there may be several alike in a rig, are
    /// known by their socket, or else by their path.
    fn is(&self, port: &SerialPort) -> bool {
        let (Some(usb), true) = (&self.usb, self.usb == port.usb) else {
            return false;
        };
        match (&usb.serial_number, &self.socket) {
            (Some(_), _) => true,
            (None, Some(socket)) => port.socket.as_ref() == Some(socket),
            (None, None) => port.path == self.path,
        }
    }
}

/// Paths to try, the best first: the very device that was read before under whatever name it has now, then what was asked for.
pub(super) fn candidates(
    selector: &SerialSelector,
    known: Option<&Known>,
    ports: &[SerialPort],
) -> Result<Vec<String>, SerialError> {
    let mut paths = Vec::new();
    let mut add = |path: &str| {
        if !paths.iter().any(|known| known == path) {
            paths.push(String::from(path));
        }
    };
    if let Some(known) = known {
        ports
            .iter()
            .filter(|port| known.is(port))
            .for_each(|port| add(&port.path));
    }
    match selector {
        // Another USB device may have the path by now.
        SerialSelector::Path(path) => {
            let by_another = |port: &SerialPort| port.path == *path && port.usb.is_some();
            if !known.is_some_and(|known| {
                known.usb.is_some() && ports.iter().any(|port| by_another(port) && !known.is(port))
            }) {
                add(path);
            }
        }
        // Once a device was chosen another one is not taken for it: to open a port may reset what hangs there.
        SerialSelector::Auto | SerialSelector::Usb { .. } if known.is_some_and(|known| known.usb.is_some()) => {}
        SerialSelector::Usb { vendor_id, product_id } => {
            let kind = |usb: &UsbIdentity| usb.vendor_id == *vendor_id && usb.product_id == *product_id;
            let found = ports.iter().filter(|port| port.usb.as_ref().is_some_and(kind));
            found.for_each(|port| add(&port.path));
        }
        SerialSelector::SerialNumber(number) => {
            let equal = |usb: &UsbIdentity| usb.serial_number.as_ref() == Some(number);
            let found = ports.iter().filter(|port| port.usb.as_ref().is_some_and(equal));
            found.for_each(|port| add(&port.path));
        }
        SerialSelector::Auto => {
            let found = ports.iter().filter(|port| port.usb.is_some());
            found.for_each(|port| add(&port.path));
        }
    }
    if paths.is_empty() {
        return Err(SerialError::Missing {
            wanted: selector.to_string(),
            found: ports.iter().map(ToString::to_string).collect(),
        });
    }
    Ok(paths)
}

#[cfg(test)]
mod tests;
