//! Frames that come late, floods, and the life of the thread.

use sinew_knobs::device::{Link, QUEUE_EVENTS, SerialError};

use super::*;

#[test]
fn steps_are_all_there_however_late_the_frame() {
    let settings = SerialSettings {
        queue_events: 4,
        ..named(Protocol::Packets)
    };
    let mut bench = Bench::new(Dialect::Encoders, 4, settings);
    bench.script("rate 1000\nturn 2 0 1 300ms\nwait 301ms\nturn 2 1 0.25 300ms\nturn 0 0.5 1 200ms");
    for _ in 0..3 {
        bench.frame(Duration::from_millis(250));
    }
    let expected = [96 - 48, 0, 24 - 48, 0];
    bench.until("the steps", |bench| {
        [0, 1, 2, 3].map(|knob| bench.turned(knob)) == expected
    });
    bench.settle();
    let status = bench.source.device_status();
    assert!(status.merged > 100, "{status:#?}");
    assert_eq!(
        (status.replaced, status.counters.dropped),
        (0, 0),
        "nothing of them is lost: {status:#?}"
    );
}

#[test]
fn the_newest_position_of_each_knob_wins() {
    let settings = SerialSettings {
        queue_events: 4,
        ..named(Protocol::Lines)
    };
    let mut bench = Bench::new(Dialect::Deej, 2, settings);
    bench.script("turn 0 0 1 200ms\nturn 1 1 0 200ms\nwait 200ms\nwait 50ms\nsilent 1000s");
    thread::sleep(Duration::from_millis(350));
    bench.until("the ends", |bench| {
        (bench.position(0), bench.position(1)) == (Some(1.0), Some(0.0))
    });
    bench.settle();
    let status = bench.source.device_status();
    assert!(status.replaced > 10, "{status:#?}");
}

/// Half a second at what a line of 1 Mbaud carries, on frames of 16 ms and one stall.
#[test]
fn a_flood_stays_within_its_bounds_and_in_order() {
    let mut bench = Bench::new(Dialect::Packets, 8, named(Protocol::Packets));
    bench.until("the first words", |bench| bench.heard.len() > 8);
    bench.script("rate 3700\nwait 500ms\nrate 100"); // frames of 27 bytes
    let mut most_waiting = 0;
    for n in 0..40 {
        bench.frame(Duration::from_millis(if n == 10 { 200 } else { 16 }));
        most_waiting = most_waiting.max(bench.source.device_status().waiting);
    }
    bench.settle();
    assert!(most_waiting <= QUEUE_EVENTS as u64 + 8, "{most_waiting}");
    let status = bench.source.device_status();
    assert_eq!((status.counters.bad, status.counters.dropped), (0, 0), "{status:#?}");
    assert!(status.counters.events > 5_000, "{status:#?}");
}

#[test]
fn a_dropped_source_lets_its_port_go() {
    let folder = folder();
    let port = Port::open(folder.path().join("box")).unwrap();
    let open = || SerialSource::open(selector(port.path()), SerialSettings::default(), Clock::start());
    let source = open().unwrap();
    let busy = open().unwrap_err();
    assert_eq!(
        busy,
        SerialError::Busy {
            path: port.path().to_string_lossy().into_owned()
        }
    );
    drop(source);
    open().expect("the thread has ended and closed the port");
}

#[test]
fn a_missing_port_is_an_error_or_is_waited_for() {
    let folder = folder();
    let path = folder.path().join("box");
    let refused = SerialSource::open(selector(&path), SerialSettings::default(), Clock::start()).unwrap_err();
    assert!(matches!(&refused, SerialError::Missing { .. }), "{refused:?}");
    assert!(refused.to_string().contains(&*path.to_string_lossy()));
    let settings = SerialSettings {
        wait: true,
        ..named(Protocol::Lines)
    };
    let clock = Clock::start();
    let mut source = SerialSource::open(selector(&path), settings, clock).unwrap();
    let status = source.device_status();
    assert_eq!(
        (status.link, status.last_error),
        (Link::Waiting, Some(refused.to_string()))
    );
    let mut port = Port::open(&path).unwrap();
    let (mut heard, begun) = (vec![], Instant::now());
    while heard.len() < 2 && begun.elapsed() < PATIENCE {
        port.send(b"100|200\n");
        source.poll(clock.now_us(), &mut |_, event| heard.push(event));
        thread::sleep(Duration::from_millis(5));
    }
    // The device that comes for the first time was never gone.
    assert!(
        heard.len() >= 2 && heard.iter().all(|event| matches!(event, SourceEvent::Knob(_))),
        "{heard:?}"
    );
    assert_eq!((source.device_status().unplugs, source.device_status().replugs), (0, 0));
}
