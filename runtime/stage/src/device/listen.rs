//! Which knobs a device has: for a moment it is only listened to. Boxes that send all the time show every knob in one line;
//! others show those that are being turned, and the rest takes its place when it is heard.

use core::time::Duration;
use std::thread;

use sinew_knobs::SourceEvent;
use sinew_knobs::device::Clock;

use super::Device;
use crate::wiring::HeardKnob;

/// Time for the first knob to be heard: a board that resets when its port opens needs it.
const FIRST: Duration = Duration::from_millis(2500);
/// Time for the others after it.
const OTHERS: Duration = Duration::from_millis(400);

/// Listens until nothing new is to be expected, at most three seconds; `stop` ends it early. Knobs come in order of their
/// addresses. Their readings are not kept: a knob is taken over from where it stands when it is heard next.
pub fn listen(device: &mut dyn Device, clock: Clock, stop: &dyn Fn() -> bool) -> Vec<HeardKnob> {
    let mut addresses: Vec<u16> = Vec::new();
    let started_us = clock.now_us();
    let mut until_us = started_us + FIRST.as_micros() as u64;
    while clock.now_us() < until_us && !stop() {
        device.poll(clock.now_us(), &mut |_, event| {
            if let SourceEvent::Knob(event) = event
                && !addresses.contains(&event.knob)
            {
                if addresses.is_empty() {
                    until_us = clock.now_us() + OTHERS.as_micros() as u64;
                }
                addresses.push(event.knob);
            }
        });
        thread::sleep(Duration::from_millis(5));
    }
    addresses.sort_unstable();
    let names = device.device_status().names;
    let name_of = |address| {
        names
            .iter()
            .find(|named| named.knob == address)
            .map(|named| named.name.clone())
    };
    addresses
        .into_iter()
        .map(|address| HeardKnob {
            address,
            name: name_of(address),
        })
        .collect()
}
