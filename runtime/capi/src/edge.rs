//! The edge itself: what every exported function runs inside. A panic stops here and becomes a status.

use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;

use crate::details::{DetailsOut, SinewDetails};
use crate::fault::Fault;
use crate::memory::Regions;
use crate::status::SinewStatus;

/// Runs `work` and turns what becomes of it into a status.
pub(crate) fn edge(work: impl FnOnce() -> Result<(), Fault>) -> SinewStatus {
    match caught(work) {
        Ok(()) => SinewStatus::Ok,
        Err(fault) => fault.status(),
    }
}

/// As [`edge`]; a fault is written to `details` too, where there are any. `work` finds their memory among the regions.
///
/// # Safety
/// `details` is null or points to a struct that starts with its own size.
pub(crate) unsafe fn edge_with_details(
    details: *mut SinewDetails,
    work: impl FnOnce(&mut Regions) -> Result<(), Fault>,
) -> SinewStatus {
    let mut regions = Regions::new();
    // SAFETY: the caller's promise.
    let out = match unsafe { DetailsOut::new(details, &mut regions) } {
        Ok(out) => out,
        Err(fault) => return fault.status(),
    };
    match caught(|| work(&mut regions)) {
        Ok(()) => SinewStatus::Ok,
        Err(fault) => {
            out.write(&fault);
            fault.status()
        }
    }
}

fn caught(work: impl FnOnce() -> Result<(), Fault>) -> Result<(), Fault> {
    // Unwind safe: what a panic may have left half done is closed by the guard of its handle.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(Err(Fault::Internal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_stops_at_the_edge() {
        assert_eq!(edge(|| panic!("on purpose")), SinewStatus::Internal);
        // SAFETY: null.
        let status = unsafe { edge_with_details(core::ptr::null_mut(), |_| panic!("on purpose")) };
        assert_eq!(status, SinewStatus::Internal);
    }
}
