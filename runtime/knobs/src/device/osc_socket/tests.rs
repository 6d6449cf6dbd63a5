//! Datagrams that another library encoded, over the loopback.

use std::thread;
use std::time::Instant;

use rosc::{OscBundle, OscMessage, OscPacket, OscTime, OscType, encoder};

use super::*;
use crate::device::Link;
use crate::{KnobEvent, Reading};

const PATIENCE: Duration = Duration::from_secs(5);

fn local() -> OscSettings {
    OscSettings {
        address: SocketAddr::from((Ipv4Addr::LOCALHOST, 0)),
        ..OscSettings::default()
    }
}

fn message(address: &str, argument: OscType) -> OscPacket {
    OscPacket::Message(OscMessage {
        addr: address.into(),
        args: vec![argument],
    })
}

#[test]
fn messages_and_bundles_of_another_library_move_knobs() {
    let clock = Clock::start();
    let mut source = OscSource::open(local(), clock).unwrap();
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let bundle = OscPacket::Bundle(OscBundle {
        timetag: OscTime {
            seconds: 0,
            fractional: 1,
        },
        content: vec![
            message("/brow", OscType::Float(0.25)),
            message("/jaw", OscType::Float(1.0)),
        ],
    });
    for packet in [message("/jaw", OscType::Float(0.5)), bundle] {
        sender
            .send_to(&encoder::encode(&packet).unwrap(), source.address())
            .unwrap();
    }
    sender.send_to(b"no OSC", source.address()).unwrap();
    let (mut heard, begun) = (vec![], Instant::now());
    while (heard.len() < 5 || source.device_status().counters.bad < 1) && begun.elapsed() < PATIENCE {
        let now_us = clock.now_us();
        source.poll(now_us, &mut |at_us, event| {
            assert!(at_us <= now_us);
            let (knob, heard_of_it) = match event {
                SourceEvent::Named { knob, name } => (knob, name.to_string()),
                SourceEvent::Knob(KnobEvent {
                    knob,
                    reading: Reading::Position { value, full_scale },
                }) => {
                    let percent = f32::from(value) / f32::from(full_scale) * 100.0 + 0.5;
                    (knob, (percent as u32).to_string())
                }
                other => panic!("{other:?}"),
            };
            heard.push((knob, heard_of_it));
        });
        thread::sleep(Duration::from_millis(1));
    }
    let expected = [(0, "/jaw"), (0, "50"), (1, "/brow"), (1, "25"), (0, "100")];
    assert_eq!(heard, expected.map(|(knob, words)| (knob, words.to_string())));
    thread::sleep(Duration::from_millis(100));
    let status = source.device_status();
    let counts = status.counters;
    assert_eq!((counts.good, counts.bad, counts.events, status.replaced), (3, 1, 3, 0));
    let names: vec::Vec<_> = status.names.iter().map(|name| name.name.as_str()).collect();
    assert_eq!(names, ["/jaw", "/brow"]);
    assert_eq!((status.link, &status.port), (Link::Open, &source.address().to_string()));
    assert!(counts.last_fault.is_some());
}

#[test]
fn an_address_that_is_taken_is_named() {
    let first = OscSource::open(local(), Clock::start()).unwrap();
    let settings = OscSettings {
        address: first.address(),
        ..OscSettings::default()
    };
    let error = OscSource::open(settings, Clock::start()).unwrap_err();
    assert_eq!(
        error,
        OscError::InUse {
            address: first.address()
        }
    );
    assert!(error.to_string().contains(&first.address().to_string()));
    drop(first);
    OscSource::open(settings, Clock::start()).expect("its thread has ended and the address is free");
}
