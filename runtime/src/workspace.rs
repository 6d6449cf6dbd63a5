//! The memory of a frame: caller's bytes, carved once into the buffers between the steps, bound to one basis.
//!
//! A workspace always holds a pose that is finite and whole: the rest pose when new, then that of the last frame.

use sinew_formats::package::{BonesView, FEATURE_COUNT, GROUP_NODES, QUAD};

use crate::added::Added;
use crate::basis::{Basis, Identity, Tier};
use crate::bones::pose::Map;
use crate::decode::{decoder, shares_at_rest};
use crate::error::{Buffer, FrameError, WorkspaceError, check_length};
use crate::memory::{ALIGNMENT, Carver};
use crate::positions::Bounds;
use crate::simd::Kernels;
use crate::simd::generic::bones::BoneLanes;
use crate::simd::generic::decode::{BlockRest, Share};
use crate::simd::generic::lanes::Gradient;
use crate::simd::generic::solve::{Quad, Xyz0};

/// Which tier of a package a workspace plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum TierChoice {
    /// All vertices are solved for: what was trained.
    #[default]
    Exact,
    /// A few affine maps that the vertices follow: for GPUs, crowds and small devices. How far it is from the exact tier,
    /// [`crate::BonesInfo::error`] says.
    Bones,
}

/// How much memory a workspace needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkspaceLayout {
    /// Bytes, when the memory starts at a multiple of `alignment`.
    pub size_bytes: usize,
    /// Preferred alignment of the memory, in bytes.
    pub alignment: usize,
}

impl WorkspaceLayout {
    /// Layout for the nearest tier that `basis` has: the exact one, about 113 bytes a vertex, where it was not left out.
    pub fn for_basis(basis: &Basis<'_>) -> Self {
        Self::of(basis, basis.nearest_tier())
    }

    /// Layout for a tier of `basis`. Bones take 49 bytes a node and 128 a bone, and nothing a vertex.
    ///
    /// # Errors
    /// [`WorkspaceError::NoBones`], [`WorkspaceError::NoExactTier`].
    pub fn for_tier(basis: &Basis<'_>, tier: TierChoice) -> Result<Self, WorkspaceError> {
        check_tier(basis, tier)?;
        Ok(Self::of(basis, tier))
    }

    fn of(basis: &Basis<'_>, tier: TierChoice) -> Self {
        let mut carver = Carver::measuring();
        Workspace::carve(basis, tier, Kernels::Scalar, &mut carver);
        Self {
            size_bytes: carver.bytes(),
            alignment: ALIGNMENT,
        }
    }

    /// Bytes that are enough wherever the memory starts.
    pub fn unaligned_bytes(&self) -> usize {
        self.size_bytes + self.alignment - 1
    }
}

fn check_tier(basis: &Basis<'_>, tier: TierChoice) -> Result<(), WorkspaceError> {
    match tier {
        _ if basis.has_tier(tier) => Ok(()),
        TierChoice::Exact => Err(WorkspaceError::NoExactTier),
        TierChoice::Bones => Err(WorkspaceError::NoBones),
    }
}

/// The buffers of the frame path. Made once; after that nothing needs memory.
#[derive(Debug)]
pub struct Workspace<'w> {
    basis: Identity,
    /// What the buffers are for; the basis has it.
    tier: TierChoice,
    /// What the frame path runs on; present on this machine.
    pub(crate) kernels: Kernels,
    /// Weights of the pose, tiny ones flushed. Shape: `[K]`.
    pub(crate) weights: &'w mut [f32],
    /// What the components count in the pose. Shape: `[K]`.
    pub(crate) shares: &'w mut [Share],
    /// Shape: `[B]`.
    pub(crate) blocks: &'w mut [BlockRest],
    /// `D = T - I` of the pose, or scratch. Shape: `[N]`, slots of the nodes.
    pub(crate) gradients: &'w mut [Gradient],
    /// Scratch: the groups of nodes that a pose touches. Shape: `[G]`.
    pub(crate) touched: &'w mut [u8],
    /// Right-hand side of the pose. Shape: that of `displacement`.
    pub(crate) forces: &'w mut [Quad],
    /// Whether another job has used the gradients since the last frame.
    pub(crate) gradients_are_stale: bool,
    /// Displacement of the pose, zero after the last node. Shape: `[T]`, solver order; empty for bones.
    pub(crate) displacement: &'w mut [Quad],
    /// Scratch: a solve that is not the pose's. Shape: that of `displacement`.
    pub(crate) solution: &'w mut [Quad],
    /// Gradients of the bones. Shape: `[B]`; empty in the exact tier, as all of the bones'.
    pub(crate) turned: &'w mut [Gradient],
    /// Displacements of the bones. Shape: `[H]`.
    pub(crate) displaced: &'w mut [BoneLanes],
    /// Maps of the pose. Shape: `[B]`.
    pub(crate) maps: &'w mut [Map],
    /// What the pose adds after the solve.
    pub(crate) added: Added<'w>,
    /// Scratch: positions for the normals. Shape: `[V]`, slots; empty for bones.
    pub(crate) posed: &'w mut [Xyz0],
    /// Box of the positions last written.
    pub(crate) bounds: Bounds,
}

impl<'w> Workspace<'w> {
    /// Carves `memory` for the nearest tier of `basis` and sets the rest pose. Bytes beyond the layout's stay untouched. Frames
    /// run on the widest kernels of this machine.
    ///
    /// # Errors
    /// [`WorkspaceError::TooSmall`], with the size that this memory would need given where it starts.
    pub fn new(basis: &Basis<'_>, memory: &'w mut [u8]) -> Result<Self, WorkspaceError> {
        Self::with_kernels(basis, memory, Kernels::detect())
    }

    /// The same with kernels of one's own choice: [`Kernels::Scalar`] gives the same bits on every machine.
    ///
    /// # Errors
    /// Those of [`Workspace::new`]; [`WorkspaceError::KernelsMissing`] where the processor lacks the instructions.
    pub fn with_kernels(basis: &Basis<'_>, memory: &'w mut [u8], kernels: Kernels) -> Result<Self, WorkspaceError> {
        Self::for_tier(basis, basis.nearest_tier(), memory, kernels)
    }

    /// The same for a tier of choice; [`WorkspaceLayout::for_tier`] says how much memory.
    ///
    /// # Errors
    /// Those of [`Workspace::with_kernels`]; [`WorkspaceError::NoBones`], [`WorkspaceError::NoExactTier`].
    pub fn for_tier(
        basis: &Basis<'_>,
        tier: TierChoice,
        memory: &'w mut [u8],
        kernels: Kernels,
    ) -> Result<Self, WorkspaceError> {
        if !kernels.run_here() {
            return Err(WorkspaceError::KernelsMissing { kernels });
        }
        let layout = WorkspaceLayout::for_tier(basis, tier)?;
        let mut carver = Carver::carving(memory, layout.size_bytes)?;
        let workspace = Self::carve(basis, tier, kernels, &mut carver);
        for (b, block) in workspace.blocks.iter_mut().enumerate() {
            block.bias = basis.bias(b);
        }
        kernels.rest_activations(workspace.blocks);
        shares_at_rest(basis, workspace.shares);
        Ok(workspace)
    }

    /// The sections in the order in which they lie in memory; all are zero. The limits of the format keep them under a
    /// gigabyte, which fits 32 bits.
    fn carve(basis: &Basis<'_>, tier: TierChoice, kernels: Kernels, carver: &mut Carver<'w>) -> Self {
        let (vertices, components) = (basis.vertex_count(), basis.component_count());
        let (solved, nodes, bones) = match tier {
            TierChoice::Exact => (vertices, vertices, 0),
            TierChoice::Bones => {
                let bones = basis.bones_view();
                bones.map_or((0, 0, 0), |bones| (0, bones.node_count, bones.rest_places.len()))
            }
        };
        let pieces = match tier {
            TierChoice::Exact => basis.after().piece_count(components),
            TierChoice::Bones => 0,
        };
        Self {
            basis: basis.identity(),
            tier,
            kernels,
            weights: carver.take(components),
            shares: carver.take(components),
            blocks: carver.take(basis.block_count()),
            gradients: carver.take(nodes),
            touched: carver.take(nodes.div_ceil(GROUP_NODES)),
            forces: carver.take(solved.div_ceil(QUAD)),
            gradients_are_stale: false,
            displacement: carver.take(solved.div_ceil(QUAD)),
            solution: carver.take(solved.div_ceil(QUAD)),
            turned: carver.take(bones),
            displaced: carver.take(bones.div_ceil(GROUP_NODES)),
            maps: carver.take(bones),
            added: Added::at_rest(carver.take(pieces)),
            posed: carver.take(solved),
            bounds: Bounds::EMPTY,
        }
    }

    /// Computes the features of the pose again, in network units; zero where no component reaches. Shape: `[V]`, source
    /// order.
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::NeedsExactTier`], [`FrameError::WrongLength`].
    pub fn features(&self, basis: &Basis<'_>, features: &mut [[f32; FEATURE_COUNT]]) -> Result<(), FrameError> {
        let tier = self.validate_exact(basis)?;
        check_length(basis.vertex_count(), Buffer::Features, features.len())?;
        let decoder = decoder(basis, tier.patches, self.shares, self.blocks);
        let mut group = [[0.0; GROUP_NODES]; FEATURE_COUNT];
        for (slot, v) in basis.vertex_from_slot().iter().enumerate() {
            let n = slot % GROUP_NODES;
            if n == 0 {
                self.kernels.features(&decoder, slot / GROUP_NODES, &mut group);
            }
            features[v as usize] = group.map(|row| row[n]);
        }
        Ok(())
    }

    /// `D = T - I` of the pose at the tier's nodes: the vertices, in slots, or those that the bones are made of. Three columns,
    /// each filled up with a zero. Shape: `[N]`.
    pub fn gradients(&self) -> &[[[f32; 4]; 3]] {
        self.gradients
    }

    /// Bounding box of the positions that the last job wrote: holds nothing, infinite and turned over, before the first.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Weights of the pose; those under 1e-6 count as zero. Shape: `[K]`.
    pub fn weights(&self) -> &[f32] {
        self.weights
    }

    /// What frames on this workspace play.
    pub fn tier(&self) -> TierChoice {
        self.tier
    }

    /// What frames on this workspace run on.
    pub fn kernels(&self) -> Kernels {
        self.kernels
    }

    /// Back to rest, which is exact.
    pub(crate) fn rest(&mut self) {
        self.weights.fill(0.0);
        self.shares.iter_mut().for_each(|share| share.factors = [0.0; 2]);
        self.gradients.fill([[0.0; 4]; 3]);
        self.gradients_are_stale = false;
        self.forces.fill(Quad::default());
        self.displacement.fill(Quad::default());
        self.maps.fill([[0.0; 4]; 4]);
        self.added.rest();
    }

    /// The exact tier, which this workspace plays.
    ///
    /// Errors: [`FrameError::ForeignWorkspace`]; [`FrameError::NeedsExactTier`] for a workspace of another tier.
    pub(crate) fn validate_exact<'a>(&self, basis: &Basis<'a>) -> Result<Tier<'a>, FrameError> {
        self.validate(basis)?;
        match self.tier {
            TierChoice::Exact => basis.exact().ok_or(FrameError::NeedsExactTier),
            TierChoice::Bones => Err(FrameError::NeedsExactTier),
        }
    }

    /// The bones, which this workspace plays.
    ///
    /// Errors: [`FrameError::ForeignWorkspace`]; [`FrameError::NeedsBones`] for a workspace of another tier.
    pub(crate) fn validate_bones<'a>(&self, basis: &Basis<'a>) -> Result<BonesView<'a>, FrameError> {
        self.validate(basis)?;
        match self.tier {
            TierChoice::Bones => basis.bones_view().ok_or(FrameError::NeedsBones),
            TierChoice::Exact => Err(FrameError::NeedsBones),
        }
    }

    /// Refuses a basis other than the one this workspace was made for.
    pub(crate) fn validate(&self, basis: &Basis<'_>) -> Result<(), FrameError> {
        if self.basis == basis.identity() {
            Ok(())
        } else {
            Err(FrameError::ForeignWorkspace)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;
    use crate::fixture::{Package, open};

    #[test]
    fn memory_may_start_anywhere() {
        let package = Package::small(1);
        let basis = open(&package);
        let layout = WorkspaceLayout::for_basis(&basis);
        let mut memory = vec![0xff_u8; layout.unaligned_bytes() + 70];
        for start in 0..70 {
            let workspace = Workspace::new(&basis, &mut memory[start..start + layout.unaligned_bytes()]).unwrap();
            assert_eq!(workspace.weights.len(), basis.component_count());
            let mut features = vec![[1.0; FEATURE_COUNT]; basis.vertex_count()];
            workspace.features(&basis, &mut features).unwrap();
            assert_eq!(features, vec![[0.0; FEATURE_COUNT]; basis.vertex_count()]);
            assert_eq!(workspace.gradients.as_ptr().align_offset(ALIGNMENT), 0);
            assert_eq!(workspace.solution.as_ptr().align_offset(ALIGNMENT), 0);
        }
    }

    #[test]
    fn too_little_memory_is_refused_with_the_size_it_needs() {
        let package = Package::small(1);
        let basis = open(&package);
        let layout = WorkspaceLayout::for_basis(&basis);
        let mut memory = vec![0_u8; layout.unaligned_bytes()];
        let skipped = memory.as_ptr().align_offset(layout.alignment);
        let exact = skipped + layout.size_bytes;
        assert!(Workspace::new(&basis, &mut memory[..exact]).is_ok());
        for actual_bytes in [0, 1, exact - 1] {
            let refused = Workspace::new(&basis, &mut memory[..actual_bytes]).unwrap_err();
            assert!(matches!(refused, WorkspaceError::TooSmall { actual_bytes: a, .. } if a == actual_bytes));
        }
        let refused = Workspace::new(&basis, &mut memory[..exact - 1]).unwrap_err();
        assert_eq!(
            refused,
            WorkspaceError::TooSmall {
                required_bytes: exact,
                actual_bytes: exact - 1
            }
        );
    }

    #[test]
    fn kernels_are_chosen_once_and_refused_where_they_do_not_run() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = vec![0_u8; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
        assert_eq!(
            Workspace::new(&basis, &mut memory).unwrap().kernels(),
            Kernels::detect()
        );
        for kernels in [Kernels::Scalar, Kernels::Portable, Kernels::Avx2, Kernels::Avx512] {
            let made = Workspace::with_kernels(&basis, &mut memory, kernels).map(|workspace| workspace.kernels());
            let missing = Err(WorkspaceError::KernelsMissing { kernels });
            assert_eq!(made, if kernels.run_here() { Ok(kernels) } else { missing });
        }
        assert!(Kernels::Scalar.run_here());
    }

    #[test]
    fn bones_are_refused_where_there_are_none_and_carved_where_there_are() {
        let (with, without) = (Package::small_with_bones(1), Package::small(1));
        let (with, without) = (open(&with), open(&without));
        assert_eq!(
            WorkspaceLayout::for_tier(&without, TierChoice::Bones),
            Err(WorkspaceError::NoBones)
        );
        let (mut memory, kernels) = (vec![0_u8; 100_000], Kernels::Scalar);
        let mut made = |basis, tier| {
            let workspace = Workspace::for_tier(basis, tier, &mut memory, kernels);
            workspace.map(|workspace| {
                let solved = (workspace.solution.len(), workspace.posed.len());
                (
                    workspace.tier(),
                    workspace.gradients.len(),
                    workspace.maps.len(),
                    solved,
                )
            })
        };
        assert_eq!(made(&without, TierChoice::Bones), Err(WorkspaceError::NoBones));
        let info = with.bones().unwrap();
        let (nodes, bones) = (info.node_count(), info.count());
        assert_eq!(
            made(&with, TierChoice::Bones),
            Ok((TierChoice::Bones, nodes, bones, (0, 0)))
        );
        let count = with.vertex_count();
        let exact = (TierChoice::Exact, count, 0, (count.div_ceil(QUAD), count));
        assert_eq!(made(&with, TierChoice::Exact), Ok(exact));

        let layout = WorkspaceLayout::for_tier(&with, TierChoice::Bones).unwrap();
        let mut memory = vec![0xff_u8; layout.unaligned_bytes()];
        let mut fits =
            |bytes: usize| Workspace::for_tier(&with, TierChoice::Bones, &mut memory[..bytes], kernels).is_ok();
        assert!(fits(layout.unaligned_bytes()));
        assert!(!fits(layout.size_bytes - 1));
    }

    #[test]
    fn layout_says_what_the_documentation_says() {
        let package = Package::small(1);
        let basis = open(&package);
        let layout = WorkspaceLayout::for_basis(&basis);
        let exact = 24 * basis.component_count() + 72 * basis.block_count() + 113 * basis.vertex_count();
        assert!(
            layout.size_bytes <= exact + 10 * layout.alignment,
            "{} {exact}",
            layout.size_bytes
        );
    }
}
