//! Structs that may grow: the first member is the struct's size as the caller's header knew it, so either side may be
//! the newer one.
//!
//! A caller's input struct may be longer than this library knows, as long as the rest is zero, which means "default"; an
//! output struct is filled as far as the shorter of the two goes.

use core::mem::MaybeUninit;

use crate::fault::Fault;
use crate::memory::{Access, Region, Regions, present};

/// No struct is longer; a larger size is garbage.
const STRUCT_BYTES_MAX: usize = 4096;

/// # Safety
/// `repr(C)`, first member `struct_bytes: usize`, no drop, and valid for any bits, those of its padding included.
pub(crate) unsafe trait GrowingStruct: Copy {
    const NAME: &'static str;
    /// Size in the first version that had this struct: the least that is accepted.
    const FIRST_BYTES: usize;
}

/// Checks pointer and size. Returns the size the caller gives.
///
/// # Safety
/// `pointer` is null or points to a readable struct that starts with its own size.
unsafe fn size<T: GrowingStruct>(pointer: *const T) -> Result<usize, Fault> {
    present(pointer, T::NAME)?;
    // SAFETY: not null, aligned, and the size is its first member.
    let actual = unsafe { pointer.cast::<usize>().read() };
    if (T::FIRST_BYTES..=STRUCT_BYTES_MAX).contains(&actual) && actual.is_multiple_of(align_of::<usize>()) {
        Ok(actual)
    } else {
        Err(Fault::StructSize {
            name: T::NAME,
            expected: size_of::<T>(),
            actual,
        })
    }
}

/// Reads an input struct; members that the caller's version lacks are zero.
///
/// # Safety
/// `pointer` is null or points to a readable struct that starts with its own size.
pub(crate) unsafe fn read<T: GrowingStruct>(pointer: *const T, regions: &mut Regions) -> Result<T, Fault> {
    // SAFETY: the caller's promise.
    let bytes = unsafe { size(pointer)? };
    regions.add(Region::new(pointer, bytes, T::NAME, Access::Read)?)?;
    let known = bytes.min(size_of::<T>());
    for at in known..bytes {
        // SAFETY: within the size that the struct gives itself.
        if unsafe { pointer.cast::<u8>().add(at).read() } != 0 {
            return Err(Fault::UnknownOption { name: T::NAME, at });
        }
    }
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: both sides are at least `known` bytes; every bit pattern is a value.
    unsafe {
        pointer
            .cast::<u8>()
            .copy_to_nonoverlapping(value.as_mut_ptr().cast(), known);
        Ok(value.assume_init())
    }
}

/// An output struct, checked, to be written at most once.
pub(crate) struct StructOut<T> {
    pointer: *mut T,
    bytes: usize,
}

impl<T: GrowingStruct> StructOut<T> {
    /// Null means that the caller does not want it.
    ///
    /// # Safety
    /// `pointer` is null or points to a writable struct that starts with its own size.
    pub(crate) unsafe fn optional(pointer: *mut T, regions: &mut Regions) -> Result<Self, Fault> {
        if pointer.is_null() {
            return Ok(Self { pointer, bytes: 0 });
        }
        // SAFETY: the caller's promise.
        unsafe { Self::required(pointer, regions) }
    }

    /// # Safety
    /// As for `optional`; null is refused.
    pub(crate) unsafe fn required(pointer: *mut T, regions: &mut Regions) -> Result<Self, Fault> {
        // SAFETY: the caller's promise.
        let bytes = unsafe { size(pointer.cast_const())? };
        regions.add(Region::new(pointer, bytes, T::NAME, Access::Write)?)?;
        Ok(Self { pointer, bytes })
    }

    /// Writes all but the size, which stays what the caller gave.
    pub(crate) fn write(&self, value: &T) {
        const SIZE_BYTES: usize = size_of::<usize>();
        if self.pointer.is_null() {
            return;
        }
        let known = self.bytes.min(size_of::<T>());
        let (from, to) = ((&raw const *value).cast::<u8>(), self.pointer.cast::<u8>());
        // SAFETY: `required` proved that the struct is that long; the value is another object.
        unsafe {
            from.add(SIZE_BYTES)
                .copy_to_nonoverlapping(to.add(SIZE_BYTES), known - SIZE_BYTES);
        }
    }
}

/// An array's element whose size the caller gives beside the array, for the same growth.
///
/// # Safety
/// `repr(C)`, no drop, and valid for any bits.
pub(crate) unsafe trait GrowingElement: Copy {
    const NAME: &'static str;
    /// Size in the first version that had this struct.
    const FIRST_BYTES: usize;
}

/// An array of such elements, checked.
pub(crate) struct Elements<T> {
    start: *const T,
    count: usize,
    stride_bytes: usize,
}

impl<T: GrowingElement> Elements<T> {
    /// No elements may be no pointer.
    ///
    /// # Safety
    /// `start` is null or readable for `count` elements of `stride_bytes`, as long as this is used.
    pub(crate) unsafe fn new(
        start: *const T,
        count: usize,
        stride_bytes: usize,
        regions: &mut Regions,
    ) -> Result<Self, Fault> {
        if count > 0 {
            present(start, T::NAME)?;
            if !(T::FIRST_BYTES..=STRUCT_BYTES_MAX).contains(&stride_bytes)
                || !stride_bytes.is_multiple_of(align_of::<T>())
            {
                return Err(Fault::ElementSize {
                    name: T::NAME,
                    expected: size_of::<T>(),
                    actual: stride_bytes,
                });
            }
            let bytes = count.saturating_mul(stride_bytes);
            regions.add(Region::new(start, bytes, T::NAME, Access::Read)?)?;
        }
        Ok(Self {
            start,
            count,
            stride_bytes,
        })
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Reads an element; members that the caller's version lacks are zero. None behind the last.
    pub(crate) fn get(&self, index: usize) -> Option<Result<T, Fault>> {
        if index >= self.count {
            return None;
        }
        let element = self.start.cast::<u8>().wrapping_add(index * self.stride_bytes);
        let known = self.stride_bytes.min(size_of::<T>());
        for at in known..self.stride_bytes {
            // SAFETY: within the element, which `new` was promised to be readable.
            if unsafe { element.add(at).read() } != 0 {
                return Some(Err(Fault::UnknownOption { name: T::NAME, at }));
            }
        }
        let mut value = MaybeUninit::<T>::zeroed();
        // SAFETY: both sides are at least `known` bytes; every bit pattern is a value.
        unsafe {
            element.copy_to_nonoverlapping(value.as_mut_ptr().cast(), known);
            Some(Ok(value.assume_init()))
        }
    }
}

/// The choice of a number that a struct or an argument gives: 0 is the first.
pub(crate) fn choice<T: Copy>(name: &'static str, value: i32, choices: &[T]) -> Result<T, Fault> {
    let chosen = usize::try_from(value).ok().and_then(|index| choices.get(index));
    chosen.copied().ok_or(Fault::UnknownChoice { name, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SinewStatus;

    /// A struct of the second version, and what the third will have.
    #[repr(C)]
    #[derive(Clone, Copy)]
    struct Grown {
        struct_bytes: usize,
        first: u64,
        second: u64,
        third: u64,
    }

    /// What this library knows of it.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Known {
        struct_bytes: usize,
        first: u64,
        second: u64,
    }

    // SAFETY: `repr(C)`, the size first, numbers only.
    unsafe impl GrowingStruct for Known {
        const NAME: &'static str = "grown";
        const FIRST_BYTES: usize = core::mem::offset_of!(Known, second);
    }

    fn grown(fields: usize, third: u64) -> Grown {
        Grown {
            struct_bytes: size_of::<usize>() + 8 * fields,
            first: 1,
            second: 2,
            third,
        }
    }

    #[test]
    fn inputs_of_older_and_newer_programs_are_read() {
        let known = |input: &Grown| {
            let pointer = (&raw const *input).cast::<Known>();
            // SAFETY: as long as it says.
            unsafe { read(pointer, &mut Regions::new()) }.map(|known| (known.first, known.second))
        };
        assert!(
            matches!(known(&grown(1, 7)), Ok((1, 0))),
            "the second member is not there"
        );
        assert!(matches!(known(&grown(2, 7)), Ok((1, 2))));
        assert!(matches!(known(&grown(3, 0)), Ok((1, 2))), "the third asks for nothing");
        let refused = |fields, third| known(&grown(fields, third)).map_err(|fault| fault.status()).err();
        assert_eq!(refused(3, 7), Some(SinewStatus::UnknownOption));
        assert_eq!(refused(0, 0), Some(SinewStatus::StructSize));
    }

    #[test]
    fn outputs_of_older_and_newer_programs_are_written_as_far_as_both_know() {
        for (fields, expected) in [(1, [10, 2, 7]), (2, [10, 20, 7]), (3, [10, 20, 7])] {
            let mut output = grown(fields, 7);
            let struct_bytes = output.struct_bytes;
            let pointer = (&raw mut output).cast::<Known>();
            // SAFETY: as long as it says.
            let Ok(out) = (unsafe { StructOut::required(pointer, &mut Regions::new()) }) else {
                panic!("sound")
            };
            out.write(&Known {
                struct_bytes: 0,
                first: 10,
                second: 20,
            });
            assert_eq!([output.first, output.second, output.third], expected);
            assert_eq!(output.struct_bytes, struct_bytes);
        }
    }
}
