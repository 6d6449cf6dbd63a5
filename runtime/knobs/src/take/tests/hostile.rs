//! Takes cut anywhere and damaged anywhere: what is whole is read, what is lost is said, nothing panics.

use super::*;

/// Walks through everything that an opened take gives.
fn walk(take: &Take<'_>) -> usize {
    let package = Package::small(1);
    let basis = open(&package);
    let lists = take.knobs().count() + take.bindings(&basis).count() + take.buttons(&basis).count();
    let records = take.records().count();
    assert_eq!(records, take.record_count());
    lists + take.component_names().count() + records
}

#[test]
fn cut_anywhere_it_gives_the_whole_chunks_and_says_what_is_lost() {
    let rig = Rig::new();
    let (bytes, _, records) = show(&rig, 3, 60, 128, true);
    let header_bytes = 16 + u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let mut most = 0;
    for cut in 0..bytes.len() {
        match Take::open(&bytes[..cut]) {
            Ok(take) => {
                assert!(cut >= header_bytes);
                let read: Vec<Stamped> = take.records().collect();
                assert!(records.starts_with(&read));
                assert!(read.len() >= most, "more bytes, no fewer records");
                most = read.len();
                assert!(take.lost_bytes() < 128, "at most a chunk");
                assert!(!take.is_closed());
            }
            Err(TakeError::HeaderCut {
                actual_bytes,
                required_bytes,
            }) => {
                assert_eq!(actual_bytes, cut);
                assert!(cut < header_bytes && required_bytes <= header_bytes && required_bytes > cut);
            }
            Err(other) => panic!("{cut}: {other:?}"),
        }
    }
    assert!(most + 20 > records.len());
}

#[test]
fn a_take_that_was_not_closed_says_so() {
    let (bytes, ..) = show(&Rig::new(), 3, 60, 128, false);
    let take = Take::open(&bytes).unwrap();
    assert!(!take.is_closed() && take.lost_bytes() == 0 && take.record_count() > 50);
}

#[test]
fn a_flipped_bit_is_found_and_what_is_before_it_is_read() {
    let rig = Rig::new();
    let (bytes, _, records) = show(&rig, 4, 40, 200, true);
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        match Take::open(&damaged) {
            Ok(take) => {
                let read: Vec<Stamped> = take.records().collect();
                assert!(records.starts_with(&read) && take.lost_bytes() > 0 && !take.is_closed());
            }
            Err(error) => assert!(
                matches!(
                    error,
                    TakeError::NotATake | TakeError::HeaderCorrupt | TakeError::HeaderCut { .. }
                ),
                "{error:?}"
            ),
        }
    }
}

/// Puts the right checksum under every chunk that can be found, so that damage reaches what lies behind it.
fn sign(bytes: &mut [u8]) {
    let mut at = 0;
    while let Some(head) = bytes.get(at..at + 16) {
        let payload_bytes = u32::from_le_bytes(head[4..8].try_into().unwrap()) as usize;
        let Some(payload) = bytes.get(at + 16..).and_then(|rest| rest.get(..payload_bytes)) else {
            return;
        };
        let mut digest = wire::CRC.digest();
        digest.update(&bytes[at..at + 12]);
        digest.update(payload);
        let crc = digest.finalize().to_le_bytes();
        bytes[at + 12..at + 16].copy_from_slice(&crc);
        at += 16 + payload_bytes;
    }
}

#[test]
fn signed_damage_never_panics_and_any_surface_it_makes_plays() {
    let rig = Rig::new();
    let (bytes, ..) = show(&rig, 6, 40, 200, true);
    let package = Package::small(1);
    let basis = open(&package);
    let (mut opened, mut played, mut refused) = (0, 0, 0);
    for seed in 0..6000 {
        let mut dice = Dice(Noise::new(seed));
        let mut damaged = bytes.clone();
        for _ in 0..=dice.throw(3) {
            let at = dice.throw(bytes.len() as u32) as usize;
            damaged[at] = [0, 1, 0xff, 0x80, dice.throw(256) as u8][dice.throw(5) as usize];
        }
        if dice.throw(4) == 0 {
            damaged.truncate(dice.throw(bytes.len() as u32) as usize);
        }
        sign(&mut damaged);
        let Ok(take) = Take::open(&damaged) else {
            refused += 1;
            continue;
        };
        opened += 1;
        walk(&take);
        let knobs: Vec<Knob<'_>> = take.knobs().collect();
        let bindings: Vec<Binding> = take.bindings(&basis).filter_map(Result::ok).collect();
        let buttons: Vec<Button> = take.buttons(&basis).filter_map(Result::ok).collect();
        let Ok(map) = ControlMap::new(basis, &knobs, &bindings, &buttons, take.tree()) else {
            continue;
        };
        played += 1;
        with_surface(map, take.settings(), |surface, controls| {
            replay(&take, surface, controls, |_, weights| {
                assert!(weights.iter().all(|w| w.is_finite()))
            })
            .unwrap();
        });
    }
    assert!(
        opened > 1000 && played > 500 && refused > 100,
        "{opened} {played} {refused}"
    );
}

#[test]
fn other_files_and_other_versions_are_refused() {
    assert_eq!(Take::open(b"PNG or whatever").unwrap_err(), TakeError::NotATake);
    assert!(matches!(Take::open(b"").unwrap_err(), TakeError::HeaderCut { .. }));
    assert_eq!(Take::open(b"SNTE").unwrap_err(), TakeError::NotATake);
    let (bytes, ..) = show(&Rig::new(), 1, 1, 128, true);
    for (version, oldest_reader) in [(0_u16, 0_u16), (2, 2)] {
        let mut other = bytes.clone();
        other[16..18].copy_from_slice(&version.to_le_bytes());
        other[18..20].copy_from_slice(&oldest_reader.to_le_bytes());
        sign(&mut other);
        let expected = TakeError::UnsupportedVersion { version, oldest_reader };
        assert_eq!(Take::open(&other).unwrap_err(), expected);
    }
    let mut newer = bytes.clone();
    newer[16] = 2;
    sign(&mut newer);
    assert!(
        Take::open(&newer).is_ok(),
        "a newer version that an old reader understands"
    );
    let mut longer = bytes.clone();
    longer.extend_from_slice(&bytes);
    let take = Take::open(&longer).unwrap();
    assert_eq!(
        (take.is_closed(), take.lost_bytes()),
        (true, bytes.len()),
        "what follows the end is not read"
    );
}
