//! What every reader thread does with what its port gave: decode, stamp, hand over, count. And the frame's side of it.

use core::sync::atomic::Ordering;
use core::time::Duration;
use std::string::String;
use std::time::Instant;
use std::vec;
use std::vec::Vec;

use super::clock::Clock;
use super::hand_off::{Reader, Writer, hand_off};
use super::status::{DeviceStatus, KnobName, Link, SharedStatus};
use super::worker::Worker;
use crate::protocol::{Decoder, DecoderSettings, Name, OSC_NAMES_MAX, Protocol};
use crate::{Counters, KnobEvent, SourceEvent};

/// How often names and words are looked at anew, at most.
const WORDS_EVERY: Duration = Duration::from_millis(50);

/// The reader thread's side of a device.
pub(super) struct Feeder {
    named: Option<Protocol>,
    settings: DecoderSettings,
    decoder: Decoder,
    /// What decoders counted that a wrong guess of the baud rate spoiled.
    earlier: Counters,
    clock: Clock,
    writer: Writer,
    status: SharedStatus,
    link: Link,
    /// Names that the frame was told, by knob.
    told: Vec<Option<Name>>,
    looked: Instant,
    is_news: bool,
    /// Events of one piece of bytes.
    events: Vec<KnobEvent>,
}

/// The frame's side of a device, and the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Device {
    reader: Reader,
    status: SharedStatus,
    _worker: Worker,
}

/// A feeder for a thread, and what [`Device::new`] needs besides the thread.
pub(super) fn feeder(
    named: Option<Protocol>,
    settings: DecoderSettings,
    clock: Clock,
    queue_events: usize,
    port: String,
) -> (Feeder, Reader, SharedStatus) {
    let decoder = Decoder::new(named, settings);
    let status = SharedStatus::new(DeviceStatus::new(port, decoder.recognition()));
    let (writer, reader) = hand_off(queue_events);
    let feeder = Feeder {
        named,
        settings,
        decoder,
        earlier: Counters::NONE,
        clock,
        writer,
        status: status.clone(),
        link: Link::Waiting,
        told: vec![None; OSC_NAMES_MAX],
        looked: Instant::now(),
        is_news: false,
        events: Vec::new(),
    };
    (feeder, reader, status)
}

impl Feeder {
    /// Bytes of a stream.
    pub(super) fn feed(&mut self, bytes: &[u8]) {
        self.decode(|decoder, sink| decoder.feed(bytes, &mut |event| sink(event)));
    }

    /// One datagram.
    #[cfg(feature = "osc")]
    pub(super) fn feed_packet(&mut self, packet: &[u8]) {
        self.decode(|decoder, sink| decoder.feed_packet(packet, &mut |event| sink(event)));
    }

    fn decode(&mut self, read: impl FnOnce(&mut Decoder, &mut dyn FnMut(KnobEvent))) {
        let at_us = self.clock.now_us();
        let mut events = core::mem::take(&mut self.events);
        read(&mut self.decoder, &mut |event| events.push(event));
        for event in &events {
            // A name goes before its knob's first reading.
            self.tell_name(at_us, event.knob, true);
            self.writer.offer(at_us, SourceEvent::Knob(*event));
        }
        let totals = self.totals();
        let mut status = self.status.lock();
        status.counters = totals;
        if !events.is_empty() {
            status.last_value_us = Some(at_us);
        }
        drop(status);
        self.is_news = true;
        events.clear();
        self.events = events;
    }

    /// Tells the frame a name that it has not heard. With `new_only`, one that has another name by now waits for the next look.
    fn tell_name(&mut self, at_us: u64, knob: u16, new_only: bool) {
        let Some(told) = self.told.get_mut(usize::from(knob)) else {
            return;
        };
        if new_only && told.is_some() {
            return;
        }
        if let Some(&name) = self.decoder.name(knob)
            && *told != Some(name)
        {
            *told = Some(name);
            self.writer.offer(at_us, SourceEvent::Named { knob, name });
        }
    }

    /// Called at least every few milliseconds: moves what waits, and tells what is new.
    pub(super) fn idle(&mut self) {
        self.writer.flush();
        if self.is_news && self.looked.elapsed() >= WORDS_EVERY {
            self.tell_words();
        }
    }

    /// Whether readings wait for room, so that the thread should look again soon.
    pub(super) fn is_behind(&mut self) -> bool {
        !self.writer.flush()
    }

    /// The port is open. The frame hears of it when it was gone before.
    pub(super) fn opened(&mut self, port: &str, baud: Option<u32>) {
        let is_back = self.link == Link::Lost;
        self.link = Link::Open;
        {
            let mut status = self.status.lock();
            status.link = Link::Open;
            status.replugs += u64::from(is_back);
            status.port.clear();
            status.port.push_str(port);
            status.baud = baud;
        }
        if is_back {
            self.writer.offer(self.clock.now_us(), SourceEvent::Replugged);
        }
        self.tell_words();
    }

    /// The port is gone.
    pub(super) fn lost(&mut self, why: String) {
        self.decoder.reset();
        if self.link == Link::Open {
            self.link = Link::Lost;
            {
                let totals = self.totals();
                let mut status = self.status.lock();
                (status.link, status.counters) = (Link::Lost, totals);
                status.unplugs += 1;
            }
            self.writer.offer(self.clock.now_us(), SourceEvent::Unplugged);
        }
        self.failed(why);
    }

    /// The port could not be opened.
    pub(super) fn failed(&mut self, why: String) {
        self.status.lock().last_error = Some(why);
    }

    /// Begins anew with another baud rate; what was counted stays.
    #[cfg(feature = "serial")]
    pub(super) fn restart(&mut self, baud: u32) {
        self.decoder.reset();
        self.earlier = self.totals();
        self.decoder = Decoder::new(self.named, self.settings);
        self.status.lock().baud = Some(baud);
        self.tell_words();
    }

    /// Totals since the source was opened.
    pub(super) fn totals(&self) -> Counters {
        self.earlier.plus(self.decoder.counters())
    }

    pub(super) fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Names, protocol and firmware, for the frame and for people.
    fn tell_words(&mut self) {
        let at_us = self.clock.now_us();
        for knob in 0..OSC_NAMES_MAX as u16 {
            self.tell_name(at_us, knob, false);
        }
        let decoder = &self.decoder;
        let name = |knob| {
            Some(KnobName {
                knob,
                name: String::from(decoder.name_of(knob)?),
                range: decoder.range_of(knob),
            })
        };
        let names: Vec<KnobName> = (0..OSC_NAMES_MAX as u16).filter_map(name).collect();
        let totals = self.totals();
        let mut status = self.status.lock();
        status.counters = totals;
        status.recognition = decoder.recognition();
        status.confidence = decoder.confidence();
        status.firmware = decoder.firmware().map(String::from);
        status.names = names;
        drop(status);
        (self.looked, self.is_news) = (Instant::now(), false);
    }
}

impl Device {
    pub(super) fn new(reader: Reader, status: SharedStatus, worker: Worker) -> Self {
        Self {
            reader,
            status,
            _worker: worker,
        }
    }

    pub(super) fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        self.reader.poll(now_us, sink);
    }

    pub(super) fn status(&self) -> DeviceStatus {
        let tally = self.reader.tally();
        let mut status = self.status.lock().clone();
        status.replaced = tally.replaced.load(Ordering::Relaxed);
        status.merged = tally.merged.load(Ordering::Relaxed);
        status.waiting = tally.waiting.load(Ordering::Relaxed) + self.reader.queued() as u64;
        status
    }
}
