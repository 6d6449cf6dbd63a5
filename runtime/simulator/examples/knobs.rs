//! A knob box moves a mesh for three seconds: `cargo run --release -p sinew-simulator --example knobs -- [PORT]`, such as
//! /dev/ttyACM0. Without a port a simulated box stands behind a pseudo-terminal and its knobs turn by themselves. The mesh is a
//! built-in creature.
//!
//! What a program does with a box: open the port, bind knobs to components, and in each frame poll, advance, play.

use core::error::Error;
use core::time::Duration;
use std::thread;

use sinew_knobs::device::{Clock, SerialSelector, SerialSettings, SerialSource};
use sinew_knobs::{Binding, ControlMap, ControlSource, ControlSurface, Knob, SurfaceBuffers, SurfaceSettings};
use sinew_peers::subject::Subject;
use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};
use sinew_simulator::{BoxSettings, Command, KnobBox, Port, Simulator};

const KNOBS: u16 = 8;
const FRAMES: usize = 180;
const FRAME: Duration = Duration::from_micros(16_667);

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (path, simulated) = match std::env::args().nth(1) {
        Some(path) => (path, None),
        None => {
            let port = Port::open(folder.path().join("box"))?;
            let path = port.path().to_string_lossy().into_owned();
            let settings = BoxSettings {
                knob_count: KNOBS,
                ..BoxSettings::default()
            };
            let running = Simulator::new(KnobBox::new(settings)?, port).spawn();
            running.command(Command::Wander(true));
            (path, Some(running))
        }
    };

    // Once: the package, what each knob moves, and the memory of the frames.
    let package = Subject::creature(2500).baked;
    let basis = Basis::open(&package)?;
    let names: Vec<String> = (0..KNOBS).map(|n| format!("knob {n}")).collect();
    let knobs: Vec<Knob<'_>> = (0..KNOBS).map(|n| Knob::new(n, &names[usize::from(n)])).collect();
    let bindings: Vec<Binding> = (0..KNOBS)
        .map(|n| Binding {
            knob: n,
            control: n,
            ..Binding::default()
        })
        .collect();
    let map = ControlMap::new(basis, &knobs, &bindings, &[], None)?;
    let mut buffers = SurfaceBuffers::for_map(&map);
    let mut surface = ControlSurface::new(map, SurfaceSettings::default(), buffers.memory())?;
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights)?;
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory)?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];

    // A thread reads the port; what it speaks is found out from its first bytes.
    let clock = Clock::start();
    let mut source = SerialSource::open(SerialSelector::Path(path.clone()), SerialSettings::default(), clock)?;
    for frame in 0..FRAMES {
        let now_us = clock.now_us();
        source.poll(now_us, &mut |event_us, event| surface.source_event(event_us, event));
        surface.advance(now_us, &mut controls)?;
        let job = Frame {
            basis: &basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        };
        job.run(&mut workspace)?;
        if frame % 30 == 29 {
            let shown: Vec<String> = (0..4).map(|k| format!("{:+.2}", controls.weights()[k])).collect();
            println!("{path}: first four weights {}", shown.join(" "));
        }
        thread::sleep(FRAME.saturating_sub(Duration::from_micros(clock.now_us() - now_us)));
    }
    let status = source.device_status();
    println!("{} readings, {} of them bad", status.counters.good, status.counters.bad);
    drop(source);
    if let Some(running) = simulated {
        running.stop()?;
    }
    Ok(())
}
