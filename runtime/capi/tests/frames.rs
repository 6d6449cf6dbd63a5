//! What engines want beyond a frame, through the C functions: the fast tier, held vertices, vertex buffers, batches. Each
//! beside the runtime's own.

mod common;

use common::player::{Held, Player, Round, Vertices, sized};
use common::{other_package, package};
use sinew::*;
use sinew_runtime::{
    Attribute, Basis, Controls, Frame, Kernels, TierChoice, VertexLayout, VertexOutput, Workspace, WorkspaceLayout,
};

/// Weights that differ between instances and frames.
fn weight(instance: usize, control: usize, frame: usize) -> f32 {
    ((3 * instance + 5 * control + 7 * frame) % 11) as f32 * 0.2 - 0.9
}

fn pose(player: &Player, instance: usize, frame: usize) {
    for control in 0..player.control_count {
        // SAFETY: the player's memory stands.
        let status = unsafe {
            sinew_control_set(
                player.controls,
                control,
                weight(instance, control as usize, frame),
                core::ptr::null_mut(),
            )
        };
        assert_eq!(status, SinewStatus::Ok);
    }
}

/// The runtime's own frame.
fn expected(package: &[u8], tier: TierChoice, instance: usize, frame: usize) -> [Vec<[f32; 3]>; 2] {
    let basis = Basis::open(package).expect("valid");
    let layout = WorkspaceLayout::for_tier(&basis, tier).expect("it has both tiers");
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut workspace = Workspace::for_tier(&basis, tier, &mut memory, Kernels::detect()).expect("enough");
    let mut weights = vec![0.0; basis.component_count()];
    let mut controls = Controls::new(&basis, &mut weights).expect("one weight a component");
    for k in 0..basis.component_count() {
        controls.set(k, weight(instance, k, frame)).expect("finite");
    }
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    let job = Frame {
        basis: &basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    };
    job.run(&mut workspace).expect("finite");
    [positions, normals]
}

#[test]
fn both_tiers_play_the_runtime_s_frames() {
    let package = package();
    for (tier, own) in [
        (SinewTier::Exact, TierChoice::Exact),
        (SinewTier::Fast, TierChoice::Fast),
    ] {
        let mut player = Player::of_tier(&package, tier).expect("valid");
        pose(&player, 1, 2);
        assert_eq!(player.frame(), Ok(SinewFrameOutcome::Solved));
        let [positions, normals] = expected(&package, own, 1, 2);
        assert_eq!(player.positions, positions.as_flattened());
        assert_eq!(player.normals, normals.as_flattened());
    }
    let basis = Basis::open(&package).expect("valid");
    let info = Player::new(&package).expect("valid").info;
    assert_eq!(
        info.fast_node_count as usize,
        basis.fast_node_count().expect("a fast tier")
    );
    assert_eq!(info.fast_error_max, basis.fast_error().expect("a fast tier").mixed_max);
    let info = Player::new(&other_package()).expect("valid").info;
    assert_eq!((info.fast_node_count, info.has_texture), (0, 0));
    assert_eq!(info.render_vertex_count, info.vertex_count);
}

#[test]
fn programs_of_the_first_header_are_served() {
    let package = package();
    let player = Player::new(&package).expect("valid");
    // What the struct had then.
    let mut info = sized::<SinewBasisInfo>();
    // SAFETY: the struct is longer than it says.
    unsafe {
        let out = info.as_mut_ptr();
        (*out).struct_bytes = core::mem::offset_of!(SinewBasisInfo, fast_node_count);
        assert_eq!(sinew_basis_info(player.basis, out), SinewStatus::Ok);
        assert_eq!(
            ((*out).vertex_count, (*out).fast_node_count),
            (9, 0),
            "nothing behind its end"
        );
        let mut report = sized::<SinewFrameReport>();
        let out = report.as_mut_ptr();
        (*out).struct_bytes = 16;
        let mut player = player;
        let options = player.options();
        let status = sinew_frame(
            player.basis,
            player.workspace,
            player.controls,
            &options,
            out,
            core::ptr::null_mut(),
        );
        assert_eq!((status, (*out).maximum), (SinewStatus::Ok, [0.0; 3]));
    }
}

#[test]
fn a_vertex_buffer_is_the_runtime_s() {
    let package = package();
    let mut player = Player::new(&package).expect("valid");
    pose(&player, 0, 3);
    player.frame().expect("finite");
    let mut vertices = Vertices::new(&player);
    let bounds = vertices.write(&player).expect("sound");

    let basis = Basis::open(&package).expect("valid");
    assert!(basis.render_vertex_count() > basis.vertex_count(), "it has a seam");
    let [positions, normals] = expected(&package, TierChoice::Exact, 0, 3);
    let at = |offset_bytes| {
        Some(Attribute {
            offset_bytes,
            stride_bytes: Vertices::STRIDE,
        })
    };
    let mut bytes = vec![0; vertices.bytes.len()];
    let found = VertexOutput {
        basis: &basis,
        positions: &positions,
        normals: Some(&normals),
        scratch: &mut vec![[0.0; 4]; basis.render_vertex_count()],
        layout: VertexLayout {
            positions: at(0),
            normals: at(12),
            tangents: at(24),
            texture_coordinates: at(40),
            ..VertexLayout::default()
        },
        bytes: &mut bytes,
    };
    let found = found.run().expect("sound");
    assert_eq!(vertices.bytes, bytes);
    assert_eq!((bounds.minimum, bounds.maximum), (found.minimum, found.maximum));

    let (mut indices, mut count) = (core::ptr::null(), 0);
    // SAFETY: the player's memory stands, and the package.
    let faces = unsafe {
        let status = sinew_basis_render_faces(player.basis, &mut indices, &mut count);
        assert_eq!(status, SinewStatus::Ok);
        core::slice::from_raw_parts(indices, count)
    };
    assert_eq!(faces, basis.render_mesh().faces.as_flattened());
}

#[test]
fn the_report_has_the_box() {
    let package = package();
    let mut player = Player::new(&package).expect("valid");
    pose(&player, 0, 1);
    let (options, mut report) = (player.options(), sized::<SinewFrameReport>());
    // SAFETY: the player's memory stands; the report is whole after a frame.
    let report = unsafe {
        let (details, out) = (core::ptr::null_mut(), report.as_mut_ptr());
        let status = sinew_frame(player.basis, player.workspace, player.controls, &options, out, details);
        assert_eq!(status, SinewStatus::Ok);
        report.assume_init()
    };
    let (points, _) = player.positions.as_chunks::<3>();
    for c in 0..3 {
        let numbers = || points.iter().map(|p| p[c]);
        assert_eq!(report.minimum[c], numbers().fold(f32::INFINITY, f32::min));
        assert_eq!(report.maximum[c], numbers().fold(f32::NEG_INFINITY, f32::max));
    }
}

#[test]
fn a_held_vertex_follows_and_a_pinned_control_stays() {
    let package = package();
    let mut player = Player::new(&package).expect("valid");
    let wanted = {
        pose(&player, 2, 5);
        player.frame().expect("finite");
        let wanted: [f32; 3] = player.positions[3..6].try_into().expect("three");
        // SAFETY: the player's memory stands.
        assert_eq!(unsafe { sinew_controls_reset(player.controls) }, SinewStatus::Ok);
        player.frame().expect("finite");
        wanted
    };
    let distance = |player: &Player| {
        let found = &player.positions[3..6];
        found
            .iter()
            .zip(wanted)
            .map(|(a, b)| (a - b) * (a - b))
            .sum::<f32>()
            .sqrt()
    };
    let before = distance(&player);
    let held = Held::new(&player, 2);
    assert_eq!(held.add(&player, 1), SinewStatus::Ok);
    assert_eq!(held.aim(1, wanted), SinewStatus::Ok);
    // SAFETY: this memory stands.
    assert_eq!(unsafe { sinew_handles_pin(held.handles, 1, 1) }, SinewStatus::Ok);
    let mut misfit = f32::INFINITY;
    for _ in 0..8 {
        misfit = held.drag(&player).expect("in reach").misfit;
    }
    player.frame().expect("finite");
    assert!(distance(&player) < 0.5 * before, "{} of {before}", distance(&player));
    assert!((distance(&player) - misfit).abs() < 1e-4);
    let mut weight = f32::NAN;
    // SAFETY: the player's memory stands.
    unsafe {
        assert_eq!(sinew_control_get(player.controls, 1, &mut weight), SinewStatus::Ok);
        assert_eq!(weight, 0.0);
        assert_eq!(sinew_handles_remove(held.handles, 1), SinewStatus::Ok);
    }
    assert_eq!(
        held.drag(&player).map(|report| report.step_count),
        Ok(0),
        "nothing is held"
    );
}

/// What may go to another thread.
#[derive(Clone, Copy)]
struct Sent<T>(T);

// SAFETY: the library says what threads may share; that is what is tested here.
unsafe impl<T> Send for Sent<T> {}
// SAFETY: as above.
unsafe impl<T> Sync for Sent<T> {}

#[test]
fn a_batch_plays_each_instance_once_with_the_same_bits() {
    const COUNT: usize = 24;
    let package = package();
    let tier = |n: usize| {
        if n.is_multiple_of(3) {
            (SinewTier::Fast, TierChoice::Fast)
        } else {
            (SinewTier::Exact, TierChoice::Exact)
        }
    };
    for threads in [1, 2, 4] {
        let mut players: Vec<Player> = (0..COUNT)
            .map(|n| Player::of_tier(&package, tier(n).0).expect("valid"))
            .collect();
        let instances: Vec<SinewInstance> = players.iter_mut().map(Player::instance).collect();
        let basis = Sent(players[0].basis);
        let round = Sent(Round::new(basis.0, &instances));
        for frame in 0..3 {
            for (n, player) in players.iter().enumerate() {
                pose(player, n, frame);
            }
            let played: usize = std::thread::scope(|scope| {
                let work = || {
                    let (round, basis) = (&round, &basis);
                    round.0.play(basis.0)
                };
                let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
                threads.into_iter().map(|thread| thread.join().expect("played")).sum()
            });
            assert_eq!(played, COUNT);
            assert_eq!(round.0.play(basis.0), 0, "the round is over");
            for (n, player) in players.iter().enumerate() {
                let report = round.0.report(n);
                assert_eq!(
                    (report.status, report.outcome),
                    (SinewStatus::Ok, SinewFrameOutcome::Solved as i32)
                );
                let [positions, normals] = expected(&package, tier(n).1, n, frame);
                assert_eq!(player.positions, positions.as_flattened(), "{n}");
                assert_eq!(player.normals, normals.as_flattened(), "{n}");
            }
            round.0.begin();
        }
    }
}
