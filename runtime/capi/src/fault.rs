//! Faults: why a call was refused, with its numbers. Plain values without heap; the edge makes a status of them, and
//! details where the caller wants some.

use core::fmt;

use sinew_runtime::input::MapError;
use sinew_runtime::{ControlError, FrameError, HandleError, OpenError, OutputError, WorkspaceError};

use crate::handle::Kind;

/// Why a call was refused.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fault {
    Null {
        name: &'static str,
    },
    Misaligned {
        name: &'static str,
        alignment: usize,
    },
    TooShort {
        name: &'static str,
        expected: usize,
        actual: usize,
    },
    TooLong {
        name: &'static str,
        actual: usize,
    },
    Overlap {
        first: &'static str,
        second: &'static str,
    },
    StructSize {
        name: &'static str,
        expected: usize,
        actual: usize,
    },
    ElementSize {
        name: &'static str,
        expected: usize,
        actual: usize,
    },
    UnknownOption {
        name: &'static str,
        at: usize,
    },
    UnknownChoice {
        name: &'static str,
        value: i32,
    },
    WrongAbi {
        expected: u32,
        actual: u32,
    },
    NotAHandle {
        name: &'static str,
    },
    WrongHandle {
        name: &'static str,
        found: Kind,
    },
    ClosedHandle {
        name: &'static str,
    },
    MovedHandle {
        name: &'static str,
    },
    DamagedHandle {
        name: &'static str,
    },
    InUse {
        name: &'static str,
    },
    NoSuchName,
    Open(OpenError),
    Control(ControlError),
    Workspace(WorkspaceError),
    Frame(FrameError),
    Hold(HandleError),
    Output(OutputError),
    Map(MapError),
    NoSuchInstance {
        instance: usize,
        instance_count: usize,
    },
    NoSuchKnob {
        knob: usize,
        knob_count: usize,
    },
    NoSuchPage {
        page: usize,
        page_count: usize,
    },
    BadReading {
        value: i32,
        full_scale: u32,
    },
    BadAddress {
        address: u32,
    },
    TooMany {
        name: &'static str,
        limit: usize,
        actual: usize,
    },
    Internal,
}

impl From<OpenError> for Fault {
    fn from(error: OpenError) -> Self {
        Self::Open(error)
    }
}

impl From<ControlError> for Fault {
    fn from(error: ControlError) -> Self {
        Self::Control(error)
    }
}

impl From<WorkspaceError> for Fault {
    fn from(error: WorkspaceError) -> Self {
        Self::Workspace(error)
    }
}

impl From<FrameError> for Fault {
    fn from(error: FrameError) -> Self {
        Self::Frame(error)
    }
}

impl From<HandleError> for Fault {
    fn from(error: HandleError) -> Self {
        Self::Hold(error)
    }
}

impl From<OutputError> for Fault {
    fn from(error: OutputError) -> Self {
        Self::Output(error)
    }
}

impl From<MapError> for Fault {
    fn from(error: MapError) -> Self {
        Self::Map(error)
    }
}

/// The numbers of a fault; zero where it has none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Numbers {
    pub(crate) index: u64,
    pub(crate) expected: u64,
    pub(crate) actual: u64,
}

impl Numbers {
    fn index(index: usize) -> Self {
        Self {
            index: index as u64,
            ..Self::default()
        }
    }

    fn counts(expected: usize, actual: usize) -> Self {
        Self {
            index: 0,
            expected: expected as u64,
            actual: actual as u64,
        }
    }

    fn indexed(index: usize, expected: usize, actual: usize) -> Self {
        Self {
            index: index as u64,
            ..Self::counts(expected, actual)
        }
    }
}

impl Fault {
    pub(crate) fn numbers(&self) -> Numbers {
        match *self {
            Self::Misaligned { alignment, .. } => Numbers::counts(alignment, 0),
            Self::TooShort { expected, actual, .. }
            | Self::StructSize { expected, actual, .. }
            | Self::ElementSize { expected, actual, .. } => Numbers::counts(expected, actual),
            Self::TooLong { actual, .. } => Numbers::counts(isize::MAX as usize, actual),
            Self::UnknownOption { at, .. } => Numbers::index(at),
            Self::WrongAbi { expected, actual } => Numbers::counts(expected as usize, actual as usize),
            Self::Open(error) => open_numbers(error),
            Self::Control(ControlError::NoSuchComponent {
                component,
                component_count,
            })
            | Self::Frame(FrameError::NoSuchComponent {
                component,
                component_count,
            }) => Numbers::indexed(component, component_count, component),
            Self::Control(ControlError::NotFinite { component }) => Numbers::index(component),
            Self::Control(ControlError::WrongLength { expected, actual })
            | Self::Frame(FrameError::WrongLength { expected, actual, .. }) => Numbers::counts(expected, actual),
            Self::Workspace(WorkspaceError::TooSmall {
                required_bytes,
                actual_bytes,
            }) => Numbers::counts(required_bytes, actual_bytes),
            Self::Frame(FrameError::FeatureNotFinite { vertex } | FrameError::NotFinite { vertex }) => {
                Numbers::index(vertex)
            }
            Self::Hold(error) => hold_numbers(error),
            Self::Output(error) => output_numbers(error),
            Self::Map(error) => map_numbers(error),
            Self::NoSuchInstance {
                instance,
                instance_count,
            } => Numbers::indexed(instance, instance_count, instance),
            Self::NoSuchKnob { knob, knob_count } => Numbers::indexed(knob, knob_count, knob),
            Self::NoSuchPage { page, page_count } => Numbers::indexed(page, page_count, page),
            Self::BadAddress { address } => Numbers::counts(u16::MAX.into(), address as usize),
            Self::TooMany { limit, actual, .. } => Numbers::counts(limit, actual),
            Self::BadReading { value, full_scale } => Numbers::counts(full_scale as usize, value.max(0) as usize),
            _ => Numbers::default(),
        }
    }
}

fn hold_numbers(error: HandleError) -> Numbers {
    match error {
        HandleError::NoSuchVertex { vertex, vertex_count } => Numbers::indexed(vertex, vertex_count, vertex),
        HandleError::NoSuchComponent {
            component,
            component_count,
        } => Numbers::indexed(component, component_count, component),
        HandleError::AlreadyHeld { vertex }
        | HandleError::NotHeld { vertex }
        | HandleError::TargetNotFinite { vertex }
        | HandleError::NotFinite { vertex } => Numbers::index(vertex),
        HandleError::Full { capacity } => Numbers::counts(capacity, capacity),
        _ => Numbers::default(),
    }
}

fn output_numbers(error: OutputError) -> Numbers {
    match error {
        OutputError::ScratchTooShort { expected, actual } => Numbers::counts(expected, actual),
        OutputError::StrideTooShort {
            required_bytes,
            stride_bytes,
            ..
        } => Numbers::counts(required_bytes, stride_bytes),
        OutputError::BufferTooShort {
            required_bytes,
            actual_bytes,
            ..
        } => Numbers::counts(required_bytes, actual_bytes),
        _ => Numbers::default(),
    }
}

fn map_numbers(error: MapError) -> Numbers {
    match error {
        MapError::SameAddress { address } => Numbers::index(address.into()),
        MapError::Calibration { knob } | MapError::Smoothing { knob } | MapError::Step { knob } => Numbers::index(knob),
        MapError::NoSuchKnob { binding, knob } => Numbers::indexed(binding, 0, knob.into()),
        MapError::NoSuchControl {
            control,
            component_count,
        } => Numbers::indexed(control.into(), component_count, control.into()),
        MapError::Response { binding, .. } | MapError::TreeKnobBound { binding } => Numbers::index(binding),
        MapError::TwoHands { first, second } => Numbers::indexed(second, first, second),
        MapError::TreeResponse { control, .. } => Numbers::index(control),
        MapError::NoSuchPage { page } => Numbers::index(page.into()),
        _ => Numbers::default(),
    }
}

fn open_numbers(error: OpenError) -> Numbers {
    match error {
        OpenError::TooShort { actual } => Numbers::counts(sinew_formats::package::HEADER_BYTES, actual),
        OpenError::UnsupportedVersion { found, latest, .. } => Numbers::counts(latest.into(), found.into()),
        OpenError::UnknownKind { found } => Numbers::counts(0, found.into()),
        OpenError::Truncated { expected, actual }
        | OpenError::TrailingBytes { expected, actual }
        | OpenError::CountMismatch { expected, actual, .. } => Numbers {
            index: 0,
            expected,
            actual,
        },
        OpenError::Misaligned { required } => Numbers::counts(required, 0),
        OpenError::PayloadCorrupt { expected, actual } => Numbers::counts(expected as usize, actual as usize),
        OpenError::IndexOutOfRange {
            index, value, limit, ..
        } => Numbers::indexed(index, limit as usize, value as usize),
        OpenError::TooFew { least, actual, .. } => Numbers::counts(least, actual),
        OpenError::TooMany { limit, actual, .. } => Numbers::counts(limit, actual),
        OpenError::NotFinite { index, .. }
        | OpenError::OutOfRange { index, .. }
        | OpenError::NotPositive { index, .. }
        | OpenError::PivotNotPositive { index }
        | OpenError::NotAscending { index, .. }
        | OpenError::NotContiguous { index, .. }
        | OpenError::NotAPermutation { index, .. }
        | OpenError::NotSymmetric { index, .. }
        | OpenError::NameInvalid { index, .. } => Numbers::index(index),
        OpenError::ParentAfterChild { block } => Numbers::index(block),
        OpenError::BitmapTail { component } | OpenError::RangeWithoutZero { component } => Numbers::index(component),
        OpenError::NameDuplicate { first, second } => Numbers::indexed(second, first, second),
        _ => Numbers::default(),
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Null { name } => write!(out, "`{name}` is NULL"),
            Self::Misaligned { name, alignment } => {
                write!(out, "`{name}` does not start at a multiple of {alignment} bytes")
            }
            Self::TooShort { name, expected, actual } => {
                write!(out, "`{name}` has length {actual} and must have at least {expected}")
            }
            Self::TooLong { name, actual } => write!(out, "`{name}` cannot have length {actual}"),
            Self::Overlap { first, second } => write!(out, "`{first}` and `{second}` share memory"),
            Self::StructSize { name, expected, actual } => write!(
                out,
                "`{name}.struct_bytes` is {actual}; set it to sizeof, which is {expected} in this library"
            ),
            Self::ElementSize { name, expected, actual } => write!(
                out,
                "an element of `{name}` is said to have {actual} bytes; pass sizeof, which is {expected} in this library"
            ),
            Self::UnknownOption { name, at } => write!(
                out,
                "`{name}` asks at byte {at} for something that this library is too old for"
            ),
            Self::UnknownChoice { name, value } => write!(out, "`{name}` is {value}, which this library does not know"),
            Self::WrongAbi { expected, actual } => write!(
                out,
                "the program was compiled with a header of interface version {actual}, the library has {expected}"
            ),
            Self::NotAHandle { name } => write!(out, "`{name}` is no handle, or its memory was freed or written over"),
            Self::WrongHandle { name, found } => write!(out, "`{name}` is a {} handle", found.name()),
            Self::ClosedHandle { name } => write!(out, "`{name}` is closed"),
            Self::MovedHandle { name } => write!(out, "`{name}` was copied or moved; a handle stays where it was made"),
            Self::DamagedHandle { name } => write!(out, "something wrote over the memory of `{name}`"),
            Self::InUse { name } => write!(out, "another thread is using `{name}`"),
            Self::NoSuchName => write!(out, "no control has this name"),
            Self::Open(error) => error.fmt(out),
            Self::Control(error) => error.fmt(out),
            Self::Workspace(error) => error.fmt(out),
            Self::Frame(error) => error.fmt(out),
            Self::Hold(error) => error.fmt(out),
            Self::Output(error) => error.fmt(out),
            Self::Map(error) => error.fmt(out),
            Self::NoSuchInstance {
                instance,
                instance_count,
            } => write!(out, "there is no instance {instance}: the batch has {instance_count}"),
            Self::NoSuchKnob { knob, knob_count } => {
                write!(out, "there is no knob {knob}: the surface has {knob_count}")
            }
            Self::NoSuchPage { page, page_count } => {
                write!(out, "there is no page {page}: the bindings have {page_count}")
            }
            Self::BadAddress { address } => write!(out, "a knob has the address {address}; the largest is 65535"),
            Self::TooMany { name, limit, actual } => write!(out, "`{name}` is {actual}; the most is {limit}"),
            Self::BadReading { value, full_scale } => {
                write!(
                    out,
                    "no knob reads {value} of {full_scale}, or the kind of reading is unknown"
                )
            }
            Self::Internal => write!(out, "the library has a defect; the handles it was writing are closed"),
        }
    }
}
