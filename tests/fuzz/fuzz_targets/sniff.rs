//! The sniffer, and the parser that it chooses.
#![no_main]

mod knobs;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| knobs::check(None, data));
