//! Who takes part: the runtime's frames, and what engines and solvers offer instead.

use core::hint::black_box;

use sinew_peers::morph::MorphTargets;
use sinew_peers::skinning::Skin;
use sinew_peers::solvers::{FaerSimplicial, LowerTriangle};
use sinew_peers::subject::Subject;
use sinew_runtime::{
    Attribute, Basis, BoneMaps, BoneOutput, Controls, Drag, Frame, FrameError, Handles, HandlesLayout, Kernels,
    Normals, Reconstruct, TierChoice, UnitEncoding, VertexLayout, VertexOutput, Workspace, WorkspaceLayout, steps,
};

use crate::measure::{Contender, Role};

/// Morph targets of the yardstick.
const TARGETS: usize = 60;
/// Bones of the rig.
const BONES: usize = 20;
/// Poses that the frames go through.
const POSES: usize = 64;

/// Builds them.
pub struct Contenders;

impl Contenders {
    /// Hands all contenders on a subject to `then`.
    pub fn of(subject: &Subject, then: impl FnOnce(&mut [Contender<'_>])) {
        let basis = Basis::open(&subject.baked).expect("a sound package");
        let without_bias = subject.without_bias();
        let faint = Basis::open(&without_bias).expect("a sound package");
        let mut contenders = Vec::new();
        for kernels in [Kernels::Scalar, Kernels::Portable, Kernels::Avx2, Kernels::Avx512] {
            if kernels.run_here() {
                let widest = kernels == Kernels::detect();
                let all = basis.component_count();
                contenders.push(frame(&basis, TierChoice::Exact, kernels, all, true));
                if basis.bones().is_some() {
                    contenders.push(bone_maps(&basis, kernels, all));
                }
                if widest {
                    contenders.push(frame(&basis, TierChoice::Exact, kernels, all, false));
                    contenders.push(frame(&basis, TierChoice::Exact, kernels, all.min(10), true));
                    if basis.bones().is_some() {
                        contenders.push(frame(&basis, TierChoice::Bones, kernels, all, true));
                    }
                    contenders.extend([1, 4].map(|held| drag(&basis, kernels, held)));
                    contenders.push(into_buffer(&basis, kernels, UnitEncoding::Octahedral16));
                    contenders.push(into_buffer(&basis, kernels, UnitEncoding::Snorm16));
                    contenders.push(one_moved(&basis, kernels));
                    contenders.push(unchanged(&basis, kernels));
                    let features = |v: usize, c: usize| 0.3 * (0.01 * v as f32 + c as f32).sin();
                    contenders.push(solve_path(&basis, kernels, features));
                    contenders.extend(floods(&basis, &faint, kernels));
                    contenders.extend(steps(&basis, kernels));
                }
            }
        }
        contenders.push(normals(&basis));
        contenders.extend(morphs(subject));
        contenders.push(skinning(subject));
        contenders.extend(solvers(subject));
        contenders.push(machine());
        then(&mut contenders);
    }
}

/// Memory that outlives the benchmark: a few contenders, once a run.
fn workspace(basis: &Basis<'_>, tier: TierChoice, kernels: Kernels) -> Workspace<'static> {
    let layout = WorkspaceLayout::for_tier(basis, tier).expect("the package has the tier");
    let memory = vec![0; layout.unaligned_bytes()];
    Workspace::for_tier(basis, tier, memory.leak(), kernels).expect("enough memory")
}

fn frame<'c>(
    basis: &'c Basis<'c>,
    tier: TierChoice,
    kernels: Kernels,
    active: usize,
    with_normals: bool,
) -> Contender<'c> {
    let component_count = basis.component_count();
    let poses = (0..POSES).map(|n| Subject::pose(component_count, active, n)).collect();
    playing(basis, tier, kernels, active, with_normals, poses)
}

/// Frames that go through `poses`.
fn playing<'c>(
    basis: &'c Basis<'c>,
    tier: TierChoice,
    kernels: Kernels,
    active: usize,
    with_normals: bool,
    poses: Vec<Vec<f32>>,
) -> Contender<'c> {
    let mut workspace = workspace(basis, tier, kernels);
    let component_count = basis.component_count();
    let mut weights = vec![0.0; component_count];
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    let name = format!(
        "{} frame, {kernels:?}, {active} active{}",
        if tier == TierChoice::Bones { "bones" } else { "exact" },
        if with_normals { ", normals" } else { "" }
    );
    let run = move |round: usize| {
        let mut controls = Controls::new(basis, &mut weights).expect("a weight a component");
        for (k, &weight) in poses[round % POSES].iter().enumerate() {
            controls.set(k, weight).expect("finite");
        }
        let frame = Frame {
            basis,
            controls: &controls,
            positions: &mut positions,
            normals: if with_normals { Some(&mut normals) } else { None },
        };
        frame.run(&mut workspace).expect("weights in range");
    };
    Contender {
        name,
        role: Role::Measured,
        run: Box::new(run),
    }
}

/// Where the bones are, and no more: an engine skins.
fn bone_maps<'c>(basis: &'c Basis<'c>, kernels: Kernels, active: usize) -> Contender<'c> {
    let mut workspace = workspace(basis, TierChoice::Bones, kernels);
    let component_count = basis.component_count();
    let bone_count = basis.bones().map_or(0, |bones| bones.count());
    let poses: Vec<_> = (0..POSES).map(|n| Subject::pose(component_count, active, n)).collect();
    let mut weights = vec![0.0; component_count];
    let mut maps = vec![[0.0; 12]; bone_count];
    let run = move |round: usize| {
        let mut controls = Controls::new(basis, &mut weights).expect("a weight a component");
        for (k, &weight) in poses[round % POSES].iter().enumerate() {
            controls.set(k, weight).expect("finite");
        }
        let job = BoneMaps {
            basis,
            controls: &controls,
            maps: BoneOutput::Rows(&mut maps),
        };
        job.run(&mut workspace).expect("weights in range");
    };
    Contender {
        name: format!("maps of {bone_count} bones, {kernels:?}, {active} active"),
        role: Role::Measured,
        run: Box::new(run),
    }
}

/// The machine's own unrest: arithmetic in registers, the same every time.
fn machine<'c>() -> Contender<'c> {
    const STEPS: u32 = 400_000;
    Contender {
        name: "nothing but arithmetic in registers".into(),
        role: Role::Measured,
        run: Box::new(|round| {
            let mut x = black_box(round as u32);
            for _ in 0..STEPS {
                x = black_box(x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
            }
            black_box(x);
        }),
    }
}

/// Frames that go on into a vertex buffer of positions and packed normals, interleaved.
fn into_buffer<'c>(basis: &'c Basis<'c>, kernels: Kernels, encoding: UnitEncoding) -> Contender<'c> {
    const STRIDE: usize = 20;
    let mut workspace = workspace(basis, TierChoice::Exact, kernels);
    let component_count = basis.component_count();
    let mut weights = vec![0.0; component_count];
    let mut points = [0, 1].map(|_| vec![[0.0; 3]; basis.vertex_count()]);
    let mut bytes = vec![0; STRIDE * basis.render_vertex_count()];
    let at = |offset_bytes| {
        Some(Attribute {
            offset_bytes,
            stride_bytes: STRIDE,
        })
    };
    let layout = VertexLayout {
        positions: at(0),
        normals: at(12),
        encoding,
        ..VertexLayout::default()
    };
    let run = move |round: usize| {
        let mut controls = Controls::new(basis, &mut weights).expect("a weight a component");
        for (k, &weight) in Subject::pose(component_count, component_count, round % POSES)
            .iter()
            .enumerate()
        {
            controls.set(k, weight).expect("finite");
        }
        let [positions, normals] = &mut points;
        let frame = Frame {
            basis,
            controls: &controls,
            positions,
            normals: Some(normals),
        };
        frame.run(&mut workspace).expect("weights in range");
        let output = VertexOutput {
            basis,
            positions,
            normals: Some(normals),
            scratch: &mut [],
            layout,
            bytes: &mut bytes,
        };
        output.run().expect("a layout that fits");
        black_box(&bytes);
    };
    Contender {
        name: format!("exact frame, {kernels:?}, into a buffer, {encoding:?}"),
        role: Role::Measured,
        run: Box::new(run),
    }
}

/// Frames in each of which one control moves, each in turn.
fn one_moved<'c>(basis: &'c Basis<'c>, kernels: Kernels) -> Contender<'c> {
    let mut workspace = workspace(basis, TierChoice::Exact, kernels);
    let component_count = basis.component_count();
    let mut weights = vec![0.0; component_count];
    let mut pose = Subject::pose(component_count, component_count, 0);
    let mut points = [0, 1].map(|_| vec![[0.0; 3]; basis.vertex_count()]);
    let mut count = 0;
    let run = move |_| {
        pose[count % component_count] = 0.3 + 0.05 * (count / component_count % 7) as f32;
        count += 1;
        let mut controls = Controls::new(basis, &mut weights).expect("a weight a component");
        for (k, &weight) in pose.iter().enumerate() {
            controls.set(k, weight).expect("finite");
        }
        let [positions, normals] = &mut points;
        let frame = Frame {
            basis,
            controls: &controls,
            positions,
            normals: Some(normals),
        };
        frame.run(&mut workspace).expect("weights in range");
    };
    Contender {
        name: format!("exact frame, {kernels:?}, one of {component_count} moved, normals"),
        role: Role::Measured,
        run: Box::new(run),
    }
}

/// A frame in which no control moved.
fn unchanged<'c>(basis: &'c Basis<'c>, kernels: Kernels) -> Contender<'c> {
    let mut one = frame(basis, TierChoice::Exact, kernels, basis.component_count(), true);
    Contender {
        name: format!("frame, {kernels:?}, nothing moved"),
        role: Role::Measured,
        run: Box::new(move |_| (one.run)(0)),
    }
}

/// One update of a drag: some vertices are held, the first goes back and forth.
fn drag<'c>(basis: &'c Basis<'c>, kernels: Kernels, held: usize) -> Contender<'c> {
    let mut workspace = workspace(basis, TierChoice::Exact, kernels);
    let memory = vec![0; HandlesLayout::for_basis(basis, held).unaligned_bytes()].leak();
    let mut handles = Handles::new(basis, held, memory).expect("enough memory");
    let vertices: Vec<usize> = (0..held).map(|n| n * basis.vertex_count() / held).collect();
    for &vertex in &vertices {
        handles.add(basis, &mut workspace, vertex).expect("a free handle");
    }
    let start = handles.targets()[0];
    let mut weights = vec![0.0; basis.component_count()];
    let run = move |round: usize| {
        let mut controls = Controls::resume(basis, &mut weights).expect("a weight a component");
        let mut target = start;
        target[round % 3] += 0.05 * (0.3 * round as f32).sin();
        handles.set_target(vertices[0], target).expect("a held vertex");
        let drag = Drag {
            basis,
            handles: &mut handles,
            controls: &mut controls,
        };
        drag.run(&mut workspace).expect("weights in range");
    };
    Contender {
        name: format!("drag update, {kernels:?}, {held} held"),
        role: Role::Measured,
        run: Box::new(run),
    }
}

/// Exponential map, right-hand side, solve, scatter: the frame behind the blend.
fn solve_path<'c>(basis: &'c Basis<'c>, kernels: Kernels, feature: impl Fn(usize, usize) -> f32) -> Contender<'c> {
    let mut workspace = workspace(basis, TierChoice::Exact, kernels);
    let features: Vec<[f32; 9]> = (0..basis.vertex_count())
        .map(|v| core::array::from_fn(|c| feature(v, c)))
        .collect();
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let run = move |_| {
        let job = Reconstruct {
            basis,
            features: &features,
            positions: &mut positions,
        };
        job.run(&mut workspace).expect("finite");
    };
    Contender {
        name: format!("features to positions, {kernels:?}"),
        role: Role::Measured,
        run: Box::new(run),
    }
}

/// Powers of ten from one down to the last denormal number, one after the other.
fn falling(n: usize) -> f32 {
    10_f32.powi(-((n % 46) as i32))
}

/// The frame and its part behind the blend on inputs full of denormals: `faint` is the subject without biases, where nothing
/// lifts what is tiny. Its weights are all denormal but for some, ever others, that are tiny or ordinary.
fn floods<'c>(basis: &'c Basis<'c>, faint: &'c Basis<'c>, kernels: Kernels) -> [Contender<'c>; 2] {
    let all = faint.component_count();
    let poses = (0..POSES)
        .map(|n| (0..all).map(|k| falling(7 * k + n)).collect())
        .collect();
    let mut whole = playing(faint, TierChoice::Exact, kernels, all, true, poses);
    let name = core::mem::replace(&mut whole.name, format!("exact frame, {kernels:?}, denormal flood"));
    whole.role = Role::FloodOf(name);
    let mut behind = solve_path(basis, kernels, |v, c| falling(31 * v + 5 * c));
    let name = core::mem::replace(
        &mut behind.name,
        format!("features to positions, {kernels:?}, denormal flood"),
    );
    behind.role = Role::FloodOf(name);
    [whole, behind]
}

/// The steps of a frame one by one, all components active.
fn steps<'c>(basis: &'c Basis<'c>, kernels: Kernels) -> [Contender<'c>; 4] {
    type Step = fn(&Basis<'_>, &mut Workspace<'_>, &mut [[f32; 3]]) -> Result<(), FrameError>;
    let steps: [(&str, Step); 4] = [
        ("decode", |basis, workspace, _| steps::decode(basis, workspace)),
        ("right-hand side", |basis, workspace, _| {
            steps::right_hand_side(basis, workspace)
        }),
        ("solve", |basis, workspace, _| steps::solve(basis, workspace)),
        ("scatter, bounding box", steps::scatter),
    ];
    steps.map(|(name, step)| {
        let mut workspace = workspace(basis, TierChoice::Exact, kernels);
        let pose = Subject::pose(basis.component_count(), basis.component_count(), 1);
        let mut weights = pose.clone();
        let mut positions = vec![[0.0; 3]; basis.vertex_count()];
        let controls = Controls::resume(basis, &mut weights).expect("a weight a component");
        let frame = Frame {
            basis,
            controls: &controls,
            positions: &mut positions,
            normals: None,
        };
        frame.run(&mut workspace).expect("weights in range");
        Contender {
            name: format!("step: {name}, {kernels:?}"),
            role: Role::Measured,
            run: Box::new(move |_| step(basis, &mut workspace, &mut positions).expect("an exact workspace")),
        }
    })
}

fn normals<'c>(basis: &'c Basis<'c>) -> Contender<'c> {
    let positions: Vec<[f32; 3]> = basis
        .slot_from_vertex()
        .iter()
        .map(|slot| basis.rest_positions()[slot as usize])
        .collect();
    let mut normals = positions.clone();
    let mut workspace = workspace(basis, TierChoice::Exact, Kernels::detect());
    let run = move |_| {
        let job = Normals {
            basis,
            positions: &positions,
            normals: &mut normals,
        };
        job.run(&mut workspace).expect("lengths agree");
    };
    Contender {
        name: "normals alone".into(),
        role: Role::Measured,
        run: Box::new(run),
    }
}

fn morphs<'c>(subject: &Subject) -> Vec<Contender<'c>> {
    MorphTargets::loops()
        .into_iter()
        .map(|(name, run)| {
            let morph = MorphTargets::new(&subject.rest, TARGETS);
            let mut out = vec![0.0; 3 * subject.rest.len()];
            Contender {
                name: format!("peer: {TARGETS} morph targets {name}"),
                role: Role::Yardstick,
                run: Box::new(move |round| {
                    let weights = Subject::pose(TARGETS, TARGETS, round);
                    run(&morph, &weights, black_box(&mut out));
                }),
            }
        })
        .collect()
}

fn skinning<'c>(subject: &Subject) -> Contender<'c> {
    let skin = Skin::new(&subject.rest, BONES);
    let (mut positions, mut normals) = (subject.rest.clone(), subject.rest.clone());
    Contender {
        name: format!("peer: skinning, {BONES} bones, normals"),
        role: Role::Measured,
        run: Box::new(move |round| {
            let pose = Skin::pose(BONES, 0.01 * (round % POSES) as f32);
            skin.run(&pose, black_box(&mut positions), black_box(&mut normals));
        }),
    }
}

fn solvers<'c>(subject: &Subject) -> Vec<Contender<'c>> {
    let surface = subject.surface();
    let lower = LowerTriangle::of(&surface.laplacian(subject.anchor_vertex()));
    let columns: Vec<f64> = (0..3 * lower.vertex_count()).map(|i| (0.01 * i as f64).sin()).collect();
    let mut faer = FaerSimplicial::new(&lower);
    let mut solution = columns.clone();
    let start = columns.clone();
    #[cfg_attr(not(feature = "cholmod"), expect(unused_mut, reason = "grows with the feature"))]
    let mut solvers = vec![Contender {
        name: "peer: faer simplicial solve, f64".into(),
        role: Role::Measured,
        run: Box::new(move |_| {
            solution.copy_from_slice(&start);
            faer.solve(black_box(&mut solution));
        }),
    }];
    #[cfg(feature = "cholmod")]
    {
        use sinew_peers::cholmod::{Cholmod, Mode};
        solvers.extend(Mode::ALL.into_iter().filter_map(|mode| {
            let mut peer = Cholmod::new(&lower, mode)?;
            let right = columns.clone();
            Some(Contender {
                name: format!("peer: CHOLMOD {mode:?} solve, f64"),
                role: Role::Measured,
                run: Box::new(move |_| {
                    peer.right().copy_from_slice(&right);
                    black_box(peer.solve().expect("a factored matrix"));
                }),
            })
        }));
    }
    solvers
}
