//! Knobs through the C functions: the same readings as the core's decoder, none lost by a flood, counters that tell what
//! happened, and a surface that holds, stops and says which way to turn.

mod common;

use core::ffi::{CStr, c_char};
use core::ptr::{null, null_mut};

use common::package;
use common::player::{Memory, Player, layout_bytes, sized};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;
use sinew::*;
use sinew_knobs::{Decoder, DecoderSettings, KnobEvent, Protocol, Reading};

/// A decoder and its memory.
struct Device {
    _memory: Memory,
    decoder: *mut SinewDecoder,
}

impl Device {
    fn new(protocol: i32) -> Self {
        let settings = SinewDecoderSettings {
            struct_bytes: size_of::<SinewDecoderSettings>(),
            protocol,
            full_scale: 0,
            midi_coding: 0,
            midi_pairing: 0,
        };
        // SAFETY: the memory is as long as the layout says and lives as long as the device.
        unsafe {
            let mut memory = Memory::new(layout_bytes(|layout| sinew_decoder_layout(layout)));
            let (at, room, mut decoder) = (memory.pointer(), memory.bytes(), null_mut());
            let status = sinew_decoder_open(SINEW_ABI_VERSION, &settings, at, room, &mut decoder, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            Self {
                _memory: memory,
                decoder,
            }
        }
    }

    fn feed(&self, now_us: u64, bytes: &[u8]) -> usize {
        let mut taken = usize::MAX;
        // SAFETY: the device's memory stands.
        let status =
            unsafe { sinew_decoder_feed(self.decoder, now_us, bytes.as_ptr().cast(), bytes.len(), &mut taken) };
        assert_eq!(status, SinewStatus::Ok);
        taken
    }

    fn greeting(&self, now_us: u64) -> Vec<u8> {
        let (mut bytes, mut length) = ([0xaa_u8; SINEW_GREETING_BYTES], usize::MAX);
        let (at, room) = (bytes.as_mut_ptr().cast(), bytes.len());
        // SAFETY: the device's memory stands.
        let status = unsafe { sinew_decoder_greeting(self.decoder, now_us, at, room, &mut length) };
        assert_eq!(status, SinewStatus::Ok);
        bytes[..length].to_vec()
    }

    fn next(&self) -> Option<SinewReading> {
        let mut reading = sized::<SinewReading>();
        // SAFETY: the device's memory stands; a reading is whole once written.
        let reading = unsafe {
            assert_eq!(sinew_decoder_next(self.decoder, reading.as_mut_ptr()), SinewStatus::Ok);
            reading.assume_init()
        };
        (reading.kind != SinewReadingKind::None as i32).then_some(reading)
    }

    fn counters(&self, now_us: u64) -> SinewCounters {
        let mut counters = sized::<SinewCounters>();
        // SAFETY: as above.
        unsafe {
            let status = sinew_decoder_counters(self.decoder, now_us, counters.as_mut_ptr());
            assert_eq!(status, SinewStatus::Ok);
            counters.assume_init()
        }
    }

    fn info(&self) -> SinewDeviceInfo {
        let mut info = sized::<SinewDeviceInfo>();
        // SAFETY: as above.
        unsafe {
            assert_eq!(sinew_decoder_info(self.decoder, info.as_mut_ptr()), SinewStatus::Ok);
            info.assume_init()
        }
    }
}

fn words(text: &[c_char]) -> &str {
    // SAFETY: the library ends its texts.
    unsafe { CStr::from_ptr(text.as_ptr()) }.to_str().expect("UTF-8")
}

fn as_event(reading: &SinewReading) -> KnobEvent {
    let (value, full_scale) = (reading.value, reading.full_scale);
    KnobEvent {
        knob: reading.knob as u16,
        reading: if reading.kind == SinewReadingKind::Steps as i32 {
            Reading::Steps(value as i16)
        } else {
            Reading::Position {
                value: value as u16,
                full_scale: full_scale as u16,
            }
        },
    }
}

/// Bytes that look like a device's, some of the time.
fn noise(rng: &mut ChaCha8Rng) -> Vec<u8> {
    const PIECES: [&[u8]; 7] = [
        b"0|240|1023\r\n",
        b"jaw:512,brow:103\n",
        b"\xb0\x07\x40\x41",
        b"\xe0\x10\x20\xe1\x10\x20",
        b"/jaw\0\0\0\0,f\0\0\x3f\0\0\0\xc0",
        b"\x03\x01\x02\0",
        b"1 2 3 4 5 6 7 8 9 10 11 12 13\n",
    ];
    let mut bytes = Vec::new();
    let mostly = *PIECES.choose(rng).expect("some");
    while bytes.len() < 6000 {
        match rng.random_range(0..20) {
            0 => bytes.push(rng.random()),
            1 => bytes.extend_from_slice(PIECES.choose(rng).expect("some")),
            _ => bytes.extend_from_slice(mostly),
        }
    }
    bytes
}

#[test]
fn readings_are_those_of_the_core_in_any_chunking() {
    let mut readings = 0;
    for case in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(case);
        let bytes = noise(&mut rng);
        let number: usize = rng.random_range(0..=5);
        let protocol = number.checked_sub(1).map(|index| Protocol::ALL[index]);
        let mut expected = Vec::new();
        let mut core = Decoder::new(protocol, DecoderSettings::default());
        core.feed(&bytes, &mut |event| expected.push(event));
        let device = Device::new(number as i32);
        let (mut found, mut fed) = (Vec::new(), 0);
        while fed < bytes.len() {
            let end = bytes.len().min(fed + rng.random_range(1..3000));
            let taken = device.feed(0, &bytes[fed..end]);
            fed += taken;
            // Now and then nobody asks.
            if taken == 0 || rng.random() {
                found.extend(core::iter::from_fn(|| device.next()).map(|reading| as_event(&reading)));
            }
        }
        found.extend(core::iter::from_fn(|| device.next()).map(|reading| as_event(&reading)));
        assert_eq!(found, expected, "case {case}");
        let (counters, own) = (device.counters(0), core.counters());
        assert_eq!(
            (counters.bytes, counters.good, counters.bad, counters.partial),
            (own.bytes, own.good, own.bad, own.partial)
        );
        assert_eq!((counters.readings, counters.dropped), (own.events, own.dropped));
        assert_eq!(words(&device.info().text), core.recognition().to_string());
        readings += found.len();
    }
    assert!(readings > 10_000, "{readings}");
}

#[test]
fn a_flood_that_nobody_asks_about_waits_at_the_port_and_loses_nothing() {
    let flood: Vec<u8> = b"1|2|3|4|5|6|7|8\n".repeat(10_000);
    let device = Device::new(SinewProtocol::Lines as i32);
    let first = device.feed(0, &flood);
    assert!(first < flood.len() && device.feed(0, &flood[first..]) == 0);
    assert!(device.counters(0).waiting <= SINEW_DECODER_READINGS as u64);
    let (mut fed, mut found) = (first, 0);
    loop {
        found += core::iter::from_fn(|| device.next()).count();
        if fed == flood.len() {
            break;
        }
        fed += device.feed(0, &flood[fed..]);
    }
    // The first line may have been cut.
    assert_eq!(found, 8 * 9_999);
    let counters = device.counters(0);
    assert_eq!((counters.dropped, counters.bad, counters.waiting), (0, 0, 0));
}

#[test]
fn counters_tell_what_happened() {
    let device = Device::new(SinewProtocol::Unknown as i32);
    assert_eq!(device.counters(5).age_us, u64::MAX, "before the first reading");
    assert_eq!(device.info().recognition, SinewRecognition::Listening);
    device.feed(1_000, b"jaw:1,brow:2\njaw:3,brow:4\njaw:5,brow:6\njaw:7,brow:8\n");
    device.feed(2_000, b"what is this?\n");
    let info = device.info();
    assert_eq!(
        (info.recognition, info.protocol),
        (SinewRecognition::Found, SinewProtocol::Lines)
    );
    assert!(info.confidence > 70 && info.confidence < 100, "{}", info.confidence);
    assert!(words(&info.text).starts_with("text lines, "), "{}", words(&info.text));
    let counters = device.counters(3_500);
    assert_eq!((counters.bad, counters.replugs, counters.age_us), (1, 0, 2_500));
    assert_eq!(
        words(&counters.last_fault_text),
        "a line is not a list of numbers (a debug print?)"
    );
    assert_ne!(counters.last_fault, 0);
    let mut name = [0; SINEW_KNOB_NAME_BYTES];
    // SAFETY: the device's memory stands.
    unsafe {
        let status = sinew_decoder_knob_name(device.decoder, 1, name.as_mut_ptr(), name.len());
        assert_eq!((status, words(&name)), (SinewStatus::Ok, "brow"));
        let status = sinew_decoder_knob_name(device.decoder, 9, name.as_mut_ptr(), name.len());
        assert_eq!((status, words(&name)), (SinewStatus::Ok, ""));
        device.feed(4_000, b"jaw:1,br");
        assert_eq!(sinew_decoder_replugged(device.decoder), SinewStatus::Ok);
    }
    let partial = counters.partial;
    let counters = device.counters(4_000);
    assert_eq!((counters.replugs, counters.partial), (1, partial + 1));
}

#[test]
fn a_device_that_waits_for_a_greeting_gets_one_when_it_is_known() {
    for (protocol, expected) in [
        (SinewProtocol::Unknown, 0),
        (SinewProtocol::Lines, 0),
        (SinewProtocol::Packets, 1),
        (SinewProtocol::Firmata, 37),
    ] {
        let device = Device::new(protocol as i32);
        assert_eq!(device.greeting(0).len(), expected, "{protocol:?}");
        assert_eq!(device.greeting(999_999).len(), 0, "{protocol:?}");
        assert_eq!(
            device.greeting(1_000_000).len(),
            expected,
            "{protocol:?}: it has not answered"
        );
    }
    // Nobody said what it speaks: it is greeted once its own words told, and no more when it reports.
    let device = Device::new(SinewProtocol::Unknown as i32);
    assert_eq!(device.greeting(0).len(), 0);
    while device.info().protocol == SinewProtocol::Unknown {
        device.feed(500_000, b"\xf9\x02\x05\xf0\x79\x02\x05x\0y\0\xf7");
    }
    assert_eq!(device.info().protocol, SinewProtocol::Firmata);
    assert_eq!(device.greeting(600_000).len(), 37);
    device.feed(700_000, b"\xe0\x10\x03");
    assert_eq!(device.greeting(2_000_000).len(), 0);
    // SAFETY: the device's memory stands.
    assert_eq!(unsafe { sinew_decoder_replugged(device.decoder) }, SinewStatus::Ok);
    assert_eq!(device.greeting(2_000_001).len(), 37);
}

#[test]
fn a_reading_tells_when_its_bytes_came() {
    let device = Device::new(SinewProtocol::Lines as i32);
    device.feed(1_000, b"1|2\n3|");
    device.feed(2_000, b"4\n");
    let times: Vec<u64> = core::iter::from_fn(|| device.next())
        .map(|reading| reading.time_us)
        .collect();
    assert_eq!(times, [2_000, 2_000], "the first line may have been cut");
}

#[test]
fn nothing_may_be_no_pointer() {
    let device = Device::new(SinewProtocol::Unknown as i32);
    let mut taken = usize::MAX;
    // SAFETY: the device's memory stands.
    unsafe {
        assert_eq!(
            sinew_decoder_feed(device.decoder, 0, null(), 0, &mut taken),
            SinewStatus::Ok
        );
        assert_eq!(taken, 0);
        assert_eq!(sinew_decoder_feed_packet(device.decoder, 0, null(), 0), SinewStatus::Ok);
    }
}

#[test]
fn a_datagram_makes_readings() {
    let device = Device::new(SinewProtocol::Unknown as i32);
    let packet = b"/jaw\0\0\0\0,f\0\0\x3f\0\0\0";
    // SAFETY: the device's memory stands.
    let status = unsafe { sinew_decoder_feed_packet(device.decoder, 7, packet.as_ptr().cast(), packet.len()) };
    assert_eq!((status, device.info().protocol), (SinewStatus::Ok, SinewProtocol::Osc));
    let reading = device.next().expect("one number");
    assert!((reading.value as f32 / reading.full_scale as f32 - 0.5).abs() < 0.01);
}

/// A player whose controls a surface moves.
struct Stage {
    player: Player,
    _memory: Memory,
    surface: *mut SinewSurface,
    now_us: u64,
}

impl Stage {
    fn new(package: &[u8], takeover: SinewTakeover) -> Self {
        let player = Player::new(package).expect("valid");
        let bindings = [0, 1].map(|n| SinewBinding {
            knob: n,
            control: n,
            page: if n == 0 { SINEW_NONE } else { 1 },
            takeover: takeover as i32,
            inverted: 0,
            curve: 0,
            curve_number: 0.0,
            centre: 0,
            detent: 0.0,
            minimum: 0.0,
            maximum: 0.0,
            slew: 0.0,
        });
        let settings = SinewSurfaceSettings {
            struct_bytes: size_of::<SinewSurfaceSettings>(),
            knob_count: 2,
            knobs: null(),
            knob_bytes: 0,
            bindings: bindings.as_ptr(),
            binding_count: 2,
            binding_bytes: size_of::<SinewBinding>(),
            tree_first: 0,
            tree_coarse: 0,
            tree_fine: 0,
            tree_takeover: 0,
            tree_stays: 0,
            spike_guard: 0,
            hold_us: 200_000,
            ease_us: 100_000,
            silence_us: 0,
        };
        let mut surface = null_mut();
        // SAFETY: all memory stands.
        let memory = unsafe {
            let bytes = layout_bytes(|layout| sinew_surface_layout(player.basis, &settings, layout, null_mut()));
            let mut memory = Memory::new(bytes);
            let (at, room) = (memory.pointer(), memory.bytes());
            let status = sinew_surface_create(player.basis, &settings, at, room, &mut surface, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            memory
        };
        Self {
            player,
            _memory: memory,
            surface,
            now_us: 0,
        }
    }

    fn turn(&mut self, knob: u32, value: i32) {
        let reading = SinewReading {
            struct_bytes: size_of::<SinewReading>(),
            time_us: self.now_us,
            kind: SinewReadingKind::Position as i32,
            knob,
            value,
            full_scale: 1023,
        };
        // SAFETY: the stage's memory stands.
        let status = unsafe { sinew_surface_read(self.surface, &reading) };
        assert_eq!(status, SinewStatus::Ok);
    }

    fn frames(&mut self, count: u32) {
        for _ in 0..count {
            self.now_us += 20_000;
            // SAFETY: the stage's memory stands.
            let status = unsafe { sinew_surface_advance(self.surface, self.player.controls, self.now_us, null_mut()) };
            assert_eq!(status, SinewStatus::Ok);
        }
    }

    fn weight(&self, control: u32) -> f32 {
        let mut weight = f32::NAN;
        // SAFETY: the stage's memory stands.
        let status = unsafe { sinew_control_get(self.player.controls, control, &mut weight) };
        assert_eq!(status, SinewStatus::Ok);
        weight
    }

    fn knob(&self, knob: u32) -> SinewKnobState {
        let mut state = sized::<SinewKnobState>();
        // SAFETY: the stage's memory stands; the state is whole once written.
        unsafe {
            assert_eq!(
                sinew_surface_knob(self.surface, knob, state.as_mut_ptr()),
                SinewStatus::Ok
            );
            state.assume_init()
        }
    }

    fn status(&self) -> SinewSurfaceStatus {
        let mut status = sized::<SinewSurfaceStatus>();
        // SAFETY: the stage's memory stands; the status is whole once written.
        unsafe {
            assert_eq!(sinew_surface_status(self.surface, status.as_mut_ptr()), SinewStatus::Ok);
            status.assume_init()
        }
    }

    fn command(&mut self, command: SinewCommand, argument: u32) {
        // SAFETY: the stage's memory stands.
        let status = unsafe { sinew_surface_command(self.surface, command as i32, argument) };
        assert_eq!(status, SinewStatus::Ok);
    }
}

#[test]
fn a_knob_waits_says_which_way_to_turn_and_picks_up() {
    let package = package();
    let mut stage = Stage::new(&package, SinewTakeover::Pickup);
    assert_eq!(stage.knob(0).state, SinewTakeoverState::Unheard);
    assert!(stage.knob(0).position < 0.0);
    stage.turn(0, 0);
    stage.frames(20);
    let waiting = stage.knob(0);
    assert_eq!((waiting.state, waiting.control), (SinewTakeoverState::TurnRight, 0));
    assert!((waiting.distance - 0.5).abs() < 0.02 && waiting.position == 0.0);
    assert_eq!(stage.weight(0), 0.0);
    stage.turn(0, 1023);
    stage.frames(100);
    assert_eq!(stage.knob(0).state, SinewTakeoverState::Engaged);
    assert_eq!(stage.weight(0), 2.0, "its upper stop");

    assert_eq!(
        stage.knob(1).state,
        SinewTakeoverState::Unassigned,
        "its page is the other one"
    );
    assert_eq!(stage.knob(1).control, SINEW_NONE);
    stage.command(SinewCommand::Page, 1);
    assert_eq!((stage.status().page, stage.status().page_count), (1, 2));
    stage.turn(1, 1023);
    stage.frames(20);
    assert_eq!(stage.knob(1).state, SinewTakeoverState::TurnLeft);
}

#[test]
fn what_is_unplugged_holds_eases_to_rest_and_is_picked_up() {
    let package = package();
    let mut stage = Stage::new(&package, SinewTakeover::Jump);
    stage.turn(0, 0);
    stage.frames(10);
    stage.turn(0, 1023);
    stage.frames(100);
    assert_eq!(stage.weight(0), 2.0);
    // SAFETY: the stage's memory stands.
    unsafe { assert_eq!(sinew_surface_unplugged(stage.surface, stage.now_us), SinewStatus::Ok) };
    stage.frames(5);
    assert_eq!((stage.weight(0), stage.knob(0).state), (2.0, SinewTakeoverState::Held));
    assert_eq!((stage.status().is_lost, stage.status().losses), (1, 1));
    stage.frames(60);
    assert_eq!(stage.weight(0), 0.0);
    // SAFETY: the stage's memory stands.
    unsafe { assert_eq!(sinew_surface_replugged(stage.surface, stage.now_us), SinewStatus::Ok) };
    stage.turn(0, 900);
    stage.frames(10);
    stage.turn(0, 910);
    stage.frames(10);
    assert_eq!(
        (stage.weight(0), stage.knob(0).state),
        (0.0, SinewTakeoverState::TurnLeft)
    );
    stage.turn(0, 400);
    stage.frames(100);
    assert!(stage.weight(0) < 0.0);
    stage.command(SinewCommand::Stop, 0);
    stage.frames(60);
    assert_eq!((stage.weight(0), stage.status().is_stopped), (0.0, 1));
    stage.command(SinewCommand::Release, 0);
    stage.frames(1);
    assert_eq!(stage.status().is_stopped, 0);
}
