//! Displacements to what a renderer wants: positions in source order, their bounding box, and vertex normals.

use sinew_formats::package::FAN_VERTICES;

use super::poisson::Lane;
use crate::simd::lanes::{Lanes, One};

/// Normal of a vertex without area around it: unused, or all its triangles are degenerate.
pub const FALLBACK_NORMAL: [f32; 3] = [0.0, 0.0, 1.0];

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

/// The orders of the exact tier. Shape: `[V]` each, permutations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Orders<'a> {
    pub(crate) solver_from_lane: &'a [u32],
    pub(crate) vertex_from_lane: &'a [u32],
}

/// `rest + displacement`, to `posed`, filled up with a zero, and to `positions`. Shape: all `[V]`; `rest` and `posed` in lanes,
/// `displacement` in solver order, `positions` in source order.
///
/// Errors: the first vertex, in lanes, whose position is not finite; then the output is only partly written.
pub(crate) fn scatter(
    rest: &[[f32; 3]],
    displacement: &[Lane],
    orders: Orders<'_>,
    posed: &mut [[f32; 4]],
    positions: &mut [[f32; 3]],
) -> Result<Bounds, u32> {
    let mut bounds = Bounds::EMPTY;
    // Stays zero while all are finite.
    let mut trace = [0.0_f32; 3];
    let lanes = orders.solver_from_lane.iter().zip(orders.vertex_from_lane);
    for ((r, posed), (&solver, &v)) in rest.iter().zip(posed.iter_mut()).zip(lanes) {
        let d = displacement[solver as usize];
        let p = [r[0] + d[0], r[1] + d[1], r[2] + d[2]];
        for c in 0..3 {
            trace[c] += 0.0 * p[c];
        }
        bounds.include(&p);
        positions[v as usize] = p;
        *posed = [p[0], p[1], p[2], 0.0];
    }
    if trace == [0.0; 3] {
        return Ok(bounds);
    }
    let lost = posed.iter().position(|p| !p.iter().all(|x| x.is_finite()));
    Err(lost.map_or(0, |lane| orders.vertex_from_lane[lane]))
}

/// How the triangles lie around the vertices, see [`sinew_formats::package::BakedBasis`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around<'a> {
    /// Shape: `[ceil(V / FAN_VERTICES) + 1]`.
    pub(crate) offsets: &'a [u32],
    /// Lanes.
    pub(crate) fans: &'a [[u32; FAN_VERTICES]],
    /// Shape: `[V]`.
    pub(crate) vertex_from_lane: &'a [u32],
}

/// Unit vertex normals, the sum of the triangles' normals times their area. Shape: `posed` `[V]` in lanes, `normals` `[V]` in
/// source order.
///
/// A vertex without area gets [`FALLBACK_NORMAL`].
pub(crate) fn normals(around: &Around<'_>, posed: &[[f32; 4]], normals: &mut [[f32; 3]]) {
    normals_from(0, around, posed, normals);
}

/// Those of the lanes from `first` on.
pub(crate) fn normals_from(first: usize, around: &Around<'_>, posed: &[[f32; 4]], normals: &mut [[f32; 3]]) {
    for (lane, &v) in around.vertex_from_lane.iter().enumerate().skip(first) {
        let (quad, column) = (lane / FAN_VERTICES, lane % FAN_VERTICES);
        let fan = &around.fans[around.offsets[quad] as usize..around.offsets[quad + 1] as usize];
        let sum = area(posed, lane, fan.iter().map(|step| step[column]));
        normals[v as usize] = unit(sum.map(One)).map(|One(x)| x);
    }
}

/// Twice the area vectors of the triangles of one walk, two at a time: for steps a b c around p their sum is
/// `(b - p) x (c - a)`. Where a last b is left, c is p.
fn area(posed: &[[f32; 4]], centre: usize, mut walk: impl Iterator<Item = u32>) -> [f32; 3] {
    let difference = |q: [f32; 4], p: [f32; 4]| [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
    let p = posed[centre];
    let mut sum = [0.0; 3];
    let Some(first) = walk.next() else {
        return sum;
    };
    let mut a = posed[first as usize];
    while let Some(b) = walk.next() {
        let c = walk.next().map_or(p, |lane| posed[lane as usize]);
        let (edge, across) = (difference(posed[b as usize], p), difference(c, a));
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
        let lanes = identity(positions.len());
        let Fans { fan_offsets, fans } = Fans::gather(faces, &lanes);
        let around = Around {
            offsets: &fan_offsets,
            fans: &fans,
            vertex_from_lane: &lanes,
        };
        let posed: Vec<[f32; 4]> = positions.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
        let mut found = vec![[f32::NAN; 3]; positions.len()];
        normals(&around, &posed, &mut found);
        found
    }

    fn scattered(displacement: &[Lane], order: &[u32]) -> (Result<Bounds, u32>, Vec<[f32; 3]>, Vec<[f32; 4]>) {
        let count = displacement.len();
        let rest: Vec<[f32; 3]> = (0..count).map(|s| [s as f32 + 1.0, 0.0, 0.0]).collect();
        let lanes: Vec<u32> = (0..count as u32).rev().collect();
        let orders = Orders {
            solver_from_lane: &lanes,
            vertex_from_lane: order,
        };
        let (mut positions, mut posed) = (vec![[0.0; 3]; count], vec![[9.0; 4]; count]);
        let outcome = scatter(&rest, displacement, orders, &mut posed, &mut positions);
        (outcome, positions, posed)
    }

    #[test]
    fn scatter_follows_both_permutations_and_bounds_the_positions() {
        let displacement = [[0.0, 0.5, 0.0, 0.0], [0.0, 0.25, 0.0, 0.0], [0.0, 0.125, 0.0, 0.0]];
        let (bounds, positions, posed) = scattered(&displacement, &[2, 0, 1]);
        assert_eq!(positions, [[2.0, 0.25, 0.0], [3.0, 0.5, 0.0], [1.0, 0.125, 0.0]]);
        let filled = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        assert_eq!(posed, [positions[2], positions[0], positions[1]].map(filled));
        let expected = Bounds {
            minimum: [1.0, 0.125, 0.0],
            maximum: [3.0, 0.5, 0.0],
        };
        assert_eq!(bounds, Ok(expected));
    }

    #[test]
    fn scatter_names_the_vertex_that_is_not_finite() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for c in 0..3 {
                let mut displacement = [[0.0; 4]; 4];
                displacement[1][c] = bad;
                assert_eq!(scattered(&displacement, &[1, 0, 3, 2]).0, Err(3));
            }
        }
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
