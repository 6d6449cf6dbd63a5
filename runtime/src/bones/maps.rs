//! The job that says where the bones are, and stops.

use sinew_formats::package::BonesView;

use super::pose::{self, Map, centre, lost};
use super::scaled::{BoneTransform, scaled};
use crate::basis::Basis;
use crate::controls::Controls;
use crate::error::{Buffer, FrameError, check_length};
use crate::frame::{FrameOutcome, take_weights};
use crate::workspace::Workspace;

/// Where the maps of the bones go, one a bone, in the bones' order. A map takes positions of the rest shape to posed ones; an
/// engine's own inverse bind matrices are identities then, or it takes the scaled form, which has its own.
#[derive(Debug)]
pub enum BoneOutput<'o> {
    /// 3 x 4, row by row: three numbers of the linear part and the translation, three times. Three texels a bone, or a
    /// shader's `mat4x3` of WGSL's transposed kind.
    Rows(&'o mut [[f32; 12]]),
    /// 3 x 4, column by column: three columns of the linear part, then the translation.
    Columns(&'o mut [[f32; 12]]),
    /// Translation, rotation and scale of a joint whose rest is [`crate::BonesInfo::rest_transform`], for engines that animate
    /// by these three. What shear a bone has beyond that is left out; [`crate::BonesInfo::error`] says what it is worth.
    Scaled(&'o mut [BoneTransform]),
}

impl BoneOutput<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Rows(maps) | Self::Columns(maps) => maps.len(),
            Self::Scaled(maps) => maps.len(),
        }
    }

    fn write(self, bones: &BonesView<'_>, maps: &[Map]) {
        match self {
            Self::Rows(out) => each(out, bones, maps, |linear, translation| {
                core::array::from_fn(|n| match n % 4 {
                    3 => translation[n / 4],
                    column => linear[column][n / 4],
                })
            }),
            Self::Columns(out) => each(out, bones, maps, |linear, translation| {
                core::array::from_fn(|n| match n / 3 {
                    3 => translation[n % 3],
                    column => linear[column][n % 3],
                })
            }),
            Self::Scaled(out) => {
                for (b, (out, map)) in out.iter_mut().zip(maps).enumerate() {
                    *out = scaled(bones, b, map);
                }
            }
        }
    }
}

/// `I + D` by columns, and what is added after it.
fn each(
    out: &mut [[f32; 12]],
    bones: &BonesView<'_>,
    maps: &[Map],
    layout: impl Fn(&[[f32; 3]; 3], &[f32; 3]) -> [f32; 12],
) {
    let centre = centre(bones);
    for (out, [x, y, z, offset]) in out.iter_mut().zip(maps) {
        let mut linear = [x, y, z].map(|column| [column[0], column[1], column[2]]);
        let translation = core::array::from_fn(|c| {
            offset[c] - (linear[0][c] * centre[0] + linear[1][c] * centre[1] + linear[2][c] * centre[2])
        });
        for c in 0..3 {
            linear[c][c] += 1.0;
        }
        *out = layout(&linear, &translation);
    }
}

/// Poses the bones and writes their maps: all that a frame has to do where an engine skins.
#[derive(Debug)]
pub struct BoneMaps<'j> {
    /// The opened package.
    pub basis: &'j Basis<'j>,
    /// Weights of the components.
    pub controls: &'j Controls<'j>,
    /// Output. Shape: `[B]`.
    pub maps: BoneOutput<'j>,
}

impl BoneMaps<'_> {
    /// Checks identities, tier and length, O(1).
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::ForeignControls`], [`FrameError::NeedsBones`], [`FrameError::WrongLength`].
    pub fn validate(&self, workspace: &Workspace<'_>) -> Result<(), FrameError> {
        let bones = workspace.validate_bones(self.basis)?;
        if self.controls.basis().identity() != self.basis.identity() {
            return Err(FrameError::ForeignControls);
        }
        check_length(bones.rest_places.len(), Buffer::Bones, self.maps.len())
    }

    /// Poses.
    ///
    /// # Errors
    /// Those of [`BoneMaps::validate`]; [`FrameError::BoneNotFinite`] when the weights are so large that numbers overflow: then
    /// the output holds the rest pose and the workspace is at rest.
    pub fn run(self, workspace: &mut Workspace<'_>) -> Result<FrameOutcome, FrameError> {
        self.validate(workspace)?;
        let bones = workspace.validate_bones(self.basis)?;
        let outcome = take_weights(self.controls, workspace);
        if outcome == FrameOutcome::Solved {
            pose::update(self.basis, &bones, workspace);
        }
        let lost = lost(workspace.maps);
        if lost.is_some() {
            workspace.rest();
        }
        self.maps.write(&bones, workspace.maps);
        match lost {
            Some(bone) => Err(FrameError::BoneNotFinite { bone }),
            None => Ok(outcome),
        }
    }
}
