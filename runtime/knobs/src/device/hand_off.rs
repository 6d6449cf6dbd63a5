//! The hand-off from a reader thread to the frame: one writer, one reader, bounded, without locks.
//!
//! Events go through a queue. When the frame is late and the queue is full, the writer keeps a backlog in memory of its own,
//! where a knob's newest position replaces the older one and its steps add up, and moves it into the queue as soon as there is
//! room. What the device said before it went or came back does not outlive that: the surface forgets it then anyway.

use core::sync::atomic::{AtomicU64, Ordering};
use std::collections::BTreeMap;
use std::sync::Arc;

use rtrb::{Consumer, Producer, RingBuffer};

use crate::protocol::Name;
use crate::{KnobEvent, Reading, SourceEvent};

/// What the hand-off counts. Every reading offered ends in exactly one of handed over, `replaced` and `merged`, or waits.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// Readings that never reached the frame: a newer one of their knob did, or the device went.
    pub(super) replaced: AtomicU64,
    /// Steps that were added to others.
    pub(super) merged: AtomicU64,
    /// Readings in the backlog.
    pub(super) waiting: AtomicU64,
}

/// The reader thread's end.
#[derive(Debug)]
pub(super) struct Writer {
    queue: Producer<(u64, SourceEvent)>,
    backlog: Backlog,
    tally: Arc<Tally>,
}

/// The frame's end.
#[derive(Debug)]
pub(super) struct Reader {
    queue: Consumer<(u64, SourceEvent)>,
    last_us: u64,
    tally: Arc<Tally>,
}

/// A hand-off with room for so many events, at least one.
pub(super) fn hand_off(queue_events: usize) -> (Writer, Reader) {
    let (producer, consumer) = RingBuffer::new(queue_events.max(1));
    let tally = Arc::new(Tally::default());
    let writer = Writer {
        queue: producer,
        backlog: Backlog::default(),
        tally: tally.clone(),
    };
    let reader = Reader {
        queue: consumer,
        last_us: 0,
        tally,
    };
    (writer, reader)
}

impl Writer {
    /// Hands an event over, now or as soon as there is room. Never blocks.
    pub(super) fn offer(&mut self, at_us: u64, event: SourceEvent) {
        if !self.flush() || self.queue.push((at_us, event)).is_err() {
            self.backlog.add(at_us, event, &self.tally);
        }
    }

    /// Moves what waits into the queue, as far as there is room. Returns whether nothing waits any more.
    pub(super) fn flush(&mut self) -> bool {
        if self.backlog.is_empty() {
            return true;
        }
        let Self { queue, backlog, tally } = self;
        backlog.drain(tally, |at_us, event| queue.push((at_us, event)).is_ok());
        self.backlog.is_empty()
    }
}

impl Reader {
    /// Takes everything that had been handed over when the call began.
    pub(super) fn poll(&mut self, now_us: u64, sink: &mut dyn FnMut(u64, SourceEvent)) {
        let ready = self.queue.slots();
        // So many are there: nobody else takes any.
        let Ok(events) = self.queue.read_chunk(ready) else {
            return;
        };
        for (at_us, event) in events {
            // A backlog is in order of each knob, not of all times; what the sink sees never runs back.
            self.last_us = at_us.max(self.last_us).min(now_us);
            sink(self.last_us, event);
        }
    }

    pub(super) fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Events in the queue.
    pub(super) fn queued(&self) -> usize {
        self.queue.slots()
    }
}

/// What waits of one knob: its name first, for whoever reads its position wants to know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Name,
    Position,
    Steps,
}

#[derive(Debug, Clone, Copy)]
enum Held {
    Name(Name),
    Position { value: u16, full_scale: u16 },
    Steps { sum: i64, events: u64 },
}

impl Held {
    fn reading_count(&self) -> u64 {
        match self {
            Self::Name(_) => 0,
            Self::Position { .. } => 1,
            Self::Steps { events, .. } => *events,
        }
    }
}

/// What the frame has still to hear of the link.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Link {
    #[default]
    AsTold,
    Gone(u64),
    Back(u64),
    GoneAndBack(u64, u64),
}

/// What found no room. Bounded: at most three entries for each of 65,536 knobs.
#[derive(Debug, Default)]
struct Backlog {
    link: Link,
    entries: BTreeMap<(u16, Kind), (u64, Held)>,
}

impl Backlog {
    fn is_empty(&self) -> bool {
        self.link == Link::AsTold && self.entries.is_empty()
    }

    fn add(&mut self, at_us: u64, event: SourceEvent, tally: &Tally) {
        let (key, held) = match event {
            SourceEvent::Named { knob, name } => ((knob, Kind::Name), Held::Name(name)),
            SourceEvent::Knob(KnobEvent { knob, reading }) => match reading {
                Reading::Position { value, full_scale } => {
                    ((knob, Kind::Position), Held::Position { value, full_scale })
                }
                Reading::Steps(steps) => {
                    let sum = steps.into();
                    ((knob, Kind::Steps), Held::Steps { sum, events: 1 })
                }
            },
            SourceEvent::Unplugged | SourceEvent::Replugged => return self.add_link(at_us, event, tally),
        };
        tally.waiting.fetch_add(held.reading_count(), Ordering::Relaxed);
        let Some((own_us, own)) = self.entries.get_mut(&key) else {
            self.entries.insert(key, (at_us, held));
            return;
        };
        *own_us = at_us;
        match (own, held) {
            (Held::Steps { sum, events }, Held::Steps { sum: more, .. }) => {
                *sum = sum.saturating_add(more);
                *events += 1;
            }
            (own, newer) => {
                count_out(&tally.replaced, own.reading_count(), tally);
                *own = newer;
            }
        }
    }

    fn add_link(&mut self, at_us: u64, event: SourceEvent, tally: &Tally) {
        self.entries.retain(|(_, kind), (_, held)| {
            count_out(&tally.replaced, held.reading_count(), tally);
            *kind == Kind::Name
        });
        let gone = event == SourceEvent::Unplugged;
        self.link = match self.link {
            Link::AsTold if gone => Link::Gone(at_us),
            Link::AsTold => Link::Back(at_us),
            Link::Gone(since) if !gone => Link::GoneAndBack(since, at_us),
            // It came back and went before the frame heard of it: it is still gone.
            Link::Back(_) if gone => Link::AsTold,
            Link::GoneAndBack(since, _) if gone => Link::Gone(since),
            told => told,
        };
    }

    /// Hands what waits to `push` until it refuses.
    fn drain(&mut self, tally: &Tally, mut push: impl FnMut(u64, SourceEvent) -> bool) {
        if let Link::Gone(at_us) | Link::GoneAndBack(at_us, _) = self.link {
            if !push(at_us, SourceEvent::Unplugged) {
                return;
            }
            self.link = match self.link {
                Link::GoneAndBack(_, at_us) => Link::Back(at_us),
                _ => Link::AsTold,
            };
        }
        if let Link::Back(at_us) = self.link {
            if !push(at_us, SourceEvent::Replugged) {
                return;
            }
            self.link = Link::AsTold;
        }
        while let Some(mut entry) = self.entries.first_entry() {
            let ((knob, _), (at_us, held)) = (*entry.key(), *entry.get());
            let knob_event = |reading| SourceEvent::Knob(KnobEvent { knob, reading });
            let (event, rest) = match held {
                Held::Name(name) => (SourceEvent::Named { knob, name }, None),
                Held::Position { value, full_scale } => (knob_event(Reading::Position { value, full_scale }), None),
                Held::Steps { sum: 0, events } => {
                    count_out(&tally.merged, events, tally);
                    entry.remove();
                    continue;
                }
                Held::Steps { sum, events } => {
                    let steps = sum.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
                    let left = sum - i64::from(steps);
                    // More than one event can say follows in the next.
                    let rest = (left != 0).then_some(Held::Steps {
                        sum: left,
                        events: events.saturating_sub(1),
                    });
                    (knob_event(Reading::Steps(steps)), rest)
                }
            };
            if !push(at_us, event) {
                return;
            }
            match (rest, held) {
                (Some(rest), _) => {
                    tally.waiting.fetch_sub(1, Ordering::Relaxed);
                    entry.get_mut().1 = rest;
                    continue;
                }
                (None, Held::Steps { events, .. }) => count_out(&tally.merged, events.saturating_sub(1), tally),
                (None, _) => {}
            }
            tally.waiting.fetch_sub(held.reading_count().min(1), Ordering::Relaxed);
            entry.remove();
        }
    }
}

/// Readings leave the backlog without being handed over.
fn count_out(how: &AtomicU64, readings: u64, tally: &Tally) {
    how.fetch_add(readings, Ordering::Relaxed);
    tally.waiting.fetch_sub(readings, Ordering::Relaxed);
}

#[cfg(test)]
mod tests;
