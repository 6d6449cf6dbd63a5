//! What tests share: the hand-made packages, the shortest way to play one, and a count of what goes to the allocator.

pub use sinew_bake::fixture as baker_fixture;
pub use sinew_formats::package::fixture;

use std::path::{Path, PathBuf};

use fixture::{tiny_baked, tiny_compact};
use sinew_formats::package::{AlignedBytes, write_baked, write_compact};
use sinew_runtime::{Basis, Controls, Frame, FrameError, Kernels, TierChoice, Workspace, WorkspaceLayout};

/// The bytes of [`tiny_compact`].
pub fn compact_package() -> AlignedBytes {
    write_compact(&tiny_compact().basis()).expect("the hand-made package obeys the rules")
}

/// The bytes of [`tiny_baked`], baked by hand from [`tiny_compact`], with bones.
pub fn baked_package() -> AlignedBytes {
    let mut baked = tiny_baked();
    baked.bones = Some(baked.three_bones());
    write_baked(&baked.basis()).expect("the hand-made package obeys the rules")
}

/// One frame from rest, with memory of its own. `weight` gives each component's weight, before it is clamped.
/// Shape of the result: positions `[V]` and normals `[V]`, source order.
pub fn play(basis: &Basis<'_>, weight: impl Fn(usize) -> f32) -> Result<[Vec<[f32; 3]>; 2], FrameError> {
    play_tier(basis, basis.nearest_tier(), weight)
}

/// The same on a tier that the package has.
pub fn play_tier(
    basis: &Basis<'_>,
    tier: TierChoice,
    weight: impl Fn(usize) -> f32,
) -> Result<[Vec<[f32; 3]>; 2], FrameError> {
    let layout = WorkspaceLayout::for_tier(basis, tier).expect("the package has the tier");
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut weights = vec![0.0; basis.component_count()];
    let mut workspace = Workspace::for_tier(basis, tier, &mut memory, Kernels::detect()).expect("memory is enough");
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

/// Runs `work` and returns how often it went to the allocator: what it asked for, and what it gave back of memory that is
/// older. Only this thread's requests count, for the test harness allocates on others.
pub fn requests(work: impl FnOnce()) -> u64 {
    let counted = allocation_counter::measure(work);
    counted.count_total + counted.count_current.min(0).unsigned_abs()
}

/// The folder that holds the workspace's `Cargo.toml`.
pub fn workspace_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[cfg(test)]
mod tests {
    use core::hint::black_box;

    use super::requests;

    #[test]
    fn requests_are_counted() {
        let old = black_box(Box::new(1));
        assert_eq!(requests(|| ()), 0);
        assert_eq!(requests(|| drop(black_box(Box::new(1)))), 1);
        assert_eq!(requests(|| drop(old)), 1);
        let mut grown = black_box(Vec::<u8>::with_capacity(1));
        assert!(requests(|| grown.resize(1000, 0)) > 0);
        let spawned = requests(|| {
            let busy = || (0..1000).for_each(|n| drop(black_box(Box::new(n))));
            std::thread::spawn(busy).join().expect("it only allocates");
        });
        assert!(spawned < 100, "another thread's are not: {spawned}");
    }
}
