//! The frame: checks all memory of the call, then runs the runtime's own frame on it.

use sinew_runtime::{Basis, Controls, Frame, FrameOutcome};

use crate::basis::{SinewBasis, share_basis};
use crate::controls::{ControlsBody, SinewControls, lend_controls};
use crate::details::SinewDetails;
use crate::edge::edge_with_details;
use crate::fault::Fault;
use crate::handle::{Handle, Lent};
use crate::memory::{Access, Regions, slice_mut};
use crate::status::SinewStatus;
use crate::structs::{self, GrowingStruct, StructOut};
use crate::workspace::{SinewWorkspace, WorkspaceBody};

/// Where a frame writes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewFrameOptions {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Takes the deformed positions, xyz for each vertex, source order, units of the source. Not NULL.
    pub positions: *mut f32,
    /// Floats that `positions` has room for: at least 3 V; more stay untouched.
    pub position_floats: usize,
    /// Takes unit vertex normals, xyz for each vertex, source order. NULL where not wanted.
    pub normals: *mut f32,
    /// Floats that `normals` has room for: at least 3 V; more stay untouched.
    pub normal_floats: usize,
}

// SAFETY: `repr(C)`, the size first, no padding, raw pointers and integers only.
unsafe impl GrowingStruct for SinewFrameOptions {
    const NAME: &'static str = "options";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// What a frame had to do.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewFrameOutcome {
    /// The controls had moved: decoded and solved.
    Solved = 1,
    /// The controls were those of the workspace's last frame: its solution was written out again.
    Unchanged = 2,
}

/// What a frame tells besides its buffers.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SinewFrameReport {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// What the frame had to do.
    pub outcome: SinewFrameOutcome,
    /// Box around the positions, its least corner.
    pub minimum: [f32; 3],
    /// Its greatest corner.
    pub maximum: [f32; 3],
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewFrameReport {
    const NAME: &'static str = "report";
    const FIRST_BYTES: usize = size_of::<Self>();
}

/// Plays one frame: the rest shape deformed by the controls, on the tier that the workspace was made for.
///
/// `basis`, `workspace`, `controls`: made for the same content.
/// `report`: NULL, or takes what the frame had to do.
///
/// Waits for nothing. Components at rest are skipped; where no control moved since the workspace's last frame, only the outputs
/// are written.
///
/// Errors: `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `UNKNOWN_OPTION`, `NOT_FINITE` (something wrote over the weights),
/// `FRAME_OVERFLOW` (then positions and normals are those of the rest shape).
///
/// # Safety
/// The handles are NULL or handles of their kind; the others are NULL or point to memory of the stated lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_frame(
    basis: *const SinewBasis,
    workspace: *mut SinewWorkspace,
    controls: *const SinewControls,
    options: *const SinewFrameOptions,
    report: *mut SinewFrameReport,
    details: *mut SinewDetails,
) -> SinewStatus {
    let play = |regions: &mut Regions| {
        // SAFETY: the caller's promise for each of them.
        unsafe {
            let basis = share_basis(basis, regions)?;
            let report = StructOut::optional(report, regions)?;
            let options = structs::read(options, regions)?;
            let target = Target {
                workspace,
                controls,
                positions: options.positions,
                position_floats: options.position_floats,
                normals: options.normals,
                normal_floats: options.normal_floats,
            };
            report.write(&target.play(&basis.basis, regions)?);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, play) }
}

/// Where one frame happens: the handles it uses and the outputs it writes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target {
    pub(crate) workspace: *mut SinewWorkspace,
    pub(crate) controls: *const SinewControls,
    pub(crate) positions: *mut f32,
    pub(crate) position_floats: usize,
    pub(crate) normals: *mut f32,
    pub(crate) normal_floats: usize,
}

impl Target {
    /// Nothing to use and nothing to write: refused.
    pub(crate) const NOWHERE: Self = Self {
        workspace: core::ptr::null_mut(),
        controls: core::ptr::null(),
        positions: core::ptr::null_mut(),
        position_floats: 0,
        normals: core::ptr::null_mut(),
        normal_floats: 0,
    };

    /// Checks all of it and plays. The caller has added the basis to the regions.
    ///
    /// # Safety
    /// The handles are null or handles of their kind; the outputs are null or writable for their floats.
    pub(crate) unsafe fn play(&self, basis: &Basis<'static>, regions: &mut Regions) -> Result<SinewFrameReport, Fault> {
        // SAFETY: the caller's promise, both.
        let (mut workspace, mut controls) = unsafe {
            let workspace: Lent<'_, WorkspaceBody> = Handle::lend(self.workspace.cast(), regions)?;
            (workspace, lend_controls(self.controls, regions)?)
        };
        let weights = controls.weights(basis)?;
        // SAFETY: the caller's promise.
        let (positions, normals) = unsafe { self.outputs(basis.vertex_count(), regions)? };
        let controls = Controls::resume(basis, weights)?;
        let job = Frame {
            basis,
            controls: &controls,
            positions,
            normals,
        };
        let outcome = match job.run(&mut workspace.workspace)? {
            FrameOutcome::Solved => SinewFrameOutcome::Solved,
            FrameOutcome::Unchanged => SinewFrameOutcome::Unchanged,
        };
        let bounds = workspace.workspace.bounds();
        Ok(SinewFrameReport {
            struct_bytes: size_of::<SinewFrameReport>(),
            outcome,
            minimum: bounds.minimum,
            maximum: bounds.maximum,
        })
    }

    /// # Safety
    /// As for `play`.
    #[expect(clippy::type_complexity, reason = "two outputs, one of them optional")]
    unsafe fn outputs<'b>(
        &self,
        vertex_count: usize,
        regions: &mut Regions,
    ) -> Result<(&'b mut [[f32; 3]], Option<&'b mut [[f32; 3]]>), Fault> {
        // SAFETY: the caller's promise, both.
        unsafe {
            let positions = vectors(self.positions, self.position_floats, vertex_count, "positions", regions)?;
            let normals = match self.normals.is_null() {
                true => None,
                false => Some(vectors(
                    self.normals,
                    self.normal_floats,
                    vertex_count,
                    "normals",
                    regions,
                )?),
            };
            Ok((positions, normals))
        }
    }

    /// Adds everything to the regions without using it.
    ///
    /// # Safety
    /// As for `play`.
    pub(crate) unsafe fn check(&self, vertex_count: usize, regions: &mut Regions) -> Result<(), Fault> {
        // SAFETY: the caller's promise, all.
        unsafe {
            regions.add(Handle::<WorkspaceBody>::place(self.workspace.cast(), Access::Write)?)?;
            regions.add(Handle::<ControlsBody>::place(self.controls.cast(), Access::Write)?)?;
            self.outputs(vertex_count, regions)?;
        }
        Ok(())
    }
}

/// A caller's output of one vector a vertex.
///
/// # Safety
/// `floats` is null or writable for `room` floats.
unsafe fn vectors<'b>(
    floats: *mut f32,
    room: usize,
    vertex_count: usize,
    name: &'static str,
    regions: &mut Regions,
) -> Result<&'b mut [[f32; 3]], Fault> {
    // SAFETY: the caller's promise.
    let floats = unsafe { slice_mut(floats, room, 3 * vertex_count, name, regions)? };
    Ok(floats.as_chunks_mut().0)
}
