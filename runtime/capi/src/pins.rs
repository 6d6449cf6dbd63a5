//! Pins: vertices that the user holds and drags. One call finds the weights that bring them to their targets.

use core::ffi::c_void;

use sinew_runtime::{Controls, Drag, HANDLES_MAX, Handles, HandlesLayout};

use crate::basis::{SinewBasis, share_basis};
use crate::controls::{SinewControls, lend_controls};
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle};
use crate::kind::Kind;
use crate::memory::{Out, Regions, SinewLayout, handle_memory, slice};
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut};
use crate::workspace::{SinewWorkspace, WorkspaceBody};

/// Vertices pinned at once, at most.
pub const SINEW_PINS_MAX: usize = 64;

const _: () = assert!(SINEW_PINS_MAX == HANDLES_MAX);

/// Pinned vertices, their targets, and the controls that dragging leaves alone.
pub struct SinewPins {
    _opaque: (),
}

struct PinsBody {
    pins: Handles<'static>,
}

impl Body for PinsBody {
    const KIND: Kind = Kind::Pins;
}

/// How a drag went.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewDragReport {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Largest distance of a pinned vertex from its target afterwards, units of the source; 0 where none is pinned.
    pub misfit: f32,
    /// Steps taken; 0 when none brought the vertices nearer, as when they are there.
    pub step_count: u32,
}

// SAFETY: `repr(C)`, the size first, numbers only.
unsafe impl GrowingStruct for SinewDragReport {
    const NAME: &'static str = "report";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// How much memory pins for this basis need: 12 bytes a vertex for each, 36 a vertex for all, and about 800 a control.
///
/// `capacity`: vertices pinned at once; more than `SINEW_PINS_MAX` count as that many.
///
/// # Safety
/// `basis` is NULL or a basis; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_layout(
    basis: *const SinewBasis,
    capacity: u32,
    layout: *mut SinewLayout,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let buffers = HandlesLayout::for_basis(&shared.basis, capacity as usize);
        // SAFETY: the caller's promise.
        unsafe { out.write(Handle::<PinsBody>::layout(buffers.size_bytes)) };
        Ok(())
    })
}

/// Makes pins; no vertex is pinned, no control locked.
///
/// `capacity`: as for `sinew_pins_layout`.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
/// written by nobody else, until the last use of the pins.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_create(
    basis: *const SinewBasis,
    capacity: u32,
    memory: *mut c_void,
    memory_bytes: usize,
    pins: *mut *mut SinewPins,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(pins, "pins", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let capacity = capacity as usize;
        let layout = Handle::<PinsBody>::layout(HandlesLayout::for_basis(&shared.basis, capacity).size_bytes);
        let memory = handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let pins = Handles::new(&shared.basis, capacity, buffers)?;
            Ok(PinsBody { pins })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

/// Pins a vertex where the workspace's last frame has it: costs one solve, and every drag from now on a little. Its target
/// is its place, so a vertex whose target is never moved is held there.
///
/// `workspace`: of the exact tier; keeps its pose.
/// `vertex`: source order.
///
/// Errors: `FOREIGN_PINS`, `FOREIGN_WORKSPACE`, `NEEDS_EXACT_TIER`, `NO_SUCH_VERTEX`, `ALREADY_PINNED`, `PINS_FULL`.
///
/// # Safety
/// The handles are NULL or handles of their kind; `details` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_add(
    basis: *const SinewBasis,
    pins: *mut SinewPins,
    workspace: *mut SinewWorkspace,
    vertex: u32,
    details: *mut SinewDetails,
) -> SinewStatus {
    let add = |regions: &mut Regions| {
        // SAFETY: the caller's promise, all.
        let (shared, mut pins, mut workspace) = unsafe {
            (
                share_basis(basis, regions)?,
                Handle::<PinsBody>::lend(pins.cast(), regions)?,
                Handle::<WorkspaceBody>::lend(workspace.cast(), regions)?,
            )
        };
        let workspace = &mut workspace.workspace;
        Ok(pins.pins.add(&shared.basis, workspace, vertex as usize)?)
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, add) }
}

/// Does something to pins alone.
///
/// # Safety
/// `pins` is null or pins whose memory stands.
unsafe fn change(
    pins: *mut SinewPins,
    work: impl FnOnce(&mut Handles<'static>, &mut Regions) -> Result<(), Fault>,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<PinsBody>::lend(pins.cast(), regions)? };
        work(&mut lent.pins, regions)
    })
}

/// Lets go of a vertex.
///
/// Errors: `NOT_PINNED`.
///
/// # Safety
/// `pins` is NULL or pins.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_remove(pins: *mut SinewPins, vertex: u32) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { change(pins, |pins, _| Ok(pins.remove(vertex as usize)?)) }
}

/// Lets go of all vertices. Locked controls stay locked.
///
/// # Safety
/// `pins` is NULL or pins.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_clear(pins: *mut SinewPins) -> SinewStatus {
    let clear = |pins: &mut Handles<'static>, _: &mut Regions| {
        pins.clear();
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { change(pins, clear) }
}

/// Says where a pinned vertex should go; the next `sinew_pins_drag` moves it there.
///
/// `target`: three floats, units of the source.
///
/// Errors: `NOT_PINNED`, `NOT_FINITE`.
///
/// # Safety
/// `pins` is NULL or pins; `target` is NULL or readable for three floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_move(pins: *mut SinewPins, vertex: u32, target: *const f32) -> SinewStatus {
    let aim = |pins: &mut Handles<'static>, regions: &mut Regions| {
        // SAFETY: the caller's promise.
        let target = unsafe { slice(target, 3, 3, "target", regions)? };
        let target = core::array::from_fn(|axis| target[axis]);
        Ok(pins.set_target(vertex as usize, target)?)
    };
    // SAFETY: the caller's promise.
    unsafe { change(pins, aim) }
}

/// Leaves a control alone while dragging, or no longer.
///
/// `is_locked`: 0: dragging moves it; anything else: it does not.
///
/// Errors: `NO_SUCH_CONTROL`.
///
/// # Safety
/// `pins` is NULL or pins.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_lock(pins: *mut SinewPins, control: u32, is_locked: i32) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { change(pins, |pins, _| Ok(pins.pin(control as usize, is_locked != 0)?)) }
}

/// Moves the weights so that the pinned vertices come nearer to their targets: once for each update of the mouse, and play
/// a frame afterwards. Coarse controls go as far as they are of use, then finer ones, each within its stops; of all ways, the
/// one with the least steps. Locked controls do not move. A fixed number of steps.
///
/// `workspace`: of the exact tier; lends its kernels and keeps its pose.
/// `controls`: the current pose; take that of the drag.
/// `report`: NULL, or takes how it went.
///
/// Errors: `FOREIGN_PINS`, `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `NEEDS_EXACT_TIER`, `NOT_FINITE` (something wrote over
/// the weights), `PIN_OVERFLOW`.
///
/// # Safety
/// The handles are NULL or handles of their kind; the others are NULL or as long as their first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_pins_drag(
    basis: *const SinewBasis,
    pins: *mut SinewPins,
    workspace: *mut SinewWorkspace,
    controls: *mut SinewControls,
    report: *mut SinewDragReport,
    details: *mut SinewDetails,
) -> SinewStatus {
    let drag = |regions: &mut Regions| {
        // SAFETY: the caller's promise, all.
        let (shared, mut pins, mut workspace, mut controls, report) = unsafe {
            (
                share_basis(basis, regions)?,
                Handle::<PinsBody>::lend(pins.cast(), regions)?,
                Handle::<WorkspaceBody>::lend(workspace.cast(), regions)?,
                lend_controls(controls, regions)?,
                StructOut::optional(report, regions)?,
            )
        };
        let basis = &shared.basis;
        let mut controls = Controls::resume(basis, controls.weights(basis)?)?;
        let job = Drag {
            basis,
            handles: &mut pins.pins,
            controls: &mut controls,
        };
        let done = job.run(&mut workspace.workspace)?;
        report.write(&SinewDragReport {
            struct_bytes: size_of::<SinewDragReport>(),
            misfit: done.misfit,
            step_count: done.step_count,
        });
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, drag) }
}
