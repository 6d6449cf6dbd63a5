//! Bones: the tier that a GPU skins. Weights -> gradients of a few nodes -> the bones' maps; and there the frame may stop, for
//! engines skin by themselves ([`BoneMaps`]), or skin on the processor ([`crate::Frame`] on a workspace of
//! [`crate::TierChoice::Bones`]).
//!
//! Path of data: weights -> decode at the nodes -> [`pose`] -> `maps` of the workspace -> [`maps`] (to the caller's layout,
//! [`scaled`]) or [`skin`] (positions and normals).

mod info;
mod maps;
pub(crate) mod pose;
mod scaled;
pub(crate) mod skin;

pub use info::{BoneName, BonesInfo};
pub use maps::{BoneMaps, BoneOutput};
pub use scaled::BoneTransform;

#[cfg(test)]
pub(crate) mod fixture;
#[cfg(test)]
mod tests;
