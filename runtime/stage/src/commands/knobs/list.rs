//! `sinew-stage knobs list`: the ports of this machine, and how to name each on the command line.

use crate::commands::Failure;

/// Runs `sinew-stage knobs list`.
pub fn run() -> Result<(), Failure> {
    serial()?;
    midi();
    println!("OSC: --osc PORT takes it from this machine, --osc 0.0.0.0:PORT from others too");
    Ok(())
}

#[cfg(feature = "serial")]
fn serial() -> Result<(), Failure> {
    let ports = sinew_knobs::device::serial_ports().map_err(|error| miette::miette!("{error}"))?;
    if ports.is_empty() {
        println!("serial ports: none; is the box plugged in, and does its cable carry data?");
        return Ok(());
    }
    println!("serial ports, for --serial:");
    for port in ports {
        println!("  {port}");
    }
    Ok(())
}

#[cfg(not(feature = "serial"))]
fn serial() -> Result<(), Failure> {
    println!("serial ports: not in this build (--features serial)");
    Ok(())
}

#[cfg(feature = "midi")]
fn midi() {
    match sinew_knobs::device::midi_ports() {
        Ok(names) if names.is_empty() => println!("MIDI ports: none"),
        Ok(names) => {
            println!("MIDI ports, for --midi (a part of the name is enough):");
            names.iter().for_each(|name| println!("  {name}"));
        }
        // Serial ports were still listed: a machine without MIDI is no error.
        Err(error) => println!("MIDI ports: {error}"),
    }
}

#[cfg(not(feature = "midi"))]
fn midi() {
    println!("MIDI ports: not in this build (--features midi)");
}
