//! The hand-off from a reader thread to the frame: one writer, one reader, bounded, without locks.
//!
//! Events go through a queue. When the frame is late and the queue is full, the writer keeps a backlog in memory of its
//! own, where a knob's newest position replaces the older one and its steps add up, and moves it into the queue, in order,
//! as soon as there is room. Why not a table of newest values that both threads share: handing it over between them
//! without a lock can bring an older value of a knob behind a newer one; this cannot.

use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use crossbeam::queue::ArrayQueue;

use crate::input::{KnobEvent, Reading, SourceEvent};

/// What both ends share.
#[derive(Debug)]
struct Channel {
    queue: ArrayQueue<(u64, SourceEvent)>,
    /// Events pushed so far, wrapping. The reader takes no more than these, so a push that is under way, perhaps in a
    /// thread that the system has put to sleep, never makes it spin.
    published: AtomicUsize,
    tally: Tally,
}

/// What the hand-off counts. Every reading offered ends in exactly one of handed over, `replaced` and `merged`, or waits.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// Positions that a newer one of their knob replaced.
    pub(super) replaced: AtomicU64,
    /// Steps that were added to others.
    pub(super) merged: AtomicU64,
    /// Readings in the backlog.
    pub(super) waiting: AtomicU64,
}

/// The reader thread's end.
#[derive(Debug)]
pub(super) struct Writer {
    channel: Arc<Channel>,
    backlog: Backlog,
}

/// The frame's end.
#[derive(Debug)]
pub(super) struct Reader {
    channel: Arc<Channel>,
    taken: usize,
    last_us: u64,
}

/// A hand-off with room for so many events, at least one.
pub(super) fn hand_off(queue_events: usize) -> (Writer, Reader) {
    let channel = Arc::new(Channel {
        queue: ArrayQueue::new(queue_events.max(1)),
        published: AtomicUsize::new(0),
        tally: Tally::default(),
    });
    let writer = Writer {
        channel: channel.clone(),
        backlog: Backlog::default(),
    };
    let reader = Reader {
        channel,
        taken: 0,
        last_us: 0,
    };
    (writer, reader)
}

impl Channel {
    fn push(&self, at_us: u64, event: SourceEvent) -> bool {
        let pushed = self.queue.push((at_us, event)).is_ok();
        if pushed {
            self.published.fetch_add(1, Ordering::Release);
        }
        pushed
    }
}

impl Writer {
    /// Hands an event over, now or as soon as there is room. Never blocks.
    pub(super) fn offer(&mut self, at_us: u64, event: SourceEvent) {
        self.flush();
        if !self.backlog.is_empty() || !self.channel.push(at_us, event) {
            match event {
                SourceEvent::Knob(event) => self.backlog.add(at_us, event, &self.channel.tally),
                link => self.backlog.add_link(at_us, link, &self.channel.tally),
            }
            self.publish();
        }
    }

    /// Moves what waits into the queue, as far as there is room. Returns whether nothing waits any more.
    pub(super) fn flush(&mut self) -> bool {
        if !self.backlog.is_empty() {
            let Self { channel, backlog } = self;
            backlog.drain(&channel.tally, |at_us, event| channel.push(at_us, event));
            self.publish();
        }
        self.backlog.is_empty()
    }

    fn publish(&self) {
        let waiting = self.backlog.reading_count();
        self.channel.tally.waiting.store(waiting, Ordering::Relaxed);
    }
}

impl Reader {
    /// Takes everything that had been handed over when the call began.
    pub(super) fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        let ready = self.channel.published.load(Ordering::Acquire).wrapping_sub(self.taken);
        for _ in 0..ready {
            let Some((at_us, event)) = self.channel.queue.pop() else {
                break;
            };
            self.taken = self.taken.wrapping_add(1);
            // A backlog is in order of each knob, not of all times; what the sink sees never runs back.
            self.last_us = at_us.max(self.last_us).min(now_us);
            sink(self.last_us, event);
        }
    }

    pub(super) fn tally(&self) -> &Tally {
        &self.channel.tally
    }

    /// Events in the queue.
    pub(super) fn queued(&self) -> usize {
        self.channel.queue.len()
    }
}

/// What waits of one knob.
#[derive(Debug, Clone, Copy)]
struct Entry {
    at_us: u64,
    knob: u16,
    held: Held,
}

#[derive(Debug, Clone, Copy)]
enum Held {
    Position { value: u16, full_scale: u16 },
    Steps { sum: i64, events: u64 },
}

impl Entry {
    fn new(at_us: u64, event: KnobEvent) -> Self {
        let held = match event.reading {
            Reading::Position { value, full_scale } => Held::Position { value, full_scale },
            Reading::Steps(steps) => Held::Steps {
                sum: steps.into(),
                events: 1,
            },
        };
        Self {
            at_us,
            knob: event.knob,
            held,
        }
    }

    fn key(&self) -> (u16, bool) {
        (self.knob, matches!(self.held, Held::Steps { .. }))
    }

    fn reading_count(&self) -> u64 {
        match self.held {
            Held::Position { .. } => 1,
            Held::Steps { events, .. } => events,
        }
    }
}

/// Readings between two changes of the link, one entry a knob in order of the first, then the change that follows them.
#[derive(Debug, Default)]
struct Segment {
    entries: VecDeque<Entry>,
    /// Number of the first entry; entries are numbered on and on, so that taking one leaves the index right.
    first: u64,
    index: HashMap<(u16, bool), u64>,
    link: Option<(u64, SourceEvent)>,
}

impl Segment {
    fn add(&mut self, entry: Entry, tally: &Tally) {
        let end = self.first + self.entries.len() as u64;
        let number = self.index.entry(entry.key()).or_insert(end);
        if *number < self.first || *number == end {
            *number = end;
            self.entries.push_back(entry);
            return;
        }
        let own = &mut self.entries[(*number - self.first) as usize];
        own.at_us = entry.at_us;
        match (&mut own.held, entry.held) {
            (
                Held::Steps { sum, events },
                Held::Steps {
                    sum: more,
                    events: count,
                },
            ) => {
                *sum = sum.saturating_add(more);
                *events += count;
            }
            (held, newer) => {
                tally.replaced.fetch_add(1, Ordering::Relaxed);
                *held = newer;
            }
        }
    }

    /// Hands entries to `push` until it refuses; returns whether all are gone.
    fn drain(&mut self, tally: &Tally, push: &mut impl FnMut(u64, SourceEvent) -> bool) -> bool {
        while let Some(entry) = self.entries.front_mut() {
            let reading = match entry.held {
                Held::Position { value, full_scale } => Reading::Position { value, full_scale },
                Held::Steps { sum, .. } => Reading::Steps(sum.clamp(i16::MIN.into(), i16::MAX.into()) as i16),
            };
            let nothing = matches!(reading, Reading::Steps(0));
            let knob = entry.knob;
            if !nothing && !push(entry.at_us, SourceEvent::Knob(KnobEvent { knob, reading })) {
                return false;
            }
            if let (Held::Steps { sum, events }, Reading::Steps(steps)) = (&mut entry.held, reading) {
                *sum -= i64::from(steps);
                *events -= u64::from(!nothing);
                if *sum != 0 {
                    continue; // more than one event can say; the rest follows
                }
                tally.merged.fetch_add(*events, Ordering::Relaxed);
            }
            self.entries.pop_front();
            self.first += 1;
        }
        self.index.clear();
        true
    }
}

/// What found no room. Bounded: two entries for each of 65,536 knobs and at most three changes of the link.
#[derive(Debug, Default)]
struct Backlog {
    segments: VecDeque<Segment>,
}

impl Backlog {
    fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    fn reading_count(&self) -> u64 {
        let entries = self.segments.iter().flat_map(|segment| &segment.entries);
        entries.map(Entry::reading_count).sum()
    }

    fn last(&mut self) -> &mut Segment {
        if self.segments.back().is_none_or(|last| last.link.is_some()) {
            self.segments.push_back(Segment::default());
        }
        let last = self.segments.len() - 1;
        &mut self.segments[last]
    }

    fn add(&mut self, at_us: u64, event: KnobEvent, tally: &Tally) {
        self.last().add(Entry::new(at_us, event), tally);
    }

    fn add_link(&mut self, at_us: u64, link: SourceEvent, tally: &Tally) {
        self.last().link = Some((at_us, link));
        // Gone, back, gone: for a frame that heard of none of it, the device went once.
        let [.., first, second, third] = self.segments.make_contiguous() else {
            return;
        };
        let told = [&*first, second, third].map(|segment| segment.link.map(|(_, link)| link));
        let (gone, back) = (Some(SourceEvent::Unplugged), Some(SourceEvent::Replugged));
        if told == [gone, back, gone] {
            for entry in second.entries.drain(..).chain(third.entries.drain(..)) {
                first.add(entry, tally);
            }
            self.segments.truncate(self.segments.len() - 2);
        }
    }

    fn drain(&mut self, tally: &Tally, mut push: impl FnMut(u64, SourceEvent) -> bool) {
        while let Some(segment) = self.segments.front_mut() {
            if !segment.drain(tally, &mut push) {
                return;
            }
            if let Some((at_us, link)) = segment.link
                && !push(at_us, link)
            {
                return;
            }
            self.segments.pop_front();
        }
    }
}

#[cfg(test)]
mod tests;
