//! Positions in slots to what a caller gets: positions in source order, and their bounding box.

use sinew_formats::package::Index;

use crate::basis::{Basis, with_index};
use crate::error::FrameError;
use crate::simd::generic::solve::Xyz0;

/// The smallest box with edges along the axes that holds all positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least x, y and z.
    pub minimum: [f32; 3],
    /// Greatest x, y and z.
    pub maximum: [f32; 3],
}

impl Bounds {
    /// Holds nothing.
    pub(crate) const EMPTY: Self = Self {
        minimum: [f32::INFINITY; 3],
        maximum: [f32::NEG_INFINITY; 3],
    };

    /// Grows around a point of numbers.
    pub(crate) fn include(&mut self, p: &[f32; 3]) {
        for c in 0..3 {
            self.minimum[c] = if p[c] < self.minimum[c] { p[c] } else { self.minimum[c] };
            self.maximum[c] = if p[c] > self.maximum[c] { p[c] } else { self.maximum[c] };
        }
    }
}

/// Writes `posed` in source order; gives the bounding box of what it wrote. Shape: both `[V]`.
///
/// Errors: [`FrameError::NotFinite`], and then both hold the rest shape.
pub(crate) fn scatter(
    basis: &Basis<'_>,
    posed: &mut [Xyz0],
    positions: &mut [[f32; 3]],
) -> (Bounds, Result<(), FrameError>) {
    with_index!(posed.len(), I => {
        let vertices = I::of(basis.vertex_from_slot());
        let written = write(vertices, posed, positions);
        match written {
            Ok(bounds) => (bounds, Ok(())),
            Err(vertex) => {
                for (posed, r) in posed.iter_mut().zip(basis.rest_positions()) {
                    *posed = [r[0], r[1], r[2], 0.0];
                }
                let bounds = write(vertices, posed, positions).unwrap_or(Bounds::EMPTY);
                (bounds, Err(FrameError::NotFinite { vertex }))
            }
        }
    })
}

/// Errors: the first vertex, in slots, whose position is not finite; then the output is only partly written.
fn write<I: Index>(vertex_from_slot: &[I], posed: &[Xyz0], positions: &mut [[f32; 3]]) -> Result<Bounds, usize> {
    let mut bounds = Bounds::EMPTY;
    // Stays zero while all are finite.
    let mut trace = [0.0_f32; 3];
    for (&[x, y, z, _], &v) in posed.iter().zip(vertex_from_slot) {
        let p = [x, y, z];
        for c in 0..3 {
            trace[c] += 0.0 * p[c];
        }
        bounds.include(&p);
        positions[v.at()] = p;
    }
    if trace == [0.0; 3] {
        return Ok(bounds);
    }
    let lost = posed.iter().position(|p| !p.iter().all(|x| x.is_finite()));
    Err(lost.map_or(0, |slot| vertex_from_slot[slot].at()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_follow_the_order_and_are_bounded() {
        let posed = [[1.0, 0.5, 0.0, 0.0], [2.0, 0.25, 0.0, 0.0], [3.0, 0.125, 0.0, 0.0]];
        let mut positions = [[0.0; 3]; 3];
        let bounds = write(&[2_u16, 0, 1], &posed, &mut positions);
        assert_eq!(positions, [[2.0, 0.25, 0.0], [3.0, 0.125, 0.0], [1.0, 0.5, 0.0]]);
        let expected = Bounds {
            minimum: [1.0, 0.125, 0.0],
            maximum: [3.0, 0.5, 0.0],
        };
        assert_eq!(bounds, Ok(expected));
    }

    #[test]
    fn the_vertex_that_is_not_finite_is_named() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for c in 0..3 {
                let mut posed = [[0.0; 4]; 4];
                posed[2][c] = bad;
                assert_eq!(write(&[1_u32, 0, 3, 2], &posed, &mut [[0.0; 3]; 4]), Err(3));
            }
        }
    }
}
