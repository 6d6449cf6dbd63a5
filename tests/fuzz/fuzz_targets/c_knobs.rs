//! Bytes of a knob box through the C functions: decoder, surface, commands, unplugging. Nothing ends with `INTERNAL` or loses
//! a reading, and every weight stays finite and within its control's stops.
//!
//! Bytes of an input: one for the settings, then steps of one byte each that say what happens; a step that feeds takes as many
//! of the bytes behind it as it says.
#![no_main]

use core::ffi::c_void;
use core::ptr::{null, null_mut};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use sinew::*;
use sinew_formats::package::{AlignedBytes, fixture::tiny_baked, write_baked};

/// Aligned as every layout asks.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct Line([u8; 64]);

struct Memory(Vec<Line>);

impl Memory {
    fn new(ask: impl FnOnce(*mut SinewLayout) -> SinewStatus) -> Self {
        let mut layout = SinewLayout {
            size_bytes: 0,
            alignment: 0,
        };
        assert_eq!(ask(&mut layout), SinewStatus::Ok);
        Self(vec![Line([0; 64]); layout.size_bytes.div_ceil(64)])
    }

    fn at(&mut self) -> (*mut c_void, usize) {
        (self.0.as_mut_ptr().cast(), 64 * self.0.len())
    }
}

static PACKAGE: LazyLock<AlignedBytes> =
    LazyLock::new(|| write_baked(&tiny_baked().basis()).expect("the fixture is valid"));

fuzz_target!(|data: &[u8]| {
    if let [choice, steps @ ..] = data {
        // SAFETY: all memory is as long as the layouts say and outlives the calls.
        unsafe { perform(*choice, steps) };
    }
});

unsafe fn perform(choice: u8, mut steps: &[u8]) {
    unsafe {
        let mut room = Memory::new(|layout| sinew_basis_layout(layout));
        let ((at, bytes), mut basis) = (room.at(), null_mut());
        let (start, length) = (PACKAGE.as_ptr().cast(), PACKAGE.len());
        let status = sinew_basis_open(SINEW_ABI_VERSION, start, length, at, bytes, &mut basis, null_mut());
        assert_eq!(status, SinewStatus::Ok);
        let mut room = Memory::new(|layout| sinew_controls_layout(basis, layout));
        let ((at, bytes), mut controls) = (room.at(), null_mut());
        let status = sinew_controls_create(basis, at, bytes, &mut controls, null_mut());
        assert_eq!(status, SinewStatus::Ok);

        let mut settings: SinewDecoderSettings = core::mem::zeroed();
        settings.struct_bytes = size_of::<SinewDecoderSettings>();
        settings.protocol = i32::from(choice & 7) % 6;
        settings.midi_coding = i32::from(choice >> 3 & 3);
        let mut room = Memory::new(|layout| sinew_decoder_layout(layout));
        let ((at, bytes), mut decoder) = (room.at(), null_mut());
        let status = sinew_decoder_open(SINEW_ABI_VERSION, &settings, at, bytes, &mut decoder, null_mut());
        assert_eq!(status, SinewStatus::Ok);

        let mut settings: SinewSurfaceSettings = core::mem::zeroed();
        settings.struct_bytes = size_of::<SinewSurfaceSettings>();
        settings.knob_count = 8;
        settings.tree_takeover = i32::from(choice >> 5 & 3);
        settings.spike_guard = u32::from(choice >> 7);
        let mut room = Memory::new(|layout| sinew_surface_layout(basis, &settings, layout, null_mut()));
        let ((at, bytes), mut surface) = (room.at(), null_mut());
        let status = sinew_surface_create(basis, &settings, at, bytes, &mut surface, null_mut());
        assert_eq!(status, SinewStatus::Ok);

        let (mut now_us, mut fed) = (0_u64, 0_u64);
        while let [step, rest @ ..] = steps {
            steps = rest;
            let argument = u32::from(step & 31);
            match step >> 5 {
                0..=3 => {
                    let (now, later) = steps.split_at(steps.len().min(usize::from(*step)));
                    steps = later;
                    fed += feed(decoder, surface, now_us, now);
                }
                4 => now_us += u64::from(argument) * 9_000,
                5 => {
                    let status = sinew_surface_command(surface, argument as i32 % 12, argument / 4);
                    assert_ne!(status, SinewStatus::Internal);
                }
                6 => {
                    let status = match argument % 3 {
                        0 => sinew_surface_unplugged(surface, now_us),
                        1 => sinew_surface_replugged(surface, now_us),
                        _ => sinew_decoder_replugged(decoder),
                    };
                    assert_eq!(status, SinewStatus::Ok);
                }
                _ => {
                    let (now, later) = steps.split_at(steps.len().min(4 * argument as usize));
                    steps = later;
                    let status = sinew_decoder_feed_packet(decoder, now_us, now.as_ptr().cast(), now.len());
                    assert_eq!(status, SinewStatus::Ok);
                    fed += now.len() as u64;
                }
            }
            let status = sinew_surface_advance(surface, controls, now_us, null_mut());
            assert_eq!(status, SinewStatus::Ok);
            look(basis, decoder, surface, controls, now_us);
        }
        let mut counters: SinewCounters = core::mem::zeroed();
        counters.struct_bytes = size_of::<SinewCounters>();
        assert_eq!(sinew_decoder_counters(decoder, now_us, &mut counters), SinewStatus::Ok);
        assert_eq!(counters.bytes, fed);
        assert_eq!(sinew_basis_info(null(), null_mut()), SinewStatus::NullPointer);
    }
}

/// Feeds and empties; the bytes that went in.
unsafe fn feed(decoder: *mut SinewDecoder, surface: *mut SinewSurface, now_us: u64, bytes: &[u8]) -> u64 {
    let mut done = 0;
    unsafe {
        loop {
            let (start, left, mut taken) = (bytes.as_ptr().add(done), bytes.len() - done, 0);
            let status = sinew_decoder_feed(decoder, now_us, start.cast(), left, &mut taken);
            assert_eq!(status, SinewStatus::Ok);
            done += taken;
            let mut reading: SinewReading = core::mem::zeroed();
            reading.struct_bytes = size_of::<SinewReading>();
            loop {
                assert_eq!(sinew_decoder_next(decoder, &mut reading), SinewStatus::Ok);
                if reading.kind == SinewReadingKind::None as i32 {
                    break;
                }
                assert_eq!(sinew_surface_read(surface, &reading), SinewStatus::Ok);
            }
            if done == bytes.len() {
                let (mut greeting, mut length) = ([0_u8; SINEW_GREETING_BYTES], usize::MAX);
                let (at, room) = (greeting.as_mut_ptr().cast(), greeting.len());
                let status = sinew_decoder_greeting(decoder, now_us, at, room, &mut length);
                assert_eq!((status, length <= room), (SinewStatus::Ok, true));
                return done as u64;
            }
        }
    }
}

/// Everything that can be asked for, and the promise on the weights.
unsafe fn look(
    basis: *const SinewBasis,
    decoder: *const SinewDecoder,
    surface: *const SinewSurface,
    controls: *const SinewControls,
    now_us: u64,
) {
    unsafe {
        let mut weights = [f32::NAN; 4];
        assert_eq!(
            sinew_controls_get_all(controls, weights.as_mut_ptr(), 4),
            SinewStatus::Ok
        );
        for (k, weight) in weights.iter().enumerate() {
            let (mut minimum, mut maximum) = (0.0, 0.0);
            let status = sinew_control_range(basis, k as u32, &mut minimum, &mut maximum);
            assert_eq!(status, SinewStatus::Ok);
            assert!((minimum..=maximum).contains(weight), "{k} at {now_us}: {weight}");
        }
        let mut state: SinewKnobState = core::mem::transmute([0_u8; size_of::<SinewKnobState>()]);
        state.struct_bytes = size_of::<SinewKnobState>();
        for knob in 0..8 {
            assert_eq!(sinew_surface_knob(surface, knob, &mut state), SinewStatus::Ok);
            assert!(state.distance >= 0.0 && state.distance <= 1.0 && state.position <= 1.0);
            let mut name = [0; SINEW_KNOB_NAME_BYTES];
            let status = sinew_decoder_knob_name(decoder, knob, name.as_mut_ptr(), name.len());
            assert_eq!(status, SinewStatus::Ok);
        }
    }
}
