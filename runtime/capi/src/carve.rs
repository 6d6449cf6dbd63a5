//! Arrays of the runtime's own records in the buffers of a handle, one after the other, each at a multiple of the handle's
//! alignment. Before the arrays are written, all checks have passed.

use crate::handle::ALIGNMENT;

/// Bytes that an array takes.
pub(crate) fn bytes<T>(count: usize) -> usize {
    (count * size_of::<T>()).next_multiple_of(ALIGNMENT)
}

/// An array of so many copies of a value, and the buffers behind it. The caller counted with [`bytes`].
pub(crate) fn filled<T: Copy>(
    buffers: &'static mut [u8],
    value: T,
    count: usize,
) -> (&'static mut [T], &'static mut [u8]) {
    let (own, rest) = buffers.split_at_mut(bytes::<T>(count));
    let start: *mut T = own.as_mut_ptr().cast();
    const { assert!(align_of::<T>() <= ALIGNMENT) };
    // SAFETY: handles and their arrays begin at multiples of the alignment, and `own` holds `count` elements, which are
    // written before they are read.
    let array = unsafe {
        (0..count).for_each(|n| start.add(n).write(value));
        core::slice::from_raw_parts_mut(start, count)
    };
    (array, rest)
}

/// The same with the elements of a slice.
pub(crate) fn copied<T: Copy>(buffers: &'static mut [u8], from: &[T]) -> (&'static mut [T], &'static mut [u8]) {
    let Some(&first) = from.first() else {
        return (&mut [], buffers);
    };
    let (array, rest) = filled(buffers, first, from.len());
    array.copy_from_slice(from);
    (array, rest)
}
