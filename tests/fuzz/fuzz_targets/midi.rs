//! MIDI bytes: controllers, pairs, encoders, running status.
#![no_main]

mod knobs;

use libfuzzer_sys::fuzz_target;
use sinew_knobs::Protocol;

fuzz_target!(|data: &[u8]| knobs::check(Some(Protocol::Midi), data));
