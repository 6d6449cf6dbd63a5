//! The decoder handle: bytes of a knob box, read by the caller from a port of his own, become readings of knobs. What came
//! waits in a queue in the same memory until it is asked for.

use core::ffi::c_char;

use sinew_runtime::input::protocol::{LINE_BYTES_MAX, SLIP_BYTES_MAX, SNIFF_BYTES_MAX};
use sinew_runtime::input::{Decoder, KnobEvent, Reading, Settings};

use crate::carve;
use crate::details::SinewDetails;
use crate::device::{SinewCounters, SinewDecoderSettings, SinewDeviceInfo, SinewReading};
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Kind};
use crate::memory::{Access, Out, Regions, SinewLayout, array, handle_memory, present};
use crate::status::SinewStatus;
use crate::structs::{self, StructOut};
use crate::version::check_abi;

/// Readings that wait in a decoder, at most.
pub const SINEW_DECODER_READINGS: usize = 2048;
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

/// Reads one device, whatever it speaks, in memory of yours.
pub struct SinewDecoder {
    _opaque: (),
}

struct DecoderBody {
    decoder: Decoder,
    queue: Queue,
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
        read(&mut self.decoder, &mut |event| queue.push(event));
        if self.decoder.counters().events != before {
            self.last_value_us = Some(now_us);
        }
    }
}

/// A ring of readings.
struct Queue {
    ring: &'static mut [KnobEvent],
    first: usize,
    count: usize,
    dropped: u64,
}

impl Queue {
    fn room(&self) -> usize {
        self.ring.len() - self.count
    }

    fn push(&mut self, event: KnobEvent) {
        let (end, length) = (self.first + self.count, self.ring.len());
        match self.room() {
            0 => self.dropped += 1,
            _ => {
                self.ring[end % length] = event;
                self.count += 1;
            }
        }
    }

    fn pop(&mut self) -> Option<KnobEvent> {
        self.count = self.count.checked_sub(1)?;
        let event = self.ring[self.first];
        self.first = (self.first + 1) % self.ring.len();
        Some(event)
    }
}

fn layout() -> SinewLayout {
    Handle::<DecoderBody>::layout(carve::bytes::<KnobEvent>(SINEW_DECODER_READINGS))
}

/// How much memory a decoder needs; the same for every device.
///
/// Errors: `NULL_POINTER`, `MISALIGNED`.
/// Threads: any.
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
/// `memory`, `memory_bytes`: at least what `sinew_decoder_layout` says; what lies beyond that stays untouched.
/// `decoder`: takes the handle, which lies at `memory`.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: `WRONG_ABI`, `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`, `UNKNOWN_OPTION`.
/// Threads: any; one call for one `memory`.
///
/// # Safety
/// The pointers are NULL or point to memory of the stated lengths. `memory` stays in place, and is written by nobody else,
/// until the last use of the decoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_open(
    abi_version: u32,
    settings: *const SinewDecoderSettings,
    memory: *mut u8,
    memory_bytes: usize,
    decoder: *mut *mut SinewDecoder,
    details: *mut SinewDetails,
) -> SinewStatus {
    let open = |regions: &mut Regions| {
        check_abi(abi_version)?;
        let out = Out::required(decoder, "decoder", regions)?;
        let (protocol, settings) = if settings.is_null() {
            (None, Settings::default())
        } else {
            // SAFETY: the caller's promise.
            unsafe { structs::read(settings, regions)? }.resolve()?
        };
        let layout = layout();
        handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let nothing = KnobEvent {
                knob: 0,
                reading: Reading::Steps(0),
            };
            let (ring, _) = carve::filled(buffers, nothing, SINEW_DECODER_READINGS);
            Ok(DecoderBody {
                decoder: Decoder::new(protocol, settings),
                queue: Queue {
                    ring,
                    first: 0,
                    count: 0,
                    dropped: 0,
                },
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

/// Ends a decoder: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free,
/// so this is optional before the memory is given back.
///
/// Errors: those of a handle.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
///
/// # Safety
/// `decoder` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_close(decoder: *mut SinewDecoder) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { Handle::<DecoderBody>::close(decoder.cast()) })
}

/// What to send to the device once after its port was opened, so that it begins: nothing for most.
///
/// `bytes`, `capacity`: 37 bytes are always enough.
/// `length`: takes the number of bytes written.
///
/// Errors: those of a handle; `TOO_SHORT` (nothing was written), `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
///
/// # Safety
/// `decoder` is NULL or a decoder; the others are NULL or writable, `bytes` for `capacity`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_greeting(
    decoder: *mut SinewDecoder,
    bytes: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(length, "length", regions)?;
        // SAFETY: the caller's promise.
        let lent = unsafe { Handle::<DecoderBody>::lend(decoder.cast(), regions)? };
        let mut greeting = [0; 64];
        let protocol = lent.decoder.protocol();
        let written = protocol.map_or(Ok(0), |protocol| protocol.write_opening(&mut greeting));
        let written = written.map_err(|_| Fault::Internal)?;
        array(bytes, capacity, written, "bytes", Access::Write, regions)?;
        // SAFETY: the caller's promise; checked.
        unsafe {
            greeting.as_ptr().copy_to_nonoverlapping(bytes, written);
            out.write(written);
        }
        Ok(())
    })
}

/// Feeds bytes of the device's stream, cut anywhere.
///
/// `now_us`: microseconds of a clock of yours that never runs back.
/// `bytes`, `length`: what the port gave; may be none.
/// `taken`: takes how many bytes were used. Fewer than `length` when half of `SINEW_DECODER_READINGS` wait: ask for them,
/// then feed the rest. So no reading of a stream is ever lost here.
///
/// Allocates nothing and waits for nothing. Bytes that make no sense are counted, never an error.
///
/// Errors: those of a handle; `TOO_LONG`, `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed. A thread that reads the port and one
/// that asks must take turns.
///
/// # Safety
/// `decoder` is NULL or a decoder; `bytes` is NULL or readable for `length`; `taken` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_feed(
    decoder: *mut SinewDecoder,
    now_us: u64,
    bytes: *const u8,
    length: usize,
    taken: *mut usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(taken, "taken", regions)?;
        array(bytes, length, length, "bytes", Access::Read, regions)?;
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<DecoderBody>::lend(decoder.cast(), regions)? };
        // SAFETY: the caller's promise; neither null nor beyond the address space.
        let mut rest = unsafe { core::slice::from_raw_parts(bytes, length) };
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
/// `now_us`: microseconds of a clock of yours that never runs back.
///
/// Errors: those of a handle; `TOO_LONG`, `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
///
/// # Safety
/// `decoder` is NULL or a decoder; `bytes` is NULL or readable for `length`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_feed_packet(
    decoder: *mut SinewDecoder,
    now_us: u64,
    bytes: *const u8,
    length: usize,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        array(bytes, length, length, "bytes", Access::Read, regions)?;
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<DecoderBody>::lend(decoder.cast(), regions)? };
        // SAFETY: the caller's promise; neither null nor beyond the address space.
        let packet = unsafe { core::slice::from_raw_parts(bytes, length) };
        lent.take(now_us, |decoder, sink| {
            decoder.feed_packet(packet, &mut |event| sink(event))
        });
        Ok(())
    })
}

/// The device was plugged in again: what is half read is thrown away. Protocol, names, scales and counters stay, so that a
/// knob has the same number as before.
///
/// Errors: those of a handle.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
///
/// # Safety
/// `decoder` is NULL or a decoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_decoder_replugged(decoder: *mut SinewDecoder) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<DecoderBody>::lend(decoder.cast(), &mut Regions::new())? };
        lent.decoder.reset();
        lent.replugs += 1;
        Ok(())
    })
}

/// The oldest reading that waits, which then waits no more; `kind` is `SINEW_READING_KIND_NONE` when none does.
///
/// Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
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
        out.write(&lent.queue.pop().map_or(SinewReading::NONE, SinewReading::of));
        Ok(())
    })
}

/// What became of the bytes so far.
///
/// `now_us`: on the clock of `sinew_decoder_feed`, for the age of the last reading.
///
/// Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
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
/// Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
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
/// Errors: those of a handle; `TOO_SHORT` (nothing was written), `OVERLAP`.
/// Threads: one at a time for each decoder; another one's use at this moment is noticed.
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
        let known = known.unwrap_or_default().as_bytes();
        array(name, name_bytes, known.len() + 1, "name", Access::Write, regions)?;
        // SAFETY: the buffer is that long, and apart from the decoder.
        unsafe {
            known.as_ptr().copy_to_nonoverlapping(name.cast(), known.len());
            name.add(known.len()).write(0);
        }
        Ok(())
    })
}
