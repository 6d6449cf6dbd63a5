//! Handles against the frame and its derivative, and dragging on a small package.

use std::vec;
use std::vec::Vec;

use super::*;
use crate::fixture::{Package, memory_for, open, workspace_in};
use crate::{Controls, Frame, Kernels, Tangent, TierChoice};

/// Sums of a hundred products near one, in f32 on both sides.
const TOLERANCE: f32 = 5e-5;
/// Of the bounding box' diagonal: what a dragged vertex reaches in `UPDATES_MAX` updates.
const REACH: f32 = 0.01;
const UPDATES_MAX: usize = 8;
const WEIGHTS: [f32; Package::COMPONENTS] = [0.7, -0.4, 0.9, -0.8, 0.2];
const REST: [f32; Package::COMPONENTS] = [0.0; Package::COMPONENTS];

fn handles_memory(basis: &Basis<'_>, capacity: usize) -> Vec<u8> {
    vec![0xff; HandlesLayout::for_basis(basis, capacity).unaligned_bytes()]
}

fn pose(basis: &Basis<'_>, weights: &[f32], workspace: &mut Workspace<'_>) -> Vec<[f32; 3]> {
    let mut memory = vec![0.0; weights.len()];
    let controls = controls_at(basis, weights, &mut memory);
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let job = Frame {
        basis,
        controls: &controls,
        positions: &mut positions,
        normals: None,
    };
    job.run(workspace).unwrap();
    positions
}

fn controls_at<'c>(basis: &'c Basis<'c>, weights: &[f32], memory: &'c mut [f32]) -> Controls<'c> {
    let mut controls = Controls::new(basis, memory).unwrap();
    for (k, &w) in weights.iter().enumerate() {
        controls.set_unclamped(k, w).unwrap();
    }
    controls
}

fn distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt()
}

/// Drags `held` to `targets` from `start` and returns the weights after each update.
fn drag(
    basis: &Basis<'_>,
    held: &[(usize, [f32; 3])],
    pinned: &[usize],
    start: &[f32],
    updates: usize,
) -> Vec<(Vec<f32>, DragReport)> {
    let (mut memory, mut own) = (memory_for(basis), handles_memory(basis, held.len()));
    let mut workspace = workspace_in(basis, &mut memory);
    let mut handles = Handles::new(basis, held.len(), &mut own).unwrap();
    for &(vertex, target) in held {
        handles.add(basis, &mut workspace, vertex).unwrap();
        handles.set_target(vertex, target).unwrap();
    }
    for &k in pinned {
        handles.pin(k, true).unwrap();
        assert_eq!(handles.is_pinned(k), Ok(true));
    }
    let mut weights = vec![0.0; start.len()];
    let mut controls = controls_at(basis, start, &mut weights);
    let update = |_| {
        let job = Drag {
            basis,
            handles: &mut handles,
            controls: &mut controls,
        };
        let report = job.run(&mut workspace).unwrap();
        (controls.weights().to_vec(), report)
    };
    (0..updates).map(update).collect()
}

#[test]
fn held_vertices_and_their_derivatives_are_those_of_the_frame() {
    let package = Package::small(3);
    let basis = open(&package);
    let (mut memory, mut own) = (memory_for(&basis), handles_memory(&basis, 5));
    // More than one walk takes together.
    let vertices = [0, 17, 29, 8, 13];
    for (weights, kernels) in [
        (REST, Kernels::Scalar),
        (WEIGHTS, Kernels::Scalar),
        (WEIGHTS, Kernels::Avx2),
        (WEIGHTS, Kernels::Avx512),
    ] {
        if !kernels.run_here() {
            continue;
        }
        let mut workspace = Workspace::with_kernels(&basis, &mut memory, kernels).unwrap();
        let mut handles = Handles::new(&basis, vertices.len(), &mut own).unwrap();
        for vertex in vertices {
            handles.add(&basis, &mut workspace, vertex).unwrap();
        }
        let positions = pose(&basis, &weights, &mut workspace);
        handles.memory.trial.copy_from_slice(&weights);
        let tier = basis.exact().unwrap();
        assert!(handles.evaluate(&basis, &tier, &workspace));
        handles.linearise(&basis, &tier, &workspace);
        for (n, &vertex) in vertices.iter().enumerate() {
            let apart = distance(&handles.trial_positions[n], &positions[vertex]);
            assert!(apart < TOLERANCE, "vertex {vertex} is {apart} away");
        }
        // The workspace lent its scratch and no more: the derivative is still that of its pose.
        for component in 0..Package::COMPONENTS {
            let mut moved = vec![[0.0; 3]; basis.vertex_count()];
            let job = Tangent {
                basis: &basis,
                component,
                displacement: &mut moved,
            };
            job.run(&mut workspace).unwrap();
            for (n, &vertex) in vertices.iter().enumerate() {
                let found: [f32; 3] = core::array::from_fn(|c| handles.memory.jacobian[component * 15 + 3 * n + c]);
                let apart = distance(&found, &moved[vertex]);
                assert!(
                    apart < TOLERANCE * 10.0,
                    "component {component}, vertex {vertex}: {apart}"
                );
            }
        }
    }
}

#[test]
fn a_drag_reaches_what_can_be_reached() {
    for seed in 1..6 {
        let package = Package::small(seed);
        let basis = open(&package);
        let mut memory = memory_for(&basis);
        let mut workspace = workspace_in(&basis, &mut memory);
        let reachable = pose(&basis, &WEIGHTS.map(|w| 0.5 * w), &mut workspace);
        let size = diagonal(basis.rest_positions()) as f32;
        let vertex = 29;
        let updates = drag(&basis, &[(vertex, reachable[vertex])], &[], &REST, UPDATES_MAX);
        let (weights, report) = updates.last().unwrap();
        let played = pose(&basis, weights, &mut workspace);
        let left = distance(&played[vertex], &reachable[vertex]);
        let way = distance(&package.rest_in_source_order[vertex], &reachable[vertex]);
        assert!(
            way > 2.0 * REACH * size,
            "seed {seed}: the target is {way} away to begin with"
        );
        assert!(left < REACH * size, "seed {seed}: {left} left of {way}");
        assert!(
            (left - report.misfit).abs() < TOLERANCE * size,
            "what is reported is what is played"
        );
        // Nothing is worse after an update than before.
        assert!(updates.windows(2).all(|pair| pair[1].1.misfit <= pair[0].1.misfit));
    }
}

#[test]
fn weights_that_go_together_are_dragged_together() {
    let package = Package::small_with_prior(2);
    let basis = open(&package);
    let mut memory = memory_for(&basis);
    let mut workspace = workspace_in(&basis, &mut memory);
    // As far as two components go, seen through a single vertex: three coordinates for five weights.
    let goal = pose(&basis, &[0.0, 0.0, 0.4, -0.4, 0.0], &mut workspace);
    let vertex = 29;
    let known = drag(&basis, &[(vertex, goal[vertex])], &[], &REST, 20);
    let plain = Package::small_with_nothing_added(2);
    let alike = drag(&open(&plain), &[(vertex, goal[vertex])], &[], &REST, 20);
    let together = |updates: &[(Vec<f32>, DragReport)]| {
        let weights = &updates.last().unwrap().0;
        let all: f32 = weights.iter().map(|w| w * w).sum();
        (weights[2] - weights[3]).powi(2) / (2.0 * all)
    };
    assert!(together(&known) > 0.9, "{:?}", known.last());
    assert!(together(&alike) < 0.7, "{:?}", alike.last());
    // One vertex tells both.
    for (found, goal) in known.last().unwrap().0.iter().zip([0.0, 0.0, 0.4, -0.4, 0.0]) {
        assert!((found - goal).abs() < 0.01, "{:?}", known.last());
    }
}

#[test]
fn a_handle_that_is_not_moved_holds_its_vertex() {
    let package = Package::small(2);
    let basis = open(&package);
    let mut memory = memory_for(&basis);
    let mut workspace = workspace_in(&basis, &mut memory);
    let start = pose(&basis, &WEIGHTS, &mut workspace);
    let size = diagonal(basis.rest_positions()) as f32;
    let (moved, held) = (29, 4);
    let mut target = start[moved];
    target[2] += 0.05 * size;
    let alone = drag(&basis, &[(moved, target)], &[], &WEIGHTS, UPDATES_MAX);
    let both = drag(
        &basis,
        &[(moved, target), (held, start[held])],
        &[],
        &WEIGHTS,
        UPDATES_MAX,
    );
    let mut slip = |updates: Vec<(Vec<f32>, DragReport)>| {
        let played = pose(&basis, &updates.last().unwrap().0, &mut workspace);
        (distance(&played[held], &start[held]), distance(&played[moved], &target))
    };
    let (slip_alone, _) = slip(alone);
    let (slip_held, left) = slip(both);
    // Six coordinates for five weights: neither vertex gets all it wants.
    assert!(
        slip_held < 0.5 * slip_alone,
        "held {slip_held}, free it slips {slip_alone}"
    );
    assert!(
        left < distance(&start[moved], &target),
        "and still the other comes nearer"
    );
}

#[test]
fn pinned_components_do_not_move_and_stops_hold() {
    let package = Package::small(2);
    let basis = open(&package);
    let far = [40.0, -30.0, 20.0];
    let updates = drag(&basis, &[(29, far)], &[1, 3], &[0.2, 0.3, 0.0, -0.4, 9.0], UPDATES_MAX);
    let (weights, report) = updates.last().unwrap();
    assert_eq!((weights[1], weights[3]), (0.3, -0.4));
    for k in [0, 2] {
        let component = basis.component(k);
        assert!(
            (component.minimum..=component.maximum).contains(&weights[k]),
            "{k}: {}",
            weights[k]
        );
    }
    assert!(
        (basis.component(4).minimum..=9.0).contains(&weights[4]),
        "beyond its stop it may stay or come back"
    );
    assert!(report.misfit.is_finite() && report.misfit > 1.0);
    // All pinned: nothing moves, and that is no error.
    let everything: Vec<usize> = (0..Package::COMPONENTS).collect();
    let (weights, report) = drag(&basis, &[(29, far)], &everything, &WEIGHTS, 1).remove(0);
    assert_eq!((&weights[..], report.step_count), (&WEIGHTS[..], 0));
}

#[test]
fn coarse_components_come_first() {
    let package = Package::small(1);
    let basis = open(&package);
    let mut memory = memory_for(&basis);
    let mut workspace = workspace_in(&basis, &mut memory);
    let coarse = [0.5, -0.3, 0.0, 0.0, 0.0];
    let reachable = pose(&basis, &coarse, &mut workspace);
    let held = [(29, reachable[29]), (3, reachable[3])];
    let (weights, _) = drag(&basis, &held, &[], &REST, 1).remove(0);
    let share = |range: core::ops::Range<usize>| weights[range].iter().map(|w| w * w).sum::<f32>();
    assert!(share(0..2) > 2.0 * share(2..5), "{weights:?}");
}

#[test]
fn without_handles_or_at_the_target_nothing_moves() {
    let package = Package::small(1);
    let basis = open(&package);
    for held in [vec![], vec![(7, package.rest_in_source_order[7])]] {
        for (weights, report) in drag(&basis, &held, &[], &REST, 2) {
            assert_eq!(weights, REST);
            assert!(report.misfit == 0.0 && report.step_count == 0);
        }
    }
}

#[test]
fn a_drag_without_handles_decodes_nothing() {
    let package = Package::small(1);
    let basis = open(&package);
    let (mut memory, mut held) = (memory_for(&basis), handles_memory(&basis, 1));
    let mut workspace = workspace_in(&basis, &mut memory);
    let mut handles = Handles::new(&basis, 1, &mut held).unwrap();
    let mut weights = [0.0; Package::COMPONENTS];
    let mut controls = controls_at(&basis, &WEIGHTS, &mut weights);
    let job = Drag {
        basis: &basis,
        handles: &mut handles,
        controls: &mut controls,
    };
    assert_eq!(
        job.run(&mut workspace),
        Ok(DragReport {
            misfit: 0.0,
            step_count: 0
        })
    );
    assert!(!handles.is_evaluated);
}

#[test]
fn handles_come_and_go() {
    let package = Package::small(4);
    let basis = open(&package);
    let (mut memory, mut own, mut other) = (memory_for(&basis), handles_memory(&basis, 3), handles_memory(&basis, 2));
    let mut workspace = workspace_in(&basis, &mut memory);
    let start = pose(&basis, &WEIGHTS, &mut workspace);
    let mut handles = Handles::new(&basis, 3, &mut own).unwrap();
    for vertex in [5, 11, 20] {
        handles.add(&basis, &mut workspace, vertex).unwrap();
    }
    assert_eq!(handles.targets(), [start[5], start[11], start[20]]);
    handles.remove(11).unwrap();
    assert_eq!(
        (handles.vertices(), handles.targets()),
        (&[5, 20][..], &[start[5], start[20]][..])
    );
    // What is left is what was never more.
    let mut fresh = Handles::new(&basis, 2, &mut other).unwrap();
    for vertex in [5, 20] {
        fresh.add(&basis, &mut workspace, vertex).unwrap();
    }
    let count = 2 * handles.features.len();
    assert_eq!(handles.pulls[..count], fresh.pulls[..count]);
    assert_eq!((handles.capacity(), fresh.capacity()), (3, 2));
    handles.clear();
    assert!(handles.vertices().is_empty());
    handles.add(&basis, &mut workspace, 11).unwrap();
    assert_eq!(handles.vertices(), [11]);
}

#[test]
fn validity() {
    let (package, other) = (Package::small(1), Package::small(2));
    let (basis, foreign) = (open(&package), open(&other));
    let (mut memory, mut foreign_memory) = (memory_for(&basis), memory_for(&foreign));
    let (mut workspace, mut foreign_workspace) = (
        workspace_in(&basis, &mut memory),
        workspace_in(&foreign, &mut foreign_memory),
    );
    let mut own = handles_memory(&basis, 2);
    let required = HandlesLayout::for_basis(&basis, 2).size_bytes;
    let refused = Handles::new(&basis, 2, &mut own[..required / 2]).unwrap_err();
    assert!(matches!(refused, WorkspaceError::TooSmall { actual_bytes, .. } if actual_bytes == required / 2));

    let mut handles = Handles::new(&basis, 2, &mut own).unwrap();
    let vertex_count = basis.vertex_count();
    let mut add = |vertex, basis: &Basis<'_>, workspace: &mut Workspace<'_>| handles.add(basis, workspace, vertex);
    assert_eq!(add(3, &basis, &mut workspace), Ok(()));
    assert_eq!(
        add(3, &basis, &mut workspace),
        Err(HandleError::AlreadyHeld { vertex: 3 })
    );
    let missing = HandleError::NoSuchVertex {
        vertex: vertex_count,
        vertex_count,
    };
    assert_eq!(add(vertex_count, &basis, &mut workspace), Err(missing));
    assert_eq!(add(4, &foreign, &mut workspace), Err(HandleError::ForeignHandles));
    assert_eq!(
        add(4, &basis, &mut foreign_workspace),
        Err(HandleError::ForeignWorkspace)
    );
    assert_eq!(add(4, &basis, &mut workspace), Ok(()));
    assert_eq!(add(5, &basis, &mut workspace), Err(HandleError::Full { capacity: 2 }));
    assert_eq!(handles.remove(5), Err(HandleError::NotHeld { vertex: 5 }));
    assert_eq!(handles.set_target(5, [0.0; 3]), Err(HandleError::NotHeld { vertex: 5 }));
    let before = handles.targets()[0];
    for bad in [f32::NAN, f32::INFINITY] {
        let refused = handles.set_target(3, [0.0, bad, 0.0]);
        assert_eq!(refused, Err(HandleError::TargetNotFinite { vertex: 3 }));
    }
    assert_eq!(handles.targets()[0], before);
    let missing = HandleError::NoSuchComponent {
        component: Package::COMPONENTS,
        component_count: Package::COMPONENTS,
    };
    assert_eq!(handles.pin(Package::COMPONENTS, true), Err(missing));
    assert_eq!(handles.is_pinned(Package::COMPONENTS), Err(missing));

    handles.set_target(3, [f32::MAX, 0.0, -f32::MAX]).unwrap();
    let (mut weights, mut foreign_weights) = (REST, REST);
    let mut controls = Controls::new(&basis, &mut weights).unwrap();
    let mut foreign_controls = Controls::new(&foreign, &mut foreign_weights).unwrap();
    let mut run = |basis: &Basis<'_>, controls: &mut Controls<'_>, workspace: &mut Workspace<'_>| {
        let job = Drag {
            basis,
            handles: &mut handles,
            controls,
        };
        let checked = job.validate(workspace);
        let outcome = job.run(workspace);
        assert!(checked.is_ok() || outcome.map(|_| ()) == checked);
        outcome
    };
    assert!(run(&basis, &mut controls, &mut workspace).is_ok(), "far is only far");
    assert!(controls.weights().iter().all(|w| w.is_finite()));
    assert_eq!(
        run(&foreign, &mut controls, &mut workspace),
        Err(HandleError::ForeignHandles)
    );
    assert_eq!(
        run(&basis, &mut controls, &mut foreign_workspace),
        Err(HandleError::ForeignWorkspace)
    );
    assert_eq!(
        run(&basis, &mut foreign_controls, &mut workspace),
        Err(HandleError::ForeignControls)
    );
    for k in 0..2 {
        controls.set_unclamped(k, f32::MAX).unwrap();
    }
    // Far out, numbers saturate or overflow: an answer or a refusal, and the controls stay numbers.
    match run(&basis, &mut controls, &mut workspace) {
        Ok(report) => assert!(report.step_count <= 2),
        Err(refused) => assert!(matches!(refused, HandleError::NotFinite { vertex: 3 | 4 })),
    }
    assert!(controls.weights().iter().all(|w| w.is_finite()));
}

#[test]
fn a_workspace_of_bones_is_refused() {
    let package = Package::small_with_bones(1);
    let basis = open(&package);
    let mut bytes = vec![0; 200_000];
    let made = Workspace::for_tier(&basis, TierChoice::Bones, &mut bytes, Kernels::Scalar);
    let mut workspace = made.unwrap();
    let mut bytes = vec![0; HandlesLayout::for_basis(&basis, 2).unaligned_bytes()];
    let mut handles = Handles::new(&basis, 2, &mut bytes).unwrap();
    assert_eq!(handles.add(&basis, &mut workspace, 3), Err(HandleError::NeedsExactTier));
    let mut weights = REST;
    let mut controls = Controls::new(&basis, &mut weights).unwrap();
    let job = Drag {
        basis: &basis,
        handles: &mut handles,
        controls: &mut controls,
    };
    assert_eq!(job.run(&mut workspace), Err(HandleError::NeedsExactTier));
}
