//! Status codes: one for every fault. The codes of released versions keep their meaning.

use core::ffi::{CStr, c_char};

use crate::status_texts::TABLE;

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
    /// The package has no fast tier; `sinew bake` makes one.
    NoFastTier = 24,
    /// The workspace is of the fast tier, and the call needs one of the exact tier.
    NeedsExactTier = 25,
    /// The handles were made for other content than the basis has now.
    ForeignHandles = 26,
    /// The index of a vertex is not less than their count.
    NoSuchVertex = 27,
    /// The vertex is held already; give it a new target.
    AlreadyHeld = 28,
    /// The vertex is not held.
    NotHeld = 29,
    /// As many vertices are held as there is room for.
    HandlesFull = 30,
    /// The weights are so large that a held vertex left f32; the controls stay as they were.
    HeldOverflow = 31,
    /// Normals or tangents are to be written, and no normals were given.
    NoNormals = 32,
    /// Tangents or texture coordinates are to be written, and the package has no texture coordinates.
    NoTexture = 33,
    /// The stride of an attribute is less than its size.
    StrideTooShort = 34,
    /// Two attributes of a vertex would write into each other, or interleave with different strides.
    AttributesOverlap = 35,
    /// The index of an instance is not less than their count.
    NoSuchInstance = 36,
    /// The index of a knob is not less than their count.
    NoSuchKnob = 40,
    /// No binding is on this page.
    NoSuchPage = 41,
    /// No knob says this: an unknown kind of reading, a value above its full scale, a number that does not fit.
    BadReading = 42,
    /// Two knobs have one address.
    KnobTwice = 43,
    /// A knob's calibration leaves no range to turn in.
    BadCalibration = 44,
    /// A knob's step is not above 0 and at most 1.
    BadStep = 45,
    /// Two bindings move one control on the same page.
    TwoHands = 46,
    /// The tree has no coarse knob, more knobs than there are, or one that a binding has too.
    BadTree = 47,
    /// A number of a response is out of range, or its limits do not fit the control.
    BadResponse = 48,
    /// More knobs or bindings than a surface takes.
    TooMany = 49,
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

fn entry(status: i32) -> Option<&'static (SinewStatus, &'static CStr, &'static CStr)> {
    TABLE.iter().find(|(known, ..)| *known as i32 == status)
}

/// The status of a number that was one.
pub(crate) fn known(status: i32) -> SinewStatus {
    entry(status).map_or(SinewStatus::Internal, |(status, ..)| *status)
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
