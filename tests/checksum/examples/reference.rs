//! The host's side of the comparison between targets: writes what the others play into a folder, and prints the
//! checksum that they must reach. `played.sinew` is the baked package that was given, or else the hand-made one;
//! `poses.txt` holds the fixed poses in the line protocol of a knob box, one pose a line.

use core::error::Error;
use core::fmt::Write as _;
use std::path::PathBuf;
use std::{env, fs};

use sinew_checksum::{POSE_COUNT, knobs, play};
use sinew_formats::package::{AlignedBytes, fixture::tiny_baked, write_baked};
use sinew_runtime::{Basis, Controls, Kernels, Workspace, WorkspaceLayout};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(env::args_os().nth(1).ok_or("usage: reference FOLDER [PACKAGE]")?);
    let bytes = match env::args_os().nth(2) {
        Some(package) => AlignedBytes::from_slice(&fs::read(package)?),
        None => write_baked(&tiny_baked().basis())?,
    };
    let basis = Basis::open(&bytes)?;
    let (vertex_count, component_count) = (basis.vertex_count(), basis.component_count());

    let mut poses = String::new();
    for n in 0..POSE_COUNT {
        for (k, knob) in knobs(n, component_count).enumerate() {
            write!(poses, "{}{knob}", if k > 0 { "|" } else { "" })?;
        }
        poses.push('\n');
    }
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("played.sinew"), &bytes[..])?;
    fs::write(folder.join("poses.txt"), poses)?;

    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::with_kernels(&basis, &mut memory, Kernels::Scalar)?;
    let mut weights = vec![0.0; component_count];
    let mut controls = Controls::new(&basis, &mut weights)?;
    let (mut positions, mut normals) = (vec![[0.0; 3]; vertex_count], vec![[0.0; 3]; vertex_count]);
    println!("{}", play(&mut controls, &mut workspace, &mut positions, &mut normals)?);
    Ok(())
}
