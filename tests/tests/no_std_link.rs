//! The runtime links into a program that has neither std nor an allocator, and plays the same bits there.
#![cfg(target_os = "linux")]

use core::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

use sinew_checksum::Checksum;
use sinew_formats::package::{fixture::tiny_baked, write_baked};
use sinew_runtime::{Basis, Controls, Kernels, Workspace, WorkspaceLayout};

#[test]
fn a_program_without_an_allocator_links_and_plays_the_same_bits() -> Result<(), Box<dyn Error>> {
    let bytes = write_baked(&tiny_baked().basis())?;
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR")).join("embedded");
    fs::create_dir_all(&scratch)?;
    let package = scratch.join("tiny.sinew");
    fs::write(&package, &bytes[..])?;

    // A copy: the checkout may be read-only. With the versions that this workspace is tested with; cargo drops what the program
    // does not need.
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = scratch.join("source");
    fs::create_dir_all(source.join("src"))?;
    fs::copy(tests.join("embedded/src/main.rs"), source.join("src/main.rs"))?;
    fs::copy(tests.join("../Cargo.lock"), source.join("Cargo.lock"))?;
    let manifest = fs::read_to_string(tests.join("embedded/Cargo.toml"))?;
    let absolute = format!("path = \"{}/embedded/..", tests.display());
    fs::write(source.join("Cargo.toml"), manifest.replace("path = \"..", &absolute))?;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let built = Command::new(cargo)
        .args(["build", "--release", "--offline", "--quiet", "--manifest-path"])
        .arg(source.join("Cargo.toml"))
        .env("CARGO_TARGET_DIR", &scratch)
        .env("SINEW_EMBEDDED_PACKAGE", &package)
        .output()?;
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));

    let ran = Command::new(scratch.join("release/sinew-embedded")).output()?;
    assert!(ran.status.success(), "exit code {:?}", ran.status.code());
    assert_eq!(String::from_utf8(ran.stdout)?.trim_end(), play(&bytes)?.to_string());
    Ok(())
}

/// What `embedded/src/main.rs` does, with std around it.
fn play(bytes: &[u8]) -> Result<Checksum, Box<dyn Error>> {
    let basis = Basis::open(bytes)?;
    let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
    let mut workspace = Workspace::with_kernels(&basis, &mut memory, Kernels::Scalar)?;
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights)?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    Ok(sinew_checksum::play(
        &mut controls,
        &mut workspace,
        &mut positions,
        &mut normals,
    )?)
}
