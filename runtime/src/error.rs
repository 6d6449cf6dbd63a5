//! What a caller can do wrong on the frame path, and the one thing that numbers can: leave f32. All errors are plain
//! values without heap.

use core::fmt;

use crate::simd::Kernels;

/// A buffer the caller hands to a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Buffer {
    /// Deformed positions, `[V]`.
    Positions,
    /// Vertex normals, `[V]`.
    Normals,
    /// Derivatives of the positions, `[V]`.
    Displacement,
    /// Features of the network, `[V]`.
    Features,
    /// Maps of the bones, `[B]`.
    Bones,
}

impl fmt::Display for Buffer {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Positions => "positions",
            Self::Normals => "normals",
            Self::Displacement => "displacement",
            Self::Features => "features",
            Self::Bones => "bones",
        })
    }
}

/// Why a job did not run. Unless a variant says otherwise, nothing was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameError {
    /// A buffer has not one element a vertex, or a bone.
    WrongLength {
        /// Which one.
        buffer: Buffer,
        /// Vertices, or bones, of the basis.
        expected: usize,
        /// Elements it has.
        actual: usize,
    },
    /// The workspace was made for another basis.
    ForeignWorkspace,
    /// The job runs on the exact tier, and the workspace was made for the bones.
    NeedsExactTier,
    /// The job runs on the bones, and the workspace was made for the exact tier.
    NeedsBones,
    /// The controls belong to another basis.
    ForeignControls,
    /// There is no such component.
    NoSuchComponent {
        /// The index asked for.
        component: usize,
        /// Components of the basis.
        component_count: usize,
    },
    /// A feature handed in is NaN or infinite.
    FeatureNotFinite {
        /// Vertex, source order.
        vertex: usize,
    },
    /// The weights are so large that a bone left f32. The output holds the rest pose and the workspace is at rest.
    BoneNotFinite {
        /// First such bone.
        bone: usize,
    },
    /// The weights are so large that a position left f32. The output holds the rest shape and the workspace is at rest.
    NotFinite {
        /// First such vertex found, source order.
        vertex: usize,
    },
}

impl core::error::Error for FrameError {}

impl fmt::Display for FrameError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::WrongLength {
                buffer,
                expected,
                actual,
            } => {
                write!(
                    out,
                    "`{buffer}` has {actual} elements, and the basis asks for {expected}"
                )
            }
            Self::ForeignWorkspace => write!(out, "the workspace was made for another basis; make one for this basis"),
            Self::NeedsExactTier => write!(out, "this job needs a workspace of the exact tier"),
            Self::NeedsBones => write!(out, "this job needs a workspace of the bones; make one for that tier"),
            Self::BoneNotFinite { bone } => write!(
                out,
                "bone {bone} left the range of numbers; use smaller weights (the bones are at rest)"
            ),
            Self::ForeignControls => write!(out, "the controls belong to another basis; make some for this basis"),
            Self::NoSuchComponent {
                component,
                component_count,
            } => {
                write!(
                    out,
                    "there is no component {component}: the basis has {component_count}"
                )
            }
            Self::FeatureNotFinite { vertex } => write!(out, "a feature of vertex {vertex} is not a finite number"),
            Self::NotFinite { vertex } => {
                write!(
                    out,
                    "vertex {vertex} left the range of numbers; use smaller weights (the mesh is at rest)"
                )
            }
        }
    }
}

/// Refuses a buffer of another length.
pub(crate) fn check_length(expected: usize, buffer: Buffer, actual: usize) -> Result<(), FrameError> {
    if actual == expected {
        Ok(())
    } else {
        Err(FrameError::WrongLength {
            buffer,
            expected,
            actual,
        })
    }
}

/// Why a control did not take a weight. The weight it had stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ControlError {
    /// There is no such component.
    NoSuchComponent {
        /// The index asked for.
        component: usize,
        /// Components of the basis.
        component_count: usize,
    },
    /// The weight is NaN or infinite.
    NotFinite {
        /// The component it was meant for.
        component: usize,
    },
    /// The memory for the weights has not one element a component.
    WrongLength {
        /// Components of the basis.
        expected: usize,
        /// Elements it has.
        actual: usize,
    },
}

impl core::error::Error for ControlError {}

impl fmt::Display for ControlError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSuchComponent {
                component,
                component_count,
            } => {
                write!(
                    out,
                    "there is no component {component}: the basis has {component_count}"
                )
            }
            Self::NotFinite { component } => {
                write!(
                    out,
                    "the weight for component {component} is not a finite number; the last one stays"
                )
            }
            Self::WrongLength { expected, actual } => {
                write!(out, "{actual} weights for {expected} components")
            }
        }
    }
}

/// Why memory does not make a workspace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum WorkspaceError {
    /// Too few bytes, counted from where they are.
    TooSmall {
        /// Bytes needed, with those lost in front of the first aligned one.
        required_bytes: usize,
        /// Bytes given.
        actual_bytes: usize,
    },
    /// The package has no bones.
    NoBones,
    /// The package was baked without the exact tier.
    NoExactTier,
    /// This processor lacks the instructions.
    KernelsMissing {
        /// The kernels asked for.
        kernels: Kernels,
    },
}

impl core::error::Error for WorkspaceError {}

impl fmt::Display for WorkspaceError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooSmall {
                required_bytes,
                actual_bytes,
            } => {
                write!(
                    out,
                    "the workspace needs {required_bytes} bytes here and got {actual_bytes}"
                )
            }
            Self::NoBones => write!(
                out,
                "the package has no bones; bake it with `--bones 128`, or use the exact tier"
            ),
            Self::NoExactTier => write!(
                out,
                "the package was baked without the exact tier; use its bones, or bake it with the exact tier"
            ),
            Self::KernelsMissing { kernels } => {
                write!(
                    out,
                    "this processor does not run the {kernels:?} kernels; use Workspace::new"
                )
            }
        }
    }
}
