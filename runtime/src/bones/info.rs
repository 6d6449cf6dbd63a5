//! What an engine needs once: names, rest transforms and the skin.

use core::fmt;

use sinew_formats::package::{BonesError, BonesView, NORMAL_UNIT};

use super::scaled::{BoneTransform, at_rest};
use crate::basis::Basis;

/// The bones of a basis: all that stays the same from frame to frame.
#[derive(Clone, Copy)]
pub struct BonesInfo<'a> {
    basis: Basis<'a>,
    bones: BonesView<'a>,
}

impl fmt::Debug for BonesInfo<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            out,
            "BonesInfo({} bones, {} influences)",
            self.count(),
            self.influences()
        )
    }
}

/// `bone000` and so on: the same bone has the same name in every file and engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoneName(pub usize);

impl fmt::Display for BoneName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "bone{:03}", self.0)
    }
}

impl<'a> BonesInfo<'a> {
    pub(crate) fn new(basis: Basis<'a>, bones: BonesView<'a>) -> Self {
        Self { basis, bones }
    }

    /// B.
    pub fn count(&self) -> usize {
        self.bones.rest_places.len()
    }

    /// N, the nodes that the bones are made of.
    pub fn node_count(&self) -> usize {
        self.bones.node_count
    }

    /// I, bones that a vertex follows at most: 4 or 8.
    pub fn influences(&self) -> usize {
        self.bones.skin.influences
    }

    /// Where the bones are at rest. Shape: `[B]`, units of the source.
    pub fn rest_places(&self) -> &'a [[f32; 3]] {
        self.bones.rest_places
    }

    /// The joint of bone `b` at rest, for [`crate::BoneOutput::Scaled`]: its inverse is the joint's inverse bind matrix. Panics if
    /// `b` is not less than [`BonesInfo::count`], like a slice.
    pub fn rest_transform(&self, b: usize) -> BoneTransform {
        at_rest(&self.bones, b)
    }

    /// How far the bones are from the exact tier, measured when the package was baked.
    pub fn error(&self) -> BonesError {
        self.bones.error
    }

    /// The bones that each vertex follows and their weights, in units of 1 / 65535, greatest first. Shape: both `[V][I]`,
    /// source order; longer memory stays as it is beyond, and shorter is filled as far as it goes.
    pub fn write_skin(&self, bones: &mut [u8], weights: &mut [u16]) {
        let own = self.influences();
        let sources = self.bones.skin.bones.chunks_exact(own);
        let sources = sources.zip(self.bones.skin.weights.chunks_exact(own));
        for (v, (from_bones, from_weights)) in self.basis.vertex_from_slot().iter().zip(sources) {
            let place = own * v as usize;
            if let Some(to) = bones.get_mut(place..place + own) {
                to.copy_from_slice(from_bones);
            }
            if let Some(to) = weights.get_mut(place..place + own) {
                to.copy_from_slice(from_weights);
            }
        }
    }

    /// Unit normals of the rest shape; zero for a vertex without area around it. Shape: `[V]`, source order.
    pub fn write_rest_normals(&self, normals: &mut [[f32; 3]]) {
        for (v, normal) in self.basis.vertex_from_slot().iter().zip(self.bones.skin.rest_normals) {
            if let Some(to) = normals.get_mut(v as usize) {
                *to = normal.map(|x| f32::from(x) * NORMAL_UNIT);
            }
        }
    }

    /// Whether any bone moves when component `k` alone does. Panics if `k` is not less than K, like a slice.
    pub fn moves(&self, k: usize) -> bool {
        let slides = self.bones.slides.iter().skip(k).step_by(self.basis.component_count());
        let slid = slides.clone().any(|group| group.as_flattened().iter().any(|&x| x != 0));
        slid || self.bones.patches.owners.iter().any(|owner| usize::from(owner[0]) == k)
    }
}
