//! Every protocol through a terminal, named and sniffed.

use sinew_knobs::device::Link;
use sinew_knobs::protocol::Recognition;

use super::*;

/// Turns a knob while another stands still, and expects the end of it.
fn check(dialect: Dialect, settings: SerialSettings) -> Bench {
    let mut bench = Bench::new(dialect, 3, settings);
    // The sniffer of a box that speaks only when turned needs a few words.
    bench.script("turn 1 0 0.75 600ms\nwait 700ms\nset 1 0.25\nset 2 1");
    if dialect == Dialect::Encoders {
        let expected = [0, 24 - 48, 48];
        bench.until("the steps", |bench| {
            [0, 1, 2].map(|knob| bench.turned(knob)) == expected
        });
    } else {
        let close = |position: Option<f32>, to: f32| {
            position.is_some_and(|position| (position - to).abs() <= 0.6 / f32::from(dialect.full_scale()))
        };
        bench.until("the positions", |bench| {
            close(bench.position(dialect.address(1)), 0.25) && close(bench.position(dialect.address(2)), 1.0)
        });
    }
    bench.settle();
    let status = bench.source.device_status();
    assert_eq!(
        (status.counters.bad, status.unplugs, status.replaced),
        (0, 0, 0),
        "{dialect}: {status:#?}"
    );
    assert_eq!(status.counters.bytes, bench.running.status().sent_bytes, "{dialect}");
    bench
}

#[test]
fn every_protocol_named() {
    thread::scope(|scope| {
        for dialect in Dialect::ALL {
            scope.spawn(move || check(dialect, named(dialect.protocol())));
        }
    });
}

#[test]
fn every_protocol_sniffed() {
    thread::scope(|scope| {
        // A Firmata board says nothing before it is asked, and is asked only by a host that knows it.
        for dialect in Dialect::ALL.into_iter().filter(|dialect| *dialect != Dialect::Firmata) {
            scope.spawn(move || {
                let bench = check_sniffed(dialect);
                let status = bench.source.device_status();
                assert!(status.confidence > 50, "{dialect}: {status:#?}");
            });
        }
    });
}

fn check_sniffed(dialect: Dialect) -> Bench {
    let mut bench = Bench::new(dialect, 3, SerialSettings::default());
    bench.script("turn 1 0 1 700ms\nwait 750ms\nturn 1 1 0.25 300ms\nwait 350ms\nrepeat");
    bench.until("the protocol", |bench| {
        let recognition = bench.source.device_status().recognition;
        let found = matches!(recognition, Recognition::Found(finding) if finding.protocol == dialect.protocol());
        found && bench.heard.len() > 10
    });
    bench
}

#[test]
fn a_hello_names_the_knobs() {
    let mut bench = Bench::new(Dialect::Packets, 20, named(Protocol::Packets));
    bench.until("the names", |bench| bench.source.device_status().names.len() == 20);
    let status = bench.source.device_status();
    assert_eq!(status.names[19].name, "knob19");
    assert_eq!(status.names[19].range, Some((0, 4095)));
    assert_eq!(status.firmware.as_deref(), Some("simulated 1"));
    assert_eq!((status.link, status.baud), (Link::Open, Some(115_200)));
}
