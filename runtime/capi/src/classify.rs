//! From a fault to its status and its numbers.

use sinew_knobs::MapError;
use sinew_runtime::{ControlError, FrameError, HandleError, OpenError, OutputError, WorkspaceError};

use crate::details::SinewPackageReason;
use crate::fault::Fault;
use crate::status::SinewStatus;

impl Fault {
    pub(crate) fn status(&self) -> SinewStatus {
        match *self {
            Self::Null { .. } => SinewStatus::NullPointer,
            Self::Misaligned { .. } => SinewStatus::Misaligned,
            Self::TooShort { .. } => SinewStatus::TooShort,
            Self::TooLong { .. } => SinewStatus::TooLong,
            Self::Overlap { .. } => SinewStatus::Overlap,
            Self::StructSize { .. } | Self::ElementSize { .. } => SinewStatus::StructSize,
            Self::UnknownOption { .. } | Self::UnknownChoice { .. } => SinewStatus::UnknownOption,
            Self::WrongAbi { .. } => SinewStatus::WrongAbi,
            Self::NotAHandle { .. } => SinewStatus::NotAHandle,
            Self::WrongHandle { .. } => SinewStatus::WrongHandle,
            Self::ClosedHandle { .. } => SinewStatus::ClosedHandle,
            Self::MovedHandle { .. } => SinewStatus::MovedHandle,
            Self::DamagedHandle { .. } => SinewStatus::DamagedHandle,
            Self::InUse { .. } => SinewStatus::InUse,
            Self::NoSuchName => SinewStatus::NoSuchName,
            Self::Open(error) => open_status(error),
            Self::Control(error) => control_status(error),
            Self::Workspace(error) => workspace_status(error),
            Self::Frame(error) => frame_status(error),
            Self::Pin(error) => pin_status(error),
            Self::Output(error) => output_status(error),
            Self::Map(error) => map_status(error),
            Self::NoSuchInstance { .. } => SinewStatus::NoSuchInstance,
            Self::NoSuchKnob { .. } => SinewStatus::NoSuchKnob,
            Self::NoSuchPage { .. } => SinewStatus::NoSuchPage,
            Self::BadReading { .. } | Self::BadAddress { .. } => SinewStatus::BadReading,
            Self::TooMany { .. } => SinewStatus::TooMany,
            Self::Internal => SinewStatus::Internal,
        }
    }

    pub(crate) fn reason(&self) -> SinewPackageReason {
        match *self {
            Self::Open(error) => open_reason(error),
            _ => SinewPackageReason::None,
        }
    }
}

fn control_status(error: ControlError) -> SinewStatus {
    match error {
        ControlError::NoSuchComponent { .. } => SinewStatus::NoSuchControl,
        ControlError::NotFinite { .. } => SinewStatus::NotFinite,
        ControlError::WrongLength { .. } => SinewStatus::TooShort,
        _ => SinewStatus::Internal,
    }
}

fn frame_status(error: FrameError) -> SinewStatus {
    match error {
        FrameError::WrongLength { .. } => SinewStatus::TooShort,
        FrameError::ForeignWorkspace => SinewStatus::ForeignWorkspace,
        FrameError::ForeignControls => SinewStatus::ForeignControls,
        FrameError::NoSuchComponent { .. } => SinewStatus::NoSuchControl,
        FrameError::FeatureNotFinite { .. } => SinewStatus::NotFinite,
        FrameError::NotFinite { .. } => SinewStatus::FrameOverflow,
        FrameError::BoneNotFinite { .. } => SinewStatus::FrameOverflow,
        FrameError::NeedsExactTier => SinewStatus::NeedsExactTier,
        FrameError::NeedsBones => SinewStatus::NeedsBones,
        _ => SinewStatus::Internal,
    }
}

fn workspace_status(error: WorkspaceError) -> SinewStatus {
    match error {
        WorkspaceError::TooSmall { .. } => SinewStatus::TooShort,
        WorkspaceError::NoBones => SinewStatus::NoBones,
        WorkspaceError::NoExactTier => SinewStatus::NeedsExactTier,
        // Kernels are detected, or scalar.
        WorkspaceError::KernelsMissing { .. } => SinewStatus::Internal,
        _ => SinewStatus::Internal,
    }
}

fn pin_status(error: HandleError) -> SinewStatus {
    match error {
        HandleError::ForeignHandles => SinewStatus::ForeignPins,
        HandleError::ForeignWorkspace => SinewStatus::ForeignWorkspace,
        HandleError::NeedsExactTier => SinewStatus::NeedsExactTier,
        HandleError::ForeignControls => SinewStatus::ForeignControls,
        HandleError::NoSuchVertex { .. } => SinewStatus::NoSuchVertex,
        HandleError::NoSuchComponent { .. } => SinewStatus::NoSuchControl,
        HandleError::AlreadyHeld { .. } => SinewStatus::AlreadyPinned,
        HandleError::NotHeld { .. } => SinewStatus::NotPinned,
        HandleError::Full { .. } => SinewStatus::PinsFull,
        HandleError::TargetNotFinite { .. } => SinewStatus::NotFinite,
        HandleError::NotFinite { .. } => SinewStatus::PinOverflow,
        _ => SinewStatus::Internal,
    }
}

fn output_status(error: OutputError) -> SinewStatus {
    match error {
        OutputError::Input(error) => frame_status(error),
        OutputError::ScratchTooShort { .. } => SinewStatus::TooShort,
        OutputError::NormalsMissing { .. } => SinewStatus::NoNormals,
        OutputError::NoTexture { .. } => SinewStatus::NoTexture,
        OutputError::StrideTooShort { .. } => SinewStatus::StrideTooShort,
        OutputError::BufferTooShort { .. } => SinewStatus::TooShort,
        OutputError::Overlap { .. } => SinewStatus::AttributesOverlap,
        _ => SinewStatus::Internal,
    }
}

fn map_status(error: MapError) -> SinewStatus {
    match error {
        MapError::SameAddress { .. } => SinewStatus::KnobTwice,
        MapError::Calibration { .. } => SinewStatus::BadCalibration,
        // Maps made through C smooth as usual.
        MapError::Smoothing { .. } => SinewStatus::Internal,
        MapError::Step { .. } => SinewStatus::BadStep,
        MapError::Acceleration { .. } => SinewStatus::BadStep,
        MapError::NoSuchKnob { .. } => SinewStatus::NoSuchKnob,
        MapError::NoSuchControl { .. } => SinewStatus::NoSuchControl,
        MapError::Response { .. } => SinewStatus::BadResponse,
        MapError::TwoHands { .. } => SinewStatus::TwoHands,
        MapError::TreeKnobs => SinewStatus::BadTree,
        MapError::TreeKnobBound { .. } => SinewStatus::BadTree,
        MapError::TreeResponse { .. } => SinewStatus::BadResponse,
        MapError::NoSuchPage { .. } => SinewStatus::NoSuchPage,
        MapError::TooMany => SinewStatus::TooMany,
        _ => SinewStatus::Internal,
    }
}

/// A package in the wrong place is the program's fault, all else the package's.
fn open_status(error: OpenError) -> SinewStatus {
    match error {
        OpenError::Misaligned { .. } => SinewStatus::Misaligned,
        _ => SinewStatus::PackageRefused,
    }
}

/// What a caller can do about a package that does not open. A rule that is broken is the reason of all that have no other.
fn open_reason(error: OpenError) -> SinewPackageReason {
    match error {
        OpenError::Misaligned { .. } => SinewPackageReason::None,
        OpenError::TooShort { .. } | OpenError::WrongMagic => SinewPackageReason::NotAPackage,
        OpenError::UnsupportedVersion { .. } | OpenError::UnknownKind { .. } | OpenError::ReservedNotZero => {
            SinewPackageReason::Version
        }
        OpenError::WrongKind { .. } => SinewPackageReason::WrongKind,
        OpenError::HeaderCorrupt
        | OpenError::Truncated { .. }
        | OpenError::TrailingBytes { .. }
        | OpenError::ContentIdMismatch => SinewPackageReason::Damaged,
        _ => SinewPackageReason::Rule,
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
            Self::Frame(FrameError::BoneNotFinite { bone }) => Numbers::index(bone),
            Self::Pin(error) => pin_numbers(error),
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

fn pin_numbers(error: HandleError) -> Numbers {
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
        MapError::Calibration { knob }
        | MapError::Smoothing { knob }
        | MapError::Step { knob }
        | MapError::Acceleration { knob } => Numbers::index(knob),
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

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    /// The errors may grow, and the compiler does not say so; each must get a status.
    #[test]
    fn every_error_of_the_crates_below_has_a_status() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let own = include_str!("classify.rs");
        for (file, name) in [
            ("runtime/src/error.rs", "ControlError"),
            ("runtime/src/error.rs", "FrameError"),
            ("runtime/src/error.rs", "WorkspaceError"),
            ("runtime/src/handles/error.rs", "HandleError"),
            ("runtime/src/output/error.rs", "OutputError"),
            ("runtime/knobs/src/map/error.rs", "MapError"),
        ] {
            let source = fs::read_to_string(root.join(file)).expect("the source is there");
            let (_, body) = source
                .split_once(&format!("pub enum {name} {{"))
                .expect("the enum is there");
            let (body, _) = body.split_once("\n}").expect("the enum ends");
            let variants = body
                .lines()
                .filter_map(|line| line.strip_prefix("    "))
                .filter(|line| line.starts_with(char::is_uppercase))
                .map(|line| line.split([' ', '{', ',', '(']).next().unwrap_or_default());
            let mut count = 0;
            for variant in variants {
                count += 1;
                let arm = format!("{name}::{variant}");
                let has = |pattern: String| own.contains(&format!("{pattern} => "));
                assert!(
                    has(arm.clone()) || has(format!("{arm} {{ .. }}")) || has(format!("{arm}(error)")),
                    "{arm} has no status"
                );
            }
            assert!(count > 2, "{name} was read");
        }
    }
}
