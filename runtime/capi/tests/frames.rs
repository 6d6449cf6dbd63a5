//! What engines want beyond a frame, through the C functions: players, bones, pins, vertex buffers, batches, another
//! package. Each beside the runtime's own.

mod common;

use core::ptr::null_mut;

use common::player::{Block, Pins, Player, Round, Vertices, sized};
use common::{other_package, package, renamed_package};
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
                null_mut(),
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
        (SinewTier::Bones, TierChoice::Bones),
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
    assert_eq!(info.bone_count as usize, basis.bones().expect("bones").count());
    assert_eq!(info.bone_error_max, basis.bones().expect("bones").error().sliders.max);
    let info = Player::new(&other_package()).expect("valid").info;
    assert_eq!((info.bone_count, info.has_texture), (0, 0));
    assert_eq!(info.render_vertex_count, info.vertex_count);
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

    let drawn = faces(&player, sinew_basis_render_faces, SinewWinding::CounterClockwise);
    assert_eq!(drawn, basis.surface().drawn_faces().iter().collect::<Vec<_>>());
}

type Faces = unsafe extern "C" fn(*const SinewBasis, i32, *mut u32, usize) -> SinewStatus;

fn faces(player: &Player, ask: Faces, winding: SinewWinding) -> Vec<[u32; 3]> {
    let mut indices = vec![[u32::MAX; 3]; player.info.face_count as usize];
    let flat = indices.as_flattened_mut();
    // SAFETY: the player's memory stands.
    let status = unsafe { ask(player.basis, winding as i32, flat.as_mut_ptr(), flat.len()) };
    assert_eq!(status, SinewStatus::Ok);
    indices
}

#[test]
fn faces_are_the_basis_s_either_way_round() {
    let package = package();
    let basis = Basis::open(&package).expect("valid");
    let player = Player::new(&package).expect("valid");
    let own = faces(&player, sinew_basis_faces, SinewWinding::CounterClockwise);
    assert_eq!(own, basis.faces().iter().collect::<Vec<_>>());
    let turned = faces(&player, sinew_basis_faces, SinewWinding::Clockwise);
    assert_eq!(turned, own.iter().map(|[a, b, c]| [*a, *c, *b]).collect::<Vec<_>>());
}

#[test]
fn a_player_is_three_handles_in_one_block_that_play_the_same() {
    let package = package();
    for tier in [SinewTier::Exact, SinewTier::Bones] {
        let mut separate = Player::of_tier(&package, tier).expect("valid");
        pose(&separate, 1, 2);
        separate.frame().expect("finite");
        let block = Block::new(&package, tier, 192).expect("valid");
        let player = block.player;
        assert_eq!(
            (player.vertex_count, player.control_count),
            (separate.info.vertex_count, separate.control_count)
        );
        let mut positions = vec![f32::NAN; 3 * player.vertex_count as usize];
        let mut options = separate.options();
        (options.positions, options.normals) = (positions.as_mut_ptr(), null_mut());
        for control in 0..player.control_count {
            let weight = weight(1, control as usize, 2);
            // SAFETY: the block stands.
            let status = unsafe { sinew_control_set(player.controls, control, weight, null_mut()) };
            assert_eq!(status, SinewStatus::Ok);
        }
        let SinewPlayer {
            basis,
            workspace,
            controls,
            ..
        } = player;
        // SAFETY: the block and the buffers stand.
        let status = unsafe { sinew_frame(basis, workspace, controls, &options, null_mut(), null_mut()) };
        assert_eq!((status, &positions), (SinewStatus::Ok, &separate.positions));
        assert!(
            block.tail().iter().all(|&byte| byte == 0xaa),
            "beyond the layout nothing is written"
        );
        // SAFETY: the block stands.
        unsafe {
            assert_eq!(sinew_close(workspace.cast()), SinewStatus::Ok);
            assert_eq!(
                sinew_frame(basis, workspace, controls, &options, null_mut(), null_mut()),
                SinewStatus::ClosedHandle
            );
            assert_eq!(sinew_controls_reset(controls), SinewStatus::Ok, "the others stand");
        }
    }
    assert!(matches!(
        Block::new(&other_package(), SinewTier::Bones, 0),
        Err(SinewStatus::NoBones)
    ));
}

#[test]
fn weights_are_carried_by_name_into_another_package() {
    let (package, other) = (package(), other_package());
    let (from, to) = (
        Player::new(&package).expect("valid"),
        Player::new(&other).expect("valid"),
    );
    let mut carried = u32::MAX;
    let mut weights = vec![f32::NAN; to.control_count as usize];
    // SAFETY: the players' memory stands.
    unsafe {
        // Beyond its stop: the new control clamps.
        assert_eq!(sinew_control_set_unclamped(from.controls, 0, 1e6), SinewStatus::Ok);
        assert_eq!(sinew_control_set(from.controls, 1, -0.25, null_mut()), SinewStatus::Ok);
        let status = sinew_controls_carry(from.basis, from.controls, to.basis, to.controls, &mut carried);
        assert_eq!((status, carried), (SinewStatus::Ok, to.control_count));
        let status = sinew_controls_get_all(to.controls, weights.as_mut_ptr(), weights.len());
        assert_eq!(status, SinewStatus::Ok);
    }
    let basis = Basis::open(&other).expect("valid");
    assert_eq!(weights[..2], [basis.component(0).maximum, -0.25]);
    assert!(weights[2..].iter().all(|&weight| weight == 0.0), "{weights:?}");
}

#[test]
fn a_control_without_a_namesake_stays_and_the_order_does_not_matter() {
    let package = package();
    let turned = renamed_package();
    let (from, to) = (
        Player::new(&package).expect("valid"),
        Player::new(&turned).expect("valid"),
    );
    let own = Basis::open(&turned).expect("valid");
    let old = Basis::open(&package).expect("valid");
    let mut carried = u32::MAX;
    // SAFETY: the players' memory stands.
    unsafe {
        for k in 0..from.control_count {
            assert_eq!(
                sinew_control_set(from.controls, k, 0.1 + 0.1 * k as f32, null_mut()),
                SinewStatus::Ok
            );
            assert_eq!(sinew_control_set(to.controls, k, -0.5, null_mut()), SinewStatus::Ok);
        }
        let status = sinew_controls_carry(from.basis, from.controls, to.basis, to.controls, &mut carried);
        assert_eq!(status, SinewStatus::Ok);
        let mut found = 0;
        for k in 0..to.control_count {
            let component = own.component(k as usize);
            let (mut weight, mut expected) = (f32::NAN, -0.5);
            if let Some(namesake) = old.component_named(component.name) {
                assert_ne!(namesake, k as usize, "the order is another");
                assert_eq!(
                    sinew_control_get(from.controls, namesake as u32, &mut expected),
                    SinewStatus::Ok
                );
                found += 1;
            }
            assert_eq!(sinew_control_get(to.controls, k, &mut weight), SinewStatus::Ok);
            assert_eq!(weight, expected.clamp(component.minimum, component.maximum), "{k}");
        }
        assert_eq!(carried, found);
        assert!(found > 0 && found < to.control_count);
    }
}

#[test]
fn the_report_has_the_box() {
    let package = package();
    let mut player = Player::new(&package).expect("valid");
    pose(&player, 0, 1);
    let (options, mut report) = (player.options(), sized::<SinewFrameReport>());
    // SAFETY: the player's memory stands; the report is whole after a frame.
    let report = unsafe {
        let (details, out) = (null_mut(), report.as_mut_ptr());
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
fn a_pinned_vertex_follows_and_a_locked_control_stays() {
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
    let pins = Pins::new(&player, 2);
    assert_eq!(pins.add(&player, 1), SinewStatus::Ok);
    assert_eq!(pins.aim(1, wanted), SinewStatus::Ok);
    // SAFETY: this memory stands.
    assert_eq!(unsafe { sinew_pins_lock(pins.pins, 1, 1) }, SinewStatus::Ok);
    let mut misfit = f32::INFINITY;
    for _ in 0..8 {
        misfit = pins.drag(&player).expect("in reach").misfit;
    }
    player.frame().expect("finite");
    assert!(distance(&player) < 0.5 * before, "{} of {before}", distance(&player));
    assert!((distance(&player) - misfit).abs() < 1e-4);
    let mut weight = f32::NAN;
    // SAFETY: the player's memory stands.
    unsafe {
        assert_eq!(sinew_control_get(player.controls, 1, &mut weight), SinewStatus::Ok);
        assert_eq!(weight, 0.0);
        assert_eq!(sinew_pins_remove(pins.pins, 1), SinewStatus::Ok);
    }
    assert_eq!(
        pins.drag(&player).map(|report| report.step_count),
        Ok(0),
        "nothing is pinned"
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
            (SinewTier::Bones, TierChoice::Bones)
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
