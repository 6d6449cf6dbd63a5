//! From a fault to its status: one each, named alike where the fault is one of a package.

use sinew_runtime::input::MapError;
use sinew_runtime::{ControlError, FrameError, HandleError, OpenError, OutputError, WorkspaceError};

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
            Self::Hold(error) => hold_status(error),
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
        FrameError::NeedsExactTier => SinewStatus::NeedsExactTier,
        _ => SinewStatus::Internal,
    }
}

fn workspace_status(error: WorkspaceError) -> SinewStatus {
    match error {
        WorkspaceError::TooSmall { .. } => SinewStatus::TooShort,
        WorkspaceError::NoFastTier => SinewStatus::NoFastTier,
        // Kernels are detected, or scalar.
        WorkspaceError::KernelsMissing { .. } => SinewStatus::Internal,
        _ => SinewStatus::Internal,
    }
}

fn hold_status(error: HandleError) -> SinewStatus {
    match error {
        HandleError::ForeignHandles => SinewStatus::ForeignHandles,
        HandleError::ForeignWorkspace => SinewStatus::ForeignWorkspace,
        HandleError::NeedsExactTier => SinewStatus::NeedsExactTier,
        HandleError::ForeignControls => SinewStatus::ForeignControls,
        HandleError::NoSuchVertex { .. } => SinewStatus::NoSuchVertex,
        HandleError::NoSuchComponent { .. } => SinewStatus::NoSuchControl,
        HandleError::AlreadyHeld { .. } => SinewStatus::AlreadyHeld,
        HandleError::NotHeld { .. } => SinewStatus::NotHeld,
        HandleError::Full { .. } => SinewStatus::HandlesFull,
        HandleError::TargetNotFinite { .. } => SinewStatus::NotFinite,
        HandleError::NotFinite { .. } => SinewStatus::HeldOverflow,
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

fn open_status(error: OpenError) -> SinewStatus {
    match error {
        OpenError::TooShort { .. } => SinewStatus::PackageTooShort,
        OpenError::WrongMagic => SinewStatus::PackageWrongMagic,
        OpenError::HeaderCorrupt => SinewStatus::PackageHeaderCorrupt,
        OpenError::UnsupportedVersion { .. } => SinewStatus::PackageUnsupportedVersion,
        OpenError::ReservedNotZero => SinewStatus::PackageReservedNotZero,
        OpenError::UnknownKind { .. } => SinewStatus::PackageUnknownKind,
        OpenError::WrongKind { .. } => SinewStatus::PackageWrongKind,
        OpenError::Truncated { .. } => SinewStatus::PackageTruncated,
        OpenError::TrailingBytes { .. } => SinewStatus::PackageTrailingBytes,
        OpenError::Misaligned { .. } => SinewStatus::PackageMisaligned,
        OpenError::PayloadCorrupt { .. } => SinewStatus::PackagePayloadCorrupt,
        OpenError::ContentIdMismatch => SinewStatus::PackageContentIdMismatch,
        OpenError::Malformed => SinewStatus::PackageMalformed,
        OpenError::NotFinite { .. } => SinewStatus::PackageNotFinite,
        OpenError::OutOfRange { .. } => SinewStatus::PackageOutOfRange,
        OpenError::NotPositive { .. } => SinewStatus::PackageNotPositive,
        OpenError::PivotNotPositive { .. } => SinewStatus::PackagePivotNotPositive,
        OpenError::IndexOutOfRange { .. } => SinewStatus::PackageIndexOutOfRange,
        OpenError::CountMismatch { .. } => SinewStatus::PackageCountMismatch,
        OpenError::TooFew { .. } => SinewStatus::PackageTooFew,
        OpenError::TooMany { .. } => SinewStatus::PackageTooMany,
        OpenError::NotAscending { .. } => SinewStatus::PackageNotAscending,
        OpenError::ParentAfterChild { .. } => SinewStatus::PackageParentAfterChild,
        OpenError::NotContiguous { .. } => SinewStatus::PackageNotContiguous,
        OpenError::NotAPermutation { .. } => SinewStatus::PackageNotAPermutation,
        OpenError::NotSymmetric { .. } => SinewStatus::PackageNotSymmetric,
        OpenError::SkinWeightSum { .. } => SinewStatus::PackageSkinWeightSum,
        OpenError::RenderFaceDiffers { .. } => SinewStatus::PackageRenderFaceDiffers,
        OpenError::BitmapTail { .. } => SinewStatus::PackageBitmapTail,
        OpenError::RangeWithoutZero { .. } => SinewStatus::PackageRangeWithoutZero,
        OpenError::NameInvalid { .. } => SinewStatus::PackageNameInvalid,
        OpenError::NameDuplicate { .. } => SinewStatus::PackageNameDuplicate,
        _ => SinewStatus::Internal,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    /// The errors may grow, and the compiler does not say so; each must get a status of its own.
    #[test]
    fn every_error_of_the_crates_below_has_a_status() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let own = include_str!("classify.rs");
        for (file, name) in [
            ("formats/src/package/error.rs", "OpenError"),
            ("runtime/src/error.rs", "ControlError"),
            ("runtime/src/error.rs", "FrameError"),
            ("runtime/src/error.rs", "WorkspaceError"),
            ("runtime/src/handles/error.rs", "HandleError"),
            ("runtime/src/output/error.rs", "OutputError"),
            ("runtime/src/input/map.rs", "MapError"),
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
                let right = match name {
                    "OpenError" => format!("=> SinewStatus::Package{variant},"),
                    _ => "=> ".to_owned(),
                };
                let has = |pattern: String| own.contains(&format!("{pattern} {right}"));
                assert!(
                    has(arm.clone()) || has(format!("{arm} {{ .. }}")) || has(format!("{arm}(error)")),
                    "{arm} has no status"
                );
            }
            assert!(count > 2, "{name} was read");
        }
    }
}
