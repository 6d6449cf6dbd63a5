//! Opening a package, carving a workspace and playing allocate nothing, refusals included: counted by the allocator.

use sinew_formats::package::{fixture::tiny_baked, write_baked};
use sinew_runtime::{
    Attribute, Basis, Batch, BoneMaps, BoneOutput, ControlError, Controls, Drag, Frame, FrameError, FrameOutcome,
    Handles, HandlesLayout, Instance, Kernels, Normals, OpenError, Reconstruct, Tangent, TierChoice, VertexLayout,
    VertexOutput, Workspace, WorkspaceError, WorkspaceLayout,
};
use sinew_support::requests;

/// The tiny package, and one of the same shape with another rest mesh.
fn packages() -> [sinew_formats::package::AlignedBytes; 2] {
    let baked = tiny_baked();
    let mut other = tiny_baked();
    other.rest_positions[0][2] += 0.25;
    [baked, other].map(|baked| write_baked(&baked.basis()).expect("the fixture is valid"))
}

#[test]
fn a_thousand_frames_allocate_nothing() {
    let [bytes, _] = packages();
    let layout = WorkspaceLayout::for_basis(&Basis::open(&bytes).expect("valid"));
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut weights = [0.0; sinew_formats::package::fixture::COMPONENT_COUNT];
    let mut positions = [[0.0; 3]; sinew_formats::package::fixture::VERTEX_COUNT];
    let mut normals = positions;
    let mut tangent = positions;
    let mut solved = 0;
    let count = requests(|| {
        let basis = Basis::open(&bytes).expect("valid");
        let mut workspace = Workspace::new(&basis, &mut memory).expect("enough memory");
        let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
        for frame in 0..1000 {
            let k = frame % basis.component_count();
            // Every third frame changes nothing.
            if frame % 3 != 0 {
                controls.set(k, (frame as f32 * 0.1).sin()).expect("finite");
            }
            let (positions, normals) = (&mut positions, Some(&mut normals[..]));
            let job = Frame {
                basis: &basis,
                controls: &controls,
                positions,
                normals,
            };
            solved += usize::from(job.run(&mut workspace).expect("finite") == FrameOutcome::Solved);
            let job = Tangent {
                basis: &basis,
                component: k,
                displacement: &mut tangent,
            };
            job.run(&mut workspace).expect("finite");
        }
        let mut features = [[0.0; 9]; sinew_formats::package::fixture::VERTEX_COUNT];
        workspace.features(&basis, &mut features).expect("one row a vertex");
        let job = Reconstruct {
            basis: &basis,
            features: &features,
            positions: &mut tangent,
        };
        job.run(&mut workspace).expect("finite");
        assert!(basis.component_named("no such").is_none());
        assert_eq!(basis.components().len(), basis.component_count());
    });
    assert_eq!(count, 0);
    assert!(solved > 600, "{solved} frames had work to do");
}

#[test]
fn bones_posed_and_skinned_allocate_nothing() {
    let mut tiny = tiny_baked();
    let bone_count = tiny.bones.insert(tiny.three_bones()).rest_places.len();
    let bytes = write_baked(&tiny.basis()).expect("the fixture is valid");
    let tier = TierChoice::Bones;
    let layout = WorkspaceLayout::for_tier(&Basis::open(&bytes).expect("valid"), tier).expect("it has bones");
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut weights = [0.0; sinew_formats::package::fixture::COMPONENT_COUNT];
    let mut positions = [[0.0; 3]; sinew_formats::package::fixture::VERTEX_COUNT];
    let mut normals = positions;
    let mut maps = vec![[0.0; 12]; bone_count];
    let mut few = [[0.0; 12]; 2];
    let mut joints = vec![sinew_runtime::BoneTransform::default(); bone_count];
    let count = requests(|| {
        let basis = Basis::open(&bytes).expect("valid");
        let mut workspace = Workspace::for_tier(&basis, tier, &mut memory, Kernels::detect()).expect("enough memory");
        let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
        for frame in 0..1000 {
            let k = frame % basis.component_count();
            controls.set(k, (frame as f32 * 0.1).sin()).expect("finite");
            for maps in [
                BoneOutput::Rows(&mut maps),
                BoneOutput::Columns(&mut few),
                BoneOutput::Scaled(&mut joints),
            ] {
                let right = !matches!(maps, BoneOutput::Columns(_));
                let (basis, controls) = (&basis, &controls);
                let outcome = BoneMaps { basis, controls, maps }.run(&mut workspace);
                assert_eq!(outcome.is_ok(), right, "too few maps are refused");
            }
            let job = Frame {
                basis: &basis,
                controls: &controls,
                positions: &mut positions,
                normals: Some(&mut normals),
            };
            job.run(&mut workspace).expect("finite");
        }
        assert!(basis.bones().is_some());
    });
    assert_eq!(count, 0);
}

#[test]
fn refusals_allocate_nothing() {
    let [bytes, other] = packages();
    let mut damaged = bytes.clone();
    let last = damaged.len() - 1;
    damaged.as_mut_slice()[last] ^= 1;
    let (basis, foreign) = (Basis::open(&bytes).expect("valid"), Basis::open(&other).expect("valid"));
    let (vertex_count, component_count) = (basis.vertex_count(), basis.component_count());
    let layout = WorkspaceLayout::for_basis(&basis);
    let (mut memory, mut foreign_memory) = (vec![0; layout.unaligned_bytes()], vec![0; layout.unaligned_bytes()]);
    let (mut weights, mut foreign_weights) = (vec![0.0; component_count], vec![0.0; component_count]);
    let (mut positions, mut normals) = (vec![[0.0; 3]; vertex_count], vec![[0.0; 3]; vertex_count]);
    let features = vec![[f32::NAN; 9]; vertex_count];
    let count = requests(|| {
        assert!(matches!(Basis::open(&damaged), Err(OpenError::ContentIdMismatch)));
        assert!(Basis::open(&bytes[..last]).is_err());
        assert!(Basis::open(&[]).is_err());

        let refused = Workspace::new(&basis, &mut memory[..8]);
        assert!(matches!(refused, Err(WorkspaceError::TooSmall { .. })));
        let refused = Controls::new(&basis, &mut weights[..1]);
        assert!(matches!(refused, Err(ControlError::WrongLength { .. })));

        let mut workspace = Workspace::new(&basis, &mut memory).expect("enough memory");
        let mut foreign_workspace = Workspace::new(&foreign, &mut foreign_memory).expect("enough memory");
        let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
        let foreign_controls = Controls::new(&foreign, &mut foreign_weights).expect("one weight a component");
        assert_eq!(controls.set(0, f32::NAN), Err(ControlError::NotFinite { component: 0 }));
        assert!(controls.set(component_count, 0.0).is_err());

        let mut frame = |controls: &Controls<'_>, length: usize, workspace: &mut Workspace<'_>| {
            let (positions, normals) = (&mut positions[..length], Some(&mut normals[..]));
            Frame {
                basis: &basis,
                controls,
                positions,
                normals,
            }
            .run(workspace)
        };
        assert_eq!(
            frame(&controls, vertex_count, &mut foreign_workspace),
            Err(FrameError::ForeignWorkspace)
        );
        assert_eq!(
            frame(&foreign_controls, vertex_count, &mut workspace),
            Err(FrameError::ForeignControls)
        );
        let short = frame(&controls, vertex_count - 1, &mut workspace);
        assert!(matches!(short, Err(FrameError::WrongLength { .. })));
        for k in 0..component_count {
            controls.set_unclamped(k, f32::MAX).expect("finite");
        }
        // Overflow: an answer or a refusal, but no allocation either way.
        let _ = frame(&controls, vertex_count, &mut workspace);

        let missing = Tangent {
            basis: &basis,
            component: component_count,
            displacement: &mut positions,
        };
        assert!(missing.run(&mut workspace).is_err());
        let broken = Reconstruct {
            basis: &basis,
            features: &features,
            positions: &mut positions,
        };
        assert_eq!(
            broken.run(&mut workspace),
            Err(FrameError::FeatureNotFinite { vertex: 0 })
        );
        let short = Normals {
            basis: &basis,
            positions: &positions[1..],
            normals: &mut normals,
        };
        assert!(short.run(&mut workspace).is_err());
    });
    assert_eq!(count, 0);
}

#[test]
fn handles_output_and_batches_allocate_nothing() {
    const COUNT: usize = sinew_formats::package::fixture::VERTEX_COUNT;
    const COMPONENTS: usize = sinew_formats::package::fixture::COMPONENT_COUNT;
    let [bytes, _] = packages();
    let basis = Basis::open(&bytes).expect("valid");
    let layout = WorkspaceLayout::for_basis(&basis);
    let mut memories = [(); 3].map(|()| vec![0; layout.unaligned_bytes()]);
    let mut handle_memory = vec![0; HandlesLayout::for_basis(&basis, 2).unaligned_bytes()];
    let mut weights = [[0.0; COMPONENTS]; 3];
    let mut positions = [[[0.0; 3]; COUNT]; 3];
    let mut normals = positions;
    let mut scratch = [[0.0; 4]; 2 * COUNT];
    let mut buffer = [0; 40 * 2 * COUNT];
    let mut steps = 0;
    let count = requests(|| {
        let [own, one, two] = &mut memories;
        let [own_weights, one_weights, two_weights] = &mut weights;
        let [own_positions, one_positions, two_positions] = &mut positions;
        let [own_normals, one_normals, two_normals] = &mut normals;
        let mut workspace = Workspace::new(&basis, own).expect("enough memory");
        let mut controls = Controls::new(&basis, own_weights).expect("one weight a component");
        assert!(Handles::new(&basis, 2, &mut handle_memory[..9]).is_err());
        let mut handles = Handles::new(&basis, 2, &mut handle_memory).expect("enough memory");
        handles.add(&basis, &mut workspace, 4).expect("room");
        handles.add(&basis, &mut workspace, 7).expect("room");
        assert!(handles.add(&basis, &mut workspace, 1).is_err());
        handles.pin(1, true).expect("a component");
        let at = |offset_bytes| {
            Some(Attribute {
                offset_bytes,
                stride_bytes: 40,
            })
        };
        let vertex_layout = VertexLayout {
            positions: at(0),
            normals: at(12),
            tangents: at(24),
            ..VertexLayout::default()
        };
        for frame in 0..200 {
            let z = 0.3 * (frame as f32 * 0.1).sin();
            handles.set_target(4, [1.0, 1.0, z]).expect("finite");
            assert!(handles.set_target(4, [f32::NAN; 3]).is_err());
            let drag = Drag {
                basis: &basis,
                handles: &mut handles,
                controls: &mut controls,
            };
            steps += drag.run(&mut workspace).expect("finite").step_count;
            let job = Frame {
                basis: &basis,
                controls: &controls,
                positions: own_positions,
                normals: Some(own_normals),
            };
            job.run(&mut workspace).expect("finite");
            for length in [buffer.len(), 7] {
                let output = VertexOutput {
                    basis: &basis,
                    positions: own_positions,
                    normals: Some(own_normals),
                    scratch: &mut scratch,
                    layout: vertex_layout,
                    bytes: &mut buffer[..length],
                };
                assert_eq!(output.run().is_ok(), length > 7);
            }
        }
        handles.remove(7).expect("held");
        handles.clear();

        let instance = |memory, weights, positions, normals| Instance {
            basis: &basis,
            controls: Controls::new(&basis, weights).expect("one weight a component"),
            workspace: Workspace::new(&basis, memory).expect("enough memory"),
            positions,
            normals: Some(normals),
            outcome: None,
        };
        let mut instances = [
            instance(one, one_weights, one_positions, one_normals),
            instance(two, two_weights, two_positions, two_normals),
        ];
        for frame in 0..200 {
            for instance in &mut instances {
                instance
                    .controls
                    .set(frame % COMPONENTS, 0.01 * frame as f32)
                    .expect("finite");
            }
            assert_eq!(Batch::new(&mut instances).play(), 2);
        }
    });
    assert_eq!(count, 0);
    assert!(steps > 20, "{steps} steps");
}
