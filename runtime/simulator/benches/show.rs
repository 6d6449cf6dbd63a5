//! A show in small: 60 frames a second of a mesh of 12,500 vertices, moved by eight knobs on a pseudo-terminal. Measures the
//! time from a line's last byte to the finished mesh that shows it and the parts of that time, counts frames that came late and
//! what the frame's thread allocates, and does the same under a flood of 1 Mbaud, with the memory of the process watched.
//! `cargo bench -p sinew-simulator --bench show -- [SECONDS of flood]`, 10 unless said.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;
use std::thread;

use sinew_knobs::device::{Clock, SerialSelector, SerialSettings, SerialSource};
use sinew_knobs::{
    Binding, ControlMap, ControlSource, ControlSurface, Knob, KnobEvent, Protocol, Reading, SourceEvent,
    SurfaceBuffers, SurfaceSettings, Takeover,
};
use sinew_peers::subject::Subject;
use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};
use sinew_simulator::Port;

const VERTICES: usize = 12_500;
const KNOBS: u16 = 8;
const FRAME_US: u64 = 16_667;
/// Values of ten bits: a knob's value names the line it came in.
const VALUES: u16 = 1024;
/// Bytes a millisecond at 1 Mbaud, ten bits a byte.
const FLOOD_BYTES: usize = 100;
/// Not a multiple of the frame, so that lines fall anywhere in it.
const LINE_EVERY: Duration = Duration::from_micros(11_300);

fn main() {
    let seconds = std::env::args()
        .skip(1)
        .find_map(|word| word.parse().ok())
        .unwrap_or(10);
    let subject = Subject::torus(VERTICES);
    println!("{} with normals, {KNOBS} knobs, 60 frames a second", subject.name);
    play(&subject, "lines as a knob box sends them", 10, false);
    play(&subject, "a flood at 1 Mbaud", seconds, true);
}

/// When the line of each value was written, µs; and whether to go on.
struct Writer {
    written_us: Vec<AtomicU64>,
    stop: AtomicBool,
}

impl Writer {
    fn run(&self, mut port: Port, clock: Clock, is_flood: bool) {
        let mut value = 0;
        while !self.stop.load(Ordering::Relaxed) {
            let mut sent = 0;
            loop {
                value = (value + 1) % VALUES;
                let line = format!("{}\r\n", vec![value.to_string(); usize::from(KNOBS)].join("|"));
                sent += port.send(line.as_bytes());
                self.written_us[usize::from(value)].store(clock.now_us(), Ordering::Release);
                if !is_flood || sent >= FLOOD_BYTES {
                    break;
                }
            }
            thread::sleep(if is_flood { Duration::from_millis(1) } else { LINE_EVERY });
        }
    }
}

fn play(subject: &Subject, name: &str, seconds: u64, is_flood: bool) {
    let basis = Basis::open(&subject.baked).expect("a sound package");
    let names: Vec<String> = (0..KNOBS).map(|n| format!("knob {n}")).collect();
    let knobs: Vec<Knob<'_>> = (0..KNOBS).map(|n| Knob::new(n, &names[usize::from(n)])).collect();
    let bindings: Vec<Binding> = (0..KNOBS)
        .map(|n| Binding {
            knob: n,
            control: n,
            takeover: Takeover::Jump,
            ..Binding::default()
        })
        .collect();
    let map = ControlMap::new(basis, &knobs, &bindings, &[], None).expect("a sound map");
    let mut buffers = SurfaceBuffers::for_map(&map);
    let mut surface = ControlSurface::new(map, SurfaceSettings::default(), buffers.memory()).expect("memory");
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).expect("a weight a component");
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory).expect("enough memory");
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();

    let folder = tempfile::tempdir().expect("a folder");
    let port = Port::open(folder.path().join("box")).expect("a pseudo-terminal");
    let clock = Clock::start();
    let settings = SerialSettings {
        protocol: Some(Protocol::Lines),
        baud: Some(1_000_000),
        ..SerialSettings::default()
    };
    let path = port.path().to_string_lossy().into_owned();
    let mut source = SerialSource::open(SerialSelector::Path(path), settings, clock).expect("the port opens");
    let writer = Writer {
        written_us: (0..VALUES).map(|_| AtomicU64::new(0)).collect(),
        stop: AtomicBool::new(false),
    };

    let frame_count = (seconds * 1_000_000 / FRAME_US) as usize;
    let [mut poll, mut advance, mut frame, mut latency] = [(); 4].map(|()| Vec::with_capacity(frame_count));
    let (mut late, mut requests, mut before_kib) = (0, 0, 0);
    thread::scope(|scope| {
        scope.spawn(|| writer.run(port, clock, is_flood));
        // A second to warm up.
        let begun_us = clock.now_us() + 1_000_000;
        for n in 0..frame_count {
            let due_us = begun_us + n as u64 * FRAME_US;
            thread::sleep(Duration::from_micros(due_us.saturating_sub(clock.now_us())));
            if n == 0 {
                source.poll(clock.now_us(), &mut |_, _| {});
                before_kib = resident_kib();
            }
            let at_us = clock.now_us();
            let (mut newest, mut polled_us, mut advanced_us) = (None, 0, 0);
            requests += sinew_support::requests(|| {
                source.poll(at_us, &mut |event_us, event| {
                    surface.source_event(event_us, event);
                    if let SourceEvent::Knob(KnobEvent {
                        knob: 0,
                        reading: Reading::Position { value, .. },
                    }) = event
                    {
                        newest = Some(value);
                    }
                });
                polled_us = clock.now_us();
                surface.advance(polled_us, &mut controls).expect("its own controls");
                advanced_us = clock.now_us();
                let job = Frame {
                    basis: &basis,
                    controls: &controls,
                    positions: &mut positions,
                    normals: Some(&mut normals),
                };
                job.run(&mut workspace).expect("weights within their stops");
            });
            let done_us = clock.now_us();
            late += u32::from(done_us > due_us + FRAME_US);
            poll.push((polled_us - at_us) as f64);
            advance.push((advanced_us - polled_us) as f64);
            frame.push((done_us - advanced_us) as f64);
            if let Some(value) = newest {
                let written_us = writer.written_us[usize::from(value)].load(Ordering::Acquire);
                latency.push(done_us.saturating_sub(written_us) as f64);
            }
        }
        writer.stop.store(true, Ordering::Relaxed);
    });
    println!("\n{name}, {seconds} s:");
    quantiles("newest line written -> mesh finished", latency);
    quantiles("  of it: poll, with the surface's events", poll);
    quantiles("  of it: surface to weights", advance);
    quantiles("  of it: weights to mesh", frame);
    let status = source.device_status();
    println!(
        "{frame_count} frames, {late} late; {requests} requests to the allocator in them; {} bytes, {} lines, {} bad, {} events replaced \
         by newer ones; memory {before_kib} -> {} KiB",
        status.counters.bytes,
        status.counters.good,
        status.counters.bad,
        status.replaced,
        resident_kib()
    );
}

/// Memory of the process that is in use; 0 where the system does not say.
fn resident_kib() -> u64 {
    const PAGE_KIB: u64 = 4;
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages: Option<u64> = statm.split(' ').nth(1).and_then(|word| word.parse().ok());
    pages.unwrap_or(0) * PAGE_KIB
}

fn quantiles(name: &str, mut numbers: Vec<f64>) {
    numbers.sort_by(f64::total_cmp);
    let at = |share: f64| {
        numbers
            .get(((numbers.len().max(1) - 1) as f64 * share) as usize)
            .copied()
    };
    let [median, tail, most] = [0.5, 0.99, 1.0].map(|share| at(share).unwrap_or(f64::NAN));
    println!("{name:>44}: median {median:.0} us, 99 % {tail:.0}, most {most:.0}");
}
