//! Status codes: one for every fault, in one table. The codes of released versions keep their meaning.

use core::ffi::{CStr, c_char};

/// Makes the enum, and the table of what logs say, of rows `number, variant, "NAME", "sentence"`.
macro_rules! statuses {
    ($($code:literal $variant:ident $name:literal $text:literal)*) => {
        /// What a call returns. Unless a status says otherwise, a call that returns anything but `SINEW_STATUS_OK` has changed
        /// nothing. New codes may be added: treat an unknown one as a fault.
        #[repr(i32)]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum SinewStatus {
            $(#[doc = $text] $variant = $code,)*
        }

        /// Status, its name in the header, its sentence.
        const TABLE: &[(SinewStatus, &str, &str)] = &[
            $((SinewStatus::$variant, concat!("SINEW_STATUS_", $name, "\0"), concat!($text, "\0")),)*
        ];
    };
}

// A gap of the numbers ends a room of the header: frame, pins, buffers, batches, knobs.
statuses! {
    0 Ok "OK" "done"
    1 NullPointer "NULL_POINTER" "a pointer that must not be NULL is"
    2 Misaligned "MISALIGNED" "a pointer does not start at a multiple of the alignment it needs"
    3 TooShort "TOO_SHORT" "memory or a buffer is shorter than it must be"
    4 TooLong "TOO_LONG" "a length reaches beyond the address space"
    5 Overlap "OVERLAP" "memory that the call writes overlaps other memory that it uses"
    6 StructSize "STRUCT_SIZE" "a struct's first member is not its size; begin with SINEW_INIT"
    7 UnknownOption "UNKNOWN_OPTION" "a struct asks for something that this library is too old for"
    8 WrongAbi "WRONG_ABI" "header and library have different interface versions"
    9 PackageRefused "PACKAGE_REFUSED" "the package does not open; the details say why"
    10 NotAHandle "NOT_A_HANDLE" "not a handle, or its memory was freed or written over"
    11 WrongHandle "WRONG_HANDLE" "a handle of another kind"
    12 ClosedHandle "CLOSED_HANDLE" "the handle was closed, or a call that wrote it ended with INTERNAL"
    13 MovedHandle "MOVED_HANDLE" "the handle was copied or moved; make it anew where it shall stay"
    14 DamagedHandle "DAMAGED_HANDLE" "something wrote over the handle's memory"
    15 InUse "IN_USE" "another thread is using the handle at this moment"
    16 ForeignWorkspace "FOREIGN_WORKSPACE" "the workspace was made for another basis; make one for this basis"
    17 ForeignControls "FOREIGN_CONTROLS" "the controls were made for another basis; make some for this basis"
    18 ForeignPins "FOREIGN_PINS" "the pins were made for another basis; make some for this basis"
    20 NoSuchControl "NO_SUCH_CONTROL" "there is no control of this index"
    21 NoSuchName "NO_SUCH_NAME" "there is no control of this name"
    22 NotFinite "NOT_FINITE" "a number is NaN or infinite; what it was meant for stays as it was"
    23 FrameOverflow "FRAME_OVERFLOW" "the weights are so large that a position or a bone left f32; outputs and workspace are at rest"
    24 NoBones "NO_BONES" "the package has no bones; bake it with some, or use the exact tier"
    25 NeedsExactTier "NEEDS_EXACT_TIER" "the call needs a workspace of the exact tier"
    26 NeedsBones "NEEDS_BONES" "the call needs a workspace of the bones"
    30 NoSuchVertex "NO_SUCH_VERTEX" "there is no vertex of this index"
    31 AlreadyPinned "ALREADY_PINNED" "the vertex is pinned already; move its target"
    32 NotPinned "NOT_PINNED" "the vertex is not pinned"
    33 PinsFull "PINS_FULL" "as many vertices are pinned as there is room for"
    34 PinOverflow "PIN_OVERFLOW" "the weights are so large that a pinned vertex left f32; the controls stay"
    40 NoNormals "NO_NORMALS" "normals or tangents are to be written and no normals were given"
    41 NoTexture "NO_TEXTURE" "the package has no texture coordinates, and so no tangents"
    42 StrideTooShort "STRIDE_TOO_SHORT" "the stride of an attribute is less than its size"
    43 AttributesOverlap "ATTRIBUTES_OVERLAP" "two attributes overlap, or interleave with different strides"
    50 NoSuchInstance "NO_SUCH_INSTANCE" "there is no instance of this index"
    60 NoSuchKnob "NO_SUCH_KNOB" "there is no knob of this index"
    61 NoSuchPage "NO_SUCH_PAGE" "no binding is on this page"
    62 BadReading "BAD_READING" "no knob says this: an unknown kind, or a number outside its range"
    63 KnobTwice "KNOB_TWICE" "two knobs have one address"
    64 BadCalibration "BAD_CALIBRATION" "the calibration of a knob leaves no range to turn in"
    65 BadStep "BAD_STEP" "the step of a knob must be above 0 and at most 1"
    66 TwoHands "TWO_HANDS" "two bindings move one control on the same page"
    67 BadTree "BAD_TREE" "the tree needs a coarse knob, and knobs that are there and that no binding has"
    68 BadResponse "BAD_RESPONSE" "a response has a number out of range, or limits that do not fit its control"
    69 TooMany "TOO_MANY" "more knobs or bindings than a surface takes"
    99 Internal "INTERNAL" "a defect of the library, please report it; what the call was writing is closed"
}

const UNKNOWN: &CStr = c"unknown status";

fn row(status: i32) -> Option<&'static (SinewStatus, &'static str, &'static str)> {
    TABLE.iter().find(|(known, ..)| *known as i32 == status)
}

/// The status of a number that was one.
pub(crate) fn known(status: i32) -> SinewStatus {
    row(status).map_or(SinewStatus::Internal, |(status, ..)| *status)
}

/// What a status means, in one English sentence without a full stop. Never NULL, never freed, unknown codes included.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_status_text(status: i32) -> *const c_char {
    // The table ends its texts with NUL.
    row(status).map_or(UNKNOWN.as_ptr(), |(.., text)| text.as_ptr().cast())
}

/// The name of a status as this header spells it, for logs. Never NULL, never freed, unknown codes included.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_status_name(status: i32) -> *const c_char {
    row(status).map_or(UNKNOWN.as_ptr(), |(_, name, _)| name.as_ptr().cast())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn text(pointer: *const c_char) -> &'static str {
        // SAFETY: the functions return static strings.
        unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8")
    }

    #[test]
    fn every_status_has_a_name_like_its_variant_and_a_sentence_of_its_own() {
        let mut texts = BTreeSet::new();
        for &(status, name, sentence) in TABLE {
            let plain = name.replace(['_', '\0'], "");
            assert!(
                plain.eq_ignore_ascii_case(&format!("SinewStatus{status:?}")),
                "{plain} {status:?}"
            );
            assert_eq!(
                name.matches('\0').count() + sentence.matches('\0').count(),
                2,
                "{status:?}"
            );
            assert!(texts.insert(sentence), "{status:?}");
            assert_eq!(known(status as i32), status);
        }
        assert_eq!(text(sinew_status_name(5)), "SINEW_STATUS_OVERLAP");
        assert_eq!(text(sinew_status_text(0)), "done");
        assert_eq!(text(sinew_status_text(i32::MIN)), "unknown status");
        assert_eq!(text(sinew_status_name(-1)), "unknown status");
    }
}
