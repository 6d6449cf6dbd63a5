//! From the write of a line's last byte on a pseudo-terminal to the event in the frame's hands, and what a poll costs.
//! `cargo bench -p sinew-simulator --bench latency`

use core::hint::black_box;
use core::time::Duration;
use std::thread;
use std::time::Instant;

use sinew_knobs::device::{Clock, SerialSelector, SerialSettings, SerialSource};
use sinew_knobs::{ControlSource, Protocol};
use sinew_simulator::Port;

const LINES: u32 = 3000;
const KNOBS: usize = 8;
const PATIENCE: Duration = Duration::from_secs(5);

fn quantiles(name: &str, unit: &str, mut numbers: Vec<f64>) {
    numbers.sort_by(f64::total_cmp);
    let at = |share: f64| numbers[((numbers.len() - 1) as f64 * share) as usize];
    let [median, ninety, most] = [0.5, 0.9, 0.99].map(at);
    println!(
        "{name}: median {median:.1} {unit}, 90 % {ninety:.1}, 99 % {most:.1} ({} samples)",
        numbers.len()
    );
}

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut port = Port::open(folder.path().join("box")).expect("a pseudo-terminal");
    let clock = Clock::start();
    let settings = SerialSettings {
        protocol: Some(Protocol::Lines),
        baud: Some(115_200),
        ..SerialSettings::default()
    };
    let path = port.path().to_string_lossy().into_owned();
    let mut source = SerialSource::open(SerialSelector::Path(path), settings, clock).expect("the port opens");
    port.send(b"\n");

    let (mut latency, mut stamped, mut idle, mut full) = (vec![], vec![], vec![], vec![]);
    for n in 0..LINES {
        let line = format!("{}\r\n", vec![(n % 1024).to_string(); KNOBS].join("|"));
        let (sent, sent_us) = (Instant::now(), clock.now_us());
        port.send(line.as_bytes());
        let mut heard = 0;
        while heard < KNOBS && sent.elapsed() < PATIENCE {
            source.poll(clock.now_us(), &mut |at_us, event| {
                black_box(event);
                if heard == 0 {
                    stamped.push(at_us.saturating_sub(sent_us) as f64);
                }
                heard += 1;
            });
        }
        latency.push(sent.elapsed().as_secs_f64() * 1e6);
        let begun = Instant::now();
        source.poll(clock.now_us(), &mut |_, event| _ = black_box(event));
        idle.push(begun.elapsed().as_secs_f64() * 1e9);
        // A frame later, with eight events waiting.
        port.send(line.as_bytes());
        thread::sleep(Duration::from_millis(2));
        let begun = Instant::now();
        source.poll(clock.now_us(), &mut |_, event| _ = black_box(event));
        full.push(begun.elapsed().as_secs_f64() * 1e9);
    }
    quantiles("last byte written -> time stamp in the reader thread", "us", stamped);
    quantiles(
        "last byte written -> last of 8 events polled, frame spinning",
        "us",
        latency,
    );
    quantiles("poll with nothing to hear", "ns", idle);
    quantiles("poll with 8 events", "ns", full);
    let status = source.device_status();
    let counts = status.counters;
    println!("{} lines, {} bad, {} dropped", counts.good, counts.bad, status.replaced);
}
