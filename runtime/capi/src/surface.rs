//! The surface handle: readings of a device's knobs become weights of controls, with takeover, pages and failsafe. Made for
//! one basis, whose package it refers to; may move any controls of the same content.

use sinew_runtime::input::{
    Binding, ControlMap, ControlSurface, Knob, KnobState, SlotState, SurfaceError, SurfaceLayout,
};
use sinew_runtime::{Controls, FrameError};

use crate::basis::{SinewBasis, share_basis};
use crate::carve;
use crate::controls::{SinewControls, lend_controls};
use crate::details::SinewDetails;
use crate::device::SinewReading;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Kind, Lent, Shared};
use crate::memory::{Out, Region, Regions, SinewLayout, handle_memory};
use crate::status::SinewStatus;
use crate::structs::{self, StructOut};
use crate::surface_map::{Records, SinewSurfaceSettings};
use crate::surface_state::{self, SinewKnobState, SinewSurfaceStatus};

/// One device's knobs on the controls of one basis, in memory of yours. Refers to the package's bytes as the basis does:
/// keep them in place, unchanged, until the last use of the surface.
pub struct SinewSurface {
    _opaque: (),
}

struct SurfaceBody {
    surface: ControlSurface<'static>,
    package: Region,
}

impl Body for SurfaceBody {
    const KIND: Kind = Kind::Surface;
}

/// # Safety
/// `surface` is null or a surface whose memory and package stand.
unsafe fn lend<'h>(surface: *const SinewSurface, regions: &mut Regions) -> Result<Lent<'h, SurfaceBody>, Fault> {
    // SAFETY: the caller's promise.
    let lent = unsafe { Handle::<SurfaceBody>::lend(surface.cast(), regions)? };
    regions.add(lent.package)?;
    Ok(lent)
}

/// # Safety
/// As for `lend`.
unsafe fn share<'h>(surface: *const SinewSurface, regions: &mut Regions) -> Result<Shared<'h, SurfaceBody>, Fault> {
    // SAFETY: the caller's promise.
    let shared = unsafe { Handle::<SurfaceBody>::share(surface.cast(), regions)? };
    regions.add(shared.package)?;
    Ok(shared)
}

fn buffer_bytes(map: &ControlMap<'_>, bindings: &[Binding]) -> usize {
    let layout = SurfaceLayout::for_map(map);
    carve::bytes::<Knob<'static>>(layout.knob_count)
        + carve::bytes::<Binding>(bindings.len())
        + carve::bytes::<KnobState>(layout.knob_count)
        + carve::bytes::<SlotState>(layout.slot_count)
}

/// How much memory a surface with these settings needs. Checks the settings as `sinew_surface_create` does.
///
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle and of `sinew_surface_create`; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `settings` is NULL or as long as its first member says, and its arrays as long as it says;
/// the others are NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_layout(
    basis: *const SinewBasis,
    settings: *const SinewSurfaceSettings,
    layout: *mut SinewLayout,
    details: *mut SinewDetails,
) -> SinewStatus {
    let ask = |regions: &mut Regions| {
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise, all.
        unsafe {
            let shared = share_basis(basis, regions)?;
            let records = Records::read(&structs::read(settings, regions)?, &shared.basis, regions)?;
            let bytes = buffer_bytes(&records.map(&shared.basis)?, records.bindings());
            out.write(Handle::<SurfaceBody>::layout(bytes));
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, ask) }
}

/// Makes a surface that has heard nothing yet and holds every weight. The settings are copied.
///
/// `memory`, `memory_bytes`: at least what `sinew_surface_layout` says for these settings; what lies beyond that stays
/// untouched.
/// `surface`: takes the handle, which lies at `memory`.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`, `UNKNOWN_OPTION`, `TOO_MANY`,
/// `KNOB_TWICE`, `BAD_READING` (an address above 65535), `BAD_CALIBRATION`, `BAD_STEP`, `NO_SUCH_KNOB`,
/// `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`, `TWO_HANDS`, `BAD_TREE`, `BAD_RESPONSE`.
/// Threads: any number at a time, each with `memory` of its own.
///
/// # Safety
/// As for `sinew_surface_layout`; `memory` stays in place, and is written by nobody else, until the last use of the
/// surface, and so does the package.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_create(
    basis: *const SinewBasis,
    settings: *const SinewSurfaceSettings,
    memory: *mut u8,
    memory_bytes: usize,
    surface: *mut *mut SinewSurface,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(surface, "surface", regions)?;
        // SAFETY: the caller's promise, all.
        let (shared, records) = unsafe {
            let shared = share_basis(basis, regions)?;
            let records = Records::read(&structs::read(settings, regions)?, &shared.basis, regions)?;
            (shared, records)
        };
        let map = records.map(&shared.basis)?;
        let counts = SurfaceLayout::for_map(&map);
        let layout = Handle::<SurfaceBody>::layout(buffer_bytes(&map, records.bindings()));
        handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let (knobs, buffers) = carve::copied(buffers, records.knobs());
            let (bindings, buffers) = carve::copied(buffers, records.bindings());
            let (states, buffers) = carve::filled(buffers, KnobState::default(), counts.knob_count);
            let (slots, _) = carve::filled(buffers, SlotState::default(), counts.slot_count);
            // The same records were a map above, so neither fails.
            let map = ControlMap::new(shared.basis, knobs, bindings, &[], records.tree)?;
            let surface = ControlSurface::new(map, records.settings, states, slots).map_err(|_| Fault::Internal)?;
            Ok(SurfaceBody {
                surface,
                package: shared.package(),
            })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

/// Ends a surface: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free,
/// so this is optional before the memory is given back.
///
/// Errors: those of a handle.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_close(surface: *mut SinewSurface) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { Handle::<SurfaceBody>::close(surface.cast()) })
}

/// Takes a reading, as it arrives: from `sinew_decoder_next`, or a slider of yours. No control moves before the next
/// `sinew_surface_advance`. A device thought lost that speaks is back.
///
/// `now_us`: microseconds of a clock of yours that never runs back.
///
/// Errors: those of a handle; `STRUCT_SIZE`, `UNKNOWN_OPTION`, `BAD_READING`, `OVERLAP`. An address that no knob has is
/// counted, not refused.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or a surface; `reading` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_take(
    surface: *mut SinewSurface,
    now_us: u64,
    reading: *const SinewReading,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (reading, mut lent) = unsafe { (structs::read(reading, regions)?, lend(surface, regions)?) };
        lent.surface.event(now_us, reading.event()?);
        Ok(())
    })
}

/// The device is gone: the pose holds, then eases to rest.
///
/// Errors: those of a handle.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or a surface.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_unplugged(surface: *mut SinewSurface, now_us: u64) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        unsafe { lend(surface, &mut Regions::new())? }.surface.unplugged(now_us);
        Ok(())
    })
}

/// The device is back: nothing moves until each knob has picked up its controls, whatever its takeover. See
/// `sinew_decoder_replugged` too.
///
/// Errors: those of a handle.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or a surface.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_replugged(surface: *mut SinewSurface, now_us: u64) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        unsafe { lend(surface, &mut Regions::new())? }.surface.replugged(now_us);
        Ok(())
    })
}

/// Does what a button would: stop, pages.
///
/// `command`: a `SinewCommand`.
/// `argument`: of `SINEW_COMMAND_FOCUS` and `SINEW_COMMAND_PAGE`; not looked at for the others.
///
/// Errors: those of a handle; `UNKNOWN_OPTION`, `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or a surface.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_command(surface: *mut SinewSurface, command: i32, argument: u32) -> SinewStatus {
    edge(|| {
        // SAFETY: the caller's promise.
        let mut lent = unsafe { lend(surface, &mut Regions::new())? };
        let asked = surface_state::command(command, argument, lent.surface.map())?;
        lent.surface.command(asked);
        Ok(())
    })
}

/// Moves the controls on to `now_us`, once a frame. But where a knob jumps, a control goes no further than its knob did, and
/// never faster than its slew limit. Time that stands still or runs back moves nothing.
///
/// `controls`: of the content that the surface was made for.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Allocates nothing and waits for nothing.
///
/// Errors: those of a handle; `FOREIGN_CONTROLS`, `NOT_FINITE` (something wrote over the weights), `OVERLAP`, `STRUCT_SIZE`.
/// Threads: one at a time for each surface and each controls handle; another one's use at this moment is noticed.
///
/// # Safety
/// The handles are NULL or handles of their kind; `details` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_advance(
    surface: *mut SinewSurface,
    controls: *mut SinewControls,
    now_us: u64,
    details: *mut SinewDetails,
) -> SinewStatus {
    let advance = |regions: &mut Regions| {
        // SAFETY: the caller's promise, both.
        let (mut surface, mut controls) = unsafe { (lend(surface, regions)?, lend_controls(controls, regions)?) };
        let basis = *surface.surface.map().basis();
        controls.check_basis(&basis)?;
        let mut controls = Controls::resume(&basis, &mut *controls.weights)?;
        match surface.surface.advance(now_us, &mut controls) {
            Ok(()) => Ok(()),
            Err(SurfaceError::ForeignControls) => Err(Fault::Frame(FrameError::ForeignControls)),
            Err(_) => Err(Fault::Internal),
        }
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, advance) }
}

/// One knob, for a display that says "turn left to pick up".
///
/// `knob`: index of the knob on the surface.
///
/// Errors: those of a handle; `NO_SUCH_KNOB`, `STRUCT_SIZE`, `OVERLAP`.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or a surface; `state` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_knob(
    surface: *const SinewSurface,
    knob: u32,
    state: *mut SinewKnobState,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, shared) = unsafe { (StructOut::required(state, regions)?, share(surface, regions)?) };
        let (knob, knob_count) = (knob as usize, shared.surface.map().knobs().len());
        if knob >= knob_count {
            return Err(Fault::NoSuchKnob { knob, knob_count });
        }
        out.write(&SinewKnobState::of(&shared.surface, knob));
        Ok(())
    })
}

/// How the surface and its device are doing.
///
/// Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
/// Threads: one at a time for each surface; another one's use at this moment is noticed.
///
/// # Safety
/// `surface` is NULL or a surface; `status` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_status(
    surface: *const SinewSurface,
    status: *mut SinewSurfaceStatus,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (out, shared) = unsafe { (StructOut::required(status, regions)?, share(surface, regions)?) };
        out.write(&SinewSurfaceStatus::of(&shared.surface));
        Ok(())
    })
}
