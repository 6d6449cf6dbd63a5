//! The memory of a frame: caller's bytes, carved once into the buffers between the steps, bound to one basis.
//!
//! A workspace always holds a pose that is finite and whole: the rest pose when new, then that of the last frame.

use sinew_formats::package::FEATURE_COUNT;

use crate::basis::{Basis, Tier};
use crate::error::{FrameError, WorkspaceError};
use crate::simd::Kernels;
use crate::simd::scalar::poisson::{BLOCK, Gradient, Lane};
use crate::simd::scalar::skin::Map;

/// Start of every buffer: a cache line, and the widest vector register.
const ALIGNMENT: usize = 64;

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
    /// Layout for the exact tier of `basis`: about 152 bytes a vertex.
    pub fn for_basis(basis: &Basis<'_>) -> Self {
        Sections::exact(basis).layout()
    }

    /// Layout for a tier of `basis`: the fast one takes about 200 bytes a node, which is 25 a vertex with a node for every
    /// eight.
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
    nodes: usize,
    largest_support: usize,
    /// Nodes of the solve that is not the pose's: none in the fast tier.
    solved_aside: usize,
    /// Nodes that vertices follow: none in the exact tier.
    maps: usize,
}

impl Sections {
    fn exact(basis: &Basis<'_>) -> Self {
        let tier = basis.exact();
        Self {
            solved_aside: tier.node_count(),
            maps: 0,
            ..Self::shared(basis, &tier)
        }
    }

    fn of(basis: &Basis<'_>, tier: TierChoice) -> Result<Self, WorkspaceError> {
        if tier == TierChoice::Exact {
            return Ok(Self::exact(basis));
        }
        let nodes = basis.fast().ok_or(WorkspaceError::NoFastTier)?.nodes();
        Ok(Self {
            solved_aside: 0,
            maps: nodes.node_count(),
            ..Self::shared(basis, &nodes)
        })
    }

    fn shared(basis: &Basis<'_>, tier: &Tier<'_>) -> Self {
        let supports = (0..tier.block_count()).map(|b| tier.support(b).len());
        Self {
            components: basis.component_count(),
            nodes: tier.node_count(),
            largest_support: supports.max().unwrap_or(0),
            solved_aside: 0,
            maps: 0,
        }
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

    /// The limits of the format keep this under a gigabyte, which fits 32 bits.
    fn size_bytes(&self) -> usize {
        section_bytes::<f32>(self.components)
            + section_bytes::<[f32; FEATURE_COUNT]>(self.nodes)
            + section_bytes::<[f32; FEATURE_COUNT]>(self.largest_support)
            + section_bytes::<Gradient>(self.nodes)
            + section_bytes::<Lane>(self.padded_nodes())
            + section_bytes::<Lane>(self.solved_aside.next_multiple_of(BLOCK))
            + section_bytes::<Map>(self.maps)
    }
}

/// Bytes of `count` elements, rounded up so that the next buffer is aligned.
fn section_bytes<T>(count: usize) -> usize {
    (count * size_of::<T>()).next_multiple_of(ALIGNMENT)
}

/// The buffers of the frame path. Made once; after that nothing needs memory.
#[derive(Debug)]
pub struct Workspace<'w> {
    basis_id: [u8; 16],
    /// What the buffers are for; the basis has it.
    pub(crate) tier: TierChoice,
    /// What the frame path runs on; present on this machine.
    pub(crate) kernels: Kernels,
    /// Weights of the pose, tiny ones flushed. Shape: `[K]`.
    pub(crate) weights: &'w mut [f32],
    /// Features of the pose, network units. Shape: `[N]`, solver order.
    pub(crate) features: &'w mut [[f32; FEATURE_COUNT]],
    /// Displacement of the pose, zero after the last node. Shape: `[4 T]`, solver order.
    pub(crate) displacement: &'w mut [Lane],
    /// Scratch: a block's blend. Shape: `[largest support]`.
    pub(crate) pre_activations: &'w mut [[f32; FEATURE_COUNT]],
    /// Scratch: `D = T - I` or its derivative. Shape: `[N]`, solver order.
    pub(crate) gradients: &'w mut [Gradient],
    /// Scratch: a solve that is not the pose's. Shape: that of `displacement`; empty in the fast tier.
    pub(crate) solution: &'w mut [Lane],
    /// Maps of the pose. Shape: `[N]`, solver order; empty in the exact tier.
    pub(crate) maps: &'w mut [Map],
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
        let (features, memory) = carve(memory, sections.nodes);
        let (displacement, memory) = carve(memory, sections.padded_nodes());
        let (pre_activations, memory) = carve(memory, sections.largest_support);
        let (gradients, memory) = carve(memory, sections.nodes);
        let (solution, memory) = carve(memory, sections.solved_aside.next_multiple_of(BLOCK));
        let (maps, _) = carve(memory, sections.maps);
        let basis_id = basis.id();
        Ok(Self {
            basis_id,
            tier,
            kernels,
            weights,
            features,
            displacement,
            pre_activations,
            gradients,
            solution,
            maps,
        })
    }

    /// Features of the pose, in network units; zero where no component reaches. Shape: `[V]`, **solver** order; in the fast
    /// tier `[N]`, those of its nodes.
    pub fn features(&self) -> &[[f32; FEATURE_COUNT]] {
        self.features
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
        self.features.fill([0.0; FEATURE_COUNT]);
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
fn carve<T: bytemuck::Pod>(memory: &mut [u8], count: usize) -> (&mut [T], &mut [u8]) {
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
            assert_eq!(workspace.features().len(), basis.vertex_count());
            assert!(workspace.features().iter().all(|x| *x == [0.0; FEATURE_COUNT]));
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
        let exact = 4 * basis.component_count() + 152 * basis.vertex_count();
        assert!(
            layout.size_bytes <= exact + 6 * layout.alignment,
            "{} {exact}",
            layout.size_bytes
        );
    }
}
