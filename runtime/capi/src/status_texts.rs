//! The names and texts of the statuses: what logs say. Beside the enum, which the header has.

use core::ffi::CStr;

use crate::status::SinewStatus;

/// Status, its name in the header, its text.
pub(crate) const TABLE: [(SinewStatus, &CStr, &CStr); 77] = [
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
        SinewStatus::NoFastTier,
        c"SINEW_STATUS_NO_FAST_TIER",
        c"the package has no fast tier; bake it with one, or use the exact tier",
    ),
    (
        SinewStatus::NeedsExactTier,
        c"SINEW_STATUS_NEEDS_EXACT_TIER",
        c"the call needs a workspace of the exact tier",
    ),
    (
        SinewStatus::ForeignHandles,
        c"SINEW_STATUS_FOREIGN_HANDLES",
        c"the handles were made for another basis; make some for this basis",
    ),
    (
        SinewStatus::NoSuchVertex,
        c"SINEW_STATUS_NO_SUCH_VERTEX",
        c"there is no vertex of this index",
    ),
    (
        SinewStatus::AlreadyHeld,
        c"SINEW_STATUS_ALREADY_HELD",
        c"the vertex is held already; give it a new target",
    ),
    (
        SinewStatus::NotHeld,
        c"SINEW_STATUS_NOT_HELD",
        c"the vertex is not held; add it first",
    ),
    (
        SinewStatus::HandlesFull,
        c"SINEW_STATUS_HANDLES_FULL",
        c"all handles are in use; remove one, or make room for more",
    ),
    (
        SinewStatus::HeldOverflow,
        c"SINEW_STATUS_HELD_OVERFLOW",
        c"the weights are so large that a held vertex left the range of numbers; the controls stay",
    ),
    (
        SinewStatus::NoNormals,
        c"SINEW_STATUS_NO_NORMALS",
        c"normals or tangents are to be written and no normals were given",
    ),
    (
        SinewStatus::NoTexture,
        c"SINEW_STATUS_NO_TEXTURE",
        c"the package has no texture coordinates, and so no tangents",
    ),
    (
        SinewStatus::StrideTooShort,
        c"SINEW_STATUS_STRIDE_TOO_SHORT",
        c"the stride of an attribute is less than its size",
    ),
    (
        SinewStatus::AttributesOverlap,
        c"SINEW_STATUS_ATTRIBUTES_OVERLAP",
        c"two attributes overlap, or interleave with different strides",
    ),
    (
        SinewStatus::NoSuchInstance,
        c"SINEW_STATUS_NO_SUCH_INSTANCE",
        c"there is no instance of this index",
    ),
    (
        SinewStatus::NoSuchKnob,
        c"SINEW_STATUS_NO_SUCH_KNOB",
        c"there is no knob of this index",
    ),
    (
        SinewStatus::NoSuchPage,
        c"SINEW_STATUS_NO_SUCH_PAGE",
        c"no binding is on this page",
    ),
    (
        SinewStatus::BadReading,
        c"SINEW_STATUS_BAD_READING",
        c"no knob says this: an unknown kind, or a value outside its scale",
    ),
    (
        SinewStatus::KnobTwice,
        c"SINEW_STATUS_KNOB_TWICE",
        c"two knobs have one address",
    ),
    (
        SinewStatus::BadCalibration,
        c"SINEW_STATUS_BAD_CALIBRATION",
        c"the calibration of a knob leaves no range to turn in",
    ),
    (
        SinewStatus::BadStep,
        c"SINEW_STATUS_BAD_STEP",
        c"the step of a knob must be above 0 and at most 1",
    ),
    (
        SinewStatus::TwoHands,
        c"SINEW_STATUS_TWO_HANDS",
        c"two bindings move one control on the same page",
    ),
    (
        SinewStatus::BadTree,
        c"SINEW_STATUS_BAD_TREE",
        c"the tree needs a coarse knob, and knobs that are there and that no binding has",
    ),
    (
        SinewStatus::BadResponse,
        c"SINEW_STATUS_BAD_RESPONSE",
        c"a response has a number out of range, or limits that do not fit its control",
    ),
    (
        SinewStatus::TooMany,
        c"SINEW_STATUS_TOO_MANY",
        c"more knobs or bindings than a surface takes",
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
