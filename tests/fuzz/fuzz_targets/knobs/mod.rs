//! What the fuzz targets of knob boxes share: one parser, or the sniffer, on bytes: no panic, no reading outside its scale,
//! and the same events in one piece, in many, and around a reset.
//!
//! Bytes of an input: settings, length of the pieces, then what the device sends.

use sinew_knobs::{
    Decoder, DecoderSettings, FullScale, KnobEvent, Protocol, Reading,
    protocol::{Coding, Pairing},
};

/// Checks one parser on an input; with no protocol named, the sniffer.
pub fn check(protocol: Option<Protocol>, data: &[u8]) {
    let [choice, chunk, bytes @ ..] = data else { return };
    let mut settings = DecoderSettings::default();
    if choice & 1 != 0 {
        settings.full_scale = FullScale::Fixed(u16::from(*choice) * 257);
    }
    settings.midi.pairing = [Pairing::Learned, Pairing::Always, Pairing::Never][usize::from(choice >> 1) % 3];
    if choice & 0x40 != 0 {
        settings.midi.set_all_codings(Coding::TwosComplement);
    }
    let mut whole = Decoder::new(protocol, settings);
    let mut events = Vec::new();
    whole.feed(bytes, &mut |event: KnobEvent| {
        if let Reading::Position { value, full_scale } = event.reading {
            assert!(full_scale >= 1 && value <= full_scale);
        }
        events.push(event);
    });
    assert_eq!(whole.counters().bytes, bytes.len() as u64);
    assert_eq!(whole.counters().events, events.len() as u64);
    assert!(
        events.len() <= bytes.len(),
        "a byte makes one reading at most; the C interface counts on it"
    );

    let mut pieces = Decoder::new(protocol, settings);
    let mut expected = events.iter();
    for piece in bytes.chunks(usize::from(*chunk).max(1)) {
        pieces.feed(piece, &mut |event| assert_eq!(Some(&event), expected.next()));
    }
    assert!(expected.next().is_none());
    assert_eq!(pieces.counters(), whole.counters());
    assert_eq!(pieces.recognition(), whole.recognition());

    whole.reset();
    for piece in bytes.chunks(usize::from(*chunk).max(1)) {
        whole.feed_packet(piece, &mut |_| ());
    }
    for knob in [0, 63, 64, u16::MAX] {
        let _ = (whole.name_of(knob), whole.range_of(knob));
    }
    let _ = (
        whole.firmware(),
        whole.knob_count(),
        whole.confidence(),
        whole.recognition().to_string(),
    );
}
