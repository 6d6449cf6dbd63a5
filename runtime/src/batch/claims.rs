//! A slice whose elements are handed out one by one, each once, to whichever thread asks next: a counter and no lock.
#![allow(unsafe_code)] // The one place where several threads write into one slice.

use core::marker::PhantomData;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Elements that nobody has taken yet: those from `next` on.
#[derive(Debug)]
pub(super) struct Claims<'s, T> {
    first: *mut T,
    count: usize,
    next: AtomicUsize,
    /// Stands for the whole slice, exclusively, as long as this lives.
    slice: PhantomData<&'s mut [T]>,
}

// SAFETY: this is a `&mut [T]` and a counter. Sending it sends the elements; sharing it lets each thread take elements that
// no other gets, which sends those too. `T: Sync` is not needed, because no two threads ever see one element.
unsafe impl<T: Send> Send for Claims<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for Claims<'_, T> {}

impl<'s, T> Claims<'s, T> {
    pub(super) fn new(slice: &'s mut [T]) -> Self {
        Self {
            first: slice.as_mut_ptr(),
            count: slice.len(),
            next: AtomicUsize::new(0),
            slice: PhantomData,
        }
    }

    /// The next element, or none when all are taken. Never waits.
    pub(super) fn take(&self) -> Option<&'s mut T> {
        // Counting stops at the end, so it never wraps round. Who joins the threads orders their writes; the counter need not.
        let step = |n: usize| (n < self.count).then_some(n + 1);
        let taken = self.next.fetch_update(Ordering::Relaxed, Ordering::Relaxed, step);
        // SAFETY: `n < count` lies in the slice, which is borrowed for 's and reached only here; the counter gives each n to
        // one caller only.
        taken.ok().map(|n| unsafe { &mut *self.first.add(n) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_element_is_taken_once() {
        let mut elements = [0_u32; 100];
        let claims = Claims::new(&mut elements);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    while let Some(element) = claims.take() {
                        *element += 1;
                    }
                });
            }
        });
        assert!(claims.take().is_none() && claims.take().is_none());
        assert_eq!(elements, [1; 100]);
    }

    #[test]
    fn nothing_to_take() {
        assert!(Claims::<u8>::new(&mut []).take().is_none());
    }
}
