//! A pose does not depend on the poses before it: what a frame leaves out because it has not moved has the bits of a whole frame.

use sinew_bake::{bake_bytes, fixture};
use sinew_runtime::{Basis, Controls, Frame, Kernels, Tangent, Workspace, WorkspaceLayout};

/// Positions, then normals.
type Played = [Vec<[f32; 3]>; 2];

fn play(basis: &Basis<'_>, weights: &[f32], workspace: &mut Workspace<'_>) -> Played {
    let mut own = weights.to_vec();
    let controls = Controls::resume(basis, &mut own).unwrap();
    let mut played = [0, 1].map(|_| vec![[f32::NAN; 3]; basis.vertex_count()]);
    let [positions, normals] = &mut played;
    let frame = Frame {
        basis,
        controls: &controls,
        positions,
        normals: Some(normals),
    };
    frame.run(workspace).unwrap();
    played
}

#[test]
fn one_knob_after_another_ends_where_all_at_once_do() {
    let baked = bake_bytes(&fixture::compact(3, false)).unwrap();
    let basis = Basis::open(&baked).unwrap();
    let component_count = basis.component_count();
    let mut memory = [0, 1].map(|_| vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()]);
    let [moving, fresh] = &mut memory;
    for kernels in [Kernels::Scalar, Kernels::Portable, Kernels::Avx2, Kernels::Avx512] {
        if !kernels.run_here() {
            continue;
        }
        let mut workspace = Workspace::with_kernels(&basis, moving, kernels).unwrap();
        let mut weights = vec![0.0; component_count];
        for step in 0..60 {
            // One control, now and then two, now and then back to rest or lost in what flushes.
            let (k, other) = (step * 5 % component_count, step * 3 % component_count);
            weights[k] = [0.9, -0.7, 0.0, 1e-7][step % 4] + 0.001 * step as f32 * (step % 4 % 2) as f32;
            if step % 6 == 0 {
                weights[other] = 0.4 - 0.02 * step as f32;
            }
            let moved = play(&basis, &weights, &mut workspace);
            let mut fresh = Workspace::with_kernels(&basis, fresh, kernels).unwrap();
            assert_eq!(moved, play(&basis, &weights, &mut fresh), "{kernels:?} {step}");
            if step % 10 == 9 {
                // Another job takes the gradients away.
                let mut displacement = vec![[0.0; 3]; basis.vertex_count()];
                let tangent = Tangent {
                    basis: &basis,
                    component: k,
                    displacement: &mut displacement,
                };
                tangent.run(&mut workspace).unwrap();
            }
        }
    }
}
