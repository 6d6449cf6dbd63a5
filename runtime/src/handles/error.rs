//! What a caller can do wrong with handles. Plain values without heap; nothing has changed when one comes back.

use core::fmt;

use crate::error::FrameError;

/// Why handles refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum HandleError {
    /// The handles were made for another basis.
    ForeignHandles,
    /// The workspace was made for another basis.
    ForeignWorkspace,
    /// The workspace was made for bones: handles hold vertices of the exact one.
    NeedsExactTier,
    /// The controls belong to another basis.
    ForeignControls,
    /// There is no such vertex.
    NoSuchVertex {
        /// The vertex asked for, source order.
        vertex: usize,
        /// Vertices of the basis.
        vertex_count: usize,
    },
    /// There is no such component.
    NoSuchComponent {
        /// The component asked for.
        component: usize,
        /// Components of the basis.
        component_count: usize,
    },
    /// The vertex is held already.
    AlreadyHeld {
        /// Source order.
        vertex: usize,
    },
    /// The vertex is not held.
    NotHeld {
        /// Source order.
        vertex: usize,
    },
    /// There is no room for another handle.
    Full {
        /// Handles there is room for.
        capacity: usize,
    },
    /// A target is NaN or infinite.
    TargetNotFinite {
        /// The vertex it was meant for, source order.
        vertex: usize,
    },
    /// The controls stand so far out that a held vertex left f32.
    NotFinite {
        /// Source order.
        vertex: usize,
    },
}

impl HandleError {
    /// What a workspace's own check found.
    pub(super) fn of_workspace(error: FrameError) -> Self {
        match error {
            FrameError::NeedsExactTier => Self::NeedsExactTier,
            _ => Self::ForeignWorkspace,
        }
    }
}

impl core::error::Error for HandleError {}

impl fmt::Display for HandleError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::ForeignHandles => write!(out, "the handles were made for another basis; make some for this basis"),
            Self::ForeignWorkspace => write!(out, "the workspace was made for another basis; make one for this basis"),
            Self::NeedsExactTier => write!(out, "handles need a workspace of the exact tier"),
            Self::ForeignControls => write!(out, "the controls belong to another basis; make some for this basis"),
            Self::NoSuchVertex { vertex, vertex_count } => {
                write!(out, "there is no vertex {vertex}: the basis has {vertex_count}")
            }
            Self::NoSuchComponent {
                component,
                component_count,
            } => {
                write!(
                    out,
                    "there is no component {component}: the basis has {component_count}"
                )
            }
            Self::AlreadyHeld { vertex } => write!(out, "vertex {vertex} is held already; give it a new target"),
            Self::NotHeld { vertex } => write!(out, "vertex {vertex} is not held; add it first"),
            Self::Full { capacity } => {
                write!(
                    out,
                    "all {capacity} handles are in use; remove one, or make room for more"
                )
            }
            Self::TargetNotFinite { vertex } => {
                write!(out, "the target of vertex {vertex} is not finite; the last one stays")
            }
            Self::NotFinite { vertex } => {
                write!(
                    out,
                    "vertex {vertex} left the range of numbers; bring the controls nearer to rest"
                )
            }
        }
    }
}
