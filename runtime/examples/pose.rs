//! One pose of a package, as an OBJ file:
//! `cargo run --release -p sinew-runtime --example pose -- POSE.obj [PACKAGE.sinew [COMPONENT=WEIGHT ...]]`.
//! Without a package a built-in creature is posed; without weights the first two components stand halfway to their ends.

mod common;

use core::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};

use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let output = arguments
        .first()
        .ok_or("usage: pose POSE.obj [PACKAGE.sinew [COMPONENT=WEIGHT ...]]")?;
    let package = common::baked_package(arguments.get(1))?;

    // Once: every check, and the memory of the frames.
    let basis = Basis::open(&package)?;
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::new(&basis, &mut memory)?;
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights)?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();

    for assignment in arguments.iter().skip(2) {
        let (name, weight) = assignment
            .split_once('=')
            .ok_or("a weight is given as COMPONENT=WEIGHT")?;
        let component = basis
            .component_named(name)
            .ok_or_else(|| format!("no component is called `{name}`"))?;
        controls.set(component, weight.parse()?)?;
    }
    if arguments.len() < 3 {
        for k in 0..basis.component_count().min(2) {
            controls.set(k, 0.5 * basis.component(k).maximum)?;
        }
    }

    // Each frame.
    let frame = Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    };
    frame.run(&mut workspace)?;

    let mut obj = BufWriter::new(File::create(output)?);
    for [x, y, z] in &positions {
        writeln!(obj, "v {x} {y} {z}")?;
    }
    for [x, y, z] in &normals {
        writeln!(obj, "vn {x} {y} {z}")?;
    }
    for face in basis.faces().iter() {
        let [a, b, c] = face.map(|v| v + 1);
        writeln!(obj, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    obj.flush()?;
    println!(
        "{output}: {} vertices, {} components",
        basis.vertex_count(),
        basis.component_count()
    );
    Ok(())
}
