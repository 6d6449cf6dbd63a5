//! Details: the numbers and the sentence behind a status, in a struct of the caller's. No heap, no global state.

use core::ffi::c_char;

use crate::fault::Fault;
use crate::memory::Regions;
use crate::status::SinewStatus;
use crate::structs::{GrowingStruct, StructOut};
use crate::text;

/// Bytes of the sentence in `SinewDetails`, with the NUL.
pub const SINEW_DETAILS_TEXT_BYTES: usize = 216;

/// What can be done about a package that does not open.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinewPackageReason {
    /// No package was refused.
    None = 0,
    /// The bytes are something else.
    NotAPackage = 1,
    /// Of a format version, or of a kind, that this library does not know: update the library, or train and bake again.
    Version = 2,
    /// Sound, but not to be played: `sinew bake` makes a baked package of a compact one.
    WrongKind = 3,
    /// Cut off or changed on its way: copy it again.
    Damaged = 4,
    /// Whole, but it breaks a rule of the format: what wrote it has a defect.
    Rule = 5,
}

/// Why a call was refused: written when a call returns anything but `SINEW_STATUS_OK`, else left alone.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SinewDetails {
    /// Set by `SINEW_INIT`.
    pub struct_bytes: usize,
    /// Index of the element at fault: control, vertex, element of a package's field. 0 where the fault has none.
    pub index: u64,
    /// What was needed: a length, a count, a limit, a version. 0 where the fault has none.
    pub expected: u64,
    /// What was found instead. 0 where the fault has none.
    pub actual: u64,
    /// The status that the call returned.
    pub status: SinewStatus,
    /// Why a package does not open.
    pub reason: SinewPackageReason,
    /// One English sentence for a log, UTF-8, ended by NUL; cut off if it is too long.
    pub text: [c_char; SINEW_DETAILS_TEXT_BYTES],
}

const _: () = assert!(size_of::<SinewDetails>() == 256 || size_of::<usize>() < 8);

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
        self.0.write(&SinewDetails {
            struct_bytes: size_of::<SinewDetails>(),
            index: numbers.index,
            expected: numbers.expected,
            actual: numbers.actual,
            status: fault.status(),
            reason: fault.reason(),
            text: text::of(fault),
        });
    }
}
