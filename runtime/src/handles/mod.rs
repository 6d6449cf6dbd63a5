//! Handles: vertices that the user holds. [`Drag`] moves the weights so that they come to where the user wants them
//! (method section 5).
//!
//! Path of data: a vertex -> one solve, its row of the inverse -> its *pull* on every deformation gradient, kept while the
//! vertex is held. A drag then needs no solve at all: the held vertices and their derivatives by all weights are sums
//! over the mesh.

mod drag;
mod error;
mod pose;
mod reach;

pub use drag::{Drag, DragReport};
pub use error::HandleError;

use sinew_formats::package::GROUP_NODES;

use crate::basis::Basis;
use crate::error::WorkspaceError;
use crate::simd::adjoint::{HeldSums, Pull, TOGETHER, pull};
use crate::simd::decode::{Group, Share};
use crate::solve::substitute;
use crate::workspace::{ALIGNMENT, Workspace, carve, section_bytes};

/// Most handles at once: the small system of a drag grows with the cube of their number.
pub const HANDLES_MAX: usize = 64;

/// How much memory handles need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandlesLayout {
    /// Bytes, when the memory starts at a multiple of `alignment`.
    pub size_bytes: usize,
    /// Preferred alignment of the memory, in bytes.
    pub alignment: usize,
}

impl HandlesLayout {
    /// Layout for `capacity` handles, of which more than [`HANDLES_MAX`] count as that many: 12 bytes a vertex for each of
    /// them, 36 a vertex for all, and about 800 a component.
    pub fn for_basis(basis: &Basis<'_>, capacity: usize) -> Self {
        Self {
            size_bytes: Sections::of(basis, capacity).size_bytes(),
            alignment: ALIGNMENT,
        }
    }

    /// Bytes that are enough wherever the memory starts.
    pub fn unaligned_bytes(&self) -> usize {
        self.size_bytes.saturating_add(self.alignment - 1)
    }
}

/// Element counts of the buffers.
struct Sections {
    capacity: usize,
    groups: usize,
    components: usize,
}

impl Sections {
    fn of(basis: &Basis<'_>, capacity: usize) -> Self {
        Self {
            capacity: capacity.min(HANDLES_MAX),
            groups: basis.vertex_count().div_ceil(GROUP_NODES),
            components: basis.component_count(),
        }
    }

    /// Rows of the small system: three a handle.
    fn rows(&self) -> usize {
        3 * self.capacity
    }

    /// Saturates where 32 bits are too few: then no memory is large enough.
    fn size_bytes(&self) -> usize {
        let (handles, rows) = (self.capacity, self.rows());
        [
            section_bytes::<u32>(handles),
            3 * section_bytes::<[f32; 3]>(handles),
            section_bytes::<Pull>(handles.saturating_mul(self.groups)),
            section_bytes::<Group<f32>>(self.groups),
            section_bytes::<HeldSums>(handles.div_ceil(TOGETHER)),
            section_bytes::<HeldSums>(self.components),
            section_bytes::<Share>(self.components),
            8 * section_bytes::<f32>(self.components),
            section_bytes::<f32>(rows * self.components),
            section_bytes::<f64>(rows * rows),
            2 * section_bytes::<f64>(rows),
        ]
        .into_iter()
        .fold(0, usize::saturating_add)
    }
}

/// Held vertices, their targets, and the components that dragging leaves alone. Lives in the caller's memory; belongs to one
/// basis. A vertex is held once at most and is named by its source index.
#[derive(Debug)]
pub struct Handles<'h> {
    basis_id: [u8; 16],
    count: usize,
    /// Of the basis: length of the diagonal of the rest shape's bounding box, positive.
    diagonal: f64,
    /// What multiplies the ridges: 1, more after steps that were worse than none.
    caution: f64,
    /// Whether `evaluated` is what `features`, `slopes` and `positions` belong to.
    is_evaluated: bool,
    /// Source order. Shape: `[capacity]`.
    vertices: &'h mut [u32],
    /// Shape: `[capacity]`, units of the source.
    targets: &'h mut [[f32; 3]],
    /// Held vertices at `evaluated`. Shape: `[capacity]`.
    positions: &'h mut [[f32; 3]],
    /// Held vertices at a step that may be taken. Shape: `[capacity]`.
    trial_positions: &'h mut [[f32; 3]],
    /// Shape: `[capacity][G]`, lanes.
    pulls: &'h mut [Pull],
    /// Shape: `[G]`, lanes.
    features: &'h mut [Group<f32>],
    /// Shape: `[ceil(capacity / TOGETHER)]`.
    held_sums: &'h mut [HeldSums],
    /// Shape: `[K]`.
    derivative_sums: &'h mut [HeldSums],
    /// Of the weights that were evaluated. Shape: `[K]`.
    shares: &'h mut [Share],
    memory: Memory<'h>,
}

/// What a drag needs for every component.
#[derive(Debug)]
struct Memory<'h> {
    /// 1 where dragging leaves the component alone. Shape: `[K]`.
    pinned: &'h mut [u32],
    /// Scratch of a pass. Shape: `[K]`.
    is_free: &'h mut [u32],
    /// Weights that the held positions belong to. Shape: `[K]`.
    evaluated: &'h mut [f32],
    /// Weights when the drag began. Shape: `[K]`.
    start: &'h mut [f32],
    /// Weights of a step that may be taken. Shape: `[K]`.
    trial: &'h mut [f32],
    /// Steps from the start, in shares of each control's range. Shape: `[K]`.
    offsets: &'h mut [f32],
    /// Least offset. Shape: `[K]`.
    lower: &'h mut [f32],
    /// Greatest offset. Shape: `[K]`.
    upper: &'h mut [f32],
    /// Shares of the diagonal a share of the range. Shape: `[K][3 * capacity]`, `3 * count` of each row in use.
    jacobian: &'h mut [f32],
    /// Shape: `[3 * capacity]` squared.
    gram: &'h mut [f64],
    /// Shape: `[3 * capacity]`.
    residual: &'h mut [f64],
    /// Shape: `[3 * capacity]`.
    multipliers: &'h mut [f64],
}

impl<'h> Handles<'h> {
    /// Carves `memory` for `capacity` handles (at most [`HANDLES_MAX`]); none is held, no component pinned.
    ///
    /// # Errors
    /// [`WorkspaceError::TooSmall`], with the size that this memory would need given where it starts.
    pub fn new(basis: &Basis<'_>, capacity: usize, memory: &'h mut [u8]) -> Result<Self, WorkspaceError> {
        let sections = Sections::of(basis, capacity);
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
        let (handles, rows, components) = (sections.capacity, sections.rows(), sections.components);
        let (vertices, memory) = carve(memory, handles);
        let (targets, memory) = carve(memory, handles);
        let (positions, memory) = carve(memory, handles);
        let (trial_positions, memory) = carve(memory, handles);
        let (pulls, memory) = carve(memory, handles * sections.groups);
        let (features, memory) = carve(memory, sections.groups);
        let (held_sums, memory) = carve(memory, handles.div_ceil(TOGETHER));
        let (derivative_sums, memory) = carve(memory, components);
        let (shares, memory) = carve(memory, components);
        let (pinned, memory) = carve(memory, components);
        let (is_free, memory) = carve(memory, components);
        let (evaluated, memory) = carve(memory, components);
        let (start, memory) = carve(memory, components);
        let (trial, memory) = carve(memory, components);
        let (offsets, memory) = carve(memory, components);
        let (lower, memory) = carve(memory, components);
        let (upper, memory) = carve(memory, components);
        let (jacobian, memory) = carve(memory, rows * components);
        let (gram, memory) = carve(memory, rows * rows);
        let (residual, memory) = carve(memory, rows);
        let (multipliers, _) = carve(memory, rows);
        Ok(Self {
            basis_id: basis.id(),
            count: 0,
            diagonal: diagonal(basis.rest_positions()),
            caution: 1.0,
            is_evaluated: false,
            vertices,
            targets,
            positions,
            trial_positions,
            pulls,
            features,
            held_sums,
            derivative_sums,
            shares,
            memory: Memory {
                pinned,
                is_free,
                evaluated,
                start,
                trial,
                offsets,
                lower,
                upper,
                jacobian,
                gram,
                residual,
                multipliers,
            },
        })
    }

    /// Takes hold of a vertex where the workspace's pose has it: costs one solve, and every drag from now on a little. Its
    /// target is its place, so a handle that is never moved holds its vertex.
    ///
    /// # Errors
    /// [`HandleError::ForeignHandles`], [`HandleError::ForeignWorkspace`], [`HandleError::NeedsExactTier`],
    /// [`HandleError::NoSuchVertex`], [`HandleError::AlreadyHeld`], [`HandleError::Full`].
    pub fn add(&mut self, basis: &Basis<'_>, workspace: &mut Workspace<'_>, vertex: usize) -> Result<(), HandleError> {
        self.check_basis(basis)?;
        workspace.validate_exact(basis).map_err(HandleError::of_workspace)?;
        let (vertex_count, capacity) = (basis.vertex_count(), self.vertices.len());
        if vertex >= vertex_count {
            return Err(HandleError::NoSuchVertex { vertex, vertex_count });
        }
        if self.index_of(vertex).is_ok() {
            return Err(HandleError::AlreadyHeld { vertex });
        }
        if self.count == capacity {
            return Err(HandleError::Full { capacity });
        }
        let (lane, n) = (basis.lane_from_vertex()[vertex] as usize, self.count);
        let solver = basis.orders().solver_from_lane[lane] as usize;
        workspace.solution.fill([0.0; 4]);
        workspace.solution[solver][0] = 1.0;
        let tier = basis.exact();
        substitute(workspace.kernels, &tier.factor(), workspace.solution.as_chunks_mut().0);
        let group_count = self.features.len();
        let own = &mut self.pulls[n * group_count..][..group_count];
        pull(&tier.rings(), tier.rest_positions(), workspace.solution, own);
        let (rest, moved) = (basis.rest_positions()[lane], workspace.displacement[solver]);
        self.vertices[n] = vertex as u32;
        self.targets[n] = core::array::from_fn(|c| rest[c] + moved[c]);
        self.count += 1;
        self.is_evaluated = false;
        Ok(())
    }

    /// Lets go of a vertex.
    ///
    /// # Errors
    /// [`HandleError::NotHeld`].
    pub fn remove(&mut self, vertex: usize) -> Result<(), HandleError> {
        let n = self.index_of(vertex)?;
        let group_count = self.features.len();
        self.count -= 1;
        self.vertices.copy_within(n + 1..=self.count, n);
        self.targets.copy_within(n + 1..=self.count, n);
        let (first, last) = ((n + 1) * group_count, (self.count + 1) * group_count);
        self.pulls.copy_within(first..last, n * group_count);
        self.is_evaluated = false;
        Ok(())
    }

    /// Lets go of all vertices. Pinned components stay pinned.
    pub fn clear(&mut self) {
        self.count = 0;
        self.is_evaluated = false;
    }

    /// Says where a held vertex should go; the next [`Drag`] moves it there. Units of the source.
    ///
    /// # Errors
    /// [`HandleError::NotHeld`]; [`HandleError::TargetNotFinite`], and the last target stays.
    pub fn set_target(&mut self, vertex: usize, target: [f32; 3]) -> Result<(), HandleError> {
        let n = self.index_of(vertex)?;
        if !target.iter().all(|x| x.is_finite()) {
            return Err(HandleError::TargetNotFinite { vertex });
        }
        self.targets[n] = target;
        Ok(())
    }

    /// Leaves a component alone while dragging, or no longer.
    ///
    /// # Errors
    /// [`HandleError::NoSuchComponent`].
    pub fn pin(&mut self, component: usize, is_pinned: bool) -> Result<(), HandleError> {
        let component_count = self.memory.pinned.len();
        let no_such = HandleError::NoSuchComponent {
            component,
            component_count,
        };
        *self.memory.pinned.get_mut(component).ok_or(no_such)? = u32::from(is_pinned);
        Ok(())
    }

    /// Whether dragging leaves a component alone.
    ///
    /// # Errors
    /// [`HandleError::NoSuchComponent`].
    pub fn is_pinned(&self, component: usize) -> Result<bool, HandleError> {
        let component_count = self.memory.pinned.len();
        let no_such = HandleError::NoSuchComponent {
            component,
            component_count,
        };
        self.memory.pinned.get(component).map(|&p| p == 1).ok_or(no_such)
    }

    /// The held vertices in the order in which they were added, source order's indices.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices[..self.count]
    }

    /// Where they should go. Shape: that of [`Handles::vertices`].
    pub fn targets(&self) -> &[[f32; 3]] {
        &self.targets[..self.count]
    }

    /// Handles there is room for.
    pub fn capacity(&self) -> usize {
        self.vertices.len()
    }

    fn index_of(&self, vertex: usize) -> Result<usize, HandleError> {
        let held = self.vertices().iter().position(|&v| v as usize == vertex);
        held.ok_or(HandleError::NotHeld { vertex })
    }

    fn check_basis(&self, basis: &Basis<'_>) -> Result<(), HandleError> {
        if self.basis_id == basis.id() {
            Ok(())
        } else {
            Err(HandleError::ForeignHandles)
        }
    }
}

/// Diagonal of the bounding box; 1 for a point, so that shares of it stay numbers.
fn diagonal(positions: &[[f32; 3]]) -> f64 {
    let sides = (0..3).map(|c| {
        let values = positions.iter().map(|p| f64::from(p[c]));
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    });
    let squared: f64 = sides.map(|side| side * side).sum();
    if squared > 0.0 { libm::sqrt(squared) } else { 1.0 }
}

#[cfg(test)]
mod tests;
