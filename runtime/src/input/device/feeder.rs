//! What every reader thread does with what its port gave: decode, stamp, hand over, count. And the frame's side of it.

use core::sync::atomic::Ordering;
use core::time::Duration;
use std::string::String;
use std::sync::Arc;

use std::time::Instant;
use std::vec::Vec;

use super::clock::Clock;
use super::hand_off::{Reader, Writer, hand_off};
use super::status::{Board, DeviceStatus, KnobName, Link};
use super::worker::Worker;
use crate::input::protocol::{Decoder, NAMES_MAX, Protocol, Settings};
use crate::input::{Counters, SourceEvent, SourceStatus};

/// How often the part of the status that people read is written, at most.
const DETAILS_EVERY: Duration = Duration::from_millis(50);

/// The reader thread's side of a device.
pub(super) struct Feeder {
    named: Option<Protocol>,
    settings: Settings,
    decoder: Decoder,
    /// What decoders counted that a wrong guess of the baud rate spoiled.
    earlier: Counters,
    clock: Clock,
    writer: Writer,
    board: Arc<Board>,
    link: Link,
    told: Instant,
    untold: bool,
}

/// The frame's side of a device, and the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Device {
    reader: Reader,
    board: Arc<Board>,
    _worker: Worker,
}

/// A feeder for a thread, and what [`Device::new`] needs besides the thread.
pub(super) fn feeder(
    named: Option<Protocol>,
    settings: Settings,
    clock: Clock,
    queue_events: usize,
    port: String,
) -> (Feeder, Reader, Arc<Board>) {
    let decoder = Decoder::new(named, settings);
    let board = Arc::new(Board::new(port, decoder.recognition()));
    let (writer, reader) = hand_off(queue_events);
    let feeder = Feeder {
        named,
        settings,
        decoder,
        earlier: Counters::NONE,
        clock,
        writer,
        board: board.clone(),
        link: Link::Waiting,
        told: Instant::now(),
        untold: false,
    };
    (feeder, reader, board)
}

impl Feeder {
    /// Bytes of a stream.
    pub(super) fn feed(&mut self, bytes: &[u8]) {
        self.take(|decoder, sink| decoder.feed(bytes, &mut |event| sink(event)));
    }

    /// One datagram.
    #[cfg(feature = "osc")]
    pub(super) fn feed_packet(&mut self, packet: &[u8]) {
        self.take(|decoder, sink| decoder.feed_packet(packet, &mut |event| sink(event)));
    }

    fn take(&mut self, read: impl FnOnce(&mut Decoder, &mut dyn FnMut(crate::input::KnobEvent))) {
        let at_us = self.clock.now_us();
        let before = self.decoder.counters().events;
        let writer = &mut self.writer;
        read(&mut self.decoder, &mut |event| {
            writer.offer(at_us, SourceEvent::Knob(event))
        });
        if self.decoder.counters().events != before {
            self.board.value_at(at_us);
        }
        self.board.count(&self.totals());
        self.untold = true;
    }

    /// Called at least every few milliseconds: moves what waits, and tells what is new.
    pub(super) fn idle(&mut self) {
        self.writer.flush();
        if self.untold && self.told.elapsed() >= DETAILS_EVERY {
            self.tell();
        }
    }

    /// Whether readings wait for room, so that the thread should look again soon.
    pub(super) fn is_behind(&mut self) -> bool {
        !self.writer.flush()
    }

    /// The port is open. The frame hears of it when it was gone before.
    pub(super) fn opened(&mut self, port: &str, baud: Option<u32>) {
        if self.link == Link::Lost {
            self.board.replugged();
            self.writer.offer(self.clock.now_us(), SourceEvent::Replugged);
        }
        self.link = Link::Open;
        {
            let mut details = self.board.details();
            details.port.clear();
            details.port.push_str(port);
            details.baud = baud;
        }
        self.tell();
    }

    /// The port is gone.
    pub(super) fn lost(&mut self, why: String) {
        self.decoder.reset();
        self.board.count(&self.totals());
        if self.link == Link::Open {
            self.board.unplugged();
            self.writer.offer(self.clock.now_us(), SourceEvent::Unplugged);
            self.link = Link::Lost;
        }
        self.failed(why);
    }

    /// The port could not be opened.
    pub(super) fn failed(&mut self, why: String) {
        self.board.details().last_error = Some(why);
        self.tell();
    }

    /// Begins anew with another baud rate; what was counted stays.
    #[cfg(feature = "serial")]
    pub(super) fn restart(&mut self, baud: u32) {
        self.decoder.reset();
        self.earlier = self.totals();
        self.decoder = Decoder::new(self.named, self.settings);
        self.board.details().baud = Some(baud);
        self.tell();
    }

    /// Totals since the source was opened.
    pub(super) fn totals(&self) -> Counters {
        let (a, b) = (&self.earlier, self.decoder.counters());
        Counters {
            bytes: a.bytes + b.bytes,
            good: a.good + b.good,
            ignored: a.ignored + b.ignored,
            bad: a.bad + b.bad,
            partial: a.partial + b.partial,
            dropped: a.dropped + b.dropped,
            clamped: a.clamped + b.clamped,
            unnamed: a.unnamed + b.unnamed,
            events: a.events + b.events,
            last_fault: b.last_fault.or(a.last_fault),
        }
    }

    pub(super) fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    fn tell(&mut self) {
        let decoder = &self.decoder;
        let name = |knob| {
            Some(KnobName {
                knob,
                name: String::from(decoder.name_of(knob)?),
                range: decoder.range_of(knob),
            })
        };
        let names: Vec<KnobName> = (0..NAMES_MAX as u16).filter_map(name).collect();
        let counters = self.totals();
        let mut details = self.board.details();
        details.link = self.link;
        details.recognition = decoder.recognition();
        details.confidence = decoder.confidence();
        details.counters = counters;
        details.firmware = decoder.firmware().map(String::from);
        details.names = names;
        drop(details);
        (self.told, self.untold) = (Instant::now(), false);
    }
}

impl Device {
    pub(super) fn new(reader: Reader, board: Arc<Board>, worker: Worker) -> Self {
        Self {
            reader,
            board,
            _worker: worker,
        }
    }

    pub(super) fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        self.reader.poll(now_us, sink);
    }

    pub(super) fn counts(&self) -> SourceStatus {
        self.board.counts(self.reader.tally().replaced.load(Ordering::Relaxed))
    }

    pub(super) fn status(&self) -> DeviceStatus {
        let counts = self.counts();
        let tally = self.reader.tally();
        let details = self.board.details();
        DeviceStatus {
            counts,
            link: details.link,
            port: details.port.clone(),
            baud: details.baud,
            recognition: details.recognition,
            confidence: details.confidence,
            counters: details.counters,
            merged: tally.merged.load(Ordering::Relaxed),
            waiting: tally.waiting.load(Ordering::Relaxed) + self.reader.queued() as u64,
            firmware: details.firmware.clone(),
            names: details.names.clone(),
            last_error: details.last_error.clone(),
        }
    }
}
