//! `sinew-stage knobs monitor`: what a box sends, live.

use core::time::Duration;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

use clap::Args;
use sinew_knobs::Reading;
use sinew_knobs::device::DeviceStatus;

use super::{Listener, knob_words};
use crate::commands::{Failure, catch_interrupts, interrupted, parse_duration, read_choice};
use crate::device::DeviceArguments;
use crate::view::words;

/// Arguments of `sinew-stage knobs monitor`.
#[derive(Args)]
#[command(
    after_help = "The first lines say which port is read, what it speaks, and how sure that is; then every knob with its reading, and \
        below how much came and how much of it made no sense, with the reason of the last. Nothing makes sense: try another --baud. \
        Ends with Ctrl-C or Enter."
)]
pub struct MonitorArguments {
    #[command(flatten)]
    device: DeviceArguments,
    /// Take the device that this file names
    #[arg(long, value_name = "FILE")]
    knobs: Option<PathBuf>,
    /// End after this time
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration)]
    time: Option<Duration>,
}

/// A knob's last reading.
struct Row {
    knob: u16,
    reading: Reading,
    /// Sum of an encoder's steps.
    turned: i64,
    /// Since the last line.
    count: u32,
}

/// Runs `sinew-stage knobs monitor`.
pub fn run(arguments: &MonitorArguments) -> Result<(), Failure> {
    catch_interrupts();
    let (_, choice) = read_choice(arguments.knobs.as_deref(), &arguments.device)?;
    let mut listener = Listener::open(&choice, arguments.time)?;
    listener.end_at_enter();
    let live = std::io::stdout().is_terminal();
    // A terminal is drawn over fifteen times a second; elsewhere a block a second is enough.
    let every_us = if live { 66_000 } else { 1_000_000 };
    let mut rows: Vec<Row> = Vec::new();
    let mut shown_us = 0;
    let mut height = 0;
    loop {
        let goes_on = listener.step(|_, event| {
            let row = match rows.iter().position(|row| row.knob == event.knob) {
                Some(index) => &mut rows[index],
                None => {
                    let at = rows.partition_point(|row| row.knob < event.knob);
                    rows.insert(
                        at,
                        Row {
                            knob: event.knob,
                            reading: event.reading,
                            turned: 0,
                            count: 0,
                        },
                    );
                    &mut rows[at]
                }
            };
            row.reading = event.reading;
            row.count += 1;
            if let Reading::Steps(steps) = event.reading {
                row.turned += i64::from(steps);
            }
        });
        let now_us = listener.clock.now_us();
        let passed_us = now_us - shown_us;
        if passed_us >= every_us || !goes_on {
            let text = block(&listener.device.device_status(), &rows, passed_us);
            show(&text, live, &mut height);
            shown_us = now_us;
            rows.iter_mut().for_each(|row| row.count = 0);
        }
        if !goes_on {
            break;
        }
    }
    if interrupted() {
        return Err(Failure::Stopped(String::new()));
    }
    Ok(())
}

/// Prints a block; on a terminal over the last one.
fn show(text: &str, live: bool, height: &mut usize) {
    let mut out = std::io::stdout().lock();
    if live {
        // Up to the first line of the last block, then clear to the end of the screen.
        let up = if *height > 0 {
            format!("\x1b[{height}A\r\x1b[J")
        } else {
            String::new()
        };
        let _ = out.write_all(up.as_bytes());
        *height = text.lines().count();
    }
    // A reader such as `head` may have heard enough.
    let _ = out.write_all(text.as_bytes());
    let _ = out.flush();
}

fn block(status: &DeviceStatus, rows: &[Row], passed_us: u64) -> String {
    let seconds = (passed_us as f64 * 1e-6).max(1e-3);
    let mut text = format!("{}\n", words::device(status));
    if let Some(error) = &status.last_error {
        text.push_str(&format!("{error}\n"));
    }
    for row in rows {
        let name = knob_words(status, row.knob);
        let rate = f64::from(row.count) / seconds;
        text.push_str(&match row.reading {
            Reading::Position { value, full_scale } => {
                let share = f32::from(value) / f32::from(full_scale.max(1));
                let full = (share.clamp(0.0, 1.0) * 24.0).round() as usize;
                let bar = format!("{}{}", "=".repeat(full), " ".repeat(24 - full));
                format!("{name:<16} {value:>5} of {full_scale:<5} [{bar}] {rate:>5.0}/s\n")
            }
            Reading::Steps(_) => format!("{name:<16} {:>+5} steps {:32} {rate:>5.0}/s\n", row.turned, ""),
        });
    }
    let counters = &status.counters;
    text.push_str(&format!(
        "{} bytes, {} messages good, {} refused, {} ignored, {} lost, {} readings beyond their scale",
        counters.bytes, counters.good, counters.bad, counters.ignored, counters.dropped, counters.clamped
    ));
    if let Some(fault) = counters.last_fault {
        text.push_str(&format!("\nthe last fault: {fault}"));
    }
    text.push('\n');
    text
}
