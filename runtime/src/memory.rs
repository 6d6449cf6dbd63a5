//! The caller's memory, cut into sections. One function names the sections of a job; run on [`Carver::measuring`] it says how much
//! memory they take, run on [`Carver::carving`] it cuts them.

use crate::error::WorkspaceError;

/// Start of every section: a cache line, and the widest vector register.
pub(crate) const ALIGNMENT: usize = 64;

/// Cuts sections off the front of memory, or only counts their bytes.
pub(crate) struct Carver<'w> {
    /// None while measuring.
    memory: Option<&'w mut [u8]>,
    /// Of the sections so far; saturates where 32 bits are too few: then no memory is large enough.
    bytes: usize,
}

impl<'w> Carver<'w> {
    /// Counts only: every section it gives is empty.
    pub(crate) fn measuring() -> Self {
        Self { memory: None, bytes: 0 }
    }

    /// Cuts `memory` from its first aligned byte on, all of it set to zero as far as `size_bytes` go.
    ///
    /// # Errors
    /// [`WorkspaceError::TooSmall`], with the size that this memory would need given where it starts.
    pub(crate) fn carving(memory: &'w mut [u8], size_bytes: usize) -> Result<Self, WorkspaceError> {
        let skipped = memory.as_ptr().align_offset(ALIGNMENT);
        let required_bytes = skipped.saturating_add(size_bytes);
        if memory.len() < required_bytes {
            return Err(WorkspaceError::TooSmall {
                required_bytes,
                actual_bytes: memory.len(),
            });
        }
        let memory = &mut memory[skipped..required_bytes];
        memory.fill(0);
        Ok(Self {
            memory: Some(memory),
            bytes: 0,
        })
    }

    /// A section of `count` elements, which are zero.
    pub(crate) fn take<T: bytemuck::Pod>(&mut self, count: usize) -> &'w mut [T] {
        let own = count.saturating_mul(size_of::<T>());
        let padded = own.checked_next_multiple_of(ALIGNMENT).unwrap_or(usize::MAX);
        self.bytes = self.bytes.saturating_add(padded);
        let Some(memory) = self.memory.take() else {
            return &mut [];
        };
        let (section, rest) = memory.split_at_mut(padded);
        self.memory = Some(rest);
        bytemuck::cast_slice_mut(&mut section[..own])
    }

    /// Bytes of all sections.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;

    #[test]
    fn what_is_measured_is_what_is_carved() {
        fn sections<'w>(carver: &mut Carver<'w>) -> (&'w mut [f32], &'w mut [[u64; 3]], &'w mut [u8]) {
            (carver.take(17), carver.take(3), carver.take(0))
        }
        let mut measuring = Carver::measuring();
        assert_eq!(sections(&mut measuring).0.len(), 0);
        assert_eq!(measuring.bytes(), 128 + 128);
        let mut memory = vec![0xff_u8; 256 + ALIGNMENT];
        let mut carver = Carver::carving(&mut memory, measuring.bytes()).unwrap();
        let (a, b, c) = sections(&mut carver);
        assert_eq!((&*a, &*b, c.len()), (&[0.0; 17][..], &[[0; 3]; 3][..], 0));
        assert_eq!(
            a.as_ptr().align_offset(ALIGNMENT) + b.as_ptr().align_offset(ALIGNMENT),
            0
        );
    }

    #[test]
    fn sections_beyond_all_memory_saturate() {
        let mut carver = Carver::measuring();
        carver.take::<[f64; 8]>(usize::MAX / 2);
        carver.take::<f32>(100);
        assert_eq!(carver.bytes(), usize::MAX);
        assert!(Carver::carving(&mut [0; 100], carver.bytes()).is_err());
    }
}
