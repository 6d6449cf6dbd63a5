//! Vertex normals, two vertices to a register while their fans are walked, eight for the unit vectors. The same operations in
//! the same order as the scalar kernel: the same bits.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use sinew_formats::package::{FAN_VERTICES, Index};

use super::lanes::Eight;
use crate::simd::Kernels;
use crate::simd::generic::lanes::Lanes;
use crate::simd::generic::normals::{Around, normals_from, unit};
use crate::simd::generic::solve::Xyz0;

/// See [`normals`](crate::simd::generic::normals::normals).
pub(crate) fn normals<I: Index>(around: &Around<'_, I>, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { compiled(around, posed, normals) }
}

#[target_feature(enable = "avx2,fma")]
fn compiled<I: Index>(around: &Around<'_, I>, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
    let (groups, _) = around.vertex_from_slot.as_chunks::<{ Eight::COUNT }>();
    let rows = around.offsets.windows(2).map(|row| row[0] as usize..row[1] as usize);
    let mut centres = posed.as_chunks::<FAN_VERTICES>().0.iter().zip(rows);
    for vertices in groups {
        let mut sums = [[_mm256_setzero_ps(); 2]; 2];
        for (sum, (centre, row)) in sums.iter_mut().zip(&mut centres) {
            *sum = area(posed, centre, &around.fans[row]);
        }
        // Entries in the order z x y; vertex 2 i + n is half n of sum i.
        let [low, high] = sums.map(|[a, b]| _mm256_unpacklo_ps(a, b));
        let [low_y, high_y] = sums.map(|[a, b]| _mm256_unpackhi_ps(a, b));
        let x = _mm256_shuffle_ps::<0xee>(low, high);
        let y = _mm256_shuffle_ps::<0x44>(low_y, high_y);
        let z = _mm256_shuffle_ps::<0x44>(low, high);
        let mut unit = [[0.0; Eight::COUNT]; 3];
        for (row, unit) in self::unit([x, y, z].map(Eight)).into_iter().zip(&mut unit) {
            row.store(unit);
        }
        for (lane, &v) in vertices.iter().enumerate() {
            let n = lane % 2 * 4 + lane / 2;
            normals[v.at()] = unit.map(|row| row[n]);
        }
    }
    normals_from(groups.len() * Eight::COUNT, around, posed, normals);
}

/// Twice the area vectors around four vertices, two and two.
#[target_feature(enable = "avx2,fma")]
fn area<I: Index>(posed: &[Xyz0], centre: &[Xyz0; FAN_VERTICES], fan: &[[I; FAN_VERTICES]]) -> [__m256; 2] {
    /// Entries y z x, and the last one where it is.
    const TURN: i32 = 0xc9;
    // SAFETY: eight numbers from the first and the third vertex on, and four below.
    let centre = [0, 2].map(|n| unsafe { _mm256_loadu_ps(centre[n..n + 2].as_ptr().cast()) });
    let points = |step: &[I; FAN_VERTICES]| {
        let [a, b, c, d] = step.map(|slot| unsafe { _mm_loadu_ps(posed[slot.at()].as_ptr()) });
        [_mm256_set_m128(b, a), _mm256_set_m128(d, c)]
    };
    let mut sum = [_mm256_setzero_ps(); 2];
    let mut add = |a: [__m256; 2], b: [__m256; 2], c: [__m256; 2]| {
        for n in 0..2 {
            let (edge, across) = (_mm256_sub_ps(b[n], centre[n]), _mm256_sub_ps(c[n], a[n]));
            let (edge_turned, across_turned) = (_mm256_permute_ps::<TURN>(edge), _mm256_permute_ps::<TURN>(across));
            // No fused product: along a line it must give zero.
            let cross = _mm256_sub_ps(_mm256_mul_ps(edge, across_turned), _mm256_mul_ps(edge_turned, across));
            sum[n] = _mm256_add_ps(sum[n], cross);
        }
    };
    if let Some((first, rest)) = fan.split_first() {
        let mut a = points(first);
        let (pairs, last) = rest.as_chunks::<2>();
        for [b, c] in pairs {
            let c = points(c);
            add(a, points(b), c);
            a = c;
        }
        if let [b] = last {
            add(a, points(b), centre);
        }
    }
    sum
}
