//! Calibrations on disk: one file for all devices of a user, each under its identity. Written by `knobs calibrate`, read
//! by `play`.

use core::fmt::Write as _;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr};
use sinew_formats::package::save_package;
use sinew_knobs::KnobCalibration;

use crate::config::keys::{Fault, Keys};
use crate::config::{ConfigError, parse_toml};

/// What was measured on one knob.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibratedKnob {
    /// Address on the device.
    pub address: u16,
    /// What the device called it; empty if it had no name.
    pub name: String,
    /// The measurement.
    pub calibration: KnobCalibration,
}

/// What was measured on one device.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DeviceCalibration {
    /// The device.
    pub device: String,
    /// Its knobs.
    pub knobs: Vec<CalibratedKnob>,
}

impl DeviceCalibration {
    /// Of a knob: by its name if it has one, because names outlive a change of order, else by its address.
    pub fn of(&self, address: Option<u16>, name: Option<&str>) -> Option<KnobCalibration> {
        let by_name = |name: &str| {
            self.knobs
                .iter()
                .find(|knob| !knob.name.is_empty() && knob.name == name)
        };
        let by_address = |address: u16| self.knobs.iter().find(|knob| knob.address == address);
        let found = name.and_then(by_name).or_else(|| address.and_then(by_address));
        found.map(|knob| knob.calibration)
    }
}

/// The calibrations of a file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Calibrations {
    /// One for each device.
    pub devices: Vec<DeviceCalibration>,
}

/// Where calibrations are kept if nothing else was said: the user's configuration folder.
///
/// # Errors
/// The system names no such folder.
pub fn default_path() -> Result<PathBuf, Report> {
    let set = |name: &str| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let folder = if cfg!(windows) {
        set("APPDATA")
    } else if cfg!(target_os = "macos") {
        set("HOME").map(|home| home.join("Library/Application Support"))
    } else {
        set("XDG_CONFIG_HOME").or_else(|| set("HOME").map(|home| home.join(".config")))
    };
    let folder = folder
        .ok_or_else(|| miette::miette!("no folder for settings is known here: name a file with --calibration"))?;
    Ok(folder.join("sinew").join("calibration.toml"))
}

impl Calibrations {
    /// Reads a file; one that is not there holds nothing.
    ///
    /// # Errors
    /// It cannot be read, or makes no sense.
    pub fn read(path: &Path) -> Result<Self, Report> {
        match std::fs::read_to_string(path) {
            Ok(text) => Ok(Self::parse(path, &text)?),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(error)
                .into_diagnostic()
                .wrap_err_with(|| format!("cannot read {}", path.display())),
        }
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ConfigError> {
        parse(text).map_err(|fault| ConfigError::new(path, text, fault))
    }

    /// Of one device.
    pub fn of(&self, device: &str) -> Option<&DeviceCalibration> {
        self.devices.iter().find(|known| known.device == device)
    }

    /// Puts a device's calibration in the place of its last one, and writes the file whole.
    ///
    /// # Errors
    /// The folder cannot be made, or the file not be written.
    pub fn store(mut self, path: &Path, device: DeviceCalibration) -> Result<(), Report> {
        self.devices.retain(|known| known.device != device.device);
        self.devices.push(device);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .into_diagnostic()
                .wrap_err_with(|| format!("cannot make the folder {}", folder.display()))?;
        }
        save_package(path, self.text().as_bytes())
            .into_diagnostic()
            .wrap_err("the calibration is not stored")
    }

    /// The file.
    pub fn text(&self) -> String {
        let mut text = String::from("# What each knob really sends, measured by `sinew-stage knobs calibrate`.\n");
        for device in &self.devices {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "\n[[device]]\nid = {}", quoted(&device.device));
            for knob in &device.knobs {
                let _ = writeln!(text, "\n[[device.knob]]\nknob = {}", knob.address);
                if !knob.name.is_empty() {
                    let _ = writeln!(text, "name = {}", quoted(&knob.name));
                }
                let KnobCalibration {
                    full_scale,
                    lowest,
                    highest,
                    centre,
                    noise,
                } = knob.calibration;
                let _ = writeln!(
                    text,
                    "full_scale = {full_scale}\nlowest = {lowest}\nhighest = {highest}"
                );
                if let Some(centre) = centre {
                    let _ = writeln!(text, "centre = {centre}");
                }
                let _ = writeln!(text, "noise = {noise}");
            }
        }
        text
    }
}

/// A text in TOML's quotes.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

fn parse(text: &str) -> Result<Calibrations, Fault> {
    let table = parse_toml(text)?;
    let mut keys = Keys::new(&table, 0..0, "the file");
    let mut devices = Vec::new();
    for mut device in keys.tables("device", "[[device]]")? {
        let id = device
            .text("id")?
            .ok_or_else(|| Fault::new(device.span.clone(), "[[device]] has no `id`"))?;
        let mut knobs = Vec::new();
        for knob in device.tables("knob", "[[device.knob]]")? {
            knobs.push(read_knob(knob)?);
        }
        device.finish()?;
        devices.push(DeviceCalibration {
            device: id.value.to_owned(),
            knobs,
        });
    }
    keys.finish()?;
    Ok(Calibrations { devices })
}

fn read_knob(mut keys: Keys<'_>) -> Result<CalibratedKnob, Fault> {
    let steps =
        |keys: &mut Keys<'_>, key: &'static str| keys.small(key, 0..=u16::MAX).map(|found| found.map(|f| f.value));
    let span = keys.span.clone();
    let needed = |value: Option<u16>, key: &str| {
        value.ok_or_else(|| Fault::new(span.clone(), format!("[[device.knob]] has no `{key}`")))
    };
    let address = needed(steps(&mut keys, "knob")?, "knob")?;
    let name = keys.text("name")?.map_or(String::new(), |found| found.value.to_owned());
    let calibration = KnobCalibration {
        full_scale: needed(steps(&mut keys, "full_scale")?, "full_scale")?,
        lowest: needed(steps(&mut keys, "lowest")?, "lowest")?,
        highest: needed(steps(&mut keys, "highest")?, "highest")?,
        centre: steps(&mut keys, "centre")?,
        noise: needed(steps(&mut keys, "noise")?, "noise")?,
    };
    keys.finish()?;
    if !calibration.is_valid() {
        return Err(Fault::new(span, "these numbers leave no range to turn in")
            .help("measure the knob again with `sinew-stage knobs calibrate`"));
    }
    Ok(CalibratedKnob {
        address,
        name,
        calibration,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const POT: KnobCalibration = KnobCalibration {
        full_scale: 1023,
        lowest: 7,
        highest: 1010,
        centre: None,
        noise: 3,
    };

    fn device(id: &str) -> DeviceCalibration {
        let knob = |address, name: &str, calibration| CalibratedKnob {
            address,
            name: name.to_owned(),
            calibration,
        };
        let centred = KnobCalibration {
            centre: Some(500),
            ..POT
        };
        DeviceCalibration {
            device: id.to_owned(),
            knobs: vec![knob(0, "", POT), knob(4, "jaw \"left\"", centred)],
        }
    }

    #[test]
    fn what_is_stored_is_read_back_and_other_devices_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new").join("calibration.toml");
        assert_eq!(Calibrations::read(&path).unwrap(), Calibrations::default());
        for id in ["usb:2341:0043:1", "usb:2341:0043:2", "usb:2341:0043:1"] {
            Calibrations::read(&path).unwrap().store(&path, device(id)).unwrap();
        }
        let read = Calibrations::read(&path).unwrap();
        assert_eq!(read.devices.len(), 2);
        assert_eq!(read.of("usb:2341:0043:2"), Some(&device("usb:2341:0043:2")));
        assert_eq!(read.of("usb:0000:0000:1"), None);
    }

    #[test]
    fn a_name_finds_its_knob_wherever_it_moved() {
        let device = device("x");
        assert_eq!(device.of(Some(0), None), Some(POT));
        assert_eq!(device.of(Some(0), Some("jaw \"left\"")).unwrap().centre, Some(500));
        assert_eq!(device.of(Some(9), Some("brow")), None);
    }

    #[test]
    fn a_calibration_without_a_range_is_refused_with_its_place() {
        let text = Calibrations {
            devices: vec![device("x")],
        }
        .text()
        .replace("highest = 1010", "highest = 9");
        let error = Calibrations::parse(Path::new("c.toml"), &text).unwrap_err();
        assert_eq!(error.to_string(), "c.toml:6:1: these numbers leave no range to turn in");
    }
}
