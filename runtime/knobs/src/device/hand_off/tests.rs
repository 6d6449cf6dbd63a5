//! A frame that is late: what it then hears, in which order, and that the counts add up.

use std::thread;
use std::vec::Vec;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

fn position(knob: u16, value: u16) -> SourceEvent {
    let reading = Reading::Position {
        value,
        full_scale: 1023,
    };
    SourceEvent::Knob(KnobEvent { knob, reading })
}

fn steps(knob: u16, steps: i16) -> SourceEvent {
    let reading = Reading::Steps(steps);
    SourceEvent::Knob(KnobEvent { knob, reading })
}

fn heard(reader: &mut Reader) -> Vec<SourceEvent> {
    let mut events = Vec::new();
    reader.poll(u64::MAX, &mut |_, event| events.push(event));
    events
}

/// What the frame hears in the end: polls until nothing waits.
fn heard_out(writer: &mut Writer, reader: &mut Reader) -> Vec<SourceEvent> {
    let mut events = heard(reader);
    while !writer.flush() {
        events.extend(heard(reader));
    }
    events.extend(heard(reader));
    events
}

fn count(number: &AtomicU64) -> u64 {
    number.load(Ordering::Relaxed)
}

#[test]
fn in_time_everything_comes_as_it_was() {
    let (mut writer, mut reader) = hand_off(4);
    for n in 0..100 {
        writer.offer(n, position(3, n as u16));
        writer.offer(n, steps(4, -1));
        let mut events = Vec::new();
        reader.poll(1000, &mut |at_us, event| events.push((at_us, event)));
        assert_eq!(events, [(n, position(3, n as u16)), (n, steps(4, -1))]);
    }
    assert_eq!((count(&reader.tally().replaced), count(&reader.tally().merged)), (0, 0));
}

#[test]
fn late_the_newest_position_of_each_knob_wins() {
    let (mut writer, mut reader) = hand_off(2);
    for n in 0..50 {
        writer.offer(n, position(0, n as u16));
        writer.offer(n, position(1, 1000 - n as u16));
    }
    assert_eq!(count(&reader.tally().waiting), 2);
    let first = heard(&mut reader);
    assert_eq!(first, [position(0, 0), position(1, 1000)], "what fitted, in order");
    // The next event finds the older ones in front of it.
    writer.offer(50, position(0, 50));
    assert_eq!(
        heard_out(&mut writer, &mut reader),
        [position(0, 49), position(1, 951), position(0, 50)]
    );
    assert_eq!(count(&reader.tally().replaced), 101 - 5);
    assert_eq!(count(&reader.tally().waiting), 0);
}

#[test]
fn late_steps_add_up_even_beyond_what_one_event_can_say() {
    let (mut writer, mut reader) = hand_off(1);
    writer.offer(0, position(9, 1));
    for n in 0..1000 {
        writer.offer(n, steps(7, if n % 10 == 0 { i16::MIN } else { -7 }));
        writer.offer(n, steps(8, if n % 2 == 0 { 5 } else { -5 }));
    }
    let mut sums = [0i64; 2];
    let events = heard_out(&mut writer, &mut reader);
    for event in &events {
        if let SourceEvent::Knob(KnobEvent {
            knob,
            reading: Reading::Steps(steps),
        }) = event
        {
            sums[usize::from(knob - 7)] += i64::from(*steps);
        }
    }
    assert_eq!(sums, [-100 * 32_768 - 900 * 7, 0]);
    assert_eq!(count(&reader.tally().merged), 2001 - events.len() as u64);
}

fn named(knob: u16, name: &str) -> SourceEvent {
    let name = Name::new(name);
    SourceEvent::Named { knob, name }
}

#[test]
fn what_happens_to_the_link_is_told_and_what_was_said_before_it_is_not() {
    let (mut writer, mut reader) = hand_off(1);
    writer.offer(0, position(0, 0));
    writer.offer(0, named(0, "jaw"));
    for n in 1..1000u64 {
        writer.offer(n, position(0, n as u16));
        writer.offer(n, steps(1, 1));
        writer.offer(n, SourceEvent::Unplugged);
        assert!(writer.backlog.entries.len() <= 2);
        writer.offer(n, SourceEvent::Replugged);
    }
    writer.offer(1000, position(0, 1000));
    let told = heard_out(&mut writer, &mut reader);
    let expected = [
        position(0, 0),
        SourceEvent::Unplugged,
        SourceEvent::Replugged,
        named(0, "jaw"),
        position(0, 1000),
    ];
    assert_eq!(told, expected);
    assert_eq!(count(&reader.tally().replaced), 2 * 999);
    assert_eq!(count(&reader.tally().waiting), 0);
}

#[test]
fn a_frame_that_knows_the_device_gone_hears_of_the_net_change_only() {
    let (mut writer, mut reader) = hand_off(1);
    writer.offer(0, SourceEvent::Unplugged);
    assert_eq!(heard(&mut reader), [SourceEvent::Unplugged]);
    writer.offer(1, named(3, "brow"));
    for _ in 0..5 {
        writer.offer(2, SourceEvent::Replugged);
        writer.offer(3, SourceEvent::Unplugged);
    }
    assert_eq!(heard_out(&mut writer, &mut reader), [named(3, "brow")], "still gone");
    writer.offer(4, named(3, "jaw"));
    writer.offer(5, SourceEvent::Replugged);
    assert_eq!(
        heard_out(&mut writer, &mut reader),
        [named(3, "jaw"), SourceEvent::Replugged]
    );
}

#[test]
fn times_never_run_back_and_never_lie_ahead() {
    let (mut writer, mut reader) = hand_off(1);
    for (at_us, knob) in [(5, 0), (6, 1), (7, 2), (9, 1)] {
        writer.offer(at_us, position(knob, 0));
    }
    let mut times = Vec::new();
    loop {
        reader.poll(8, &mut |at_us, _| times.push(at_us));
        if writer.flush() {
            break;
        }
    }
    reader.poll(20, &mut |at_us, _| times.push(at_us));
    assert_eq!(times, [5, 8, 8]);
}

/// Two threads, a frame that is now in time, now late: no knob ever steps back, the last value arrives, steps are all there, and
/// every event is accounted for.
#[test]
fn under_a_flood_nothing_is_lost_uncounted_or_comes_out_of_order() {
    const EVENTS: u64 = 200_000;
    const KNOBS: usize = 5;
    let (mut writer, mut reader) = hand_off(64);
    let flood = thread::spawn(move || {
        let mut offered = [0u64; KNOBS];
        let mut turned = 0i64;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for n in 0..EVENTS {
            let knob = random.random_range(0..KNOBS + 1);
            if let Some(value) = offered.get_mut(knob) {
                *value += 1;
                // A knob's value counts its own events.
                let full_scale = (*value >> 16) as u16;
                let reading = Reading::Position {
                    value: *value as u16,
                    full_scale,
                };
                let knob = knob as u16;
                writer.offer(n, SourceEvent::Knob(KnobEvent { knob, reading }));
            } else {
                let by = random.random_range(-40..90);
                turned += i64::from(by);
                writer.offer(n, steps(KNOBS as u16, by));
            }
        }
        while !writer.flush() {
            thread::yield_now();
        }
        (offered, turned)
    });
    let mut last = [0u64; KNOBS];
    let (mut turned, mut handed, mut polls) = (0i64, 0u64, 0u64);
    let mut listen = |reader: &mut Reader| {
        reader.poll(u64::MAX, &mut |_, event| {
            let SourceEvent::Knob(event) = event else {
                panic!("nothing happened to the link")
            };
            handed += 1;
            match event.reading {
                Reading::Position { value, full_scale } => {
                    let value = u64::from(full_scale) << 16 | u64::from(value);
                    let own = &mut last[usize::from(event.knob)];
                    assert!(value > *own, "knob {} went from {own} to {value}", event.knob);
                    *own = value;
                }
                Reading::Steps(steps) => turned += i64::from(steps),
            }
        });
    };
    while !flood.is_finished() {
        listen(&mut reader);
        polls += 1;
        if polls.is_multiple_of(8) {
            thread::sleep(core::time::Duration::from_micros(300));
        }
    }
    listen(&mut reader);
    assert_eq!(flood.join().unwrap(), (last, turned));
    let tally = reader.tally();
    let replaced = count(&tally.replaced);
    assert!(replaced > 0, "the frame was late");
    assert_eq!(handed + replaced + count(&tally.merged), EVENTS);
}
