//! The memory of a frame: caller's bytes, carved once into the buffers between the steps, bound to one basis.
//!
//! A workspace always holds a pose that is finite and whole: the rest pose when new, then that of the last frame.

use sinew_formats::package::{FEATURE_COUNT, GROUP_NODES};

use crate::basis::Basis;
use crate::decode::decoder;
use crate::error::{Buffer, FrameError, WorkspaceError};
use crate::normals::check_length;
use crate::simd::Kernels;
use crate::simd::decode::{BlockRest, Share};
use crate::simd::lanes::Gradient;
use crate::simd::scalar::poisson::{BLOCK, Lane};
use crate::simd::scalar::skin::Map;
use crate::simd::scalar::surface::Bounds;

/// Start of every buffer: a cache line, and the widest vector register.
pub(crate) const ALIGNMENT: usize = 64;

/// Which tier of a package a workspace plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum TierChoice {
    /// All vertices are solved for: what was trained.
    #[default]
    Exact,
    /// A few nodes are solved for, and the vertices follow them: for crowds and small devices. How far it is from the exact
    /// tier, [`Basis::fast_error`] says.
    Fast,
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
    /// Layout for the exact tier of `basis`: about 96 bytes a vertex.
    pub fn for_basis(basis: &Basis<'_>) -> Self {
        Sections::exact(basis).layout()
    }

    /// Layout for a tier of `basis`. The fast one takes 16 bytes a vertex and 128 a node: a third of the exact one's with a
    /// node for every eight vertices.
    ///
    /// # Errors
    /// [`WorkspaceError::NoFastTier`].
    pub fn for_tier(basis: &Basis<'_>, tier: TierChoice) -> Result<Self, WorkspaceError> {
        Ok(Sections::of(basis, tier)?.layout())
    }

    /// Bytes that are enough wherever the memory starts.
    pub fn unaligned_bytes(&self) -> usize {
        self.size_bytes + self.alignment - 1
    }
}

/// Element counts of the buffers, in the order in which they lie in memory.
struct Sections {
    components: usize,
    blocks: usize,
    nodes: usize,
    /// Nodes of the solve that is not the pose's: none in the fast tier.
    solved_aside: usize,
    /// Nodes that vertices follow: none in the exact tier.
    maps: usize,
    vertices: usize,
}

impl Sections {
    fn exact(basis: &Basis<'_>) -> Self {
        let vertices = basis.vertex_count();
        Self {
            components: basis.component_count(),
            blocks: basis.block_count(),
            nodes: vertices,
            solved_aside: vertices,
            maps: 0,
            vertices,
        }
    }

    fn of(basis: &Basis<'_>, tier: TierChoice) -> Result<Self, WorkspaceError> {
        let exact = Self::exact(basis);
        if tier == TierChoice::Exact {
            return Ok(exact);
        }
        let nodes = basis.fast_node_count().ok_or(WorkspaceError::NoFastTier)?;
        Ok(Self {
            nodes,
            solved_aside: 0,
            maps: nodes,
            ..exact
        })
    }

    fn layout(&self) -> WorkspaceLayout {
        WorkspaceLayout {
            size_bytes: self.size_bytes(),
            alignment: ALIGNMENT,
        }
    }

    /// Nodes of whole blocks: the solve runs on tiles.
    fn padded_nodes(&self) -> usize {
        self.nodes.next_multiple_of(BLOCK)
    }

    fn padded_aside(&self) -> usize {
        self.solved_aside.next_multiple_of(BLOCK)
    }

    /// The limits of the format keep this under a gigabyte, which fits 32 bits.
    fn size_bytes(&self) -> usize {
        section_bytes::<f32>(self.components)
            + section_bytes::<Share>(self.components)
            + section_bytes::<BlockRest>(self.blocks)
            + section_bytes::<Gradient>(self.nodes)
            + section_bytes::<Lane>(self.padded_nodes())
            + section_bytes::<Lane>(self.padded_aside())
            + section_bytes::<Map>(self.maps)
            + section_bytes::<[f32; 4]>(self.vertices)
    }
}

/// Bytes of `count` elements, rounded up so that the next buffer is aligned.
pub(crate) fn section_bytes<T>(count: usize) -> usize {
    let bytes = count.saturating_mul(size_of::<T>()).saturating_add(ALIGNMENT - 1);
    bytes - bytes % ALIGNMENT
}

/// The buffers of the frame path. Made once; after that nothing needs memory.
#[derive(Debug)]
pub struct Workspace<'w> {
    basis_id: [u8; 16],
    /// What the buffers are for; the basis has it.
    tier: TierChoice,
    /// What the frame path runs on; present on this machine.
    pub(crate) kernels: Kernels,
    /// Weights of the pose, tiny ones flushed. Shape: `[K]`.
    pub(crate) weights: &'w mut [f32],
    /// What the components count in the pose. Shape: `[K]`.
    pub(crate) shares: &'w mut [Share],
    /// Constants of the basis and the kernels. Shape: `[B]`.
    pub(crate) blocks: &'w mut [BlockRest],
    /// `D = T - I` of the pose, or scratch. Shape: `[N]`, lanes.
    pub(crate) gradients: &'w mut [Gradient],
    /// Whether another job has used the gradients since the last frame.
    pub(crate) gradients_are_stale: bool,
    /// Displacement of the pose, zero after the last node. Shape: `[4 T]`, solver order.
    pub(crate) displacement: &'w mut [Lane],
    /// Scratch: a solve that is not the pose's. Shape: that of `displacement`; empty in the fast tier.
    pub(crate) solution: &'w mut [Lane],
    /// Maps of the pose. Shape: `[N]`, lanes; empty in the exact tier.
    pub(crate) maps: &'w mut [Map],
    /// Scratch: positions for the normals. Shape: `[V]`, lanes.
    pub(crate) posed: &'w mut [[f32; 4]],
    /// Box of the positions last written.
    pub(crate) bounds: Bounds,
}

impl<'w> Workspace<'w> {
    /// Carves `memory`, sets the rest pose. Bytes beyond the layout's stay untouched. Frames run on the widest kernels of
    /// this machine.
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
        Self::for_tier(basis, TierChoice::Exact, memory, kernels)
    }

    /// The same for a tier of choice; [`WorkspaceLayout::for_tier`] says how much memory.
    ///
    /// # Errors
    /// Those of [`Workspace::with_kernels`]; [`WorkspaceError::NoFastTier`].
    pub fn for_tier(
        basis: &Basis<'_>,
        tier: TierChoice,
        memory: &'w mut [u8],
        kernels: Kernels,
    ) -> Result<Self, WorkspaceError> {
        if !kernels.run_here() {
            return Err(WorkspaceError::KernelsMissing { kernels });
        }
        let sections = Sections::of(basis, tier)?;
        let skipped = memory.as_ptr().align_offset(ALIGNMENT);
        let required_bytes = skipped.saturating_add(sections.size_bytes());
        if memory.len() < required_bytes {
            return Err(WorkspaceError::TooSmall {
                required_bytes,
                actual_bytes: memory.len(),
            });
        }
        let memory = &mut memory[skipped..required_bytes];
        memory.fill(0);
        let (weights, memory) = carve(memory, sections.components);
        let (shares, memory) = carve(memory, sections.components);
        let (blocks, memory) = carve::<BlockRest>(memory, sections.blocks);
        let (gradients, memory) = carve(memory, sections.nodes);
        let (displacement, memory) = carve(memory, sections.padded_nodes());
        let (solution, memory) = carve(memory, sections.padded_aside());
        let (maps, memory) = carve(memory, sections.maps);
        let (posed, _) = carve(memory, sections.vertices);
        for (b, block) in blocks.iter_mut().enumerate() {
            block.bias = basis.exact().block(b).bias;
        }
        kernels.rest_activations(blocks);
        let basis_id = basis.id();
        Ok(Self {
            basis_id,
            tier,
            kernels,
            weights,
            shares,
            blocks,
            gradients,
            gradients_are_stale: false,
            displacement,
            solution,
            maps,
            posed,
            bounds: Bounds::EMPTY,
        })
    }

    /// Computes the features of the pose again, in network units; zero where no component reaches. Shape: `[V]`, source
    /// order.
    ///
    /// # Errors
    /// [`FrameError::ForeignWorkspace`], [`FrameError::NeedsExactTier`], [`FrameError::WrongLength`].
    pub fn features(&self, basis: &Basis<'_>, features: &mut [[f32; FEATURE_COUNT]]) -> Result<(), FrameError> {
        self.validate_exact(basis)?;
        check_length(basis, Buffer::Features, features.len())?;
        let tier = basis.exact();
        let decoder = decoder(&tier, self.shares, self.blocks, true);
        let mut group = [[0.0; GROUP_NODES]; FEATURE_COUNT];
        for (g, vertices) in basis.vertex_from_lane().chunks(GROUP_NODES).enumerate() {
            self.kernels.features(&decoder, g, &mut group);
            for (n, &v) in vertices.iter().enumerate() {
                features[v as usize] = group.map(|row| row[n]);
            }
        }
        Ok(())
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
        self.shares.fill(Share::default());
        self.gradients.fill([[0.0; 4]; 3]);
        self.gradients_are_stale = false;
        self.displacement.fill([0.0; 4]);
        self.maps.fill([[0.0; 4]; 4]);
    }

    /// Refuses another basis, and the fast tier.
    pub(crate) fn validate_exact(&self, basis: &Basis<'_>) -> Result<(), FrameError> {
        self.validate(basis)?;
        match self.tier {
            TierChoice::Exact => Ok(()),
            TierChoice::Fast => Err(FrameError::NeedsExactTier),
        }
    }

    /// Refuses a basis other than the one this workspace was made for.
    pub(crate) fn validate(&self, basis: &Basis<'_>) -> Result<(), FrameError> {
        if self.basis_id == basis.id() {
            Ok(())
        } else {
            Err(FrameError::ForeignWorkspace)
        }
    }
}

/// Splits the first `count` elements off aligned memory.
pub(crate) fn carve<T: bytemuck::Pod>(memory: &mut [u8], count: usize) -> (&mut [T], &mut [u8]) {
    let (section, rest) = memory.split_at_mut(section_bytes::<T>(count));
    let section = &mut section[..count * size_of::<T>()];
    (bytemuck::cast_slice_mut(section), rest)
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
        for kernels in [Kernels::Scalar, Kernels::Avx2, Kernels::Avx512] {
            let made = Workspace::with_kernels(&basis, &mut memory, kernels).map(|workspace| workspace.kernels());
            let missing = Err(WorkspaceError::KernelsMissing { kernels });
            assert_eq!(made, if kernels.run_here() { Ok(kernels) } else { missing });
        }
        assert!(Kernels::Scalar.run_here());
    }

    #[test]
    fn the_fast_tier_is_refused_where_there_is_none_and_carved_where_there_is() {
        let (with, without) = (Package::small_with_fast_tier(1), Package::small(1));
        let (with, without) = (open(&with), open(&without));
        let none = Err(WorkspaceError::NoFastTier);
        assert_eq!(WorkspaceLayout::for_tier(&without, TierChoice::Fast), none);
        let (mut memory, kernels) = (vec![0_u8; 100_000], Kernels::Scalar);
        let mut made = |basis, tier| {
            let workspace = Workspace::for_tier(basis, tier, &mut memory, kernels);
            workspace.map(|workspace| (workspace.tier(), workspace.maps.len(), workspace.solution.len()))
        };
        assert_eq!(made(&without, TierChoice::Fast), Err(WorkspaceError::NoFastTier));
        let nodes = with.fast_node_count().unwrap();
        assert_eq!(made(&with, TierChoice::Fast), Ok((TierChoice::Fast, nodes, 0)));
        let padded = nodes.next_multiple_of(BLOCK);
        assert_eq!(made(&with, TierChoice::Exact), Ok((TierChoice::Exact, 0, padded)));

        let layout = WorkspaceLayout::for_tier(&with, TierChoice::Fast).unwrap();
        let mut memory = vec![0xff_u8; layout.unaligned_bytes()];
        let mut fits =
            |bytes: usize| Workspace::for_tier(&with, TierChoice::Fast, &mut memory[..bytes], kernels).is_ok();
        assert!(fits(layout.unaligned_bytes()));
        assert!(!fits(layout.size_bytes - 1));
    }

    #[test]
    fn layout_says_what_the_documentation_says() {
        let package = Package::small(1);
        let basis = open(&package);
        let layout = WorkspaceLayout::for_basis(&basis);
        let exact = 12 * basis.component_count() + 72 * basis.block_count() + 96 * basis.vertex_count();
        assert!(
            layout.size_bytes <= exact + 8 * layout.alignment,
            "{} {exact}",
            layout.size_bytes
        );
    }
}
