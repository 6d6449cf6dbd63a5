//! The workspace handle: the memory of a frame, bound to the content of one basis.

use sinew_runtime::{Kernels, TierChoice, Workspace, WorkspaceLayout};

use crate::basis::{SinewBasis, share_basis};
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle, Kind};
use crate::memory::{Out, Regions, SinewLayout, handle_memory};
use crate::status::SinewStatus;
use crate::structs::{self, GrowingStruct, choice};

/// The buffers of one frame at a time, in memory of yours: about 96 bytes a vertex, a third of that in the fast tier. One
/// for every mesh that is posed on its own; any number may share a basis.
pub struct SinewWorkspace {
    _opaque: (),
}

pub(crate) struct WorkspaceBody {
    pub(crate) workspace: Workspace<'static>,
}

impl Body for WorkspaceBody {
    const KIND: Kind = Kind::Workspace;
}

/// Which tier of a package a workspace plays.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewTier {
    /// All vertices are solved for: what was trained.
    Exact = 0,
    /// A few nodes are solved for, and the vertices follow them: for crowds and small devices. How far it is from the exact
    /// tier, `SinewBasisInfo` says.
    Fast = 1,
}

/// What frames run on.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewKernels {
    /// The widest of this machine.
    Widest = 0,
    /// Those that give the same bits on every machine.
    Scalar = 1,
}

/// What a workspace is for. Zero everywhere is the exact tier on the widest kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewWorkspaceOptions {
    /// `sizeof(SinewWorkspaceOptions)`.
    pub struct_bytes: usize,
    /// A `SinewTier`.
    pub tier: i32,
    /// A `SinewKernels`.
    pub kernels: i32,
}

// SAFETY: `repr(C)`, the size first, integers only.
unsafe impl GrowingStruct for SinewWorkspaceOptions {
    const NAME: &'static str = "options";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// # Safety
/// `options` is null or as long as its first member says.
unsafe fn read(options: *const SinewWorkspaceOptions, regions: &mut Regions) -> Result<(TierChoice, Kernels), Fault> {
    if options.is_null() {
        return Ok((TierChoice::Exact, Kernels::detect()));
    }
    // SAFETY: the caller's promise.
    let options = unsafe { structs::read(options, regions)? };
    let tiers = [TierChoice::Exact, TierChoice::Fast];
    let kernels = [Kernels::detect(), Kernels::Scalar];
    Ok((
        choice("options.tier", options.tier, &tiers)?,
        choice("options.kernels", options.kernels, &kernels)?,
    ))
}

/// How much memory a workspace of the exact tier needs for this basis.
///
/// Errors: those of a handle; `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_layout(basis: *const SinewBasis, layout: *mut SinewLayout) -> SinewStatus {
    // SAFETY: the caller's promise.
    unsafe { sinew_workspace_layout_for(basis, core::ptr::null(), layout) }
}

/// The same for a workspace with options.
///
/// `options`: NULL for the exact tier.
///
/// Errors: those of a handle; `NO_FAST_TIER`, `STRUCT_SIZE`, `UNKNOWN_OPTION`, `OVERLAP`.
/// Threads: any number at a time.
///
/// # Safety
/// `basis` is NULL or a basis; `options` is NULL or as long as its first member says; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_layout_for(
    basis: *const SinewBasis,
    options: *const SinewWorkspaceOptions,
    layout: *mut SinewLayout,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise, both.
        let (shared, (tier, _)) = unsafe { (share_basis(basis, regions)?, read(options, regions)?) };
        let buffers = WorkspaceLayout::for_tier(&shared.basis, tier)?;
        // SAFETY: the caller's promise.
        unsafe { out.write(Handle::<WorkspaceBody>::layout(buffers.size_bytes)) };
        Ok(())
    })
}

/// Makes a workspace of the exact tier, at rest.
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
    // SAFETY: the caller's promise.
    unsafe { sinew_workspace_create_for(basis, core::ptr::null(), memory, memory_bytes, workspace, details) }
}

/// The same with options.
///
/// `options`: NULL for the exact tier.
/// `memory`, `memory_bytes`: at least what `sinew_workspace_layout_for` says for these options.
///
/// Errors: those of `sinew_workspace_create`; `NO_FAST_TIER`, `UNKNOWN_OPTION`.
/// Threads: any number at a time, each with `memory` of its own.
///
/// # Safety
/// As for `sinew_workspace_create`; `options` is NULL or as long as its first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_create_for(
    basis: *const SinewBasis,
    options: *const SinewWorkspaceOptions,
    memory: *mut u8,
    memory_bytes: usize,
    workspace: *mut *mut SinewWorkspace,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(workspace, "workspace", regions)?;
        // SAFETY: the caller's promise, both.
        let (shared, (tier, kernels)) = unsafe { (share_basis(basis, regions)?, read(options, regions)?) };
        let buffers = WorkspaceLayout::for_tier(&shared.basis, tier)?;
        let layout = Handle::<WorkspaceBody>::layout(buffers.size_bytes);
        handle_memory(memory, memory_bytes, layout, regions)?;
        let body = |buffers: &'static mut [u8]| {
            let workspace = Workspace::for_tier(&shared.basis, tier, buffers, kernels)?;
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
