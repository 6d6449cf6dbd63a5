//! Linear memory beyond the module's own data: one arena, taken from its start again for every package.

use core::arch::wasm32::{memory_grow, memory_size};
use core::{ptr, slice};

/// Bytes a page of WebAssembly.
const PAGE_BYTES: usize = 64 * 1024;
/// A cache line; what a package, a workspace and a vector register want.
const ALIGNMENT: usize = 64;

unsafe extern "C" {
    /// Set by the linker at the end of data and stack; only its address means anything.
    static __heap_base: u8;
}

/// Takes slices off the arena, front to back. There is one at a time: making one ends all slices of the one before.
pub(crate) struct Arena {
    next: usize,
}

impl Arena {
    /// The empty arena.
    ///
    /// # Safety
    /// No slice of an earlier arena may be used again.
    pub(crate) unsafe fn new() -> Self {
        Self {
            next: (&raw const __heap_base).addr(),
        }
    }

    /// Room for `count` elements at a multiple of 64: its address, or none when memory cannot grow that far.
    pub(crate) fn reserve<T: Plain>(&mut self, count: usize) -> Option<usize> {
        let start = self.next.checked_next_multiple_of(ALIGNMENT)?;
        let end = start.checked_add(count.checked_mul(size_of::<T>())?)?;
        let pages = end.div_ceil(PAGE_BYTES);
        let missing = pages.saturating_sub(memory_size(0));
        if missing > 0 && memory_grow(0, missing) == usize::MAX {
            return None;
        }
        self.next = end;
        Some(start)
    }

    /// `count` zeroed elements at a multiple of 64, or none when memory cannot grow that far.
    pub(crate) fn take<T: Plain>(&mut self, count: usize) -> Option<&'static mut [T]> {
        let first = ptr::with_exposed_provenance_mut::<T>(self.reserve::<T>(count)?);
        // SAFETY: the bytes are inside linear memory, beyond data and stack, handed out once by this arena, aligned to 64, and
        // zeroed, which is a value of every `Plain` type.
        Some(unsafe {
            first.write_bytes(0, count);
            slice::from_raw_parts_mut(first, count)
        })
    }
}

/// Types without padding of which all-zero bytes are a value, and that align to at most 64.
///
/// # Safety
/// The type is such.
pub(crate) unsafe trait Plain: 'static {}

// SAFETY: a byte.
unsafe impl Plain for u8 {}
// SAFETY: zero bits are 0.0.
unsafe impl Plain for f32 {}
// SAFETY: three floats.
unsafe impl Plain for [f32; 3] {}
// SAFETY: three whole numbers.
unsafe impl Plain for [u32; 3] {}
