//! Packages changed at random under a header that fits, so that they get past the checksums: what `open` lets through
//! plays to the end, with extreme controls too, and no call ends with `INTERNAL`, which is what a panic becomes.
//! Seeds are case numbers, so a failure names its case. `tests/fuzz` does the same with coverage as guide.

mod common;

use core::time::Duration;
use std::time::Instant;

use common::player::{Pins, Player, Round, Vertices};
use common::{other_package, package};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;
use sinew::*;
use sinew_formats::package::{AlignedBytes, HEADER_BYTES, Header, PackageKind};

const CASE_COUNT: u64 = 100_000;
/// A slow machine does fewer cases, and says so.
const TIME_MAX: Duration = Duration::from_secs(20);

/// Numbers at the edges of what a field may hold.
const HOSTILE: [u32; 12] = [
    0,
    1,
    8,
    9,
    0x7fff_ffff,
    0x8000_0000,
    u32::MAX,
    f32::NAN.to_bits(),
    f32::INFINITY.to_bits(),
    f32::MAX.to_bits(),
    f32::MIN_POSITIVE.to_bits(),
    0x7bff_7bff, // the largest halves
];

const WEIGHTS: [f32; 9] = [
    0.0,
    1e-7,
    -0.5,
    1.0,
    f32::MIN_POSITIVE,
    f32::MAX,
    f32::MIN,
    f32::NAN,
    f32::INFINITY,
];

/// One to four bits, bytes or words of the payload changed; header, checksum and content id made to fit.
fn mutate(rng: &mut ChaCha8Rng, package: &mut AlignedBytes) {
    let bytes = package.as_mut_slice();
    for _ in 0..rng.random_range(1..5) {
        let at = rng.random_range(HEADER_BYTES..bytes.len() - 3);
        match rng.random_range(0..4) {
            0 => bytes[at] = rng.random(),
            1 => {
                let word = at / 4 * 4;
                let value = HOSTILE.choose(rng).expect("some");
                bytes[word..word + 4].copy_from_slice(&value.to_le_bytes());
            }
            _ => bytes[at] ^= 1 << rng.random_range(0..8),
        }
    }
    let (header, payload) = bytes.split_at_mut(HEADER_BYTES);
    header.copy_from_slice(&Header::for_payload(PackageKind::Baked, payload).to_bytes());
}

/// Frames with controls at random, some of them impossible. Returns whether numbers overflowed.
fn play(rng: &mut ChaCha8Rng, player: &mut Player) -> bool {
    let mut overflowed = false;
    for _ in 0..4 {
        for _ in 0..player.control_count {
            let control = rng.random_range(0..player.control_count + 1);
            let weight = *WEIGHTS.choose(rng).expect("some");
            // SAFETY: the player's memory stands.
            let status = unsafe {
                match rng.random() {
                    true => sinew_control_set(player.controls, control, weight, core::ptr::null_mut()),
                    false => sinew_control_set_unclamped(player.controls, control, weight),
                }
            };
            let right = match status {
                SinewStatus::Ok => control < player.control_count && weight.is_finite(),
                SinewStatus::NoSuchControl => control == player.control_count,
                SinewStatus::NotFinite => !weight.is_finite(),
                _ => false,
            };
            assert!(right, "{status:?}");
        }
        match player.frame() {
            Ok(_) => {}
            Err(SinewStatus::FrameOverflow) => overflowed = true,
            Err(other) => panic!("{other:?}"),
        }
        let numbers = player.positions.iter().chain(&player.normals);
        assert!(numbers.clone().all(|x| x.is_finite()));
    }
    overflowed
}

/// Vertex buffer, pins, bones and batch of a mutant. Returns whether a drag or a frame overflowed.
fn use_all(rng: &mut ChaCha8Rng, player: &mut Player, package: &[u8]) -> bool {
    let mut vertices = Vertices::new(player);
    vertices.write(player).expect("the layout is sound");
    let (floats, _) = vertices.bytes.as_chunks::<4>();
    assert!(floats.iter().all(|bytes| f32::from_ne_bytes(*bytes).is_finite()));

    let mut overflowed = false;
    let pins = Pins::new(player, 2);
    for _ in 0..3 {
        let vertex = rng.random_range(0..player.info.vertex_count + 1);
        let target = core::array::from_fn(|_| *WEIGHTS.choose(rng).expect("some"));
        let (added, aimed) = (pins.add(player, vertex), pins.aim(vertex, target));
        assert!(![added, aimed].contains(&SinewStatus::Internal), "{added:?} {aimed:?}");
        match pins.drag(player) {
            Err(SinewStatus::NeedsExactTier) => assert_eq!(player.info.has_exact_tier, 0),
            Ok(report) => assert!(report.step_count <= 2),
            Err(SinewStatus::PinOverflow) => overflowed = true,
            Err(other) => panic!("{other:?}"),
        }
    }
    let mut weights = vec![f32::NAN; player.control_count as usize];
    // SAFETY: the player's memory stands.
    let status = unsafe { sinew_controls_get_all(player.controls, weights.as_mut_ptr(), weights.len()) };
    assert_eq!(status, SinewStatus::Ok);
    assert!(weights.iter().all(|weight| weight.is_finite()));

    let mut bones = None;
    if player.info.bone_count > 0 {
        let mut own = Player::of_tier(package, SinewTier::Bones).expect("it opened");
        overflowed |= play(rng, &mut own);
        bones = Some(own);
    }
    let mut instances = vec![player.instance()];
    instances.extend(bones.as_mut().map(Player::instance));
    let round = Round::new(player.basis, &instances);
    assert_eq!(round.play(player.basis), instances.len());
    for n in 0..instances.len() {
        let status = round.report(n).status;
        assert!(
            matches!(status, SinewStatus::Ok | SinewStatus::FrameOverflow),
            "{status:?}"
        );
    }
    overflowed
}

#[test]
fn what_opens_plays() {
    let whole = [package(), other_package()];
    let start = Instant::now();
    let (mut case_count, mut opened, mut overflowed, mut overflowed_elsewhere) = (0, 0, 0, 0);
    for case in 0..CASE_COUNT {
        if start.elapsed() > TIME_MAX {
            println!("stopped after {case} of {CASE_COUNT} cases");
            break;
        }
        case_count += 1;
        let mut rng = ChaCha8Rng::seed_from_u64(case);
        let mut mutant = whole[case as usize % 2].clone();
        mutate(&mut rng, &mut mutant);
        match Player::new(&mutant) {
            Ok(mut player) => {
                opened += 1;
                overflowed += u32::from(play(&mut rng, &mut player));
                overflowed_elsewhere += u32::from(use_all(&mut rng, &mut player, &mutant));
            }
            Err(status) => assert_eq!(status, SinewStatus::PackageRefused, "case {case}"),
        }
    }
    println!(
        "{case_count} mutants: {opened} opened, {overflowed} overflowed in a frame, {overflowed_elsewhere} in a drag or \
         the bones"
    );
    assert!(opened > case_count / 10, "{opened}");
    assert!(overflowed > 0 && overflowed_elsewhere > 0);
}
