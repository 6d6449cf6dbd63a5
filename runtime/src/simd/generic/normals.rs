//! Vertex normals.

use sinew_formats::package::{FAN_VERTICES, Index};

use super::lanes::Lanes;
use super::solve::Xyz0;
use crate::simd::all::One;

/// Normal of a vertex without area around it: unused, or all its triangles are degenerate.
pub const FALLBACK_NORMAL: [f32; 3] = [0.0, 0.0, 1.0];

/// How the triangles lie around the vertices, see [`sinew_formats::package::BakedBasis`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around<'a, I> {
    /// Shape: `[ceil(V / FAN_VERTICES) + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Slots.
    pub(crate) fans: &'a [[I; FAN_VERTICES]],
    /// Where normals go. Shape: `[V]`, a permutation.
    pub(crate) vertex_from_slot: &'a [I],
}

/// Unit vertex normals, the sum of the triangles' normals times their area. Shape: `posed` `[V]` in slots, `normals` `[V]` in
/// source order.
///
/// A vertex without area gets [`FALLBACK_NORMAL`].
pub(crate) fn normals<I: Index>(around: &Around<'_, I>, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
    normals_from(0, around, posed, normals);
}

/// Those of the slots from `first` on.
pub(crate) fn normals_from<I: Index>(first: usize, around: &Around<'_, I>, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
    for (slot, &v) in around.vertex_from_slot.iter().enumerate().skip(first) {
        let (row, column) = (slot / FAN_VERTICES, slot % FAN_VERTICES);
        let fan = &around.fans[around.offsets[row] as usize..around.offsets[row + 1] as usize];
        let sum = area(posed, slot, fan.iter().map(|step| step[column].at()));
        normals[v.at()] = unit(sum.map(One)).map(|One(x)| x);
    }
}

/// Twice the area vectors of the triangles of one walk, two at a time: for steps a b c around p their sum is
/// `(b - p) x (c - a)`. Where a last b is left, c is p.
fn area(posed: &[Xyz0], centre: usize, mut walk: impl Iterator<Item = usize>) -> [f32; 3] {
    let difference = |q: Xyz0, p: Xyz0| [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
    let p = posed[centre];
    let mut sum = [0.0; 3];
    let Some(first) = walk.next() else {
        return sum;
    };
    let mut a = posed[first];
    while let Some(b) = walk.next() {
        let c = walk.next().map_or(p, |slot| posed[slot]);
        let (edge, across) = (difference(posed[b], p), difference(c, a));
        for n in 0..3 {
            let (i, j) = ((n + 1) % 3, (n + 2) % 3);
            // No fused product: along a line it must give zero.
            sum[n] += edge[i] * across[j] - edge[j] * across[i];
        }
        a = c;
    }
    sum
}

/// Vectors of length one; [`FALLBACK_NORMAL`] for one of no length, or of one that left f32.
#[inline(always)]
pub(crate) fn unit<L: Lanes>(n: [L; 3]) -> [L; 3] {
    /// More than the inverse length of what has a largest entry of one.
    const INVERSE_END: f32 = 2.0;
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let [x, y, z] = n.map(|x| x.max(zero.sub(x)));
    // By the largest entry first: the square of a small or a large area would leave f32.
    let inverse = one.div(x.max(y).max(z));
    let m = n.map(|x| x.mul(inverse));
    let inverse = one.div(m[0].mul(m[0]).add(m[1].mul(m[1])).add(m[2].mul(m[2])).sqrt());
    // Not a number where the largest entry was zero, infinite or none itself.
    let valid = inverse.select_below(L::splat(INVERSE_END), inverse, zero);
    core::array::from_fn(|c| zero.select_below(valid, m[c].mul(valid), L::splat(FALLBACK_NORMAL[c])))
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use sinew_formats::package::Fans;

    use super::*;

    /// Rounding of a unit vector.
    const TOLERANCE: f32 = 1e-6;

    fn identity(count: usize) -> Vec<u32> {
        (0..count as u32).collect()
    }

    /// Normals with all orders the same.
    fn normals_of(faces: &[[u32; 3]], positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let slots = identity(positions.len());
        let Fans { fan_offsets, fans } = Fans::gather(faces, &slots);
        let around = Around {
            offsets: &fan_offsets,
            fans: &fans,
            vertex_from_slot: &slots,
        };
        let posed: Vec<Xyz0> = positions.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
        let mut found = vec![[f32::NAN; 3]; positions.len()];
        normals(&around, &posed, &mut found);
        found
    }

    #[test]
    fn normals_are_weighted_by_area() {
        // Two triangles over the edge 0-1: one of area 1 facing +z, one of area 2 facing +y.
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]];
        let found = normals_of(&[[0, 1, 2], [1, 0, 3]], &positions);
        let slant = 1.0 / 5.0_f32.sqrt();
        let expected = [
            [0.0, 2.0 * slant, slant],
            [0.0, 2.0 * slant, slant],
            [0.0, 0.0, 1.0],
            [0.0, 1.0, 0.0],
        ];
        for (n, e) in found.iter().zip(&expected) {
            assert!((0..3).all(|c| (n[c] - e[c]).abs() < TOLERANCE), "{n:?} {e:?}");
        }
    }

    #[test]
    fn vertices_without_area_get_the_fallback() {
        let line = [[0.1, 0.7, 0.3], [1.1, 0.7, 0.3], [2.1, 0.7, 0.3], [5.0, 5.0, 5.0]];
        assert_eq!(normals_of(&[[0, 1, 2]], &line), [FALLBACK_NORMAL; 4]);
        let double = [[0.1, 0.2, 0.3], [1.3, 0.7, 0.9], [1.3, 0.7, 0.9]];
        assert_eq!(normals_of(&[[0, 1, 2]], &double), [FALLBACK_NORMAL; 3]);
    }

    #[test]
    fn tiny_and_huge_triangles_have_unit_normals() {
        for scale in [1e-15_f32, 1e9, 1e17] {
            let positions = [[0.0; 3], [scale, 0.0, 0.0], [0.0, scale, scale]];
            for n in normals_of(&[[0, 1, 2]], &positions) {
                assert!(
                    (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0).abs() < TOLERANCE,
                    "{scale}: {n:?}"
                );
                assert_ne!(n, FALLBACK_NORMAL);
            }
        }
        let overflowing = [[0.0; 3], [1e30, 0.0, 0.0], [0.0, 1e30, 1e30]];
        assert_eq!(normals_of(&[[0, 1, 2]], &overflowing), [FALLBACK_NORMAL; 3]);
    }
}
