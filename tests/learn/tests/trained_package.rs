//! What is promised of a trained package, measured on the one that `SINEW_PACKAGE` names (a compact package, as `sinew train`
//! writes it).

use core::error::Error;

use sinew_bake::{BakeOptions, Surface, bake, bake_with};
use sinew_formats::package::{AlignedBytes, CompactView, read_package};
use sinew_runtime::{
    Basis, Controls, Drag, Frame, Handles, HandlesLayout, Kernels, TierChoice, Workspace, WorkspaceLayout,
};
use sinew_trainer::evaluate::{EncoderSettings, StackEncoder};
use sinew_trainer::features::reconstruct::PoissonSystem;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Of the bounding box's diagonal: f16 of the folded components, f32 of the frame. Trained horses reach 3e-6 to 7e-6.
const EXACT_TOLERANCE: f64 = 8e-6;
/// Poses of the comparison.
const POSES: usize = 24;
/// Share of the controls that move in a mixed pose.
const MIXED_SHARE: f64 = 0.25;

/// Share of the controls that move in a slider pose, and of their ranges.
const SLIDER_SHARE: f64 = 0.5;
const SLIDER_REACH: f32 = 0.7;

/// What is promised of the bones' stored figures, and the fresh poses they are held against.
const FIGURES_TOLERANCE: f64 = 0.1;
const FRESH_POSES: usize = 256;

/// How far a held vertex is dragged, and how near it must come; shares of the diagonal.
const DRAG: f32 = 0.1;
const REACHED: f32 = 0.01;
const FRAMES: usize = 8;

fn package() -> AlignedBytes {
    let path = std::env::var_os("SINEW_PACKAGE").expect("SINEW_PACKAGE names a trained package");
    read_package(path.as_ref()).expect("SINEW_PACKAGE names a package")
}

fn diagonal(rest: &[[f32; 3]]) -> f64 {
    let extent = |c: usize| {
        let (least, most) = rest.iter().fold((f32::MAX, f32::MIN), |(least, most), p| {
            (least.min(p[c]), most.max(p[c]))
        });
        f64::from(most - least)
    };
    (0..3).map(|c| extent(c).powi(2)).sum::<f64>().sqrt()
}

/// A pose in which a share of the controls stand anywhere within a part of their ranges.
fn posed<'c>(
    basis: &'c Basis<'c>,
    own: &'c mut [f32],
    rng: &mut ChaCha8Rng,
    (share, reach): (f64, f32),
) -> Result<Controls<'c>, Box<dyn Error>> {
    let mut controls = Controls::new(basis, own)?;
    for (k, component) in basis.components().enumerate() {
        if rng.random_range(0.0..1.0) < share {
            controls.set(k, reach * rng.random_range(component.minimum..=component.maximum))?;
        }
    }
    Ok(controls)
}

fn distance(a: &[f32; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (f64::from(a[c]) - b[c]).powi(2)).sum::<f64>().sqrt()
}

#[test]
#[ignore = "needs SINEW_PACKAGE, a trained package"]
fn the_exact_tier_is_the_unfolded_network_in_f64() -> Result<(), Box<dyn Error>> {
    let bytes = package();
    let compact = CompactView::open(&bytes)?;
    let surface = Surface::of_package(&compact);
    let network = StackEncoder::new(&compact, &surface.topology, EncoderSettings::default());
    let anchor = compact.anchor_vertex() as usize;
    let system = PoissonSystem::new(&surface.topology, &surface.weights, &surface.rest, anchor)?;
    let (rotation, stretch) = (f64::from(compact.rotation_scale()), f64::from(compact.stretch_scale()));
    let baked = bake(&compact)?;
    let basis = Basis::open(&baked)?;
    let size = diagonal(compact.rest_positions());
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for kernels in [Kernels::Scalar, Kernels::Portable, Kernels::Avx2, Kernels::Avx512] {
        if !kernels.run_here() {
            continue;
        }
        let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
        let mut workspace = Workspace::with_kernels(&basis, &mut memory, kernels)?;
        let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
        for _ in 0..POSES {
            let mut own = vec![0.0; basis.component_count()];
            let controls = posed(&basis, &mut own, &mut rng, (MIXED_SHARE, 1.0))?;
            let mut positions = vec![[0.0; 3]; basis.vertex_count()];
            let frame = Frame {
                basis: &basis,
                controls: &controls,
                positions: &mut positions,
                normals: None,
            };
            frame.run(&mut workspace)?;
            let weights: Vec<f64> = controls.weights().iter().map(|&w| f64::from(w)).collect();
            let features: Vec<[f64; 9]> = network
                .decode(&weights)
                .iter()
                .map(|x| core::array::from_fn(|i| x[i] * if i < 3 { rotation } else { stretch }))
                .map(|mut x: [f64; 9]| {
                    // Stretch is stored as a difference from the identity: its diagonal is xx, yy, zz.
                    for i in [3, 6, 8] {
                        x[i] += 1.0;
                    }
                    x
                })
                .collect();
            let expected = system.reconstruct(&features);
            for ((found, expected), rest) in positions.iter().zip(&expected).zip(&surface.rest) {
                worst = worst.max(distance(found, *expected) / size);
                moved = moved.max(distance(found, *rest) / size);
            }
        }
        println!("{kernels:?}: error {worst:.2e} of the diagonal, where up to {moved:.2} is moved");
        assert!(moved > 0.05, "the poses move something");
        assert!(worst < EXACT_TOLERANCE, "{kernels:?}: {worst}");
    }
    Ok(())
}

#[test]
#[ignore = "needs SINEW_PACKAGE, a trained package"]
fn the_bones_are_as_far_as_they_say_on_fresh_poses() -> Result<(), Box<dyn Error>> {
    let bytes = package();
    let compact = CompactView::open(&bytes)?;
    let baked = bake_with(&compact, &BakeOptions::default())?;
    let basis = Basis::open(&baked)?;
    let stored = basis.bones().ok_or("baked with bones")?.error().sliders;
    let size = diagonal(compact.rest_positions());
    let mut memory = Vec::new();
    for tier in [TierChoice::Exact, TierChoice::Bones] {
        memory.push(vec![0; WorkspaceLayout::for_tier(&basis, tier)?.unaligned_bytes()]);
    }
    let [exact, bones] = &mut memory[..] else {
        return Err("two tiers".into());
    };
    let mut exact = Workspace::for_tier(&basis, TierChoice::Exact, exact, Kernels::detect())?;
    let mut bones = Workspace::for_tier(&basis, TierChoice::Bones, bones, Kernels::detect())?;
    let mut positions = [
        vec![[0.0; 3]; basis.vertex_count()],
        vec![[0.0; 3]; basis.vertex_count()],
    ];
    let mut distances = Vec::new();
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    for _ in 0..FRESH_POSES {
        let mut own = vec![0.0; basis.component_count()];
        let controls = posed(&basis, &mut own, &mut rng, (SLIDER_SHARE, SLIDER_REACH))?;
        for (workspace, positions) in [&mut exact, &mut bones].into_iter().zip(&mut positions) {
            let frame = Frame {
                basis: &basis,
                controls: &controls,
                positions,
                normals: None,
            };
            frame.run(workspace)?;
        }
        let pairs = positions[1].iter().zip(&positions[0]);
        distances.extend(pairs.map(|(a, b)| distance(a, b.map(f64::from)) / size));
    }
    distances.sort_unstable_by(f64::total_cmp);
    let rms = (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
    let p99 = distances[distances.len() * 99 / 100];
    println!(
        "bones: rms {rms:.3e}, stored {:.3e}; p99 {p99:.3e}, stored {:.3e}",
        stored.rms, stored.p99
    );
    for (stored, found) in [(stored.rms, rms), (stored.p99, p99)] {
        let stored = f64::from(stored);
        assert!((found - stored).abs() < FIGURES_TOLERANCE * stored, "{found} {stored}");
    }
    Ok(())
}

/// The lowest vertex of each quarter: hooves, where the subject has four.
fn feet(rest: &[[f32; 3]]) -> Vec<usize> {
    let middle: [f32; 3] = core::array::from_fn(|c| rest.iter().map(|p| p[c]).sum::<f32>() / rest.len() as f32);
    let quarter = |p: &[f32; 3]| (p[0] > middle[0], p[2] > middle[2]);
    [(false, false), (false, true), (true, false), (true, true)]
        .into_iter()
        .filter_map(|wanted| {
            (0..rest.len())
                .filter(|&v| quarter(&rest[v]) == wanted)
                .min_by(|&a, &b| rest[a][1].total_cmp(&rest[b][1]))
        })
        .collect()
}

#[test]
#[ignore = "needs SINEW_PACKAGE, a trained package"]
fn a_dragged_foot_arrives() -> Result<(), Box<dyn Error>> {
    let bytes = package();
    let compact = CompactView::open(&bytes)?;
    let baked = bake(&compact)?;
    let basis = Basis::open(&baked)?;
    let rest = compact.rest_positions();
    let size = diagonal(rest) as f32;
    let directions = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut arrived = 0;
    for foot in feet(rest) {
        for direction in directions {
            let mut memory = vec![0; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
            let mut workspace = Workspace::new(&basis, &mut memory)?;
            let mut held = vec![0; HandlesLayout::for_basis(&basis, 1).unaligned_bytes()];
            let mut handles = Handles::new(&basis, 1, &mut held)?;
            handles.add(&basis, &mut workspace, foot)?;
            let target: [f32; 3] = core::array::from_fn(|c| rest[foot][c] + DRAG * size * direction[c]);
            handles.set_target(foot, target)?;
            let mut own = vec![0.0; basis.component_count()];
            let mut controls = Controls::new(&basis, &mut own)?;
            let mut left = f32::INFINITY;
            let mut frames = 0;
            while frames < FRAMES && left > REACHED {
                let drag = Drag {
                    basis: &basis,
                    handles: &mut handles,
                    controls: &mut controls,
                };
                left = drag.run(&mut workspace)?.misfit / size;
                frames += 1;
            }
            // What the drag says is where the mesh is.
            let mut positions = vec![[0.0; 3]; basis.vertex_count()];
            let frame = Frame {
                basis: &basis,
                controls: &controls,
                positions: &mut positions,
                normals: None,
            };
            frame.run(&mut workspace)?;
            let seen = distance(&positions[foot], target.map(f64::from)) as f32 / size;
            assert!((seen - left).abs() < 1e-4, "{seen} {left}");
            println!(
                "vertex {foot} to {direction:?}: {:.2} % left after {frames} frames",
                100.0 * left
            );
            arrived += u32::from(left <= REACHED);
        }
    }
    assert!(arrived > 0, "no drag arrives");
    Ok(())
}
