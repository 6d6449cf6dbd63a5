//! What all rooms share: versions of the library, for people, and of the interface, for the check that header and library
//! belong together; the end of a handle.

use core::ffi::{CStr, c_char, c_void};

use crate::edge::edge;
use crate::fault::Fault;
use crate::handle::close;
use crate::status::SinewStatus;

/// Version of this interface. Rises when a function, a struct or a status code changes its meaning; additions leave it.
pub const SINEW_ABI_VERSION: u32 = 1;

const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
    Ok(version) => version,
    Err(_) => panic!("a version has no NUL"),
};

/// The library's version, for example "0.1.0". Never NULL, never freed.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_version() -> *const c_char {
    VERSION.as_ptr()
}

/// The interface version that the library was built with; `SINEW_ABI_VERSION` is that of the header. The functions that open
/// something compare the two.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_abi_version() -> u32 {
    SINEW_ABI_VERSION
}

/// Ends a handle of any kind: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing
/// to free, so this is optional before memory and package are given back.
///
/// # Safety
/// `handle` is NULL or points to a handle's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sinew_close(handle: *mut c_void) -> SinewStatus {
    // SAFETY: the caller's promise.
    edge(|| unsafe { close(handle) })
}

/// Refuses a program that was compiled with another header.
pub(crate) fn check_abi(abi_version: u32) -> Result<(), Fault> {
    if abi_version == SINEW_ABI_VERSION {
        Ok(())
    } else {
        Err(Fault::WrongAbi {
            expected: SINEW_ABI_VERSION,
            actual: abi_version,
        })
    }
}
