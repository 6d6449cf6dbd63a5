//! The player: basis, workspace and controls in one block of memory, for a program that plays one mesh. What it makes are
//! handles like all others.

use core::ffi::c_void;

use crate::basis::{BasisBody, SinewBasis, open_package};
use crate::controls::{ControlsBody, SinewControls};
use crate::details::SinewDetails;
use crate::edge::edge_with_details;
use crate::fault::Fault;
use crate::handle::{ALIGNMENT, Handle};
use crate::memory::{Out, Regions, SinewLayout, handle_memory};
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut};
use crate::version::check_abi;
use crate::workspace::{Choice, SinewWorkspace, SinewWorkspaceOptions, WorkspaceBody};

/// All that plays one mesh: handles that lie in one block.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewPlayer {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// The opened package.
    pub basis: *mut SinewBasis,
    /// At rest.
    pub workspace: *mut SinewWorkspace,
    /// All at rest.
    pub controls: *mut SinewControls,
    /// V: elements of positions and normals.
    pub vertex_count: u32,
    /// K: controls, one a component.
    pub control_count: u32,
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewPlayer {
    const NAME: &'static str = "player";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// A player's block: three handles, one after the other, each of a size that is a multiple of the alignment.
struct Block {
    basis: SinewLayout,
    workspace: SinewLayout,
    controls: SinewLayout,
}

impl Block {
    fn of(opened: &BasisBody, choice: Choice) -> Result<Self, Fault> {
        Ok(Self {
            basis: Handle::<BasisBody>::layout(0),
            workspace: WorkspaceBody::layout(&opened.basis, choice)?,
            controls: ControlsBody::layout(&opened.basis),
        })
    }

    fn layout(&self) -> SinewLayout {
        let [basis, workspace, controls] = [self.basis, self.workspace, self.controls].map(|part| part.size_bytes);
        SinewLayout {
            size_bytes: basis.saturating_add(workspace).saturating_add(controls),
            alignment: ALIGNMENT,
        }
    }
}

/// How much memory a player of this package needs. Takes as long as `sinew_player_open`: it checks the package.
///
/// `bytes`, `length`: the whole package, at a multiple of 16; frames are fastest where it is one of 64.
/// `options`: NULL for the exact tier.
///
/// Errors: `PACKAGE_REFUSED`, `NO_BONES`, `UNKNOWN_OPTION`.
///
/// # Safety
/// Pointers are NULL or point to memory of the stated lengths; `options` and `details` are as long as their first member says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_player_layout(
    bytes: *const c_void,
    length: usize,
    options: *const SinewWorkspaceOptions,
    layout: *mut SinewLayout,
    details: *mut SinewDetails,
) -> SinewStatus {
    let ask = |regions: &mut Regions| {
        let out = Out::required(layout, "layout", regions)?;
        // SAFETY: the caller's promise, all.
        unsafe {
            let choice = Choice::read(options, regions)?;
            out.write(Block::of(&open_package(bytes, length, regions)?, choice)?.layout());
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, ask) }
}

/// Opens a package and makes a workspace and controls for it, all in one block.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `bytes`, `length`, `options`: as for `sinew_player_layout`.
///
/// Errors: `WRONG_ABI`, `PACKAGE_REFUSED`, `NO_BONES`, `UNKNOWN_OPTION`.
///
/// # Safety
/// Pointers are NULL or point to memory of the stated lengths; structs are as long as their first member says. `bytes` and
/// `memory` stay in place, and are written by nobody else, until the last use of the handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_player_open(
    abi_version: u32,
    bytes: *const c_void,
    length: usize,
    options: *const SinewWorkspaceOptions,
    memory: *mut c_void,
    memory_bytes: usize,
    player: *mut SinewPlayer,
    details: *mut SinewDetails,
) -> SinewStatus {
    let open = |regions: &mut Regions| {
        check_abi(abi_version)?;
        // SAFETY: the caller's promise, all; the block was checked against its layout, and its parts lie apart.
        unsafe {
            let out = StructOut::required(player, regions)?;
            let choice = Choice::read(options, regions)?;
            let opened = open_package(bytes, length, regions)?;
            let block = Block::of(&opened, choice)?;
            let memory = handle_memory(memory, memory_bytes, block.layout(), regions)?;
            let basis = opened.basis;
            let workspace_at = memory.add(block.basis.size_bytes);
            let controls_at = workspace_at.add(block.workspace.size_bytes);
            let workspace = WorkspaceBody::create(&basis, choice, workspace_at)?;
            let controls = ControlsBody::create(&basis, controls_at)?;
            let handle = Handle::create(memory, block.basis, |_| Ok(opened))?;
            out.write(&SinewPlayer {
                struct_bytes: size_of::<SinewPlayer>(),
                basis: handle.cast(),
                workspace,
                controls,
                vertex_count: basis.vertex_count() as u32,
                control_count: basis.component_count() as u32,
            });
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, open) }
}
