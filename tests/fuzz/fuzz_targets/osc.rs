//! OSC: in SLIP and in datagrams.
#![no_main]

mod knobs;

use libfuzzer_sys::fuzz_target;
use sinew_knobs::Protocol;

fuzz_target!(|data: &[u8]| knobs::check(Some(Protocol::Osc), data));
