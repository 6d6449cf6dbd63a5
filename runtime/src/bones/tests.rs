//! The bones against the formulas of the format's page, in f64, and every way to ask for them against the others.

use std::vec;
use std::vec::Vec;

use super::fixture::BONES;
use super::*;
use crate::fixture::{Package, memory_for, open};
use crate::{
    Bounds, Buffer, Controls, Frame, FrameError, FrameOutcome, Kernels, TierChoice, Workspace, WorkspaceLayout,
};
use sinew_formats::package::{GROUP_NODES, NORMAL_UNIT, TURN_NODES};

const WEIGHTS: [f32; Package::COMPONENTS] = [0.8, -0.6, 0.5, -1.2, 0.3];
/// Of positions up to 6: sums of some hundred f32 products.
const TOLERANCE: f64 = 2e-5;

fn memory(basis: &crate::Basis<'_>) -> Vec<u8> {
    vec![
        0xff;
        WorkspaceLayout::for_tier(basis, TierChoice::Bones)
            .unwrap()
            .unaligned_bytes()
    ]
}

fn workspace<'w>(basis: &crate::Basis<'_>, memory: &'w mut [u8], kernels: Kernels) -> Workspace<'w> {
    Workspace::for_tier(basis, TierChoice::Bones, memory, kernels).unwrap()
}

fn with_controls<T>(basis: &crate::Basis<'_>, weights: &[f32], job: impl FnOnce(&Controls<'_>) -> T) -> T {
    let mut own = vec![0.0; weights.len()];
    let mut controls = Controls::new(basis, &mut own).unwrap();
    for (k, &w) in weights.iter().enumerate() {
        controls.set_unclamped(k, w).unwrap();
    }
    job(&controls)
}

type Skinned = (Result<FrameOutcome, FrameError>, Vec<[f32; 3]>, Vec<[f32; 3]>);

fn frame(basis: &crate::Basis<'_>, weights: &[f32], workspace: &mut Workspace<'_>) -> Skinned {
    let mut positions = vec![[f32::NAN; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    let outcome = with_controls(basis, weights, |controls| {
        let job = Frame {
            basis,
            controls,
            positions: &mut positions,
            normals: Some(&mut normals),
        };
        job.run(workspace)
    });
    (outcome, positions, normals)
}

fn rows(basis: &crate::Basis<'_>, weights: &[f32], workspace: &mut Workspace<'_>) -> Vec<[f32; 12]> {
    let mut maps = vec![[f32::NAN; 12]; BONES];
    with_controls(basis, weights, |controls| {
        let maps = BoneOutput::Rows(&mut maps);
        BoneMaps { basis, controls, maps }.run(workspace)
    })
    .unwrap();
    maps
}

/// `I + D_b` by rows, then `d_b - D_b c_b`: the page's formulas in f64 on gradients of the exact tier, whose nodes these are.
fn reference(basis: &crate::Basis<'_>, weights: &[f32]) -> Vec<[f64; 12]> {
    let mut bytes = memory_for(basis);
    let mut exact = Workspace::for_tier(basis, TierChoice::Exact, &mut bytes, Kernels::Scalar).unwrap();
    frame(basis, weights, &mut exact).0.unwrap();
    let bones = basis.bones_view().unwrap();
    let nodes: Vec<[[f64; 3]; 3]> = exact
        .gradients
        .iter()
        .map(|columns| core::array::from_fn(|r| core::array::from_fn(|c| f64::from(columns[c][r]))))
        .collect();
    let bone = |b: usize| {
        let mut d = [[0.0; 3]; 3];
        for n in 0..TURN_NODES {
            let node = &nodes[usize::from(bones.turn_nodes[b][n])];
            for (r, row) in d.iter_mut().enumerate() {
                for (c, x) in row.iter_mut().enumerate() {
                    *x += (0..3)
                        .map(|i| node[r][i] * f64::from(bones.turns[b][n][3 * i + c]))
                        .sum::<f64>();
                }
            }
        }
        let (h, lane) = (b / GROUP_NODES, b % GROUP_NODES);
        let mut place = [0.0; 3];
        for (n, node) in nodes.iter().enumerate() {
            let pull = &bones.pulls[h * nodes.len() + n];
            for (r, x) in place.iter_mut().enumerate() {
                let sum = (0..3).map(|i| node[r][i] * f64::from(pull[i][lane])).sum::<f64>();
                *x += sum * f64::from(bones.pull_scales[b]);
            }
        }
        for (k, &weight) in weights.iter().enumerate() {
            for (r, x) in place.iter_mut().enumerate() {
                let slide = f64::from(bones.slides[h * weights.len() + k][r][lane]);
                *x += f64::from(weight) * slide * f64::from(bones.slide_scales[b]);
            }
        }
        let c = bones.rest_places[b].map(f64::from);
        core::array::from_fn(|n| match (n / 4, n % 4) {
            (r, 3) => place[r] - (0..3).map(|i| d[r][i] * c[i]).sum::<f64>(),
            (r, column) => d[r][column] + f64::from(u8::from(r == column)),
        })
    };
    (0..BONES).map(bone).collect()
}

fn apply(map: &[f64; 12], p: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|r| map[4 * r] * p[0] + map[4 * r + 1] * p[1] + map[4 * r + 2] * p[2] + map[4 * r + 3])
}

#[test]
fn maps_are_those_of_the_format_on_all_kernels() {
    let package = Package::small_with_bones(1);
    let basis = open(&package);
    let expected = reference(&basis, &WEIGHTS);
    assert!(
        expected
            .iter()
            .any(|map| (map[0] - 1.0).abs() > 0.1 && map[3].abs() > 0.1)
    );
    for kernels in [Kernels::Scalar, Kernels::Portable, Kernels::Avx2, Kernels::Avx512] {
        if !kernels.run_here() {
            continue;
        }
        let mut bytes = memory(&basis);
        let mut workspace = workspace(&basis, &mut bytes, kernels);
        for (b, (found, expected)) in rows(&basis, &WEIGHTS, &mut workspace).iter().zip(&expected).enumerate() {
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (f64::from(*found) - expected).abs() < TOLERANCE,
                    "{kernels:?}, bone {b}"
                );
            }
        }
    }
}

#[test]
fn layouts_say_the_same() {
    let package = Package::small_with_bones(2);
    let basis = open(&package);
    let mut bytes = memory(&basis);
    let mut workspace = workspace(&basis, &mut bytes, Kernels::Scalar);
    let rows = rows(&basis, &WEIGHTS, &mut workspace);
    let mut columns = vec![[f32::NAN; 12]; BONES];
    let outcome = with_controls(&basis, &WEIGHTS, |controls| {
        let maps = BoneOutput::Columns(&mut columns);
        let basis = &basis;
        BoneMaps { basis, controls, maps }.run(&mut workspace)
    });
    assert_eq!(outcome, Ok(FrameOutcome::Unchanged), "one pose, written twice");
    for (rows, columns) in rows.iter().zip(&columns) {
        for n in 0..12 {
            assert_eq!(rows[4 * (n % 3) + n / 3], columns[n]);
        }
    }
}

#[test]
fn the_skin_is_what_a_shader_makes_of_the_maps() {
    for influences in [4, 8] {
        let package = Package::with_bones(3, influences);
        let basis = open(&package);
        let mut bytes = memory(&basis);
        let mut workspace = workspace(&basis, &mut bytes, Kernels::detect());
        let maps = rows(&basis, &WEIGHTS, &mut workspace);
        let (outcome, positions, normals) = frame(&basis, &WEIGHTS, &mut workspace);
        assert_eq!(outcome, Ok(FrameOutcome::Unchanged));
        let info = basis.bones().unwrap();
        assert_eq!(info.influences(), influences as usize);
        let count = basis.vertex_count() * info.influences();
        let (mut bones, mut weights) = (vec![0; count], vec![0; count]);
        info.write_skin(&mut bones, &mut weights);
        let mut rest_normals = vec![[9.0; 3]; basis.vertex_count()];
        info.write_rest_normals(&mut rest_normals);
        let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for v in 0..basis.vertex_count() {
            let mut map = [0.0_f64; 12];
            for n in v * info.influences()..(v + 1) * info.influences() {
                let share = f64::from(weights[n]) / 65_535.0;
                for (sum, x) in map.iter_mut().zip(&maps[usize::from(bones[n])]) {
                    *sum += share * f64::from(*x);
                }
            }
            let rest = package.rest_in_source_order[v].map(f64::from);
            for (found, expected) in positions[v].iter().zip(apply(&map, rest)) {
                assert!((f64::from(*found) - expected).abs() < TOLERANCE, "vertex {v}");
            }
            let matrix = cofactors_of(&map);
            let turned: [f64; 3] =
                core::array::from_fn(|r| (0..3).map(|c| matrix[3 * r + c] * f64::from(rest_normals[v][c])).sum());
            let length = turned.iter().map(|x| x * x).sum::<f64>().sqrt();
            for (found, expected) in normals[v].iter().zip(turned) {
                assert!((f64::from(*found) - expected / length).abs() < 1e-4, "normal {v}");
            }
            for c in 0..3 {
                bounds[0][c] = bounds[0][c].min(positions[v][c]);
                bounds[1][c] = bounds[1][c].max(positions[v][c]);
            }
        }
        let [minimum, maximum] = bounds;
        assert_eq!(workspace.bounds(), Bounds { minimum, maximum });
        assert!(
            rest_normals
                .as_flattened()
                .iter()
                .any(|x| x.abs() > 1000.0 * NORMAL_UNIT)
        );
    }
}

/// Row-major cofactors of the linear part.
fn cofactors_of(map: &[f64; 12]) -> [f64; 9] {
    let m = |r: usize, c: usize| map[4 * (r % 3) + c % 3];
    core::array::from_fn(|n| {
        let (r, c) = (n / 3, n % 3);
        m(r + 1, c + 1) * m(r + 2, c + 2) - m(r + 1, c + 2) * m(r + 2, c + 1)
    })
}

#[test]
fn rest_is_exact_and_tiny_weights_are_rest() {
    let package = Package::small_with_bones(1);
    let basis = open(&package);
    let mut bytes = memory(&basis);
    let mut workspace = workspace(&basis, &mut bytes, Kernels::detect());
    let neutral = [0.0; Package::COMPONENTS];
    let identity: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    for weights in [neutral, WEIGHTS, neutral, [1e-7; Package::COMPONENTS]] {
        let maps = rows(&basis, &weights, &mut workspace);
        let (_, positions, _) = frame(&basis, &weights, &mut workspace);
        let is_rest = weights[0].abs() < 1e-6;
        assert_eq!(maps.iter().all(|map| *map == identity), is_rest);
        assert_eq!(positions == package.rest_in_source_order, is_rest);
    }
}

#[test]
fn scaled_joints_are_the_affine_maps_but_for_shear() {
    let package = Package::small_with_bones(4);
    let basis = open(&package);
    let mut bytes = memory(&basis);
    let mut workspace = workspace(&basis, &mut bytes, Kernels::Scalar);
    let weights = WEIGHTS.map(|w| 0.2 * w);
    let maps = rows(&basis, &weights, &mut workspace);
    let info = basis.bones().unwrap();
    let rest = (0..BONES).map(|b| info.rest_transform(b));
    let mut joints: Vec<BoneTransform> = rest.collect();
    let at_rest = joints.clone();
    with_controls(&basis, &weights, |controls| {
        let maps = BoneOutput::Scaled(&mut joints);
        let basis = &basis;
        BoneMaps { basis, controls, maps }.run(&mut workspace)
    })
    .unwrap();
    for (b, (joint, map)) in joints.iter().zip(&maps).enumerate() {
        let place = info.rest_places()[b].map(f64::from);
        let moved = apply(&map.map(f64::from), place);
        for c in 0..3 {
            assert!(
                (f64::from(joint.translation[c]) - moved[c]).abs() < TOLERANCE,
                "the place itself, bone {b}"
            );
        }
        let length = joint.rotation.iter().map(|x| x * x).sum::<f32>();
        assert!((length - 1.0).abs() < 1e-5 && joint.rotation[3] >= 0.0);
        assert!(joint.scale.iter().all(|s| (0.2..3.0).contains(s)), "{:?}", joint.scale);
    }
    // Back at rest the joints are those of the bind pose.
    with_controls(&basis, &[0.0; Package::COMPONENTS], |controls| {
        let maps = BoneOutput::Scaled(&mut joints);
        let basis = &basis;
        BoneMaps { basis, controls, maps }.run(&mut workspace)
    })
    .unwrap();
    for (joint, rest) in joints.iter().zip(&at_rest) {
        let pairs = joint
            .rotation
            .iter()
            .zip(&rest.rotation)
            .chain(joint.scale.iter().zip(&rest.scale));
        assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1e-6);
        assert_eq!(joint.translation, rest.translation);
    }
}

#[test]
fn overflow_gives_rest_and_leaves_the_workspace_usable() {
    let package = Package::small_with_bones(1);
    let basis = open(&package);
    let mut bytes = memory(&basis);
    let mut workspace = workspace(&basis, &mut bytes, Kernels::detect());
    let before = frame(&basis, &WEIGHTS, &mut workspace).1;
    workspace.maps[7][1][1] = f32::INFINITY;
    let (outcome, positions, normals) = frame(&basis, &WEIGHTS, &mut workspace);
    assert!(matches!(outcome, Err(FrameError::NotFinite { .. })), "{outcome:?}");
    assert_eq!(positions, package.rest_in_source_order);
    assert!(normals.as_flattened().iter().all(|x| x.is_finite()));
    assert_eq!(frame(&basis, &WEIGHTS, &mut workspace).1, before);

    workspace.maps[7][3][2] = f32::NAN;
    let mut maps = vec![[9.0; 12]; BONES];
    let outcome = with_controls(&basis, &WEIGHTS, |controls| {
        let maps = BoneOutput::Rows(&mut maps);
        let basis = &basis;
        BoneMaps { basis, controls, maps }.run(&mut workspace)
    });
    assert_eq!(outcome, Err(FrameError::BoneNotFinite { bone: 7 }));
    assert!(maps.iter().all(|map| map[0] == 1.0 && map[3] == 0.0), "rest");
    assert_eq!(frame(&basis, &WEIGHTS, &mut workspace).1, before);
    // Weights without measure saturate, and whatever happens ends in numbers.
    for weights in [
        [f32::MAX; Package::COMPONENTS],
        [f32::MIN, f32::MAX, 1.0, f32::MIN, f32::MAX],
    ] {
        let (_, positions, normals) = frame(&basis, &weights, &mut workspace);
        assert!(positions.iter().chain(&normals).flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn validity() {
    let (package, other, plain) = (
        Package::small_with_bones(1),
        Package::small_with_bones(2),
        Package::small(1),
    );
    let (basis, foreign, plain) = (open(&package), open(&other), open(&plain));
    let (mut own, mut others, mut exact) = (memory(&basis), memory(&foreign), memory_for(&basis));
    let mut workspace = workspace(&basis, &mut own, Kernels::Scalar);
    let mut foreign_workspace = self::workspace(&foreign, &mut others, Kernels::Scalar);
    let mut exact = Workspace::for_tier(&basis, TierChoice::Exact, &mut exact, Kernels::Scalar).unwrap();
    let run = |of: &crate::Basis<'_>, count: usize, workspace: &mut Workspace<'_>| {
        let mut maps = vec![[9.0; 12]; count];
        let outcome = with_controls(of, &WEIGHTS, |controls| {
            let maps = BoneOutput::Columns(&mut maps);
            let basis = &basis;
            let job = BoneMaps { basis, controls, maps };
            let checked = job.validate(workspace);
            let outcome = job.run(workspace).map(|_| ());
            assert_eq!(outcome, checked);
            outcome
        });
        assert!(
            outcome.is_ok() || maps.iter().all(|map| *map == [9.0; 12]),
            "nothing was written"
        );
        outcome
    };
    assert_eq!(run(&basis, BONES, &mut workspace), Ok(()));
    let foreign_one = run(&basis, BONES, &mut foreign_workspace);
    assert_eq!(foreign_one, Err(FrameError::ForeignWorkspace));
    assert_eq!(run(&foreign, BONES, &mut workspace), Err(FrameError::ForeignControls));
    assert_eq!(run(&basis, BONES, &mut exact), Err(FrameError::NeedsBones));
    let (buffer, expected, actual) = (Buffer::Bones, BONES, BONES - 1);
    let short = FrameError::WrongLength {
        buffer,
        expected,
        actual,
    };
    assert_eq!(run(&basis, BONES - 1, &mut workspace), Err(short));
    assert!(plain.bones().is_none());
}

#[test]
fn names_and_what_moves() {
    let package = Package::small_with_bones(1);
    let basis = open(&package);
    let info = basis.bones().unwrap();
    assert_eq!(std::format!("{}", BoneName(7)), "bone007");
    assert_eq!((info.count(), info.node_count()), (BONES, basis.vertex_count()));
    assert!((0..Package::COMPONENTS).all(|k| info.moves(k)));
    assert!(info.error().sliders.rms > 0.0 && info.error().shapes.poses == 0);
}
