//! The decoder handle: bytes of a knob box, read by the caller from a port of his own, become readings of knobs. What came
//! waits in a queue in the same memory until it is asked for.

use core::ffi::{c_char, c_void};

use sinew_knobs::protocol::{Greeting, LINE_BYTES_MAX, OPENING_BYTES_MAX, SLIP_BYTES_MAX, SNIFF_BYTES_MAX};
use sinew_knobs::{Decoder, DecoderSettings, KnobEvent, Reading};

use crate::carve::Carver;
use crate::details::SinewDetails;
use crate::device::{SinewCounters, SinewDecoderSettings, SinewDeviceInfo, SinewReading};
use crate::edge::{edge, edge_with_details};
use crate::handle::{Body, Handle};
use crate::kind::Kind;
use crate::memory::{Out, Regions, SinewLayout, handle_memory, present, slice, slice_mut, write_text};
use crate::status::SinewStatus;
use crate::structs::{self, StructOut};
use crate::version::check_abi;

/// Readings that wait in a decoder, at most.
pub const SINEW_DECODER_READINGS: usize = 2048;
/// Bytes of a buffer that holds any greeting.
pub const SINEW_GREETING_BYTES: usize = 37;

const _: () = assert!(SINEW_GREETING_BYTES == OPENING_BYTES_MAX);

/// Bytes that a parser holds back: each makes one reading at most, and all of them may do so at once.
const HELD_BACK: usize = {
    let longest = if LINE_BYTES_MAX > SLIP_BYTES_MAX {
        LINE_BYTES_MAX
    } else {
        SLIP_BYTES_MAX
    };
    if longest > SNIFF_BYTES_MAX {
        longest
    } else {
        SNIFF_BYTES_MAX
    }
};

const _: () = assert!(HELD_BACK < SINEW_DECODER_READINGS);

/// Reads one device, whatever it speaks.
pub struct SinewDecoder {
    _opaque: (),
}

struct DecoderBody {
    decoder: Decoder,
    queue: Queue,
    greeting: Greeting,
    replugs: u64,
    last_value_us: Option<u64>,
}

impl Body for DecoderBody {
    const KIND: Kind = Kind::Decoder;
}

impl DecoderBody {
    /// Runs the decoder; what it says goes into the queue.
    fn take(&mut self, now_us: u64, read: impl FnOnce(&mut Decoder, &mut dyn FnMut(KnobEvent))) {
        let before = self.decoder.counters().events;
        let queue = &mut self.queue;
        read(&mut self.decoder, &mut |event| queue.push(Arrival { now_us, event }));
        if self.decoder.counters().events != before {
            self.last_value_us = Some(now_us);
        }
    }
}

/// A reading, and when its bytes came.
#[derive(Clone, Copy)]
struct Arrival {
    now_us: u64,
    event: KnobEvent,
}

/// A ring of readings.
struct Queue {
    ring: &'static mut [Arrival],
    first: usize,
    count: usize,
    dropped: u64,
}

impl Queue {
    fn cut(carver: &mut Carver) -> Self {
        let nothing = Arrival {
            now_us: 0,
            event: KnobEvent {
                knob: 0,
                reading: Reading::Steps(0),
            },
        };
        Self {
            ring: carver.take(SINEW_DECODER_READINGS, nothing),
            first: 0,
            count: 0,
            dropped: 0,
        }
    }

    fn room(&self) -> usize {
        self.ring.len() - self.count
    }

    fn push(&mut self, arrival: Arrival) {
        let (end, length) = (self.first + self.count, self.ring.len());
        match self.room() {
            0 => self.dropped += 1,
            _ => {
                self.ring[end % length] = arrival;
                self.count += 1;
            }
        }
    }

    fn pop(&mut self) -> Option<Arrival> {
        self.count = self.count.checked_sub(1)?;
        let arrival = self.ring[self.first];
        self.first = (self.first + 1) % self.ring.len();
        Some(arrival)
    }
}

fn layout() -> SinewLayout {
    let mut carver = Carver::measuring();
    Queue::cut(&mut carver);
    Handle::<DecoderBody>::layout(carver.bytes())
}

/// How much memory a decoder needs; the same for every device.
///
/// # Safety
/// `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_layout(layout: *mut SinewLayout) -> SinewStatus {
    edge(|| {
        let out = Out::required(layout, "layout", &mut Regions::new())?;
        // SAFETY: the caller's promise.
        unsafe { out.write(self::layout()) };
        Ok(())
    })
}

/// Opens a decoder at the beginning of a device's bytes. Needs no basis.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `settings`: NULL for the usual ones: the first bytes decide what the device speaks.
///
/// Errors: `WRONG_ABI`, `UNKNOWN_OPTION`.
///
/// # Safety
/// The pointers are NULL or point to memory of the stated lengths. `memory` stays in place, and is written by nobody else,
/// until the last use of the decoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_open(
    abi_version: u32,
    settings: *const SinewDecoderSettings,
    memory: *mut c_void,
    memory_bytes: usize,
    decoder: *mut *mut SinewDecoder,
    details: *mut SinewDetails,
) -> SinewStatus {
    let open = |regions: &mut Regions| {
        check_abi(abi_version)?;
        let out = Out::required(decoder, "decoder", regions)?;
        let (protocol, settings) = if settings.is_null() {
            (None, DecoderSettings::default())
        } else {
            // SAFETY: the caller's promise.
            unsafe { structs::read(settings, regions)? }.resolve()?
        };
        let layout = layout();
        let memory = handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let decoder = Decoder::new(protocol, settings);
            Ok(DecoderBody {
                greeting: Greeting::new(&decoder),
                decoder,
                queue: Queue::cut(&mut Carver::carving(buffers)),
                replugs: 0,
                last_value_us: None,
            })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, open) }
}

/// What to send to the device now: ask after each `sinew_decoder_feed`, also one without bytes, and write it to the port. A
/// device that waits for a greeting gets one as soon as it is known what it speaks, and again each second until it answers; all
/// others get nothing.
///
/// `now_us`: on the clock of `sinew_decoder_feed`.
/// `bytes`, `capacity`: room for `SINEW_GREETING_BYTES`.
/// `length`: takes the number of bytes written, nearly always 0.
///
/// # Safety
/// `decoder` is NULL or a decoder; the others are NULL or writable, `bytes` for `capacity`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_greeting(
    decoder: *mut SinewDecoder,
    now_us: u64,
    bytes: *mut c_void,
    capacity: usize,
    length: *mut usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(length, "length", regions)?;
        // SAFETY: the caller's promise, both.
        let (mut lent, bytes) = unsafe {
            (
                Handle::<DecoderBody>::lend(decoder.cast(), regions)?,
                slice_mut(bytes.cast::<u8>(), capacity, OPENING_BYTES_MAX, "bytes", regions)?,
            )
        };
        let lent = &mut *lent;
        let mut opening = [0; OPENING_BYTES_MAX];
        let due = lent.greeting.due(&lent.decoder, now_us, &mut opening);
        bytes[..due.len()].copy_from_slice(due);
        // SAFETY: the caller's promise.
        unsafe { out.write(due.len()) };
        Ok(())
    })
}

/// Feeds bytes of the device's stream, cut anywhere. Waits for nothing. Bytes that make no sense are counted, never an error.
///
/// `now_us`: when the bytes came, microseconds of a clock of yours that never runs back.
/// `bytes`, `length`: what the port gave; may be none.
/// `taken`: takes how many bytes were used. Fewer than `length` when half of `SINEW_DECODER_READINGS` wait: ask for them,
/// then feed the rest. So no reading of a stream is ever lost here.
///
/// # Safety
/// `decoder` is NULL or a decoder; `bytes` is NULL or readable for `length`; `taken` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_feed(
    decoder: *mut SinewDecoder,
    now_us: u64,
    bytes: *const c_void,
    length: usize,
    taken: *mut usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(taken, "taken", regions)?;
        // SAFETY: the caller's promise, both.
        let (mut rest, mut lent) = unsafe {
            (
                slice(bytes.cast::<u8>(), length, length, "bytes", regions)?,
                Handle::<DecoderBody>::lend(decoder.cast(), regions)?,
            )
        };
        loop {
            let (now, later) = rest.split_at(rest.len().min(lent.queue.room().saturating_sub(HELD_BACK)));
            if now.is_empty() {
                break;
            }
            lent.take(now_us, |decoder, sink| decoder.feed(now, &mut |event| sink(event)));
            rest = later;
        }
        // SAFETY: the caller's promise.
        unsafe { out.write(length - rest.len()) };
        Ok(())
    })
}

/// Feeds one datagram, whole: OSC as it comes over UDP. What finds no room among the readings that wait is dropped and
/// counted.
///
/// `now_us`: when the datagram came, microseconds of a clock of yours that never runs back.
///
/// # Safety
/// `decoder` is NULL or a decoder; `bytes` is NULL or readable for `length`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_feed_packet(
    decoder: *mut SinewDecoder,
    now_us: u64,
    bytes: *const c_void,
    length: usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (packet, mut lent) = unsafe {
            (
                slice(bytes.cast::<u8>(), length, length, "bytes", regions)?,
                Handle::<DecoderBody>::lend(decoder.cast(), regions)?,
            )
        };
        lent.take(now_us, |decoder, sink| {
            decoder.feed_packet(packet, &mut |event| sink(event))
        });
        Ok(())
    })
}

/// The device was plugged in again: what is half read is thrown away, and the device is greeted anew. Protocol, names, scales
/// and counters stay, so that a knob has the same number as before.
///
/// # Safety
/// `decoder` is NULL or a decoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_replugged(decoder: *mut SinewDecoder) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<DecoderBody>::lend(decoder.cast(), &mut Regions::new())? };
        lent.decoder.reset();
        lent.greeting = Greeting::new(&lent.decoder);
        lent.replugs += 1;
        Ok(())
    })
}

/// The oldest reading that waits, which then waits no more; `kind` is `SINEW_READING_KIND_NONE` when none does.
///
/// # Safety
/// `decoder` is NULL or a decoder; `reading` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_next(decoder: *mut SinewDecoder, reading: *mut SinewReading) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, mut lent) = unsafe {
            (
                StructOut::required(reading, regions)?,
                Handle::<DecoderBody>::lend(decoder.cast(), regions)?,
            )
        };
        let oldest = lent.queue.pop();
        out.write(&oldest.map_or(SinewReading::NONE, |arrival| {
            SinewReading::of(arrival.now_us, arrival.event)
        }));
        Ok(())
    })
}

/// What became of the bytes so far.
///
/// `now_us`: on the clock of `sinew_decoder_feed`, for the age of the last reading.
///
/// # Safety
/// `decoder` is NULL or a decoder; `counters` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_counters(
    decoder: *const SinewDecoder,
    now_us: u64,
    counters: *mut SinewCounters,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, shared) = unsafe {
            (
                StructOut::required(counters, regions)?,
                Handle::<DecoderBody>::share(decoder.cast(), regions)?,
            )
        };
        let counted = SinewCounters::of(shared.decoder.counters());
        out.write(&SinewCounters {
            dropped: counted.dropped + shared.queue.dropped,
            waiting: shared.queue.count as u64,
            replugs: shared.replugs,
            age_us: shared
                .last_value_us
                .map_or(u64::MAX, |last| now_us.saturating_sub(last)),
            ..counted
        });
        Ok(())
    })
}

/// What the decoder knows of its device: what it speaks and how sure that is.
///
/// # Safety
/// `decoder` is NULL or a decoder; `info` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_info(decoder: *const SinewDecoder, info: *mut SinewDeviceInfo) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, shared) = unsafe {
            (
                StructOut::required(info, regions)?,
                Handle::<DecoderBody>::share(decoder.cast(), regions)?,
            )
        };
        out.write(&SinewDeviceInfo::of(&shared.decoder));
        Ok(())
    })
}

/// What the device calls a knob: its label, OSC address, or from a HELLO; UTF-8, ended by NUL, empty where it has no name.
/// `SINEW_KNOB_NAME_BYTES` are always enough.
///
/// # Safety
/// `decoder` is NULL or a decoder; `name` is NULL or writable for `name_bytes`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_knob_name(
    decoder: *const SinewDecoder,
    knob: u32,
    name: *mut c_char,
    name_bytes: usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        present(name, "name")?;
        // SAFETY: the caller's promise.
        let shared = unsafe { Handle::<DecoderBody>::share(decoder.cast(), regions)? };
        let known = u16::try_from(knob).ok().and_then(|knob| shared.decoder.name_of(knob));
        // SAFETY: the caller's promise.
        unsafe { write_text(known.unwrap_or_default(), name, name_bytes, "name", regions) }
    })
}
