//! Bytes that are no package, or one that was damaged on its way or made with intent: opening refuses each with the
//! right error, never panics, and what it lets through cannot harm the frame path.

use rand::{Rng, RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_formats::package::{
    AlignedBytes, BakedView, CompactView, FIRST_VERSION, FORMAT_VERSION, HEADER_BYTES, Header, MAGIC, OpenError,
    PAYLOAD_ALIGNMENT, PackageKind,
};
use sinew_runtime::{Basis, FrameError, TierChoice};
use sinew_support::{baked_package, compact_package, play_tier};

/// Either kind, opened by its own view.
fn open(kind: PackageKind, bytes: &[u8]) -> Result<(), OpenError> {
    match kind {
        PackageKind::Compact => CompactView::open(bytes).map(drop),
        PackageKind::Baked => BakedView::open(bytes).map(drop),
    }
}

fn packages() -> [(PackageKind, AlignedBytes); 2] {
    [
        (PackageKind::Compact, compact_package()),
        (PackageKind::Baked, baked_package()),
    ]
}

/// Gives a changed payload a header that fits: a fault of the writer, or intent, not of the transfer.
fn reseal(kind: PackageKind, package: &mut AlignedBytes) {
    let (header, payload) = package.as_mut_slice().split_at_mut(HEADER_BYTES);
    header.copy_from_slice(&Header::for_payload(kind, payload).to_bytes());
}

#[test]
fn the_whole_packages_open() {
    for (kind, package) in packages() {
        assert_eq!(open(kind, &package), Ok(()));
        println!("{kind}: {} bytes", package.len());
    }
}

#[test]
fn every_prefix_is_refused() {
    for (kind, package) in packages() {
        for end in 0..package.len() {
            let expected = if end < HEADER_BYTES {
                OpenError::TooShort { actual: end }
            } else {
                OpenError::Truncated {
                    expected: package.len() as u64,
                    actual: end as u64,
                }
            };
            assert_eq!(open(kind, &package[..end]), Err(expected));
        }
    }
}

#[test]
fn every_flipped_bit_is_refused() {
    for (kind, mut package) in packages() {
        for bit in 0..8 * package.len() {
            let (byte, mask) = (bit / 8, 1 << (bit % 8));
            package.as_mut_slice()[byte] ^= mask;
            let refused = open(kind, &package);
            let right = match byte {
                _ if byte < MAGIC.len() => refused == Err(OpenError::WrongMagic),
                _ if byte < HEADER_BYTES => refused == Err(OpenError::HeaderCorrupt),
                _ => matches!(refused, Err(OpenError::ContentIdMismatch)),
            };
            assert!(right, "{kind}, bit {bit}: {refused:?}");
            package.as_mut_slice()[byte] ^= mask;
        }
    }
}

#[test]
fn more_bytes_than_the_header_says_are_refused() {
    for (kind, package) in packages() {
        let expected = package.len() as u64;
        for extra in [1, 16, 1000] {
            let mut longer = AlignedBytes::zeroed(package.len() + extra);
            longer.as_mut_slice()[..package.len()].copy_from_slice(&package);
            let actual = expected + extra as u64;
            assert_eq!(open(kind, &longer), Err(OpenError::TrailingBytes { expected, actual }));
        }
    }
}

#[test]
fn a_length_beyond_all_memory_is_refused() {
    for (kind, mut package) in packages() {
        let mut header = Header::read(&package).unwrap();
        header.payload_bytes = u64::MAX;
        package.as_mut_slice()[..HEADER_BYTES].copy_from_slice(&header.to_bytes());
        let actual = package.len() as u64;
        assert_eq!(
            open(kind, &package),
            Err(OpenError::Truncated {
                expected: u64::MAX,
                actual
            })
        );
    }
}

#[test]
fn every_misaligned_start_is_refused() {
    for (kind, package) in packages() {
        for shift in 1..PAYLOAD_ALIGNMENT {
            let mut shifted = AlignedBytes::zeroed(package.len() + shift);
            shifted.as_mut_slice()[shift..].copy_from_slice(&package);
            assert_eq!(
                open(kind, &shifted[shift..]),
                Err(OpenError::Misaligned {
                    required: PAYLOAD_ALIGNMENT
                })
            );
        }
    }
}

#[test]
fn other_versions_are_refused_by_name() {
    for (kind, mut package) in packages() {
        for version in [0, FIRST_VERSION - 1, FORMAT_VERSION + 1, u16::MAX] {
            let mut header = Header::read(&compact_package()).unwrap();
            (header.format_version, header.oldest_reader) = (version, version);
            package.as_mut_slice()[..HEADER_BYTES].copy_from_slice(&header.to_bytes());
            let refused = open(kind, &package);
            assert!(matches!(refused, Err(OpenError::UnsupportedVersion { found, .. }) if found == version));
        }
    }
}

/// What became of changed payloads.
#[derive(Debug, Default)]
struct Fates {
    malformed: usize,
    against_a_rule: usize,
    opened: usize,
    overflowed: usize,
}

/// Opens a package with a changed payload and, if that succeeds, uses all of it.
fn try_changed(kind: PackageKind, package: &mut AlignedBytes, fates: &mut Fates) {
    reseal(kind, package);
    match open(kind, package) {
        Err(OpenError::Malformed) => fates.malformed += 1,
        Err(_) => fates.against_a_rule += 1,
        Ok(()) => {
            fates.opened += 1;
            match kind {
                PackageKind::Compact => use_compact(&CompactView::open(package).unwrap()),
                PackageKind::Baked => fates.overflowed += usize::from(use_baked(package).is_err()),
            }
        }
    }
}

/// Follows every index as the baker does.
fn use_compact(view: &CompactView<'_>) {
    let rest = view.rest_positions();
    let faces = view.faces().to_vec();
    let corners = faces.as_flattened().iter().chain(view.bridges().as_flattened());
    assert!(
        corners
            .chain([&view.anchor_vertex()])
            .all(|&v| rest[v as usize].iter().all(|x| x.is_finite()))
    );
    let mut entry_count = 0;
    for entry in view.entries() {
        assert!(entry.vertex < view.vertex_count());
        assert_eq!(
            view.block(view.component(entry.component).block as usize)
                .encoder
                .bias
                .len(),
            entry.values.len()
        );
        entry_count += 1;
    }
    assert_eq!(entry_count, view.values().len());
}

/// Plays a frame at the stops of the controls on every tier; its numbers are finite, or it says that they are not.
fn use_baked(package: &AlignedBytes) -> Result<(), FrameError> {
    let basis = Basis::open(package).unwrap();
    let stops = |k: usize| if k.is_multiple_of(2) { f32::MAX } else { f32::MIN };
    let tiers = [TierChoice::Exact, TierChoice::Bones];
    let played = tiers.into_iter().filter(|&tier| basis.has_tier(tier)).map(|tier| {
        let neutral = play_tier(&basis, tier, |_| 0.0).expect("rest needs no numbers but its own");
        assert!(finite(&neutral));
        play_tier(&basis, tier, stops).map(|frame| assert!(finite(&frame)))
    });
    played.fold(Ok(()), Result::and)
}

fn finite(frame: &[Vec<[f32; 3]>; 2]) -> bool {
    frame.iter().flatten().flatten().all(|x| x.is_finite())
}

#[test]
fn every_flipped_bit_under_a_fitting_header_is_refused_or_harmless() {
    for (kind, mut package) in packages() {
        let mut fates = Fates::default();
        for bit in 8 * HEADER_BYTES..8 * package.len() {
            let (byte, mask) = (bit / 8, 1 << (bit % 8));
            package.as_mut_slice()[byte] ^= mask;
            try_changed(kind, &mut package, &mut fates);
            package.as_mut_slice()[byte] ^= mask;
        }
        println!("{kind}: {fates:?}");
        assert!(fates.malformed > 0 && fates.against_a_rule > 0 && fates.opened > 0);
    }
}

#[test]
fn every_word_set_to_a_hostile_value_is_refused_or_harmless() {
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
    for (kind, mut package) in packages() {
        let mut fates = Fates::default();
        for word in (HEADER_BYTES..package.len() - 3).step_by(4) {
            let before: [u8; 4] = *package[word..].first_chunk().unwrap();
            for value in HOSTILE {
                package.as_mut_slice()[word..word + 4].copy_from_slice(&value.to_le_bytes());
                try_changed(kind, &mut package, &mut fates);
            }
            package.as_mut_slice()[word..word + 4].copy_from_slice(&before);
        }
        println!("{kind}: {fates:?}");
        assert!(fates.malformed > 0 && fates.against_a_rule > 0 && fates.opened > 0);
    }
}

#[test]
fn every_shorter_payload_under_a_fitting_header_is_refused() {
    for (kind, package) in packages() {
        for end in HEADER_BYTES..package.len() {
            let mut shorter = AlignedBytes::from_slice(&package[..end]);
            reseal(kind, &mut shorter);
            assert!(open(kind, &shorter).is_err(), "{kind}, {end} bytes");
        }
    }
}

/// Cases of each random test; seeds are the case numbers, so a failure names its case.
const CASE_COUNT: u64 = 256;

#[test]
fn noise_is_refused() {
    for case in 0..CASE_COUNT {
        let mut rng = ChaCha8Rng::seed_from_u64(case);
        let mut noise = vec![0; rng.random_range(0..300)];
        rng.fill_bytes(&mut noise);
        if case % 2 == 0 && noise.len() >= MAGIC.len() {
            noise[..MAGIC.len()].copy_from_slice(&MAGIC);
        }
        let mut aligned = AlignedBytes::from_slice(&noise);
        for kind in [PackageKind::Compact, PackageKind::Baked] {
            assert!(open(kind, &aligned).is_err(), "case {case}");
            if aligned.len() >= HEADER_BYTES {
                reseal(kind, &mut aligned);
                assert!(open(kind, &aligned).is_err(), "case {case}");
            }
        }
    }
}

#[test]
fn several_changes_at_once_are_refused_or_harmless() {
    for case in 0..CASE_COUNT {
        let mut rng = ChaCha8Rng::seed_from_u64(case);
        for (kind, mut package) in packages() {
            for _ in 0..rng.random_range(2..6) {
                let byte = rng.random_range(HEADER_BYTES..package.len());
                package.as_mut_slice()[byte] = rng.random();
            }
            try_changed(kind, &mut package, &mut Fates::default());
        }
    }
}
