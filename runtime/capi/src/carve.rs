//! Arrays of the runtime's own records in the buffers of a handle. One function names the arrays of a handle; run on
//! [`Carver::measuring`] it says how many bytes they take, run on [`Carver::carving`] it cuts them.

use crate::handle::ALIGNMENT;

/// Cuts arrays off the front of buffers, or only counts their bytes.
pub(crate) struct Carver {
    /// None while measuring.
    buffers: Option<&'static mut [u8]>,
    /// Of the arrays so far; saturates.
    bytes: usize,
}

impl Carver {
    /// Counts only: every array it gives is empty.
    pub(crate) fn measuring() -> Self {
        Self {
            buffers: None,
            bytes: 0,
        }
    }

    /// Cuts the buffers of a handle whose layout was measured. They begin at a multiple of the alignment.
    pub(crate) fn carving(buffers: &'static mut [u8]) -> Self {
        Self {
            buffers: Some(buffers),
            bytes: 0,
        }
    }

    /// An array of so many copies of a value.
    pub(crate) fn take<T: Copy>(&mut self, count: usize, value: T) -> &'static mut [T] {
        const { assert!(align_of::<T>() <= ALIGNMENT) };
        let own = count.saturating_mul(size_of::<T>());
        let padded = own.checked_next_multiple_of(ALIGNMENT).unwrap_or(usize::MAX);
        self.bytes = self.bytes.saturating_add(padded);
        let Some(buffers) = self.buffers.take() else {
            return &mut [];
        };
        let (own, rest) = buffers.split_at_mut(padded);
        self.buffers = Some(rest);
        let start: *mut T = own.as_mut_ptr().cast();
        // SAFETY: the array begins at a multiple of the alignment, and `own` holds `count` elements, which are written before
        // they are read.
        unsafe {
            (0..count).for_each(|n| start.add(n).write(value));
            core::slice::from_raw_parts_mut(start, count)
        }
    }

    /// Bytes of all arrays so far: no more than any memory has.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes.min(isize::MAX as usize / 2)
    }
}
