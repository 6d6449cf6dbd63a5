//! The box repeats to the byte, and a host's decoder understands it.

use sinew_knobs::protocol::Pairing;
use sinew_knobs::{Decoder, DecoderSettings, Reading};

use super::*;

const SCRIPT: &str = "noise 2\nwander on\nwait 300ms\ngarbage 20\nwait 50ms\ncut\nwait 100ms\nburst 30\nsag 0.8\n\
    wait 100ms\nfreeze 100ms\nwait 150ms\nunplug 200ms\nwait 100ms\nrate 700\nsilent 20ms\nwait 300ms\nrepeat";

fn bytes_of(dialect: Dialect, seed: u64, step_us: u64) -> Vec<u8> {
    let settings = BoxSettings {
        dialect,
        seed,
        ..BoxSettings::default()
    };
    let mut knobs = KnobBox::new(settings).unwrap();
    knobs.run_script(0, Script::parse(SCRIPT).unwrap());
    knobs.heard(b"");
    let mut bytes = Vec::new();
    for now_us in (0..=2_500_000).step_by(step_us as usize) {
        knobs.advance(now_us, &mut |output| match output {
            Output::Bytes(more) => bytes.extend_from_slice(more),
            Output::Unplug => bytes.extend(b"<unplug>"),
            Output::Plug => bytes.extend(b"<plug>"),
        });
    }
    bytes
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_the_steps() {
    for dialect in Dialect::ALL {
        let bytes = bytes_of(dialect, 3, 500);
        assert_eq!(bytes, bytes_of(dialect, 3, 100_000), "{dialect}");
        assert!(
            bytes.windows(8).filter(|window| window == b"<unplug>").count() >= 2,
            "it repeats"
        );
        if dialect != Dialect::Firmata {
            assert_ne!(bytes, bytes_of(dialect, 4, 500), "{dialect}");
        }
    }
}

#[test]
fn a_decoder_hears_where_the_knobs_stand() {
    for dialect in Dialect::ALL {
        let settings = BoxSettings {
            dialect,
            knob_count: 3,
            ..BoxSettings::default()
        };
        let mut knobs = KnobBox::new(settings).unwrap();
        let mut decoding = DecoderSettings::default();
        if dialect == Dialect::Midi14 {
            decoding.midi.pairing = Pairing::Always; // too few turns to learn from
        }
        let mut decoder = Decoder::new(Some(dialect.protocol()), decoding);
        let full_scale = f32::from(dialect.full_scale());
        let mut heard = [None; 3];
        let mut turned = [0i32; 3];
        for (step, to) in [0.5, 0.0, 0.25, 1.0].into_iter().enumerate() {
            let now_us = step as u64 * 100_000;
            knobs.command(now_us, Command::Set { knob: 1, to });
            let mut bytes = Vec::new();
            let mut end = |output: Output<'_>| {
                if let Output::Bytes(more) = output {
                    bytes.extend_from_slice(more);
                }
            };
            knobs.advance(now_us, &mut end);
            let mut request = [0; 64];
            let count = dialect.protocol().write_opening(&mut request).unwrap();
            knobs.heard(&request[..count]);
            knobs.advance(now_us + 99_999, &mut end);
            decoder.feed(&bytes, &mut |event| {
                let knob = usize::from(event.knob - dialect.address(0));
                match event.reading {
                    Reading::Position { value, full_scale } => heard[knob] = Some((value, full_scale)),
                    Reading::Steps(steps) => turned[knob] += i32::from(steps),
                }
            });
            let expected = (to * full_scale).round();
            if dialect == Dialect::Encoders {
                assert_eq!(turned, [0, expected as i32 - 48, 0], "{to}");
            } else {
                let (value, scale) = heard[1].unwrap_or_else(|| panic!("{dialect} says nothing"));
                let position = f32::from(value) / f32::from(scale);
                assert!(
                    (position - expected / full_scale).abs() < 1e-3,
                    "{dialect}: {position} for {to}"
                );
            }
        }
        let counters = decoder.counters();
        assert_eq!((counters.bad, counters.dropped), (0, 0), "{dialect}: {counters:?}");
    }
}

#[test]
fn only_possible_boxes_exist() {
    let with = |knob_count, rate_hz| {
        let dialect = Dialect::Firmata;
        KnobBox::new(BoxSettings {
            dialect,
            knob_count,
            rate_hz,
            seed: 0,
        })
        .map(drop)
    };
    assert_eq!(with(16, 100_000), Ok(()));
    assert_eq!(with(17, 100), Err(BoxError::KnobCount { asked: 17, most: 16 }));
    assert_eq!(with(0, 100), Err(BoxError::KnobCount { asked: 0, most: 16 }));
    assert_eq!(with(1, 0), Err(BoxError::Rate { asked: 0 }));
}
