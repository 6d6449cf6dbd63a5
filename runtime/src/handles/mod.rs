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

use self::reach::Likely;

use crate::basis::{Basis, Identity, with_index};
use crate::decode::shares_at_rest;
use crate::error::WorkspaceError;
use crate::memory::{ALIGNMENT, Carver};
use crate::simd::generic::adjoint::{HeldSums, Pull, TOGETHER, pull};
use crate::simd::generic::decode::{Group, Share};
use crate::simd::generic::solve::{Quad, Rings, place, put};
use crate::solve::substitute;
use crate::workspace::Workspace;

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
        let mut carver = Carver::measuring();
        Handles::carve(basis, capacity, &mut carver);
        Self {
            size_bytes: carver.bytes(),
            alignment: ALIGNMENT,
        }
    }

    /// Bytes that are enough wherever the memory starts.
    pub fn unaligned_bytes(&self) -> usize {
        self.size_bytes.saturating_add(self.alignment - 1)
    }
}

/// Held vertices, their targets, and the components that dragging leaves alone. Lives in the caller's memory; belongs to one
/// basis. A vertex is held once at most and is named by its source index.
#[derive(Debug)]
pub struct Handles<'h> {
    basis: Identity,
    count: usize,
    /// Of the basis: length of the diagonal of the rest shape's bounding box, positive.
    diagonal: f64,
    /// What multiplies the ridges: 1, more after steps that were worse than none.
    caution: f64,
    /// Whether `evaluated` is what `features`, `slopes` and `positions` belong to.
    is_evaluated: bool,
    /// Whether `start` is that of the vertices that are held.
    is_started: bool,
    /// Source order. Shape: `[capacity]`.
    vertices: &'h mut [u32],
    /// Shape: `[capacity]`, units of the source.
    targets: &'h mut [[f32; 3]],
    /// Held vertices at `evaluated`. Shape: `[capacity]`.
    positions: &'h mut [[f32; 3]],
    /// Held vertices at a step that may be taken. Shape: `[capacity]`.
    trial_positions: &'h mut [[f32; 3]],
    /// Shape: `[capacity][G]`, slots.
    pulls: &'h mut [Pull],
    /// Shape: `[G]`, slots.
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
    /// Weights that steps are counted from: in a package that knows its weights those when the held vertices were last chosen, moved by
    /// what others have moved since; in any other those when the update began. Shape: `[K]`.
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
    /// One over each control's range, 0 where it has none. Shape: `[K]`.
    inverse_ranges: &'h mut [f32],
    /// Scratch of a pass that knows the weights. Shape: the prior's factors and its mean `[Q][3 * capacity]`.
    projected: &'h mut [f64],
}

impl<'h> Handles<'h> {
    /// Carves `memory` for `capacity` handles (at most [`HANDLES_MAX`]); none is held, no component pinned.
    ///
    /// # Errors
    /// [`WorkspaceError::TooSmall`], with the size that this memory would need given where it starts.
    pub fn new(basis: &Basis<'_>, capacity: usize, memory: &'h mut [u8]) -> Result<Self, WorkspaceError> {
        let layout = HandlesLayout::for_basis(basis, capacity);
        let mut carver = Carver::carving(memory, layout.size_bytes)?;
        let handles = Self::carve(basis, capacity, &mut carver);
        shares_at_rest(basis, handles.shares);
        Ok(Self {
            diagonal: diagonal(basis.rest_positions()),
            ..handles
        })
    }

    /// The sections in the order in which they lie in memory; all are zero.
    fn carve(basis: &Basis<'_>, capacity: usize, carver: &mut Carver<'h>) -> Self {
        let capacity = capacity.min(HANDLES_MAX);
        let (groups, components) = (basis.vertex_count().div_ceil(GROUP_NODES), basis.component_count());
        // Three rows of the small system a handle.
        let rows = 3 * capacity;
        Self {
            basis: basis.identity(),
            count: 0,
            diagonal: 1.0,
            caution: 1.0,
            is_evaluated: false,
            is_started: false,
            vertices: carver.take(capacity),
            targets: carver.take(capacity),
            positions: carver.take(capacity),
            trial_positions: carver.take(capacity),
            pulls: carver.take(capacity.saturating_mul(groups)),
            features: carver.take(groups),
            held_sums: carver.take(capacity.div_ceil(TOGETHER)),
            derivative_sums: carver.take(components),
            shares: carver.take(components),
            memory: Memory {
                pinned: carver.take(components),
                is_free: carver.take(components),
                evaluated: carver.take(components),
                start: carver.take(components),
                trial: carver.take(components),
                offsets: carver.take(components),
                lower: carver.take(components),
                upper: carver.take(components),
                jacobian: carver.take(rows * components),
                gram: carver.take(rows * rows),
                residual: carver.take(rows),
                multipliers: carver.take(rows),
                inverse_ranges: carver.take(components),
                projected: carver.take(Likely::factor_count(&basis.prior()).saturating_mul(rows)),
            },
        }
    }

    /// Takes hold of a vertex where the workspace's pose has it: costs one solve, and every drag from now on a little. Its
    /// target is its place, so a handle that is never moved holds its vertex.
    ///
    /// # Errors
    /// [`HandleError::ForeignHandles`], [`HandleError::ForeignWorkspace`], [`HandleError::NeedsExactTier`],
    /// [`HandleError::NoSuchVertex`], [`HandleError::AlreadyHeld`], [`HandleError::Full`].
    pub fn add(&mut self, basis: &Basis<'_>, workspace: &mut Workspace<'_>, vertex: usize) -> Result<(), HandleError> {
        self.check_basis(basis)?;
        let tier = workspace.validate_exact(basis).map_err(HandleError::of_workspace)?;
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
        let (slot, n) = (basis.slot_from_vertex().at(vertex) as usize, self.count);
        let solver = tier.solve.solver_from_slot.at(slot);
        workspace.solution.fill(Quad::default());
        put(workspace.solution, solver, [1.0, 0.0, 0.0]);
        substitute(workspace.kernels, &tier, workspace.solution);
        let group_count = self.features.len();
        let own = &mut self.pulls[n * group_count..][..group_count];
        with_index!(vertex_count, I => pull(&Rings::<I>::of(&tier.solve), tier.rest, workspace.solution, own));
        let (rest, moved) = (tier.rest[slot], place(workspace.displacement, solver));
        let added = workspace.added.at(&basis.after(), slot);
        self.vertices[n] = vertex as u32;
        self.targets[n] = core::array::from_fn(|c| rest[c] + moved[c] + added[c]);
        self.count += 1;
        self.is_evaluated = false;
        self.is_started = false;
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
        self.is_started = false;
        Ok(())
    }

    /// Lets go of all vertices. Pinned components stay pinned.
    pub fn clear(&mut self) {
        self.count = 0;
        self.is_evaluated = false;
        self.is_started = false;
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
        // It stays where it is now, not where it was.
        self.is_started = false;
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
        if self.basis == basis.identity() {
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
