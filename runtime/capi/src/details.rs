//! Details: the numbers and the sentence behind a status, in a struct of the caller's. No heap, no global state.

use core::ffi::c_char;
use core::fmt::{self, Write};

use crate::fault::Fault;
use crate::memory::Regions;
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut};

/// Bytes of the text in `SinewDetails`, with the NUL.
pub const SINEW_DETAILS_TEXT_BYTES: usize = 228;

/// Why a call was refused. Set `struct_bytes` to `sizeof(SinewDetails)`; the rest is written when a call that takes the
/// struct returns anything but `SINEW_STATUS_OK`, and is left alone otherwise.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SinewDetails {
    /// `sizeof(SinewDetails)`.
    pub struct_bytes: usize,
    /// Index of the element at fault: control, vertex, element of a package's field. 0 where the fault has none.
    pub index: u64,
    /// What was needed: a length, a count, a limit, a version. 0 where the fault has none.
    pub expected: u64,
    /// What was found instead. 0 where the fault has none.
    pub actual: u64,
    /// The status that the call returned.
    pub status: SinewStatus,
    /// One English sentence for a log, UTF-8, ended by NUL; cut off if it is too long.
    pub text: [c_char; SINEW_DETAILS_TEXT_BYTES],
}

// SAFETY: `repr(C)`, the size first. It is only written, never read.
unsafe impl GrowingStruct for SinewDetails {
    const NAME: &'static str = DETAILS;
    const FIRST_BYTES: usize = size_of::<Self>();
}

const DETAILS: &str = "details";

/// The caller's details, checked.
pub(crate) struct DetailsOut(StructOut<SinewDetails>);

impl DetailsOut {
    /// # Safety
    /// `details` is null or points to a writable struct that starts with its own size.
    pub(crate) unsafe fn new(details: *mut SinewDetails, regions: &mut Regions) -> Result<Self, Fault> {
        // SAFETY: the caller's promise.
        unsafe { StructOut::optional(details, regions) }.map(Self)
    }

    /// Writes the fault down, unless it is that these details lie in memory of something else.
    pub(crate) fn write(&self, fault: &Fault) {
        if let Fault::Overlap { first, second } = fault
            && [*first, *second].contains(&DETAILS)
        {
            return;
        }
        let numbers = fault.numbers();
        let mut text = Text {
            bytes: [0; SINEW_DETAILS_TEXT_BYTES],
            length: 0,
        };
        // An error says that the text was cut off, which is documented.
        let _ = write!(text, "{fault}");
        self.0.write(&SinewDetails {
            struct_bytes: size_of::<SinewDetails>(),
            index: numbers.index,
            expected: numbers.expected,
            actual: numbers.actual,
            status: fault.status(),
            text: text.bytes.map(|byte| byte as c_char),
        });
    }
}

/// Text of bounded length that ends with NUL and never within a character.
struct Text {
    bytes: [u8; SINEW_DETAILS_TEXT_BYTES],
    length: usize,
}

impl Write for Text {
    fn write_str(&mut self, more: &str) -> fmt::Result {
        let room = SINEW_DETAILS_TEXT_BYTES - 1 - self.length;
        let taken = more.floor_char_boundary(room);
        self.bytes[self.length..][..taken].copy_from_slice(&more.as_bytes()[..taken]);
        self.length += taken;
        if taken == more.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_cut_between_characters_and_ends_with_nul() {
        let mut text = Text {
            bytes: [0; SINEW_DETAILS_TEXT_BYTES],
            length: 0,
        };
        assert!(text.write_str(&"x".repeat(SINEW_DETAILS_TEXT_BYTES - 2)).is_ok());
        assert!(text.write_str("é").is_err());
        assert_eq!(text.length, SINEW_DETAILS_TEXT_BYTES - 2);
        assert_eq!(text.bytes[text.length..], [0, 0]);
    }
}
