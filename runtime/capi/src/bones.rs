//! Bones: where they are at rest and in a pose, and which vertices follow them. For hosts whose GPU skins.

use sinew_runtime::{BoneMaps, BoneOutput, BoneTransform, BonesInfo, Controls, WorkspaceError};

use crate::basis::{BasisBody, SinewBasis, share_basis};
use crate::controls::{SinewControls, lend_controls};
use crate::details::SinewDetails;
use crate::edge::edge_with_details;
use crate::fault::Fault;
use crate::handle::{Handle, Lent, Shared};
use crate::memory::{Regions, slice_mut};
use crate::number;
use crate::status::SinewStatus;
use crate::structs::choice;
use crate::workspace::{SinewWorkspace, WorkspaceBody};

/// How a bone is written.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewBoneForm {
    /// 12 floats: a 3 x 4 matrix, row by row, that takes rest positions to posed ones. At rest it is the identity.
    Rows = 0,
    /// 12 floats: the same, column by column; the translation is the last column.
    Columns = 1,
    /// 10 floats: translation, unit quaternion x y z w, and scale of a joint, for engines that animate by these three. At rest
    /// it is what `sinew_bones_rest` gives. Shear is left out.
    Scaled = 2,
}

/// Floats of a joint: translation, quaternion, scale.
const JOINT_FLOATS: usize = 10;
/// Floats of a matrix.
const MAP_FLOATS: usize = 12;

fn bones_of(basis: &Shared<'_, BasisBody>) -> Result<BonesInfo<'static>, Fault> {
    Ok(basis.basis.bones().ok_or(WorkspaceError::NoBones)?)
}

/// Poses the bones and writes where they are: all that a frame costs where an engine skins.
///
/// `workspace`: one of the bones (`SINEW_TIER_BONES`).
/// `form`: what stands in `maps`; one bone after the other.
/// `maps`, `map_floats`: 12 floats a bone, or 10; more stay untouched.
///
/// Errors: `NO_BONES`, `NEEDS_BONES`, `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `UNKNOWN_OPTION`, `NOT_FINITE` (something wrote over
/// the weights), `FRAME_OVERFLOW` (then the bones are at rest).
///
/// # Safety
/// The handles are NULL or handles of their kind; the others are NULL or point to memory of the stated lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_bones_pose(
    basis: *const SinewBasis,
    workspace: *mut SinewWorkspace,
    controls: *const SinewControls,
    form: number::SinewBoneForm,
    maps: *mut f32,
    map_floats: usize,
    details: *mut SinewDetails,
) -> SinewStatus {
    let pose = |regions: &mut Regions| {
        // SAFETY: the caller's promise for each of them.
        unsafe {
            let basis = share_basis(basis, regions)?;
            let count = bones_of(&basis)?.count();
            let forms = [SinewBoneForm::Rows, SinewBoneForm::Columns, SinewBoneForm::Scaled];
            let form = choice("form", form, &forms)?;
            let mut workspace: Lent<'_, WorkspaceBody> = Handle::lend(workspace.cast(), regions)?;
            let mut controls = lend_controls(controls, regions)?;
            let weights = controls.weights(&basis.basis)?;
            let floats_each = if form == SinewBoneForm::Scaled {
                JOINT_FLOATS
            } else {
                MAP_FLOATS
            };
            let floats = slice_mut(maps, map_floats, floats_each * count, "maps", regions)?;
            let maps = match form {
                SinewBoneForm::Rows => BoneOutput::Rows(floats.as_chunks_mut().0),
                SinewBoneForm::Columns => BoneOutput::Columns(floats.as_chunks_mut().0),
                SinewBoneForm::Scaled => BoneOutput::Scaled(bytemuck::cast_slice_mut(floats)),
            };
            let job = BoneMaps {
                basis: &basis.basis,
                controls: &Controls::resume(&basis.basis, weights)?,
                maps,
            };
            job.run(&mut workspace.workspace)?;
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, pose) }
}

/// Where the joints of the bones are at rest: 10 floats a bone, as `SINEW_BONE_FORM_SCALED` has them. The inverses of these are an
/// engine's inverse bind matrices.
///
/// Errors: `NO_BONES`.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_bones_rest(
    basis: *const SinewBasis,
    joints: *mut f32,
    joint_floats: usize,
    details: *mut SinewDetails,
) -> SinewStatus {
    let rest = |regions: &mut Regions| {
        // SAFETY: the caller's promise, both.
        let (bones, floats) = unsafe {
            let basis = share_basis(basis, regions)?;
            let bones = bones_of(&basis)?;
            let floats = slice_mut(joints, joint_floats, JOINT_FLOATS * bones.count(), "joints", regions)?;
            (bones, floats)
        };
        let joints: &mut [BoneTransform] = bytemuck::cast_slice_mut(floats);
        for (b, joint) in joints.iter_mut().enumerate() {
            *joint = bones.rest_transform(b);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, rest) }
}

/// Which bones each vertex follows: 4 or 8 a vertex (`bone_influences` of the info), greatest weight first, source order.
///
/// `bones`, `bone_count`: indices of bones; 0 where the weight is 0.
/// `weights`, `weight_count`: in units of 1 / 65535; those of a vertex sum to 65535.
///
/// Errors: `NO_BONES`.
///
/// # Safety
/// `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_bones_skin(
    basis: *const SinewBasis,
    bones: *mut u8,
    bone_count: usize,
    weights: *mut u16,
    weight_count: usize,
    details: *mut SinewDetails,
) -> SinewStatus {
    let skin = |regions: &mut Regions| {
        // SAFETY: the caller's promise, all.
        unsafe {
            let basis = share_basis(basis, regions)?;
            let info = bones_of(&basis)?;
            let count = info.influences() * basis.basis.vertex_count();
            let bones = slice_mut(bones, bone_count, count, "bones", regions)?;
            let weights = slice_mut(weights, weight_count, count, "weights", regions)?;
            info.write_skin(bones, weights);
        }
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { edge_with_details(details, skin) }
}
