//! Vertex normals, four vertices to a register while their fans are walked, sixteen for the unit vectors. The same operations in
//! the same order as the scalar kernel: the same bits.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use sinew_formats::package::FAN_VERTICES;

use super::lanes::Sixteen;
use crate::simd::Kernels;
use crate::simd::lanes::Lanes;
use crate::simd::scalar::surface::{self, Around};

/// See [`surface::normals`].
pub(crate) fn normals(around: &Around<'_>, posed: &[[f32; 4]], normals: &mut [[f32; 3]]) {
    assert!(Kernels::Avx512.run_here());
    // SAFETY: the instructions are present.
    unsafe { compiled(around, posed, normals) }
}

#[target_feature(enable = "avx2,fma,f16c,avx512f,avx512bw,avx512dq,avx512vl")]
fn compiled(around: &Around<'_>, posed: &[[f32; 4]], normals: &mut [[f32; 3]]) {
    let (groups, _) = around.solver_from_lane.as_chunks::<{ Sixteen::COUNT }>();
    let rows = around.offsets.windows(2).map(|row| row[0] as usize..row[1] as usize);
    let mut quads = posed.as_chunks::<FAN_VERTICES>().0.iter().zip(rows);
    for solvers in groups {
        let mut sums = [_mm512_setzero_ps(); 4];
        for (sum, (centre, row)) in sums.iter_mut().zip(&mut quads) {
            *sum = area(posed, centre, &around.fans[row]);
        }
        // Entries in the order z x y; vertex 4 i + n is quarter n of sum i.
        let [low, high] = [0, 2].map(|i| _mm512_unpacklo_ps(sums[i], sums[i + 1]));
        let [low_y, high_y] = [0, 2].map(|i| _mm512_unpackhi_ps(sums[i], sums[i + 1]));
        let x = _mm512_shuffle_ps::<0xee>(low, high);
        let y = _mm512_shuffle_ps::<0x44>(low_y, high_y);
        let z = _mm512_shuffle_ps::<0x44>(low, high);
        let mut unit = [[0.0; Sixteen::COUNT]; 3];
        for (row, unit) in surface::unit([x, y, z].map(Sixteen)).into_iter().zip(&mut unit) {
            row.store(unit);
        }
        for (lane, &solver) in solvers.iter().enumerate() {
            let n = lane % 4 * 4 + lane / 4;
            normals[around.vertex_from_solver[solver as usize] as usize] = unit.map(|row| row[n]);
        }
    }
    surface::normals_from(groups.len() * Sixteen::COUNT, around, posed, normals);
}

/// Twice the area vectors around four vertices.
#[target_feature(enable = "avx2,fma,f16c,avx512f,avx512bw,avx512dq,avx512vl")]
fn area(posed: &[[f32; 4]], centre: &[[f32; 4]; FAN_VERTICES], fan: &[[u32; FAN_VERTICES]]) -> __m512 {
    /// Entries y z x, and the last one where it is.
    const TURN: i32 = 0xc9;
    // SAFETY: sixteen numbers, and four below.
    let centre = unsafe { _mm512_loadu_ps(centre.as_ptr().cast()) };
    let edges = |step: &[u32; FAN_VERTICES]| {
        let [a, b, c, d] = step.map(|lane| unsafe { _mm_loadu_ps(posed[lane as usize].as_ptr()) });
        let neighbours = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(_mm256_set_m128(b, a)), _mm256_set_m128(d, c));
        _mm512_sub_ps(neighbours, centre)
    };
    let mut sum = _mm512_setzero_ps();
    let Some((first, rest)) = fan.split_first() else {
        return sum;
    };
    let mut a = edges(first);
    let mut a_turned = _mm512_permute_ps::<TURN>(a);
    for step in rest {
        let b = edges(step);
        let b_turned = _mm512_permute_ps::<TURN>(b);
        // No fused product: two equal edges must give zero.
        let cross = _mm512_sub_ps(_mm512_mul_ps(a, b_turned), _mm512_mul_ps(a_turned, b));
        sum = _mm512_add_ps(sum, cross);
        (a, a_turned) = (b, b_turned);
    }
    sum
}
