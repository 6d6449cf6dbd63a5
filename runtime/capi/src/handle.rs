//! Handles: what the caller's memory holds. A head says what it is, where it was made and how long it is; a canary ends
//! it. Every call looks at both before it believes the rest, so that a foreign, closed, moved or overwritten handle is
//! refused. Memory that was given back to an allocator cannot be told for certain; the canaries find it by chance.

use core::cell::UnsafeCell;
use core::ffi::c_void;
use core::ops::{Deref, DerefMut};
use core::sync::atomic::{AtomicI32, AtomicU32, Ordering};

use crate::fault::Fault;
use crate::kind::Kind;
use crate::memory::{Access, Region, Regions, SinewLayout, present};

/// Start of a handle and of the buffers behind it: a cache line, and the widest vector register.
pub(crate) const ALIGNMENT: usize = 64;
const CANARY_BYTES: usize = size_of::<u64>();

/// What a kind of handle holds. Nothing in it needs dropping: memory may simply be taken away.
pub(crate) trait Body {
    const KIND: Kind;
}

/// Numbers only: any readable memory may be looked at as a head.
#[repr(C)]
struct Head {
    tag: AtomicU32,
    /// Calls that read, or -1 for one that writes.
    lock: AtomicI32,
    /// Where the handle was made.
    address: usize,
    /// Handle, buffers and canary.
    region_bytes: usize,
    /// Follows from the two above; the canary at the end is a copy.
    seal: u64,
}

impl Head {
    /// Looks at what the caller gives as a handle, of whatever kind.
    ///
    /// # Safety
    /// `pointer` is null, or readable for the size of a handle of any kind; if a handle was made there, its memory is still
    /// the caller's.
    unsafe fn check<'h>(pointer: *const Self, name: &'static str) -> Result<(&'h Self, Kind), Fault> {
        present(pointer, name)?;
        // SAFETY: readable by the caller's promise, aligned, and any bits are a head.
        let head = unsafe { &*pointer };
        let kind = match head.tag.load(Ordering::Acquire) {
            Kind::CLOSED => return Err(Fault::ClosedHandle { name }),
            tag => Kind::of(tag).ok_or(Fault::NotAHandle { name })?,
        };
        if head.address != pointer.addr() {
            return Err(Fault::MovedHandle { name });
        }
        let expected = seal(kind, head.address, head.region_bytes);
        // SAFETY: the seal shows that the length is the one that `create` wrote, so the canary is in the caller's memory.
        let whole = head.seal == expected
            && unsafe { pointer.byte_add(head.region_bytes - CANARY_BYTES).cast::<u64>().read() } == expected;
        if whole {
            Ok((head, kind))
        } else {
            Err(Fault::DamagedHandle { name })
        }
    }

    /// Takes the handle for a call that writes it.
    fn lock(&self, name: &'static str) -> Result<(), Fault> {
        let free = self.lock.compare_exchange(0, -1, Ordering::Acquire, Ordering::Relaxed);
        free.map(|_| ()).map_err(|_| Fault::InUse { name })
    }
}

#[repr(C)]
pub(crate) struct Handle<B> {
    head: Head,
    body: UnsafeCell<B>,
}

/// Spreads every bit of where and how long over the whole word.
fn seal(kind: Kind, address: usize, region_bytes: usize) -> u64 {
    let mixed = (address as u64 ^ u64::from(kind.tag())).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed ^ region_bytes as u64).wrapping_mul(0xd6e8_feb8_6659_fd93)
}

impl<B: Body> Handle<B> {
    const NAME: &'static str = B::KIND.name();
    /// Where the buffers start.
    const BUFFERS_AT: usize = size_of::<Self>().next_multiple_of(ALIGNMENT);

    /// Memory for a handle with `buffer_bytes` of buffers.
    pub(crate) fn layout(buffer_bytes: usize) -> SinewLayout {
        const { assert!(align_of::<Self>() <= ALIGNMENT && !core::mem::needs_drop::<B>()) };
        SinewLayout {
            size_bytes: (Self::BUFFERS_AT + buffer_bytes + CANARY_BYTES).next_multiple_of(ALIGNMENT),
            alignment: ALIGNMENT,
        }
    }

    /// Makes a handle in memory that was checked against `layout`. `body` gets the buffers; if it fails, nothing was written.
    ///
    /// # Safety
    /// `memory` is writable for the layout's size and nobody else uses it, as long as the handle is used.
    pub(crate) unsafe fn create(
        memory: *mut u8,
        layout: SinewLayout,
        body: impl FnOnce(&'static mut [u8]) -> Result<B, Fault>,
    ) -> Result<*mut Self, Fault> {
        let canary_at = layout.size_bytes - CANARY_BYTES;
        // SAFETY: within the layout, and apart from the head and the canary.
        let buffers =
            unsafe { core::slice::from_raw_parts_mut(memory.add(Self::BUFFERS_AT), canary_at - Self::BUFFERS_AT) };
        let body = body(buffers)?;
        let (address, region_bytes) = (memory.addr(), layout.size_bytes);
        let seal = seal(B::KIND, address, region_bytes);
        let head = Head {
            tag: AtomicU32::new(B::KIND.tag()),
            lock: AtomicI32::new(0),
            address,
            region_bytes,
            seal,
        };
        let handle = memory.cast::<Self>();
        // SAFETY: the memory is aligned for both and long enough; the canary's place is a multiple of 8.
        unsafe {
            handle.write(Self {
                head,
                body: UnsafeCell::new(body),
            });
            memory.add(canary_at).cast::<u64>().write(seal);
        }
        Ok(handle)
    }

    /// Looks at what the caller gives as a handle.
    ///
    /// # Safety
    /// `pointer` is null, or readable for the size of a handle of any kind; if a handle was made there, its memory is still
    /// the caller's.
    unsafe fn check<'h>(pointer: *const Self) -> Result<&'h Self, Fault> {
        // SAFETY: the caller's promise.
        let (_, kind) = unsafe { Head::check(pointer.cast(), Self::NAME)? };
        if kind != B::KIND {
            return Err(Fault::WrongHandle {
                name: Self::NAME,
                found: kind,
            });
        }
        // SAFETY: `create` wrote a whole handle of this kind here, and it stands.
        Ok(unsafe { &*pointer })
    }

    /// Where a handle lies that is not used now, but must not be written by anybody else.
    ///
    /// # Safety
    /// As for `check`.
    pub(crate) unsafe fn place(pointer: *const Self, access: Access) -> Result<Region, Fault> {
        // SAFETY: the caller's promise.
        unsafe { Self::check(pointer)? }.region(access)
    }

    fn region(&self, access: Access) -> Result<Region, Fault> {
        Region::new(&raw const *self, self.head.region_bytes, Self::NAME, access)
    }

    /// The body, to be read along with other calls.
    ///
    /// # Safety
    /// As for `check`.
    pub(crate) unsafe fn share<'h>(pointer: *const Self, regions: &mut Regions) -> Result<Shared<'h, B>, Fault> {
        // SAFETY: the caller's promise.
        let handle = unsafe { Self::check(pointer)? };
        regions.add(handle.region(Access::Read)?)?;
        handle
            .head
            .lock
            .fetch_update(Ordering::Acquire, Ordering::Relaxed, |readers| {
                (0..i32::MAX).contains(&readers).then(|| readers + 1)
            })
            .map_err(|_| Fault::InUse { name: Self::NAME })?;
        Ok(Shared { handle })
    }

    /// The body, to be written by this call alone.
    ///
    /// # Safety
    /// As for `check`.
    pub(crate) unsafe fn lend<'h>(pointer: *const Self, regions: &mut Regions) -> Result<Lent<'h, B>, Fault> {
        // SAFETY: the caller's promise.
        let handle = unsafe { Self::check(pointer)? };
        regions.add(handle.region(Access::Write)?)?;
        handle.head.lock(Self::NAME)?;
        let unwinding_before = std::thread::panicking();
        Ok(Lent {
            handle,
            unwinding_before,
        })
    }
}

/// Ends a handle of any kind: from now on it is refused by name, for as long as its memory stands.
///
/// # Safety
/// As for `Handle::check`.
pub(crate) unsafe fn close(pointer: *mut c_void) -> Result<(), Fault> {
    const NAME: &str = "handle";
    // SAFETY: the caller's promise.
    let (head, _) = unsafe { Head::check(pointer.cast_const().cast(), NAME)? };
    head.lock(NAME)?;
    head.tag.store(Kind::CLOSED, Ordering::Release);
    head.lock.store(0, Ordering::Release);
    Ok(())
}

/// A handle that is being read.
pub(crate) struct Shared<'h, B> {
    handle: &'h Handle<B>,
}

impl<B> Deref for Shared<'_, B> {
    type Target = B;

    fn deref(&self) -> &B {
        // SAFETY: the lock keeps writers out while this guard lives.
        unsafe { &*self.handle.body.get() }
    }
}

impl<B> Drop for Shared<'_, B> {
    fn drop(&mut self) {
        self.handle.head.lock.fetch_sub(1, Ordering::Release);
    }
}

/// A handle that is being written.
pub(crate) struct Lent<'h, B> {
    handle: &'h Handle<B>,
    unwinding_before: bool,
}

impl<B> Deref for Lent<'_, B> {
    type Target = B;

    fn deref(&self) -> &B {
        // SAFETY: the lock gives this guard the body alone.
        unsafe { &*self.handle.body.get() }
    }
}

impl<B> DerefMut for Lent<'_, B> {
    fn deref_mut(&mut self) -> &mut B {
        // SAFETY: the lock gives this guard the body alone.
        unsafe { &mut *self.handle.body.get() }
    }
}

impl<B> Drop for Lent<'_, B> {
    fn drop(&mut self) {
        // What a panic left half done must not be used again.
        if std::thread::panicking() && !self.unwinding_before {
            self.handle.head.tag.store(Kind::CLOSED, Ordering::Relaxed);
        }
        self.handle.head.lock.store(0, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use core::panic::AssertUnwindSafe;
    use std::panic::catch_unwind;

    use super::*;

    struct Number(u32);

    impl Body for Number {
        const KIND: Kind = Kind::Controls;
    }

    struct Letter;

    impl Body for Letter {
        const KIND: Kind = Kind::Basis;
    }

    #[repr(C, align(64))]
    struct Memory([u8; 512]);

    fn number(memory: &mut Memory) -> *mut Handle<Number> {
        // SAFETY: the memory is longer than this layout.
        let handle = unsafe {
            Handle::create(memory.0.as_mut_ptr(), Handle::<Number>::layout(100), |buffers| {
                assert!(buffers.len() >= 100);
                Ok(Number(7))
            })
        };
        let Ok(handle) = handle else { panic!("made") };
        handle
    }

    fn read(handle: *const Handle<Number>) -> Result<u32, Fault> {
        // SAFETY: all handles here lie in memory that stands.
        unsafe { Handle::share(handle, &mut Regions::new()) }.map(|number| number.0)
    }

    fn status(handle: *const Handle<Number>) -> crate::SinewStatus {
        read(handle).map_or_else(|fault| fault.status(), |_| crate::SinewStatus::Ok)
    }

    #[test]
    fn readers_share_and_a_writer_is_alone() {
        let mut memory = Memory([0; 512]);
        let handle = number(&mut memory);
        let regions = || Regions::new();
        // SAFETY: the handle stands.
        unsafe {
            let reading = Handle::share(handle, &mut regions()).ok();
            assert!(reading.is_some() && read(handle).is_ok());
            assert!(Handle::lend(handle, &mut regions()).is_err());
            drop(reading);
            let Ok(mut writing) = Handle::lend(handle, &mut regions()) else {
                panic!("free")
            };
            writing.0 = 8;
            assert_eq!(status(handle), crate::SinewStatus::InUse);
            assert!(close(handle.cast()).is_err());
            drop(writing);
        }
        assert!(matches!(read(handle), Ok(8)));
    }

    #[test]
    fn a_panic_closes_what_it_wrote() {
        let mut memory = Memory([0; 512]);
        let handle = number(&mut memory);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            // SAFETY: the handle stands.
            let _writing = unsafe { Handle::lend(handle, &mut Regions::new()) };
            panic!("on purpose");
        }));
        assert!(outcome.is_err());
        assert_eq!(status(handle), crate::SinewStatus::ClosedHandle);
    }

    #[test]
    fn every_wrong_handle_has_its_name() {
        let (mut memory, mut elsewhere) = (Memory([0; 512]), Memory([0; 512]));
        let nothing = elsewhere.0.as_ptr().cast::<Handle<Number>>();
        assert_eq!(status(core::ptr::null()), crate::SinewStatus::NullPointer);
        assert_eq!(status(nothing.wrapping_byte_add(1)), crate::SinewStatus::Misaligned);
        assert_eq!(status(nothing), crate::SinewStatus::NotAHandle);
        let handle = number(&mut memory);
        // SAFETY: both are whole memories; a letter is looked for where a number is.
        unsafe {
            elsewhere.0.as_mut_ptr().copy_from_nonoverlapping(handle.cast(), 512);
            let letter = Handle::<Letter>::share(handle.cast(), &mut Regions::new());
            assert_eq!(
                letter.map_err(|fault| fault.status()).err(),
                Some(crate::SinewStatus::WrongHandle)
            );
        }
        assert_eq!(status(elsewhere.0.as_ptr().cast()), crate::SinewStatus::MovedHandle);
        let canary = Handle::<Number>::layout(100).size_bytes - 1;
        for byte in (8..32).chain([canary]) {
            let handle = number(&mut memory);
            // SAFETY: within the memory.
            unsafe { *handle.cast::<u8>().add(byte) ^= 1 };
            let damaged = status(handle);
            let moved = (8..16).contains(&byte) && damaged == crate::SinewStatus::MovedHandle;
            assert!(moved || damaged == crate::SinewStatus::DamagedHandle, "{byte}");
        }
        let handle = number(&mut memory);
        // SAFETY: the handle stands.
        assert!(unsafe { close(handle.cast()) }.is_ok());
        assert_eq!(status(handle), crate::SinewStatus::ClosedHandle);
    }
}
