//! Opening, creating, setting and playing through the C functions allocate nothing, refusals included: counted by the
//! allocator.

mod common;

use core::ptr::{null, null_mut};

use common::player::{Memory, Pins, Player, Round, Vertices, layout_bytes, sized};
use common::{other_package, package};
use sinew::*;
use sinew_support::requests;

#[test]
fn a_thousand_frames_allocate_nothing() {
    let bytes = package();
    let mut player = Player::new(&bytes).expect("valid");
    let mut solved = 0;
    let count = requests(|| {
        for frame in 0..1000_u32 {
            let (k, weight) = (frame % player.control_count, (frame as f32 * 0.1).sin());
            // Every third frame changes nothing.
            if frame % 3 != 0 {
                // SAFETY: the player's memory stands.
                let status = unsafe { sinew_control_set(player.controls, k, weight, null_mut()) };
                assert_eq!(status, SinewStatus::Ok);
            }
            solved += u32::from(player.frame() == Ok(SinewFrameOutcome::Solved));
        }
    });
    assert_eq!(count, 0);
    assert!(solved > 500, "{solved} frames had something to do");
}

#[test]
fn opening_creating_asking_and_closing_allocate_nothing() {
    let (bytes, mut damaged) = (package(), package());
    damaged.as_mut_slice()[100] ^= 1;
    let mut player = Player::new(&bytes).expect("valid");
    let other = Player::new(&bytes).expect("valid");
    let [basis_memory, workspace_memory, controls_memory] = player.memory();
    let memory = [basis_memory, workspace_memory, controls_memory].map(|memory| (memory.pointer(), memory.bytes()));
    let (mut basis, mut workspace, mut controls) = (null_mut(), null_mut(), null_mut());
    let mut details = sized::<SinewDetails>();
    let mut name = [0; SINEW_NAME_BYTES];
    let (mut control, mut minimum, mut weights) = (7, 0.0, [0.0; 4]);
    let mut block = Memory::new(1 << 16);
    let mut layout = SinewLayout {
        size_bytes: 0,
        alignment: 0,
    };
    let mut made = sized::<SinewPlayer>();
    let count = requests(|| {
        // SAFETY: the player's memory stands, and nobody uses its handles meanwhile.
        unsafe {
            let details = details.as_mut_ptr();
            let [(at, room), ..] = memory;
            let open = |bytes: &[u8], basis: &mut *mut SinewBasis| {
                sinew_basis_open(
                    SINEW_ABI_VERSION,
                    bytes.as_ptr().cast(),
                    bytes.len(),
                    at,
                    room,
                    basis,
                    details,
                )
            };
            assert_eq!(open(&damaged, &mut basis), SinewStatus::PackageRefused);
            assert_eq!(open(&bytes, &mut basis), SinewStatus::Ok);
            let (at, room) = memory[1];
            assert_eq!(
                sinew_workspace_create(basis, null(), at, room, &mut workspace, details),
                SinewStatus::Ok
            );
            let (at, room) = memory[2];
            assert_eq!(
                sinew_controls_create(basis, at, room, &mut controls, details),
                SinewStatus::Ok
            );
            assert_eq!(
                sinew_control_name(basis, 0, name.as_mut_ptr(), name.len()),
                SinewStatus::Ok
            );
            assert_eq!(sinew_control_find(basis, name.as_ptr(), &mut control), SinewStatus::Ok);
            assert_eq!(
                sinew_control_range(basis, control, &mut minimum, null_mut()),
                SinewStatus::Ok
            );
            assert_eq!(
                sinew_control_set(controls, control, f32::NAN, null_mut()),
                SinewStatus::NotFinite
            );
            assert_eq!(
                sinew_controls_get_all(controls, weights.as_mut_ptr(), 4),
                SinewStatus::Ok
            );
            assert_eq!(
                sinew_controls_set_all(controls, weights.as_ptr(), 4, details),
                SinewStatus::Ok
            );
            let played = sinew_frame(basis, workspace, controls, null(), null_mut(), details);
            assert_eq!(played, SinewStatus::NullPointer);
            let (from_basis, from) = (other.basis, other.controls);
            let status = sinew_controls_carry(from_basis, from, basis, controls, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            for handle in [controls.cast(), workspace.cast(), basis.cast()] {
                assert_eq!(sinew_close(handle), SinewStatus::Ok);
            }
            let (at, room) = (block.pointer(), block.bytes());
            let (bytes, length) = (bytes.as_ptr().cast(), bytes.len());
            let status = sinew_player_layout(bytes, length, null(), &mut layout, details);
            assert_eq!((status, layout.size_bytes <= room), (SinewStatus::Ok, true));
            let out = made.as_mut_ptr();
            let status = sinew_player_open(SINEW_ABI_VERSION, bytes, length, null(), at, room, out, details);
            assert_eq!(status, SinewStatus::Ok);
        }
    });
    assert_eq!(count, 0);
    assert_eq!(control, 0);
}

#[test]
fn frames_that_overflow_allocate_nothing() {
    let bytes = other_package();
    let mut player = Player::new(&bytes).expect("valid");
    let count = requests(|| {
        for k in 0..player.control_count {
            // SAFETY: the player's memory stands.
            let status = unsafe { sinew_control_set_unclamped(player.controls, k, f32::MAX) };
            assert_eq!(status, SinewStatus::Ok);
        }
        assert_eq!(player.frame(), Err(SinewStatus::FrameOverflow));
    });
    assert_eq!(count, 0);
}

#[test]
fn knobs_drags_buffers_and_batches_allocate_nothing() {
    let bytes = package();
    let mut player = Player::new(&bytes).expect("valid");
    let mut bones = Player::of_tier(&bytes, SinewTier::Bones).expect("it has one");
    let (pins, mut vertices) = (Pins::new(&player, 2), Vertices::new(&player));
    let round = Round::new(player.basis, &[player.instance(), bones.instance()]);
    let mut settings = sized::<SinewSurfaceSettings>();
    // SAFETY: zero is as usual everywhere else.
    let settings = unsafe {
        (*settings.as_mut_ptr()).knob_count = 4;
        settings.assume_init()
    };
    let (mut decoder, mut surface) = (null_mut(), null_mut());
    // SAFETY: the memory stands.
    unsafe {
        let mut memory = Memory::new(layout_bytes(|layout| sinew_decoder_layout(layout)));
        let mut more = Memory::new(layout_bytes(|layout| {
            sinew_surface_layout(player.basis, &settings, layout, null_mut())
        }));
        let (mut reading, mut counters) = (sized::<SinewReading>(), sized::<SinewCounters>());
        let line = b"0|512|1023|7\r\n7|100|3|1\r\noops\r\n";
        let mut moved = 0;
        let count = requests(|| {
            let (at, room) = (memory.pointer(), memory.bytes());
            let status = sinew_decoder_open(SINEW_ABI_VERSION, null(), at, room, &mut decoder, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            let (at, room) = (more.pointer(), more.bytes());
            let status = sinew_surface_create(player.basis, &settings, at, room, &mut surface, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            assert_eq!(pins.add(&player, 1), SinewStatus::Ok);
            for frame in 0..200 {
                let (now_us, mut taken) = (frame * 16_667, 0);
                let status = sinew_decoder_feed(decoder, now_us, line.as_ptr().cast(), line.len(), &mut taken);
                assert_eq!((status, taken), (SinewStatus::Ok, line.len()));
                loop {
                    let reading = reading.as_mut_ptr();
                    assert_eq!(sinew_decoder_next(decoder, reading), SinewStatus::Ok);
                    if (*reading).kind == SinewReadingKind::None as i32 {
                        break;
                    }
                    assert_eq!(sinew_surface_read(surface, reading), SinewStatus::Ok);
                }
                let status = sinew_surface_advance(surface, player.controls, now_us, null_mut());
                assert_eq!(status, SinewStatus::Ok);
                let status = sinew_decoder_counters(decoder, now_us, counters.as_mut_ptr());
                assert_eq!(status, SinewStatus::Ok);
                assert_eq!(pins.aim(1, [0.1, frame as f32 * 0.01, 0.3]), SinewStatus::Ok);
                moved += pins.drag(&player).expect("finite").step_count;
                round.begin();
                assert_eq!(round.play(player.basis), 2);
                vertices.write(&player).expect("sound");
            }
        });
        assert_eq!(count, 0);
        assert!(moved > 0);
        assert_eq!((*counters.as_ptr()).bytes, 200 * line.len() as u64);
    }
}

#[test]
fn memory_beyond_a_layout_stays_untouched() {
    let bytes = package();
    let mut player = Player::new(&bytes).expect("valid");
    let size_bytes = player.memory()[1].bytes();
    let mut memory = Memory::new(size_bytes + 640);
    let (at, room) = (memory.pointer(), memory.bytes());
    let mut workspace = null_mut();
    // SAFETY: the memory stands.
    let tail = unsafe {
        let status = sinew_workspace_create(player.basis, null(), at, room, &mut workspace, null_mut());
        assert_eq!(status, SinewStatus::Ok);
        player.workspace = workspace;
        assert!(player.frame().is_ok());
        core::slice::from_raw_parts(at.cast::<u8>().add(size_bytes), 640)
    };
    assert!(tail.iter().all(|&byte| byte == 0xaa));
}
