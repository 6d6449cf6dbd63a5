//! Normals: the last step, and a job of its own for positions that come from elsewhere.

use crate::basis::Basis;
use crate::error::{Buffer, FrameError};
use crate::simd::scalar::surface;

/// Unit vertex normals of the basis' triangles, weighted by area. A vertex without area gets
/// [`FALLBACK_NORMAL`](crate::FALLBACK_NORMAL).
#[derive(Debug)]
pub struct Normals<'j> {
    /// The triangles.
    pub basis: &'j Basis<'j>,
    /// Shape: `[V]`, source order.
    pub positions: &'j [[f32; 3]],
    /// Output. Shape: `[V]`, source order.
    pub normals: &'j mut [[f32; 3]],
}

impl Normals<'_> {
    /// Checks the lengths.
    ///
    /// # Errors
    /// [`FrameError::WrongLength`].
    pub fn validate(&self) -> Result<(), FrameError> {
        check_length(self.basis, Buffer::Positions, self.positions.len())?;
        check_length(self.basis, Buffer::Normals, self.normals.len())
    }

    /// Computes the normals.
    ///
    /// # Errors
    /// Those of [`Normals::validate`].
    pub fn run(self) -> Result<(), FrameError> {
        self.validate()?;
        surface::normals(self.basis.faces(), self.positions, self.normals);
        Ok(())
    }
}

/// Refuses a buffer that has not one element a vertex.
pub(crate) fn check_length(basis: &Basis<'_>, buffer: Buffer, actual: usize) -> Result<(), FrameError> {
    let expected = basis.vertex_count();
    if actual == expected {
        Ok(())
    } else {
        Err(FrameError::WrongLength {
            buffer,
            expected,
            actual,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;
    use crate::fixture::{Package, open};

    #[test]
    fn validity() {
        let package = Package::small(1);
        let basis = open(&package);
        let count = basis.vertex_count();
        let run = |positions: usize, normals: usize| {
            let (positions, mut normals) = (vec![[0.0; 3]; positions], vec![[9.0; 3]; normals]);
            let outcome = Normals {
                basis: &basis,
                positions: &positions,
                normals: &mut normals,
            }
            .run();
            assert!(
                outcome.is_ok() || normals.iter().all(|n| *n == [9.0; 3]),
                "nothing was written"
            );
            outcome
        };
        let short = |buffer, actual| {
            Err(FrameError::WrongLength {
                buffer,
                expected: count,
                actual,
            })
        };
        assert_eq!(run(count, count), Ok(()));
        assert_eq!(run(count - 1, count), short(Buffer::Positions, count - 1));
        assert_eq!(run(count, count + 1), short(Buffer::Normals, count + 1));
    }
}
