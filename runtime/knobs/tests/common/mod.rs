//! Streams as devices send them, for the tests of the protocols, and an ear that writes down what a decoder says.

use rand::{Rng, RngCore};
use sinew_knobs::{
    Counters, Decoder, DecoderSettings, KnobEvent, Protocol,
    protocol::{Coding, FrameKind, write_frame},
};

/// All protocols, in the order of [`Protocol::ALL`].
pub const PROTOCOLS: [Protocol; 5] = Protocol::ALL;

/// One encoder, all else as it comes.
pub fn settings() -> DecoderSettings {
    let mut settings = DecoderSettings::default();
    settings.midi.set_coding(70, Coding::SignedBit);
    settings
}

/// All that a decoder tells.
#[derive(Debug, PartialEq, Eq)]
pub struct Heard {
    pub events: Vec<KnobEvent>,
    pub counters: Counters,
    pub names: Vec<Option<String>>,
    pub protocol: Option<Protocol>,
    pub confidence: u8,
    pub recognition: String,
}

/// Feeds the chunks and writes down what comes of them.
pub fn hear<'a>(mut decoder: Decoder, chunks: impl IntoIterator<Item = &'a [u8]>) -> Heard {
    let mut events = Vec::new();
    for chunk in chunks {
        decoder.feed(chunk, &mut |event| events.push(event));
    }
    Heard {
        events,
        counters: *decoder.counters(),
        names: (0..70).map(|knob| decoder.name_of(knob).map(str::to_owned)).collect(),
        protocol: decoder.protocol(),
        confidence: decoder.confidence(),
        recognition: decoder.recognition().to_string(),
    }
}

/// A stream of so many messages, with what real devices mix in.
pub fn stream(protocol: Protocol, message_count: usize, random: &mut impl RngCore) -> Vec<u8> {
    let mut bytes = Vec::new();
    let labelled = random.random_bool(0.5);
    let separator = ['|', ',', ';', '\t', ' '][random.random_range(0..5)];
    let knob_count = random.random_range(2..9_u16);
    let mut sequence = random.random_range(0..255_u8);
    let channel = random.random_range(0..16_u8);
    for message in 0..message_count {
        match protocol {
            Protocol::Lines => {
                let fields = (0..knob_count).map(|knob| {
                    let value = random.random_range(0..1024);
                    if labelled {
                        format!("k{knob}:{value}")
                    } else {
                        value.to_string()
                    }
                });
                let line = fields.collect::<Vec<_>>().join(&separator.to_string());
                bytes.extend(format!("{line}\r\n").bytes());
                if message % 16 == 9 {
                    bytes.extend(b"loop took 12 ms\n");
                }
            }
            Protocol::Packets => {
                let mut payload = vec![0, knob_count as u8];
                payload.extend(1023_u16.to_le_bytes());
                for _ in 0..knob_count {
                    payload.extend(random.random_range(0..1024_u16).to_le_bytes());
                }
                extend_frame(&mut bytes, FrameKind::Values, sequence, &payload);
                sequence = sequence.wrapping_add(1);
                if message % 16 == 0 {
                    let hello = [&[0, 2, 0, 1, 3][..], b"box", &[0, 0, 0xff, 3, 3], b"jaw"].concat();
                    extend_frame(&mut bytes, FrameKind::Hello, sequence, &hello);
                    sequence = sequence.wrapping_add(1);
                }
            }
            Protocol::Midi => {
                let mut data = || random.random_range(0..128_u8);
                match message % 5 {
                    0 => bytes.extend([0xb0 | channel, 70, data() | 1, 70, data() | 1]),
                    1 => bytes.extend([0xb0 | channel, 3, data(), 35, data()]),
                    2 => bytes.extend([0xb0 | channel, 0xf8, 80, data(), 0xb0 | channel, 81, data()]),
                    3 if message % 25 == 3 => bytes.extend([0xf0, 1, 2, 3, 0xf7, 0xb0 | channel, 4, data()]),
                    _ => bytes.extend([0xb0 | channel, 5, data()]),
                }
            }
            Protocol::Firmata => {
                if message == 0 {
                    bytes.extend(b"\xf9\x02\x05\xf0\x79\x02\x05B\x00\xf7");
                }
                for pin in 0..knob_count as u8 {
                    let value = random.random_range(0..1024_u16);
                    bytes.extend([0xe0 | pin, (value & 0x7f) as u8, (value >> 7) as u8]);
                }
                if message % 7 == 3 {
                    bytes.extend(b"\x90\x04\x00\xf0\x71H\x00i\x00\xf7");
                }
            }
            Protocol::Osc => extend_slip(&mut bytes, &datagram(message, random)),
            _ => unreachable!("all protocols have a stream"),
        }
    }
    bytes
}

/// A stream of a device whose knobs all stand at the upper end.
pub fn at_the_top(protocol: Protocol, message_count: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for message in 0..message_count {
        match protocol {
            Protocol::Lines => bytes.extend(b"1023|1023|1023\r\n"),
            Protocol::Packets => {
                let payload = [0, 2, 0xff, 3, 0xff, 3, 0xff, 3];
                extend_frame(&mut bytes, FrameKind::Values, message as u8, &payload);
            }
            Protocol::Midi => bytes.extend(b"\xb0\x50\x7f\x51\x7f\xe1\x7f\x7f"),
            Protocol::Firmata => bytes.extend(b"\xe0\x7f\x07\xe1\x7f\x07"),
            Protocol::Osc => {
                let packet = [
                    &b"/abc/def/jaw\0\0\0\0,ff\0"[..],
                    &1_f32.to_be_bytes(),
                    &1_f32.to_be_bytes(),
                ]
                .concat();
                extend_slip(&mut bytes, &packet);
            }
            _ => unreachable!("all protocols have a stream"),
        }
    }
    bytes
}

/// OSC packets as they come over UDP.
pub fn datagrams(count: usize, random: &mut impl RngCore) -> Vec<Vec<u8>> {
    (0..count).map(|message| datagram(message, random)).collect()
}

fn datagram(message: usize, random: &mut impl RngCore) -> Vec<u8> {
    let value = random.random_range(0.0..1.0_f32).to_be_bytes();
    let float = |address: &[u8]| [address, b",f\0\0", &value].concat();
    match message % 3 {
        0 => float(b"/jaw\0\0\0\0"),
        1 => [&b"/VMC/Ext/Blend/Val\0\0,sf\0Joy\0"[..], &value].concat(),
        _ => {
            let mut bundle = b"#bundle\0\0\0\0\0\0\0\0\x01".to_vec();
            for address in [&b"/brow\0\0\0"[..], b"/lid\0\0\0\0"] {
                let element = float(address);
                bundle.extend((element.len() as u32).to_be_bytes());
                bundle.extend(element);
            }
            bundle
        }
    }
}

fn extend_frame(bytes: &mut Vec<u8>, kind: FrameKind, sequence: u8, payload: &[u8]) {
    let mut frame = [0; 256];
    let length = write_frame(kind, sequence, payload, &mut frame).unwrap();
    bytes.extend(&frame[..length]);
}

fn extend_slip(bytes: &mut Vec<u8>, packet: &[u8]) {
    for &byte in packet {
        match byte {
            0xc0 => bytes.extend([0xdb, 0xdc]),
            0xdb => bytes.extend([0xdb, 0xdd]),
            _ => bytes.push(byte),
        }
    }
    bytes.push(0xc0);
}
