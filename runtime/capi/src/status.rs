//! Status codes: one for every fault, with a name and a sentence. The codes of released versions keep their meaning.

use core::ffi::{CStr, c_char};

/// What a call returns. Unless a status says otherwise, a call that returns anything but `SINEW_STATUS_OK` has changed
/// nothing. New codes may be added: treat an unknown one as a fault.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SinewStatus {
    /// Done.
    Ok = 0,
    /// A pointer that must not be NULL is.
    NullPointer = 1,
    /// A pointer does not start at a multiple of its type's alignment, or memory not at that of its layout.
    Misaligned = 2,
    /// Memory or a buffer is shorter than it must be; the layout call or the count says how long.
    TooShort = 3,
    /// A length that no object has: it would reach beyond the address space.
    TooLong = 4,
    /// Memory that this call writes overlaps other memory that it uses.
    Overlap = 5,
    /// A struct's first member is not its size; set it to `sizeof`.
    StructSize = 6,
    /// A struct of a newer header asks for something that this library does not know.
    UnknownOption = 7,
    /// The header belongs to another interface version than the library.
    WrongAbi = 8,
    /// Not a handle: never made, or its memory was freed or written over.
    NotAHandle = 10,
    /// A handle of another kind.
    WrongHandle = 11,
    /// The handle was closed, or a call that wrote it ended with `SINEW_STATUS_INTERNAL`.
    ClosedHandle = 12,
    /// The handle was copied or moved from where it was made; make it anew where it shall stay.
    MovedHandle = 13,
    /// Something wrote over the handle's memory.
    DamagedHandle = 14,
    /// Another thread is using the handle at this moment.
    InUse = 15,
    /// The workspace was made for other content than the basis has now.
    ForeignWorkspace = 16,
    /// The controls were made for other content than the basis has now.
    ForeignControls = 17,
    /// The index of a control is not less than their count.
    NoSuchControl = 20,
    /// No control has this name.
    NoSuchName = 21,
    /// A weight is NaN or infinite; the weights stay as they were.
    NotFinite = 22,
    /// The weights are so large that a position left f32. The outputs hold the rest shape, the workspace is at rest.
    FrameOverflow = 23,
    /// A defect of the library, stopped at its edge; the handles that the call was writing are closed, its outputs may be half
    /// written. Please report it.
    Internal = 99,
    /// Fewer bytes than a package's header.
    PackageTooShort = 100,
    /// The first bytes are not a package's.
    PackageWrongMagic = 101,
    /// The header's checksum does not fit.
    PackageHeaderCorrupt = 102,
    /// A format version that this library does not read.
    PackageUnsupportedVersion = 103,
    /// Reserved bytes of the header are in use.
    PackageReservedNotZero = 104,
    /// The header names an unknown kind of package.
    PackageUnknownKind = 105,
    /// A compact package where a baked one is needed; `sinew bake` makes one.
    PackageWrongKind = 106,
    /// The package ends early.
    PackageTruncated = 107,
    /// Bytes follow the package.
    PackageTrailingBytes = 108,
    /// The bytes do not start at a multiple of 16.
    PackageMisaligned = 109,
    /// The payload's checksum does not fit.
    PackagePayloadCorrupt = 110,
    /// The content id is not the content's.
    PackageContentIdMismatch = 111,
    /// The payload is not an archive of its kind.
    PackageMalformed = 112,
    /// A number is NaN or infinite.
    PackageNotFinite = 113,
    /// A number lies outside its range.
    PackageOutOfRange = 114,
    /// A number that must be above zero is not.
    PackageNotPositive = 115,
    /// A pivot of the factor is not above zero.
    PackagePivotNotPositive = 116,
    /// An index points past the end.
    PackageIndexOutOfRange = 117,
    /// Two counts that must agree do not.
    PackageCountMismatch = 118,
    /// A field has fewer elements than make sense.
    PackageTooFew = 119,
    /// A field has more elements than the format allows.
    PackageTooMany = 120,
    /// Elements that must ascend do not.
    PackageNotAscending = 121,
    /// A block's parent is missing or comes after it.
    PackageParentAfterChild = 122,
    /// Parts that must follow one another do not.
    PackageNotContiguous = 123,
    /// The two vertex orders are not each other's inverse.
    PackageNotAPermutation = 124,
    /// An edge differs in its two directions.
    PackageNotSymmetric = 125,
    /// A bit beyond the last vertex is set.
    PackageBitmapTail = 126,
    /// The range of a control leaves out zero.
    PackageRangeWithoutZero = 127,
    /// A name is empty, too long or has control characters.
    PackageNameInvalid = 128,
    /// Two controls have one name.
    PackageNameDuplicate = 129,
    /// The skin weights of a vertex of the fast tier do not sum to one.
    PackageSkinWeightSum = 130,
    /// A triangle of render vertices does not stand for the corners of its triangle.
    PackageRenderFaceDiffers = 131,
}

/// Status, its name in the header, its text.
const TABLE: [(SinewStatus, &CStr, &CStr); 54] = [
    (SinewStatus::Ok, c"SINEW_STATUS_OK", c"done"),
    (
        SinewStatus::NullPointer,
        c"SINEW_STATUS_NULL_POINTER",
        c"a pointer that must not be NULL is",
    ),
    (
        SinewStatus::Misaligned,
        c"SINEW_STATUS_MISALIGNED",
        c"a pointer does not start at a multiple of the alignment it needs",
    ),
    (
        SinewStatus::TooShort,
        c"SINEW_STATUS_TOO_SHORT",
        c"memory or a buffer is shorter than it must be",
    ),
    (
        SinewStatus::TooLong,
        c"SINEW_STATUS_TOO_LONG",
        c"a length reaches beyond the address space",
    ),
    (
        SinewStatus::Overlap,
        c"SINEW_STATUS_OVERLAP",
        c"memory that the call writes overlaps other memory that it uses",
    ),
    (
        SinewStatus::StructSize,
        c"SINEW_STATUS_STRUCT_SIZE",
        c"a struct's first member is not its size; set it to sizeof",
    ),
    (
        SinewStatus::UnknownOption,
        c"SINEW_STATUS_UNKNOWN_OPTION",
        c"a struct asks for something that this library is too old for",
    ),
    (
        SinewStatus::WrongAbi,
        c"SINEW_STATUS_WRONG_ABI",
        c"header and library have different interface versions",
    ),
    (
        SinewStatus::NotAHandle,
        c"SINEW_STATUS_NOT_A_HANDLE",
        c"not a handle, or its memory was freed or written over",
    ),
    (
        SinewStatus::WrongHandle,
        c"SINEW_STATUS_WRONG_HANDLE",
        c"a handle of another kind",
    ),
    (
        SinewStatus::ClosedHandle,
        c"SINEW_STATUS_CLOSED_HANDLE",
        c"the handle is closed",
    ),
    (
        SinewStatus::MovedHandle,
        c"SINEW_STATUS_MOVED_HANDLE",
        c"the handle was copied or moved; make it anew where it shall stay",
    ),
    (
        SinewStatus::DamagedHandle,
        c"SINEW_STATUS_DAMAGED_HANDLE",
        c"something wrote over the handle's memory",
    ),
    (
        SinewStatus::InUse,
        c"SINEW_STATUS_IN_USE",
        c"another thread is using the handle at this moment",
    ),
    (
        SinewStatus::ForeignWorkspace,
        c"SINEW_STATUS_FOREIGN_WORKSPACE",
        c"the workspace was made for another basis; make one for this basis",
    ),
    (
        SinewStatus::ForeignControls,
        c"SINEW_STATUS_FOREIGN_CONTROLS",
        c"the controls were made for another basis; make some for this basis",
    ),
    (
        SinewStatus::NoSuchControl,
        c"SINEW_STATUS_NO_SUCH_CONTROL",
        c"there is no control of this index",
    ),
    (
        SinewStatus::NoSuchName,
        c"SINEW_STATUS_NO_SUCH_NAME",
        c"there is no control of this name",
    ),
    (
        SinewStatus::NotFinite,
        c"SINEW_STATUS_NOT_FINITE",
        c"a weight is NaN or infinite; the weights stay as they were",
    ),
    (
        SinewStatus::FrameOverflow,
        c"SINEW_STATUS_FRAME_OVERFLOW",
        c"the weights are so large that a position left the range of numbers; the mesh is at rest",
    ),
    (
        SinewStatus::Internal,
        c"SINEW_STATUS_INTERNAL",
        c"a defect of the library; the handles that the call was writing are closed",
    ),
    (
        SinewStatus::PackageTooShort,
        c"SINEW_STATUS_PACKAGE_TOO_SHORT",
        c"not a package: fewer bytes than a header",
    ),
    (
        SinewStatus::PackageWrongMagic,
        c"SINEW_STATUS_PACKAGE_WRONG_MAGIC",
        c"not a package, or one that went through a transfer in text mode",
    ),
    (
        SinewStatus::PackageHeaderCorrupt,
        c"SINEW_STATUS_PACKAGE_HEADER_CORRUPT",
        c"the package's header is damaged; copy the file again",
    ),
    (
        SinewStatus::PackageUnsupportedVersion,
        c"SINEW_STATUS_PACKAGE_UNSUPPORTED_VERSION",
        c"the package has a format version that this library does not read",
    ),
    (
        SinewStatus::PackageReservedNotZero,
        c"SINEW_STATUS_PACKAGE_RESERVED_NOT_ZERO",
        c"reserved bytes of the package's header are in use",
    ),
    (
        SinewStatus::PackageUnknownKind,
        c"SINEW_STATUS_PACKAGE_UNKNOWN_KIND",
        c"the package is of an unknown kind",
    ),
    (
        SinewStatus::PackageWrongKind,
        c"SINEW_STATUS_PACKAGE_WRONG_KIND",
        c"the package is not a baked one; run `sinew bake` on it",
    ),
    (
        SinewStatus::PackageTruncated,
        c"SINEW_STATUS_PACKAGE_TRUNCATED",
        c"the package is cut off; copy the file again",
    ),
    (
        SinewStatus::PackageTrailingBytes,
        c"SINEW_STATUS_PACKAGE_TRAILING_BYTES",
        c"bytes follow the package; pass its exact length",
    ),
    (
        SinewStatus::PackageMisaligned,
        c"SINEW_STATUS_PACKAGE_MISALIGNED",
        c"the package must start at a multiple of 16 bytes in memory",
    ),
    (
        SinewStatus::PackagePayloadCorrupt,
        c"SINEW_STATUS_PACKAGE_PAYLOAD_CORRUPT",
        c"the package is damaged; copy the file again",
    ),
    (
        SinewStatus::PackageContentIdMismatch,
        c"SINEW_STATUS_PACKAGE_CONTENT_ID_MISMATCH",
        c"the package's content id is not that of its content",
    ),
    (
        SinewStatus::PackageMalformed,
        c"SINEW_STATUS_PACKAGE_MALFORMED",
        c"the package's payload is not a valid archive",
    ),
    (
        SinewStatus::PackageNotFinite,
        c"SINEW_STATUS_PACKAGE_NOT_FINITE",
        c"a number of the package is NaN or infinite",
    ),
    (
        SinewStatus::PackageOutOfRange,
        c"SINEW_STATUS_PACKAGE_OUT_OF_RANGE",
        c"a number of the package lies outside its range",
    ),
    (
        SinewStatus::PackageNotPositive,
        c"SINEW_STATUS_PACKAGE_NOT_POSITIVE",
        c"a number of the package must be above zero and is not",
    ),
    (
        SinewStatus::PackagePivotNotPositive,
        c"SINEW_STATUS_PACKAGE_PIVOT_NOT_POSITIVE",
        c"a pivot of the package's factor is not above zero",
    ),
    (
        SinewStatus::PackageIndexOutOfRange,
        c"SINEW_STATUS_PACKAGE_INDEX_OUT_OF_RANGE",
        c"an index of the package points past the end",
    ),
    (
        SinewStatus::PackageCountMismatch,
        c"SINEW_STATUS_PACKAGE_COUNT_MISMATCH",
        c"two counts of the package must agree and do not",
    ),
    (
        SinewStatus::PackageTooFew,
        c"SINEW_STATUS_PACKAGE_TOO_FEW",
        c"a field of the package has too few elements",
    ),
    (
        SinewStatus::PackageTooMany,
        c"SINEW_STATUS_PACKAGE_TOO_MANY",
        c"a field of the package has more elements than the format allows",
    ),
    (
        SinewStatus::PackageNotAscending,
        c"SINEW_STATUS_PACKAGE_NOT_ASCENDING",
        c"elements of the package must ascend and do not",
    ),
    (
        SinewStatus::PackageParentAfterChild,
        c"SINEW_STATUS_PACKAGE_PARENT_AFTER_CHILD",
        c"a block's parent is missing or comes after it",
    ),
    (
        SinewStatus::PackageNotContiguous,
        c"SINEW_STATUS_PACKAGE_NOT_CONTIGUOUS",
        c"parts of the package must follow one another and do not",
    ),
    (
        SinewStatus::PackageNotAPermutation,
        c"SINEW_STATUS_PACKAGE_NOT_A_PERMUTATION",
        c"the package's vertex orders are not each other's inverse",
    ),
    (
        SinewStatus::PackageNotSymmetric,
        c"SINEW_STATUS_PACKAGE_NOT_SYMMETRIC",
        c"an edge of the package differs in its two directions",
    ),
    (
        SinewStatus::PackageBitmapTail,
        c"SINEW_STATUS_PACKAGE_BITMAP_TAIL",
        c"a bit beyond the package's last vertex is set",
    ),
    (
        SinewStatus::PackageRangeWithoutZero,
        c"SINEW_STATUS_PACKAGE_RANGE_WITHOUT_ZERO",
        c"the range of a control leaves out zero",
    ),
    (
        SinewStatus::PackageNameInvalid,
        c"SINEW_STATUS_PACKAGE_NAME_INVALID",
        c"a name in the package is empty, too long or has control characters",
    ),
    (
        SinewStatus::PackageNameDuplicate,
        c"SINEW_STATUS_PACKAGE_NAME_DUPLICATE",
        c"two controls of the package have the same name",
    ),
    (
        SinewStatus::PackageSkinWeightSum,
        c"SINEW_STATUS_PACKAGE_SKIN_WEIGHT_SUM",
        c"package: skin weights of the fast tier do not sum to one",
    ),
    (
        SinewStatus::PackageRenderFaceDiffers,
        c"SINEW_STATUS_PACKAGE_RENDER_FACE_DIFFERS",
        c"package: a triangle of render vertices does not stand for its triangle",
    ),
];

fn entry(status: i32) -> Option<&'static (SinewStatus, &'static CStr, &'static CStr)> {
    TABLE.iter().find(|(known, ..)| *known as i32 == status)
}

/// What a status means, in one English sentence without a full stop. Never NULL, never freed, unknown codes included.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_status_text(status: i32) -> *const c_char {
    entry(status).map_or(c"unknown status", |(_, _, text)| text).as_ptr()
}

/// The name of a status as this header spells it, for logs. Never NULL, never freed, unknown codes included.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_status_name(status: i32) -> *const c_char {
    entry(status).map_or(c"unknown status", |(_, name, _)| name).as_ptr()
}

#[cfg(test)]
mod tests {
    use core::ffi::CStr;
    use std::collections::BTreeSet;

    use super::*;

    fn text(pointer: *const c_char) -> &'static str {
        // SAFETY: the functions return static strings.
        unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8")
    }

    #[test]
    fn every_status_has_its_own_name_and_text() {
        let source = include_str!("status.rs");
        let variants = source
            .lines()
            .filter(|line| line.ends_with(',') && line.contains(" = "))
            .count();
        assert_eq!(TABLE.len(), variants, "every status of the enum is in the table");
        let names: BTreeSet<&CStr> = TABLE.iter().map(|(_, name, _)| *name).collect();
        let texts: BTreeSet<&CStr> = TABLE.iter().map(|(_, _, text)| *text).collect();
        assert_eq!((names.len(), texts.len()), (TABLE.len(), TABLE.len()));
        for (status, name, _) in TABLE {
            // What cbindgen makes of the variant.
            let letters = format!("SinewStatus{status:?}");
            let plain = name.to_str().expect("UTF-8").replace('_', "");
            assert!(plain.eq_ignore_ascii_case(&letters), "{plain} {letters}");
        }
        assert_eq!(text(sinew_status_name(5)), "SINEW_STATUS_OVERLAP");
        assert_eq!(text(sinew_status_text(i32::MIN)), "unknown status");
        assert_eq!(text(sinew_status_name(-1)), "unknown status");
    }
}
