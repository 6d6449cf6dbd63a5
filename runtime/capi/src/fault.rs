//! Faults: why a call was refused, and the sentence that says so. Plain values without heap; `classify.rs` makes a status and
//! numbers of them.

use core::fmt;

use sinew_knobs::MapError;
use sinew_runtime::{ControlError, FrameError, HandleError, OpenError, OutputError, WorkspaceError};

use crate::kind::Kind;

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
    Pin(HandleError),
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
        Self::Pin(error)
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
                "`{name}.struct_bytes` is {actual}; begin with SINEW_INIT, or set it to sizeof, which is {expected} in this library"
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
            Self::Pin(error) => error.fmt(out),
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
