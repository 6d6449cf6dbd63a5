//! "Playing a baked package" in FORMAT.md, step by step as it stands there, in f64 and with nothing of the runtime: the golden
//! package plays as recorded, and the page's worked numbers are what comes out.

use std::fs;

use nalgebra::{Matrix3, Vector3};
use sinew_formats::package::{BakedView, FEATURE_COUNT, GROUP_NODES, NO_PIECE, QUAD, read_package};
use sinew_support::{play, workspace_folder};

/// Those of the recorded frame.
const WEIGHTS: [f64; 4] = [1.0, -0.75, 0.5, 2.0];
/// The page's vertex: the middle of the grid.
const VERTEX: usize = 4;
/// Of the mesh, two units wide: what f32 makes of it.
const TOLERANCE: f64 = 1e-6;

struct Worked {
    features: [f64; FEATURE_COUNT],
    gradient: Matrix3<f64>,
    right_hand_side: Vector3<f64>,
    displacement: Vector3<f64>,
    position: Vector3<f64>,
}

/// Step 1.
fn features(view: &BakedView<'_>, weights: &[f64]) -> Vec<[f64; FEATURE_COUNT]> {
    let patches = view.exact().expect("an exact tier").patches;
    let mut features = vec![[0.0; FEATURE_COUNT]; view.vertex_count()];
    for (slot, x) in features.iter_mut().enumerate() {
        let (g, n) = (slot / GROUP_NODES, slot % GROUP_NODES);
        for (b, block) in view.blocks().enumerate() {
            let bias = block.bias.map(f64::from);
            let mut sum = bias;
            for t in patches.offsets[g] as usize..patches.offsets[g + 1] as usize {
                let [component, owner] = patches.owners[t].map(usize::from);
                let scales = view.component(component).value_scales.by_feature();
                for c in (0..FEATURE_COUNT).filter(|_| owner == b) {
                    let value = f64::from(patches.values[t][c][n]) * f64::from(scales[c]);
                    sum[c] += weights[component] * value;
                }
            }
            for c in 0..FEATURE_COUNT {
                x[c] += sum[c].tanh() - bias[c].tanh();
            }
        }
    }
    features
}

/// Step 2.
fn gradient(view: &BakedView<'_>, x: &[f64; FEATURE_COUNT]) -> Matrix3<f64> {
    let r = f64::from(view.rotation_scale()) * Vector3::new(x[0], x[1], x[2]);
    let s = Matrix3::new(x[3], x[4], x[5], x[4], x[6], x[7], x[5], x[7], x[8]);
    let stretch = Matrix3::identity() + f64::from(view.stretch_scale()) * s;
    nalgebra::Rotation3::new(r).into_inner() * stretch - Matrix3::identity()
}

/// Step 4, in solver order.
fn solve(view: &BakedView<'_>, b: &mut [Vector3<f64>]) {
    let system = view.exact().expect("an exact tier").solve;
    let tiles = |column: usize| system.tile_offsets[column] as usize..system.tile_offsets[column + 1] as usize;
    let columns = b.len() / QUAD;
    for q in 0..columns {
        for t in tiles(q) {
            let row = system.tile_rows.at(t) as usize;
            for c in 0..QUAD {
                for r in 0..QUAD {
                    let moved = f64::from(system.tiles[t][4 * c + r]) * b[QUAD * q + c];
                    b[QUAD * row + r] -= moved;
                }
            }
        }
    }
    for q in (0..columns).rev() {
        let mut own = [Vector3::zeros(); QUAD];
        for c in 0..QUAD {
            for r in 0..QUAD {
                own[r] += f64::from(system.inverse_diagonals[q][4 * c + r]) * b[QUAD * q + c];
            }
        }
        for t in tiles(q) {
            let row = system.tile_rows.at(t) as usize;
            for c in 0..QUAD {
                for r in 0..QUAD {
                    own[c] -= f64::from(system.tiles[t][4 * c + r]) * b[QUAD * row + r];
                }
            }
        }
        b[QUAD * q..QUAD * (q + 1)].copy_from_slice(&own);
    }
}

/// All of step 5 for one slot.
fn added(view: &BakedView<'_>, weights: &[f64], slot: usize) -> Vector3<f64> {
    let after = view.after();
    let (pieces, modes) = (after.piece_count(weights.len()), after.mode_count());
    let mut sum = Vector3::zeros();
    for (k, weight) in weights.iter().enumerate() {
        if let Some(&piece) = after.piece_of.get(slot).filter(|&&piece| piece != NO_PIECE) {
            let offset = after.piece_offsets[k * pieces + usize::from(piece)];
            sum += *weight * Vector3::from(offset.map(f64::from));
        }
        for m in 0..modes {
            let share = f64::from(after.mix[m * weights.len() + k]) * f64::from(after.mode_scales[m]);
            sum += *weight * share * Vector3::from(after.modes[slot * modes + m].map(f64::from));
        }
    }
    sum
}

/// Every step, for every slot.
fn worked(view: &BakedView<'_>, weights: &[f64]) -> Vec<Worked> {
    let system = view.exact().expect("an exact tier").solve;
    let rest: Vec<Vector3<f64>> = view
        .rest_positions()
        .iter()
        .map(|r| Vector3::from(r.map(f64::from)))
        .collect();
    let features = features(view, weights);
    let gradients: Vec<_> = features.iter().map(|x| gradient(view, x)).collect();
    let right_hand_sides: Vec<Vector3<f64>> = (0..rest.len())
        .map(|i| {
            let ring = system.ring_offsets[i] as usize..system.ring_offsets[i + 1] as usize;
            let terms = ring.map(|entry| {
                let (j, weight) = (system.ring.at(entry) as usize, f64::from(system.ring_weights[entry]));
                0.5 * weight * (gradients[i] + gradients[j]) * (rest[i] - rest[j])
            });
            terms.sum()
        })
        .collect();
    let mut solved = vec![Vector3::zeros(); rest.len().next_multiple_of(QUAD)];
    for (i, b) in right_hand_sides.iter().enumerate() {
        solved[system.solver_from_slot.at(i) as usize] = *b;
    }
    solve(view, &mut solved);
    (0..rest.len())
        .map(|i| {
            let displacement = solved[system.solver_from_slot.at(i) as usize];
            Worked {
                features: features[i],
                gradient: gradients[i],
                right_hand_side: right_hand_sides[i],
                displacement,
                position: rest[i] + displacement + added(view, weights, i),
            }
        })
        .collect()
}

/// The rows of the page's table.
fn table(worked: &Worked) -> String {
    let numbers = |numbers: &[f64]| {
        let texts: Vec<String> = numbers.iter().map(|x| format!("{x:.6}")).collect();
        texts.join(" ")
    };
    let gradient = worked.gradient.transpose();
    [
        ("features x", numbers(&worked.features)),
        ("D, by rows", numbers(gradient.as_slice())),
        ("b", numbers(worked.right_hand_side.as_slice())),
        ("d", numbers(worked.displacement.as_slice())),
        ("position", numbers(worked.position.as_slice())),
    ]
    .map(|(name, numbers)| format!("| {name} | {numbers} |\n"))
    .concat()
}

#[test]
fn the_page_plays_the_golden_package() {
    let bytes = read_package(&workspace_folder().join("tests/golden/v3/baked.sinew")).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    let worked = worked(&view, &WEIGHTS);
    let basis = sinew_runtime::Basis::open(&bytes).unwrap();
    let [positions, _] = play(&basis, |k| WEIGHTS[k] as f32).unwrap();
    for (slot, vertex) in view.vertex_from_slot().iter().enumerate() {
        let found = Vector3::from(positions[vertex as usize].map(f64::from));
        let error = (found - worked[slot].position).norm();
        assert!(error < TOLERANCE, "vertex {vertex}: {error}");
    }
    let page = fs::read_to_string(workspace_folder().join("formats/FORMAT.md")).unwrap();
    let rows = table(&worked[view.slot_from_vertex().at(VERTEX) as usize]);
    assert!(page.contains(&rows), "the page's worked numbers should be:\n{rows}");
}
