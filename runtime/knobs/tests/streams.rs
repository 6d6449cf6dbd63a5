//! Every protocol on streams as devices send them: the same bytes in any chunking give the same events, a replug at any
//! byte gives no false reading, hostile bytes give counts and no panic, and sniffing finds what it is and loses nothing.

mod common;

use common::{Heard, PROTOCOLS, datagrams, hear, settings, stream};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;
use sinew_knobs::{
    Decoder, Fault, Protocol, Reading,
    protocol::{Recognition, SNIFF_BYTES_MAX},
};

#[test]
fn any_chunking_gives_the_same_events() {
    for (seed, protocol) in PROTOCOLS.into_iter().enumerate() {
        let mut random = ChaCha8Rng::seed_from_u64(seed as u64);
        let bytes = stream(protocol, 40, &mut random);
        for named in [Some(protocol), None] {
            let whole = hear(Decoder::new(named, settings()), [&bytes[..]]);
            assert!(whole.events.len() > 40, "{protocol}: {:?}", whole.counters);
            for at in 0..=bytes.len() {
                let split = hear(Decoder::new(named, settings()), [&bytes[..at], &bytes[at..]]);
                assert_eq!(split, whole, "{protocol} split at {at}");
            }
            let single = hear(Decoder::new(named, settings()), bytes.chunks(1));
            assert_eq!(single, whole, "{protocol} a byte at a time");
            for _ in 0..50 {
                let mut pieces = Vec::new();
                let mut rest = &bytes[..];
                while !rest.is_empty() {
                    let (piece, after) = rest.split_at(random.random_range(0..=rest.len().min(40)));
                    pieces.push(piece);
                    rest = after;
                }
                assert_eq!(hear(Decoder::new(named, settings()), pieces), whole, "{protocol}");
            }
        }
    }
}

#[test]
fn sniffing_finds_every_protocol_and_loses_no_event() {
    for (seed, protocol) in PROTOCOLS.into_iter().enumerate() {
        let mut random = ChaCha8Rng::seed_from_u64(100 + seed as u64);
        for _ in 0..20 {
            let bytes = stream(protocol, 60, &mut random);
            // The port opens anywhere in the stream.
            let bytes = &bytes[random.random_range(0..bytes.len() / 4)..];
            let named = hear(Decoder::new(Some(protocol), settings()), [bytes]);
            let sniffed = hear(Decoder::new(None, settings()), [bytes]);
            assert_eq!(
                sniffed.protocol,
                Some(protocol),
                "{} in {bytes:02x?}",
                sniffed.recognition
            );
            assert_eq!(
                (&sniffed.events, sniffed.counters),
                (&named.events, named.counters),
                "{protocol}"
            );
            assert!(
                (85..100).contains(&sniffed.confidence),
                "{protocol} {}",
                sniffed.confidence
            );
            assert!(
                sniffed.recognition.starts_with(protocol.words()),
                "{}",
                sniffed.recognition
            );
        }
    }
}

#[test]
fn datagrams_need_no_slip() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let packets = datagrams(30, &mut random);
    let mut decoder = Decoder::new(None, settings());
    let mut event_count = 0;
    for packet in &packets {
        decoder.feed_packet(packet, &mut |_| event_count += 1);
    }
    assert_eq!(decoder.protocol(), Some(Protocol::Osc));
    assert_eq!(event_count, decoder.counters().events);
    assert_eq!((decoder.counters().bad, event_count > 30), (0, true));
    assert!(decoder.name_of(0).is_some_and(|name| name.starts_with('/')));
}

/// A device whose knobs all stand at their upper ends: any other reading was made up.
#[test]
fn a_replug_at_any_byte_makes_no_reading_up() {
    for protocol in PROTOCOLS {
        let bytes = common::at_the_top(protocol, 20);
        for cut in 0..bytes.len() {
            for resume in [0, cut / 2, cut] {
                let mut decoder = Decoder::new(Some(protocol), settings());
                let mut event_count = 0;
                let mut check = |event: sinew_knobs::KnobEvent| {
                    event_count += 1;
                    match event.reading {
                        Reading::Position { value, full_scale } => {
                            assert_eq!(value, full_scale, "{protocol} {cut} {resume}")
                        }
                        Reading::Steps(_) => panic!("no encoders here"),
                    }
                    assert!(event.knob < 4100, "{protocol} {cut} {resume}");
                };
                decoder.feed(&bytes[..cut], &mut check);
                decoder.reset();
                decoder.feed(&bytes[resume..], &mut check);
                assert_eq!(
                    decoder.counters().bad,
                    0,
                    "{protocol} {cut} {resume}: {:?}",
                    decoder.counters()
                );
                assert_eq!(decoder.counters().events, event_count);
            }
        }
    }
}

fn check_invariants(heard: &Heard, byte_count: usize) {
    assert_eq!(heard.counters.bytes, byte_count as u64);
    assert_eq!(heard.counters.events, heard.events.len() as u64);
    for event in &heard.events {
        match event.reading {
            Reading::Position { value, full_scale } => assert!(full_scale >= 1 && value <= full_scale, "{event:?}"),
            Reading::Steps(steps) => assert_ne!(steps, 0),
        }
    }
}

#[test]
fn hostile_bytes_are_counted_and_harm_nothing() {
    let mut random = ChaCha8Rng::seed_from_u64(2026);
    // Bytes on which some parser turns.
    let turning = b"\0\x01\x7f\x80\x90\xb0\xc0\xdb\xdc\xdd\xe0\xf0\xf7\xf8\xf9\xff\n\r|,:;.-=\t #/09";
    let named = PROTOCOLS.into_iter().map(Some).chain([None]);
    for protocol in named {
        for round in 0..300 {
            let mut bytes = match round % 3 {
                0 => (0..random.random_range(0..3000)).map(|_| random.random()).collect(),
                1 => (0..random.random_range(0..3000))
                    .map(|_| *turning.choose(&mut random).unwrap())
                    .collect(),
                _ => stream(protocol.unwrap_or(PROTOCOLS[round % PROTOCOLS.len()]), 30, &mut random),
            };
            for _ in 0..random.random_range(0..20) {
                if bytes.is_empty() {
                    break;
                }
                let at = random.random_range(0..bytes.len());
                match random.random_range(0..4) {
                    0 => bytes[at] ^= 1 << random.random_range(0..8),
                    1 => bytes.truncate(at),
                    2 => bytes.insert(at, *turning.choose(&mut random).unwrap()),
                    _ => bytes.extend_from_within(at..(at + 200).min(bytes.len())),
                }
            }
            let size = random.random_range(1..64);
            let heard = hear(Decoder::new(protocol, settings()), bytes.chunks(size));
            check_invariants(&heard, bytes.len());
            let mut decoder = Decoder::new(protocol, settings());
            for packet in bytes.chunks(size) {
                decoder.feed_packet(packet, &mut |_| ());
                if random.random_bool(0.05) {
                    decoder.reset();
                }
            }
        }
    }
}

#[test]
fn noise_is_undecided_and_says_so() {
    let (mut undecided_count, round_count) = (0, 200);
    for seed in 0..round_count {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut decoder = Decoder::new(None, settings());
        assert_eq!(decoder.recognition(), Recognition::Listening { waiting_bytes: 0 });
        let noise: Vec<u8> = (0..4 * SNIFF_BYTES_MAX).map(|_| random.random()).collect();
        decoder.feed(&noise, &mut |_| ());
        if decoder.recognition() == Recognition::Undecided {
            undecided_count += 1;
            assert_eq!((decoder.protocol(), decoder.confidence()), (None, 0));
            assert_eq!(decoder.counters().last_fault, Some(Fault::Undecided));
            // The right baud rate at last: it still finds out.
            decoder.feed(&stream(Protocol::Lines, 300, &mut random), &mut |_| ());
            assert_eq!(decoder.protocol(), Some(Protocol::Lines), "seed {seed}");
        }
    }
    assert_eq!(undecided_count, round_count, "noise was taken for a device");
}

#[test]
fn a_decoder_is_small_and_names_are_read() {
    assert!(size_of::<Decoder>() < 15_000, "{} bytes", size_of::<Decoder>());
    for protocol in Protocol::ALL {
        assert_eq!(Protocol::parse_name(protocol.name()), Some(protocol));
    }
    assert_eq!(Protocol::parse_name("DEEJ"), Some(Protocol::Lines));
    assert_eq!(Protocol::parse_name("dmx"), None);
    let mut out = [0; 37];
    let lengths = PROTOCOLS.map(|protocol| protocol.write_opening(&mut out).unwrap());
    assert_eq!(lengths, [0, 1, 0, 37, 0]);
    assert_eq!(
        Protocol::Firmata
            .write_opening(&mut out[..36])
            .unwrap_err()
            .required_bytes,
        37
    );
}
