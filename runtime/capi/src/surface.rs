//! The surface handle: readings of a device's knobs become weights of controls, with takeover, pages and failsafe. Made for
//! one basis, whose package it refers to; may move any controls of the same content.

use core::ffi::c_void;

use sinew_knobs::{
    Binding, ControlMap, ControlSurface, Knob, KnobState, SlotState, SurfaceError, SurfaceLayout, SurfaceMemory,
};
use sinew_runtime::{Controls, FrameError};

use crate::basis::{SinewBasis, share_basis};
use crate::carve::Carver;
use crate::controls::{SinewControls, lend_controls};
use crate::details::SinewDetails;
use crate::device::SinewReading;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Lent, Shared};
use crate::kind::Kind;
use crate::memory::{Out, Region, Regions, SinewLayout, handle_memory};
use crate::number;
use crate::status::SinewStatus;
use crate::structs::{self, StructOut};
use crate::surface_map::{Records, SinewSurfaceSettings};
use crate::surface_state::{self, SinewKnobState, SinewSurfaceStatus};

/// One device's knobs on the controls of one basis. Refers to the package's bytes, as the basis does.
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

/// The arrays of a surface.
struct Arrays {
    knobs: &'static mut [Knob<'static>],
    bindings: &'static mut [Binding],
    states: &'static mut [KnobState],
    slots: &'static mut [SlotState],
    left: &'static mut [f32],
}

impl Arrays {
    fn cut(carver: &mut Carver, layout: SurfaceLayout, binding_count: usize) -> Self {
        Self {
            knobs: carver.take(layout.knob_count, Knob::new(0, "")),
            bindings: carver.take(binding_count, Binding::default()),
            states: carver.take(layout.knob_count, KnobState::default()),
            slots: carver.take(layout.slot_count, SlotState::default()),
            left: carver.take(layout.control_count, f32::NAN),
        }
    }
}

fn layout(map: &ControlMap<'_>, bindings: &[Binding]) -> SinewLayout {
    let mut carver = Carver::measuring();
    Arrays::cut(&mut carver, SurfaceLayout::for_map(map), bindings.len());
    Handle::<SurfaceBody>::layout(carver.bytes())
}

/// How much memory a surface with these settings needs. Checks the settings as `sinew_surface_create` does.
///
/// Errors: those of `sinew_surface_create`.
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
            out.write(self::layout(&records.map(&shared.basis)?, records.bindings()));
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, ask) }
}

/// Makes a surface that has heard nothing yet and holds every weight. The settings are copied.
///
/// Errors: `UNKNOWN_OPTION`, `TOO_MANY`, `KNOB_TWICE`, `BAD_READING` (an address above 65535), `BAD_CALIBRATION`, `BAD_STEP`,
/// `NO_SUCH_KNOB`, `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`, `TWO_HANDS`, `BAD_TREE`, `BAD_RESPONSE`.
///
/// # Safety
/// As for `sinew_surface_layout`; `memory` stays in place, and is written by nobody else, until the last use of the
/// surface, and so does the package.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_create(
    basis: *const SinewBasis,
    settings: *const SinewSurfaceSettings,
    memory: *mut c_void,
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
        let layout = layout(&map, records.bindings());
        let memory = handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let mut carver = Carver::carving(buffers);
            let arrays = Arrays::cut(&mut carver, SurfaceLayout::for_map(&map), records.bindings().len());
            let Arrays {
                knobs,
                bindings,
                states,
                slots,
                left,
            } = arrays;
            knobs.copy_from_slice(records.knobs());
            bindings.copy_from_slice(records.bindings());
            let memory = SurfaceMemory {
                knobs: states,
                slots,
                left,
            };
            // The same records were a map above, so neither fails.
            let map = ControlMap::new(shared.basis, knobs, bindings, &[], records.tree)?;
            let surface = ControlSurface::new(map, records.settings, memory).map_err(|_| Fault::Internal)?;
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

/// Reads a knob: a reading of `sinew_decoder_next`, or a slider of yours. No control moves before the next
/// `sinew_surface_advance`. A device thought lost that speaks is back. An address that no knob has is counted, not refused.
///
/// Errors: `UNKNOWN_OPTION`, `BAD_READING`.
///
/// # Safety
/// `surface` is NULL or a surface; `reading` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_read(surface: *mut SinewSurface, reading: *const SinewReading) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise, both.
        let (reading, mut lent) = unsafe { (structs::read(reading, regions)?, lend(surface, regions)?) };
        lent.surface.event(reading.time_us, reading.event()?);
        Ok(())
    })
}

/// The device is gone: the pose holds, then eases to rest.
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
/// `argument`: of `SINEW_COMMAND_FOCUS` and `SINEW_COMMAND_PAGE`; not looked at for the others.
///
/// Errors: `UNKNOWN_OPTION`, `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`.
///
/// # Safety
/// `surface` is NULL or a surface.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_surface_command(
    surface: *mut SinewSurface,
    command: number::SinewCommand,
    argument: u32,
) -> SinewStatus {
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
///
/// Errors: `FOREIGN_CONTROLS`, `NOT_FINITE` (something wrote over the weights).
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
        let mut controls = Controls::resume(&basis, controls.weights(&basis)?)?;
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
/// Errors: `NO_SUCH_KNOB`.
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
