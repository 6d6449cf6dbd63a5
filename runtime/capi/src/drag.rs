//! Handles: vertices that the user holds and drags. One call finds the weights that bring them to their targets.

use sinew_runtime::{Controls, Drag, HANDLES_MAX, Handles, HandlesLayout};

use crate::basis::{SinewBasis, share_basis};
use crate::controls::{SinewControls, lend_controls};
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Kind};
use crate::memory::{Access, Out, Regions, SinewLayout, array, handle_memory};
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut};
use crate::workspace::{SinewWorkspace, WorkspaceBody};

/// Vertices held at once, at most.
pub const SINEW_HANDLES_MAX: usize = 64;

const _: () = assert!(SINEW_HANDLES_MAX == HANDLES_MAX);

/// Held vertices, their targets, and the controls that dragging leaves alone, in memory of yours.
pub struct SinewHandles {
    _opaque: (),
}

struct HandlesBody {
    handles: Handles<'static>,
}

impl Body for HandlesBody {
    const KIND: Kind = Kind::Handles;
}

/// How a drag went. Set `struct_bytes` to `sizeof(SinewDragReport)` before the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewDragReport {
    /// `sizeof(SinewDragReport)`.
    pub struct_bytes: usize,
    /// Largest distance of a held vertex from its target afterwards, units of the source; 0 where none is held.
    pub misfit: f32,
    /// Steps taken; 0 when none brought the vertices nearer, as when they are there.
    pub step_count: u32,
}

// SAFETY: `repr(C)`, the size first, numbers only.
unsafe impl GrowingStruct for SinewDragReport {
    const NAME: &'static str = "report";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// How much memory handles for this basis need: 12 bytes a vertex for each, 36 a vertex for all, and about 800 a control.
///
/// `capacity`: vertices held at once; more than `SINEW_HANDLES_MAX` count as that many.
///
/// Errors: those of a handle; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_layout(
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
        unsafe { out.write(Handle::<HandlesBody>::layout(buffers.size_bytes)) };
        Ok(())
    })
}

/// Makes handles; no vertex is held, no control pinned.
///
/// `memory`, `memory_bytes`: at least what `sinew_handles_layout` says for this `capacity`; what lies beyond that stays
/// untouched.
/// `handles`: takes the handle, which lies at `memory`.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`.
/// Threads: any number at a time, each with `memory` of its own.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
/// written by nobody else, until the last use of the handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_create(
    basis: *const SinewBasis,
    capacity: u32,
    memory: *mut u8,
    memory_bytes: usize,
    handles: *mut *mut SinewHandles,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(handles, "handles", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let capacity = capacity as usize;
        let layout = Handle::<HandlesBody>::layout(HandlesLayout::for_basis(&shared.basis, capacity).size_bytes);
        handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let handles = Handles::new(&shared.basis, capacity, buffers)?;
            Ok(HandlesBody { handles })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

/// Ends handles: later calls with them are refused with `CLOSED_HANDLE` while their memory stands. There is nothing to free,
/// so this is optional before the memory is given back.
///
/// Errors: those of a handle.
/// Threads: one at a time for each handles handle; another one's use at this moment is noticed.
///
/// # Safety
/// `handles` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_close(handles: *mut SinewHandles) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { Handle::<HandlesBody>::close(handles.cast()) })
}

/// Takes hold of a vertex where the workspace's last frame has it: costs one solve, and every drag from now on a little. Its
/// target is its place, so a vertex that is never moved is held there.
///
/// `workspace`: of the exact tier; keeps its pose.
/// `vertex`: source order.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle; `FOREIGN_HANDLES`, `FOREIGN_WORKSPACE`, `NEEDS_EXACT_TIER`, `NO_SUCH_VERTEX`,
/// `ALREADY_HELD`, `HANDLES_FULL`, `OVERLAP`, `STRUCT_SIZE`.
/// Threads: one at a time for each workspace and each handles handle; another one's use at this moment is noticed.
///
/// # Safety
/// The handles are NULL or handles of their kind; `details` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_add(
    basis: *const SinewBasis,
    handles: *mut SinewHandles,
    workspace: *mut SinewWorkspace,
    vertex: u32,
    details: *mut SinewDetails,
) -> SinewStatus {
    let add = |regions: &mut Regions| {
        // SAFETY: the caller's promise, all.
        let (shared, mut handles, mut workspace) = unsafe {
            (
                share_basis(basis, regions)?,
                Handle::<HandlesBody>::lend(handles.cast(), regions)?,
                Handle::<WorkspaceBody>::lend(workspace.cast(), regions)?,
            )
        };
        let workspace = &mut workspace.workspace;
        Ok(handles.handles.add(&shared.basis, workspace, vertex as usize)?)
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, add) }
}

/// Does something to handles alone.
///
/// # Safety
/// `handles` is null or handles whose memory stands.
unsafe fn change(
    handles: *mut SinewHandles,
    work: impl FnOnce(&mut Handles<'static>, &mut Regions) -> Result<(), Fault>,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        // SAFETY: the caller's promise.
        let mut lent = unsafe { Handle::<HandlesBody>::lend(handles.cast(), regions)? };
        work(&mut lent.handles, regions)
    })
}

/// Lets go of a vertex.
///
/// Errors: those of a handle; `NOT_HELD`.
/// Threads: one at a time for each handles handle; another one's use at this moment is noticed.
///
/// # Safety
/// `handles` is NULL or handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_remove(handles: *mut SinewHandles, vertex: u32) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { change(handles, |handles, _| Ok(handles.remove(vertex as usize)?)) }
}

/// Lets go of all vertices. Pinned controls stay pinned.
///
/// Errors: those of a handle.
/// Threads: one at a time for each handles handle; another one's use at this moment is noticed.
///
/// # Safety
/// `handles` is NULL or handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_clear(handles: *mut SinewHandles) -> SinewStatus {
    let clear = |handles: &mut Handles<'static>, _: &mut Regions| {
        handles.clear();
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { change(handles, clear) }
}

/// Says where a held vertex should go; the next `sinew_drag` moves it there.
///
/// `target`: three floats, units of the source.
///
/// Errors: those of a handle; `NOT_HELD`, `NOT_FINITE` (the last target stays), `OVERLAP`.
/// Threads: one at a time for each handles handle; another one's use at this moment is noticed.
///
/// # Safety
/// `handles` is NULL or handles; `target` is NULL or readable for three floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_target(
    handles: *mut SinewHandles,
    vertex: u32,
    target: *const f32,
) -> SinewStatus {
    let aim = |handles: &mut Handles<'static>, regions: &mut Regions| {
        array(target, 3, 3, "target", Access::Read, regions)?;
        // SAFETY: the caller's promise; checked.
        let target = unsafe { target.cast::<[f32; 3]>().read() };
        Ok(handles.set_target(vertex as usize, target)?)
    };
    // SAFETY: the caller's promise.
    unsafe { change(handles, aim) }
}

/// Leaves a control alone while dragging, or no longer.
///
/// `is_pinned`: 0: dragging moves it; anything else: it does not.
///
/// Errors: those of a handle; `NO_SUCH_CONTROL`.
/// Threads: one at a time for each handles handle; another one's use at this moment is noticed.
///
/// # Safety
/// `handles` is NULL or handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_handles_pin(handles: *mut SinewHandles, control: u32, is_pinned: i32) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { change(handles, |handles, _| Ok(handles.pin(control as usize, is_pinned != 0)?)) }
}

/// Moves the weights so that the held vertices come nearer to their targets: once for each update of the mouse, and play a
/// frame afterwards. Coarse controls go as far as they are of use, then finer ones, each within its stops; of all ways, the
/// one with the least steps. Pinned controls do not move.
///
/// `workspace`: of the exact tier; lends its kernels and keeps its pose.
/// `controls`: the current pose; take that of the drag.
/// `report`: NULL, or takes how it went.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Allocates nothing; a fixed number of steps.
///
/// Errors: those of a handle; `FOREIGN_HANDLES`, `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `NEEDS_EXACT_TIER`,
/// `NOT_FINITE` (something wrote over the weights), `HELD_OVERFLOW`, `OVERLAP`, `STRUCT_SIZE`.
/// Threads: one at a time for each workspace, each controls and each handles handle; another one's use at this moment is
/// noticed.
///
/// # Safety
/// The handles are NULL or handles of their kind; the others are NULL or as long as their first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_drag(
    basis: *const SinewBasis,
    handles: *mut SinewHandles,
    workspace: *mut SinewWorkspace,
    controls: *mut SinewControls,
    report: *mut SinewDragReport,
    details: *mut SinewDetails,
) -> SinewStatus {
    let drag = |regions: &mut Regions| {
        // SAFETY: the caller's promise, all.
        let (shared, mut handles, mut workspace, mut controls, report) = unsafe {
            (
                share_basis(basis, regions)?,
                Handle::<HandlesBody>::lend(handles.cast(), regions)?,
                Handle::<WorkspaceBody>::lend(workspace.cast(), regions)?,
                lend_controls(controls, regions)?,
                StructOut::optional(report, regions)?,
            )
        };
        let basis = &shared.basis;
        controls.check_basis(basis)?;
        let mut controls = Controls::resume(basis, &mut *controls.weights)?;
        let job = Drag {
            basis,
            handles: &mut handles.handles,
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
