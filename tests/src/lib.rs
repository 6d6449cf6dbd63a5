//! What the tests that cross crates share: the hand-made packages, and the shortest way to play one.

pub use sinew_formats::package::fixture;

use std::path::{Path, PathBuf};

use fixture::{tiny_baked, tiny_compact};
use sinew_formats::package::{AlignedBytes, write_baked, write_compact};
use sinew_runtime::{Basis, Controls, Frame, FrameError, Workspace, WorkspaceLayout};

/// The bytes of [`tiny_compact`].
pub fn compact_package() -> AlignedBytes {
    write_compact(&tiny_compact().basis()).expect("the hand-made package obeys the rules")
}

/// The bytes of [`tiny_baked`], baked by hand from [`tiny_compact`], with a fast tier.
pub fn baked_package() -> AlignedBytes {
    let mut baked = tiny_baked();
    baked.fast = Some(baked.own_nodes());
    write_baked(&baked.basis()).expect("the hand-made package obeys the rules")
}

/// One frame from rest, with memory of its own. `weight` gives each component's weight, before it is clamped.
/// Shape of the result: positions `[V]` and normals `[V]`, source order.
pub fn play(basis: &Basis<'_>, weight: impl Fn(usize) -> f32) -> Result<[Vec<[f32; 3]>; 2], FrameError> {
    let mut memory = vec![0; WorkspaceLayout::for_basis(basis).unaligned_bytes()];
    let mut weights = vec![0.0; basis.component_count()];
    let mut workspace = Workspace::new(basis, &mut memory).expect("memory is as large as the layout says");
    let mut controls = Controls::new(basis, &mut weights).expect("one weight a component");
    for k in 0..basis.component_count() {
        controls.set(k, weight(k)).expect("weights are finite");
    }
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    Frame {
        basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    }
    .run(&mut workspace)?;
    Ok([positions, normals])
}

/// The folder that holds the workspace's `Cargo.toml`.
pub fn workspace_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}
