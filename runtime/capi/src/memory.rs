//! The caller's memory: pointers become regions only after null, alignment and length are checked, and no region that
//! is written may touch another.

use core::ffi::{c_char, c_void};

use crate::fault::Fault;

/// How much memory a handle needs. Fixed for ever, hence without a size of its own.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinewLayout {
    /// Bytes: a multiple of the alignment.
    pub size_bytes: usize,
    /// The memory must start at a multiple of this: a power of two, at most 64.
    pub alignment: usize,
}

/// What a call does with a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    Read,
    Write,
}

/// Some of the caller's memory, by the name of the argument that gives it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Region {
    pub(crate) name: &'static str,
    start: usize,
    bytes: usize,
    access: Access,
}

impl Region {
    const EMPTY: Self = Self {
        name: "",
        start: 0,
        bytes: 0,
        access: Access::Read,
    };

    /// `bytes` from `pointer` on. Refuses what reaches beyond the address space: no object does.
    pub(crate) fn new<T>(pointer: *const T, bytes: usize, name: &'static str, access: Access) -> Result<Self, Fault> {
        let start = pointer.addr();
        if isize::try_from(bytes).is_err() || start.checked_add(bytes).is_none() {
            return Err(Fault::TooLong { name, actual: bytes });
        }
        Ok(Self {
            name,
            start,
            bytes,
            access,
        })
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.start < other.start + other.bytes && other.start < self.start + self.bytes
    }
}

/// All regions of one call.
#[derive(Clone, Copy)]
pub(crate) struct Regions {
    regions: [Region; Self::COUNT_MAX],
    count: usize,
}

impl Regions {
    /// No call has more: a batch's details, result, basis, package, instances and memory, and of each instance workspace,
    /// controls, positions and normals.
    const COUNT_MAX: usize = 10;

    pub(crate) fn new() -> Self {
        Self {
            regions: [Region::EMPTY; Self::COUNT_MAX],
            count: 0,
        }
    }

    /// Adds a region, unless it overlaps one that is there and either is written.
    pub(crate) fn add(&mut self, region: Region) -> Result<(), Fault> {
        for other in &self.regions[..self.count] {
            let written = region.access == Access::Write || other.access == Access::Write;
            if written && region.overlaps(other) {
                return Err(Fault::Overlap {
                    first: other.name,
                    second: region.name,
                });
            }
        }
        self.regions[self.count] = region;
        self.count += 1;
        Ok(())
    }
}

/// Refuses null and wrongly aligned pointers.
pub(crate) fn present<T>(pointer: *const T, name: &'static str) -> Result<(), Fault> {
    aligned(pointer, align_of::<T>(), name)
}

fn aligned<T>(pointer: *const T, alignment: usize, name: &'static str) -> Result<(), Fault> {
    if pointer.is_null() {
        return Err(Fault::Null { name });
    }
    if !pointer.addr().is_multiple_of(alignment) {
        return Err(Fault::Misaligned { name, alignment });
    }
    Ok(())
}

/// A caller's array of `count` elements that must hold at least `least`; the region is the `least` that are used. No
/// elements may be no pointer.
fn array<T>(
    pointer: *const T,
    count: usize,
    least: usize,
    name: &'static str,
    access: Access,
    regions: &mut Regions,
) -> Result<(), Fault> {
    if count > 0 {
        present(pointer, name)?;
    }
    if count < least {
        return Err(Fault::TooShort {
            name,
            expected: least,
            actual: count,
        });
    }
    if least == 0 {
        return Ok(());
    }
    // The whole must be possible, not only the part in use: a length gone wrong is noticed.
    let whole = count.saturating_mul(size_of::<T>());
    Region::new(pointer, whole, name, access)?;
    regions.add(Region::new(pointer, least * size_of::<T>(), name, access)?)
}

/// The first `least` of a caller's `count` elements, to be read.
///
/// # Safety
/// `pointer` is null or readable for `count` elements, which are valid for any bits, as long as the slice is used.
pub(crate) unsafe fn slice<'b, T>(
    pointer: *const T,
    count: usize,
    least: usize,
    name: &'static str,
    regions: &mut Regions,
) -> Result<&'b [T], Fault> {
    array(pointer, count, least, name, Access::Read, regions)?;
    if least == 0 {
        return Ok(&[]);
    }
    // SAFETY: the caller's promise; neither null nor beyond the address space.
    Ok(unsafe { core::slice::from_raw_parts(pointer, least) })
}

/// The first `least` of a caller's `count` elements, to be written.
///
/// # Safety
/// `pointer` is null or writable for `count` elements, which are valid for any bits, as long as the slice is used.
pub(crate) unsafe fn slice_mut<'b, T>(
    pointer: *mut T,
    count: usize,
    least: usize,
    name: &'static str,
    regions: &mut Regions,
) -> Result<&'b mut [T], Fault> {
    array(pointer, count, least, name, Access::Write, regions)?;
    if least == 0 {
        return Ok(&mut []);
    }
    // SAFETY: the caller's promise; checked, and apart from all that was added to the regions.
    Ok(unsafe { core::slice::from_raw_parts_mut(pointer, least) })
}

/// Writes a text and its NUL to a caller's buffer; nothing where it is too short.
///
/// # Safety
/// `buffer` is null or writable for `buffer_bytes`.
pub(crate) unsafe fn write_text(
    text: &str,
    buffer: *mut c_char,
    buffer_bytes: usize,
    name: &'static str,
    regions: &mut Regions,
) -> Result<(), Fault> {
    // SAFETY: the caller's promise.
    let buffer = unsafe { slice_mut(buffer.cast::<u8>(), buffer_bytes, text.len() + 1, name, regions)? };
    let (own, nul) = buffer.split_at_mut(text.len());
    own.copy_from_slice(text.as_bytes());
    nul.fill(0);
    Ok(())
}

/// Memory for a handle, or several: checked against their layout.
pub(crate) fn handle_memory(
    memory: *mut c_void,
    memory_bytes: usize,
    layout: SinewLayout,
    regions: &mut Regions,
) -> Result<*mut u8, Fault> {
    let memory: *mut u8 = memory.cast();
    aligned(memory, layout.alignment, "memory")?;
    array(
        memory,
        memory_bytes,
        layout.size_bytes,
        "memory",
        Access::Write,
        regions,
    )?;
    Ok(memory)
}

/// A place for one result, checked, to be written once all else is.
pub(crate) struct Out<T>(*mut T);

impl<T: Copy> Out<T> {
    pub(crate) fn required(pointer: *mut T, name: &'static str, regions: &mut Regions) -> Result<Self, Fault> {
        array(pointer, 1, 1, name, Access::Write, regions)?;
        Ok(Self(pointer))
    }

    /// Null means that the caller does not want it.
    pub(crate) fn optional(pointer: *mut T, name: &'static str, regions: &mut Regions) -> Result<Self, Fault> {
        if pointer.is_null() {
            return Ok(Self(pointer));
        }
        Self::required(pointer, name, regions)
    }

    /// # Safety
    /// The pointer is null or writable: what the exported function asked of its caller.
    pub(crate) unsafe fn write(&self, value: T) {
        if !self.0.is_null() {
            // SAFETY: the caller's promise; alignment was checked.
            unsafe { self.0.write(value) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(start: usize, bytes: usize, access: Access) -> Region {
        Region::new(core::ptr::without_provenance::<u8>(start), bytes, "some", access).expect("possible")
    }

    #[test]
    fn only_written_regions_must_lie_apart() {
        let add = |other: Region| {
            let mut regions = Regions::new();
            regions.add(region(100, 10, Access::Read)).expect("first");
            regions.add(other).is_ok()
        };
        for (start, bytes, apart) in [(90, 10, true), (90, 11, false), (109, 1, false), (110, 5, true)] {
            assert_eq!(add(region(start, bytes, Access::Write)), apart, "{start} {bytes}");
            assert!(add(region(start, bytes, Access::Read)));
        }
    }

    #[test]
    fn no_region_reaches_beyond_the_address_space() {
        let at = core::ptr::without_provenance::<u8>;
        assert!(Region::new(at(usize::MAX - 3), 3, "some", Access::Read).is_ok());
        assert!(Region::new(at(usize::MAX - 3), 4, "some", Access::Read).is_err());
        assert!(Region::new(at(1), usize::MAX / 2 + 1, "some", Access::Read).is_err());
        let mut regions = Regions::new();
        let refused = array(at(4).cast::<u32>(), usize::MAX, 1, "some", Access::Read, &mut regions);
        assert_eq!(
            refused.map_err(|fault| fault.status()),
            Err(crate::SinewStatus::TooLong)
        );
    }
}
