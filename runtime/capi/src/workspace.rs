//! The workspace handle: the memory of a frame, bound to the content of one basis.

use core::ffi::c_void;

use sinew_runtime::{Basis, Kernels, TierChoice, Workspace, WorkspaceLayout};

use crate::basis::{SinewBasis, share_basis};
use crate::details::SinewDetails;
use crate::edge::{edge, edge_with_details};
use crate::fault::Fault;
use crate::handle::{Body, Handle};
use crate::kind::Kind;
use crate::memory::{Out, Regions, SinewLayout, handle_memory};
use crate::number;
use crate::status::SinewStatus;
use crate::structs::{self, GrowingStruct, choice};

/// The buffers of one frame at a time: about 113 bytes a vertex, or 128 a bone. One for every mesh that
/// is posed on its own; any number may share a basis.
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
    /// A few affine maps are posed, and the vertices follow them: for engines that skin by themselves (`sinew_bones.h`), crowds
    /// and small devices. How far they are from the exact tier, `SinewBasisInfo` says.
    Bones = 1,
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
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Which tier it plays.
    pub tier: number::SinewTier,
    /// What it runs on.
    pub kernels: number::SinewKernels,
}

// SAFETY: `repr(C)`, the size first, integers only.
unsafe impl GrowingStruct for SinewWorkspaceOptions {
    const NAME: &'static str = "options";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// What a workspace is made for.
#[derive(Clone, Copy)]
pub(crate) struct Choice {
    tier: TierChoice,
    kernels: Kernels,
}

impl Choice {
    /// # Safety
    /// `options` is null or as long as its first member says.
    pub(crate) unsafe fn read(options: *const SinewWorkspaceOptions, regions: &mut Regions) -> Result<Self, Fault> {
        if options.is_null() {
            return Ok(Self {
                tier: TierChoice::Exact,
                kernels: Kernels::detect(),
            });
        }
        // SAFETY: the caller's promise.
        let options = unsafe { structs::read(options, regions)? };
        let tiers = [TierChoice::Exact, TierChoice::Bones];
        let kernels = [Kernels::detect(), Kernels::Scalar];
        Ok(Self {
            tier: choice("options.tier", options.tier, &tiers)?,
            kernels: choice("options.kernels", options.kernels, &kernels)?,
        })
    }
}

impl WorkspaceBody {
    /// Refuses a tier that the basis does not have.
    pub(crate) fn layout(basis: &Basis<'_>, choice: Choice) -> Result<SinewLayout, Fault> {
        let buffers = WorkspaceLayout::for_tier(basis, choice.tier)?;
        Ok(Handle::<Self>::layout(buffers.size_bytes))
    }

    /// # Safety
    /// `memory` was checked against the layout for this basis and choice.
    pub(crate) unsafe fn create(
        basis: &Basis<'_>,
        choice: Choice,
        memory: *mut u8,
    ) -> Result<*mut SinewWorkspace, Fault> {
        let Choice { tier, kernels } = choice;
        let body = |buffers: &'static mut [u8]| {
            let workspace = Workspace::for_tier(basis, tier, buffers, kernels)?;
            Ok(Self { workspace })
        };
        // SAFETY: the caller's promise.
        Ok(unsafe { Handle::create(memory, Self::layout(basis, choice)?, body)? }.cast())
    }
}

/// How much memory a workspace needs for this basis.
///
/// `options`: NULL for the exact tier.
///
/// Errors: `NO_BONES`, `UNKNOWN_OPTION`.
///
/// # Safety
/// `basis` is NULL or a basis; `options` is NULL or as long as its first member says; `layout` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_layout(
    basis: *const SinewBasis,
    options: *const SinewWorkspaceOptions,
    layout: *mut SinewLayout,
) -> SinewStatus {
    edge(|| {
        let regions = &mut Regions::new();
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise, all.
        unsafe {
            let (shared, choice) = (share_basis(basis, regions)?, Choice::read(options, regions)?);
            out.write(WorkspaceBody::layout(&shared.basis, choice)?);
        }
        Ok(())
    })
}

/// Makes a workspace, at rest.
///
/// `options`: NULL for the exact tier.
///
/// Errors: `NO_BONES`, `UNKNOWN_OPTION`.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
/// written by nobody else, until the last use of the workspace.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_workspace_create(
    basis: *const SinewBasis,
    options: *const SinewWorkspaceOptions,
    memory: *mut c_void,
    memory_bytes: usize,
    workspace: *mut *mut SinewWorkspace,
    details: *mut SinewDetails,
) -> SinewStatus {
    let create = |regions: &mut Regions| {
        let out = Out::required(workspace, "workspace", regions)?;
        // SAFETY: the caller's promise, all; the memory was checked against this layout.
        unsafe {
            let (shared, choice) = (share_basis(basis, regions)?, Choice::read(options, regions)?);
            let layout = WorkspaceBody::layout(&shared.basis, choice)?;
            let memory = handle_memory(memory, memory_bytes, layout, regions)?;
            out.write(WorkspaceBody::create(&shared.basis, choice, memory)?);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, create) }
}
