//! Cables that are pulled, garbage, messages cut in half: what is heard stays true, and what is not is counted.

use super::*;

#[test]
fn a_pulled_cable_is_told_and_the_box_is_found_again() {
    let mut bench = Bench::new(Dialect::Labels, 3, named(Protocol::Lines));
    bench.script("wander on");
    bench.until("the first words", |bench| bench.heard.len() > 30);
    for n in 1..=2 {
        bench.script("unplug 100ms");
        bench.until("the replug", |bench| bench.source.device_status().replugs == n);
        let known = bench.heard.len();
        bench.until("new words", |bench| bench.heard.len() > known + 30);
    }
    let story = [SourceEvent::Unplugged, SourceEvent::Replugged].repeat(2);
    assert_eq!(bench.links(), story);
    bench.script("wander off\nset 2 0.75");
    bench.until("the position", |bench| {
        bench.position(2).is_some_and(|position| (position - 0.75).abs() < 1e-3)
    });
    bench.settle();
    let counts = bench.source.device_status();
    assert_eq!((counts.unplugs, counts.replugs), (2, 2));
    // A knob has the same number after a replug.
    let names: Vec<_> = bench
        .source
        .device_status()
        .names
        .into_iter()
        .map(|name| name.name)
        .collect();
    assert_eq!(names, ["knob0", "knob1", "knob2"]);
}

#[test]
fn garbage_and_cuts_are_counted_and_the_values_after_them_are_right() {
    thread::scope(|scope| {
        for dialect in [
            Dialect::Deej,
            Dialect::Csv,
            Dialect::Packets,
            Dialect::Midi14,
            Dialect::Firmata,
            Dialect::Osc,
        ] {
            scope.spawn(move || {
                let mut bench = Bench::new(dialect, 4, named(dialect.protocol()));
                bench.script("wander on");
                bench.until("the first words", |bench| bench.heard.len() > 20);
                bench.script(
                    "noise 2\ngarbage 40\nwait 40ms\ncut\nwait 40ms\ngarbage 200\nburst 20\nwait 40ms\ncut\nwait 20ms",
                );
                thread::sleep(Duration::from_millis(200));
                // Two places, one after the other: a box that speaks only when turned says both halves anew.
                bench.script("wander off\nnoise 0\nset 3 0.1\nwait 50ms\nset 3 0.9\nwait 50ms\nset 3 0.6");
                bench.until("the position", |bench| {
                    let position = bench.position(dialect.address(3));
                    position.is_some_and(|position| (position - 0.6).abs() < 2e-3)
                });
                bench.settle();
                let status = bench.source.device_status();
                assert!(status.counters.bad > 0, "{dialect}: {status:#?}");
                assert!(status.counters.last_fault.is_some(), "{dialect}");
            });
        }
    });
}

/// The cable goes after each byte of a message; each time the rest of it is no value, and the next whole line is.
#[test]
fn a_cable_may_be_pulled_at_every_byte() {
    const LINE: &[u8] = b"111|222\r\n333|444\r\n";
    let folder = folder();
    let mut port = Port::open(folder.path().join("box")).unwrap();
    let clock = Clock::start();
    let mut source = SerialSource::open(selector(port.path()), named(Protocol::Lines), clock).unwrap();
    let mut heard = Vec::new();
    let wait = |source: &mut SerialSource, heard: &mut Vec<SourceEvent>, is_so: &dyn Fn(&SerialSource) -> bool| {
        let begun = Instant::now();
        while !is_so(source) {
            assert!(begun.elapsed() < PATIENCE, "{:#?}", source.device_status());
            thread::sleep(Duration::from_micros(300));
        }
        source.poll(clock.now_us(), &mut |_, event| heard.push(event));
    };
    let event = |knob, value| {
        let reading = Reading::Position {
            value,
            full_scale: 1023,
        };
        SourceEvent::Knob(KnobEvent { knob, reading })
    };
    let mut bytes = 0;
    for cut in 0..=LINE.len() {
        heard.clear();
        // The opening line is taken for cut, as it may be. A carriage return ends a line as well.
        for part in [b"999|999\n".as_slice(), &LINE[..cut]] {
            assert_eq!(port.send(part), part.len());
            bytes += part.len() as u64;
        }
        wait(&mut source, &mut heard, &|source| {
            source.device_status().counters.bytes == bytes
        });
        port.unplug();
        wait(&mut source, &mut heard, &|source| {
            source.device_status().unplugs == cut as u64 + 1
        });
        port.plug().unwrap();
        wait(&mut source, &mut heard, &|source| {
            source.device_status().replugs == cut as u64 + 1
        });
        // It counts before it tells.
        let begun = Instant::now();
        while heard.last() != Some(&SourceEvent::Replugged) && begun.elapsed() < PATIENCE {
            source.poll(clock.now_us(), &mut |_, event| heard.push(event));
        }
        let mut expected = Vec::new();
        if cut >= 8 {
            expected.extend([event(0, 111), event(1, 222)]);
        }
        if cut >= 17 {
            expected.extend([event(0, 333), event(1, 444)]);
        }
        expected.extend([SourceEvent::Unplugged, SourceEvent::Replugged]);
        assert_eq!(heard, expected, "cut after {cut} bytes");
    }
    assert_eq!(source.device_status().counters.bad, 0, "a pulled cable is no bad line");
}
