//! A crowd: many instances of one package, each in a pose of its own, played by all cores:
//! `cargo run --release -p sinew-runtime --example crowd -- [PACKAGE.sinew [INSTANCES]]`, a built-in creature and a hundred of it
//! unless said. All share the package; each has the memory of its own frames, and the thread that comes first plays the next.

mod common;

use core::error::Error;
use core::time::Duration;
use std::thread;
use std::time::Instant;

use sinew_runtime::{Basis, Batch, Controls, Instance, Kernels, TierChoice, Workspace, WorkspaceLayout};

const INSTANCES: usize = 100;
const FRAMES: usize = 60;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let package = common::baked_package(arguments.first())?;
    let count = arguments.get(1).map_or(Ok(INSTANCES), |text| text.parse())?;
    let basis = Basis::open(&package)?;
    println!("{count} instances of {} vertices", basis.vertex_count());
    for tier in [TierChoice::Exact, TierChoice::Bones] {
        if basis.has_tier(tier) {
            let time = play(&basis, tier, count)?;
            println!(
                "{tier:?} tier: {:.2} ms a frame of the whole crowd",
                1e3 * time.as_secs_f64()
            );
        }
    }
    Ok(())
}

/// Mean time of a frame of the whole crowd.
fn play(basis: &Basis<'_>, tier: TierChoice, count: usize) -> Result<Duration, Box<dyn Error>> {
    let bytes = WorkspaceLayout::for_tier(basis, tier)?.unaligned_bytes();
    let mut memories = vec![vec![0; bytes]; count];
    let mut weights = vec![vec![0.0; basis.component_count()]; count];
    let mut positions = vec![vec![[0.0; 3]; basis.vertex_count()]; count];
    let mut crowd = Vec::with_capacity(count);
    for ((memory, weights), positions) in memories.iter_mut().zip(&mut weights).zip(&mut positions) {
        crowd.push(Instance {
            basis,
            controls: Controls::new(basis, weights)?,
            workspace: Workspace::for_tier(basis, tier, memory, Kernels::detect())?,
            positions,
            normals: None,
            outcome: None,
        });
    }
    let thread_count = thread::available_parallelism()?.get();
    let begun = Instant::now();
    for frame in 0..FRAMES {
        for (n, instance) in crowd.iter_mut().enumerate() {
            for k in 0..basis.component_count() {
                let swing = (0.1 * frame as f32 + n as f32 + k as f32).sin();
                instance.controls.set(k, 0.5 * swing * basis.component(k).maximum)?;
            }
        }
        let batch = Batch::new(&mut crowd);
        thread::scope(|scope| {
            for _ in 1..thread_count {
                scope.spawn(|| batch.play());
            }
            batch.play();
        });
        for instance in &crowd {
            instance.outcome.ok_or("every instance is played")??;
        }
    }
    Ok(begun.elapsed() / FRAMES as u32)
}
