//! The workspace handle: the memory of a frame, bound to the content of one basis.

use sinew_runtime::{Workspace, WorkspaceLayout};

use crate::basis::{SinewBasis, share_basis};
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::handle::{Body, Handle, Kind};
use crate::memory::{Out, Regions, SinewLayout, handle_memory};
use crate::status::SinewStatus;

/// The buffers of one frame at a time, in memory of yours: about 132 bytes a vertex. One for every mesh that is posed on
/// its own; any number may share a basis.
pub struct SinewWorkspace {
    _opaque: (),
}

pub(crate) struct WorkspaceBody {
    pub(crate) workspace: Workspace<'static>,
}

impl Body for WorkspaceBody {
    const KIND: Kind = Kind::Workspace;
}

/// How much memory a workspace for this basis needs.
///
/// Errors: those of a handle; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_layout(basis: *const SinewBasis, layout: *mut SinewLayout) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let buffers = WorkspaceLayout::for_basis(&shared.basis);
        // SAFETY: the caller's promise.
        unsafe { out.write(Handle::<WorkspaceBody>::layout(buffers.size_bytes)) };
        Ok(())
    })
}

/// Makes a workspace, at rest.
///
/// `memory`, `memory_bytes`: at least what `sinew_workspace_layout` says; what lies beyond that stays untouched.
/// `workspace`: takes the handle, which lies at `memory`.
/// `details`: NULL, or takes the numbers behind a refusal.
///
/// Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`.
/// Threads: any number at a time, each with `memory` of its own.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
/// written by nobody else, until the last use of the workspace.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_create(
    basis: *const SinewBasis,
    memory: *mut u8,
    memory_bytes: usize,
    workspace: *mut *mut SinewWorkspace,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(workspace, "workspace", regions)?;
        // SAFETY: the caller's promise.
        let shared = unsafe { share_basis(basis, regions)? };
        let layout = Handle::<WorkspaceBody>::layout(WorkspaceLayout::for_basis(&shared.basis).size_bytes);
        handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let workspace = Workspace::new(&shared.basis, buffers)?;
            Ok(WorkspaceBody { workspace })
        };
        // SAFETY: the memory was checked against this layout.
        unsafe { out.write(Handle::create(memory, layout, body)?.cast()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}

/// Ends a workspace: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to
/// free, so this is optional before the memory is given back.
///
/// Errors: those of a handle.
/// Threads: one at a time for each workspace; another one's use at this moment is noticed.
///
/// # Safety
/// `workspace` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_close(workspace: *mut SinewWorkspace) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { Handle::<WorkspaceBody>::close(workspace.cast()) })
}
