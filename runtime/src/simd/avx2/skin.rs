//! The skin, eight lanes: a register holds two columns of a node's map, each x y z and zero. What it computes is said at the
//! scalar kernel.
//!
//! All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole elements, for
//! which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use sinew_formats::package::SKIN_NODES;

use crate::simd::Kernels;
use crate::simd::scalar::skin::{Map, Skin, UNIT};

/// See [`skin`](crate::simd::scalar::skin::skin).
pub(crate) fn skin(skin: &Skin<'_>, maps: &[Map], positions: &mut [[f32; 3]]) -> bool {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { skin_avx2(skin, maps, positions) }
}

#[target_feature(enable = "avx2,fma")]
fn skin_avx2(skin: &Skin<'_>, maps: &[Map], positions: &mut [[f32; 3]]) -> bool {
    let [x, y, z] = skin.centre;
    // The arm gets a one as its fourth coordinate, which takes the offset.
    let centre = _mm_setr_ps(x, y, z, -1.0);
    let (first_two, last_two) = (
        _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1),
        _mm256_setr_epi32(2, 2, 2, 2, 3, 3, 3, 3),
    );
    let mut lost = _mm_setzero_ps();
    let rows = skin.nodes.iter().zip(skin.weights);
    for ((position, r), (nodes, weights)) in positions.iter_mut().zip(skin.rest).zip(rows) {
        let weights = _mm256_castps128_ps256(load_weights(weights));
        let (mut low, mut high) = (_mm256_setzero_ps(), _mm256_setzero_ps());
        for (n, &node) in nodes.iter().enumerate() {
            let weight = _mm256_permutevar8x32_ps(weights, _mm256_set1_epi32(n as i32));
            let [map_low, map_high] = load_map(&maps[usize::from(node)]);
            low = _mm256_fmadd_ps(weight, map_low, low);
            high = _mm256_fmadd_ps(weight, map_high, high);
        }
        let r = load_point(r);
        let arm = _mm256_castps128_ps256(_mm_sub_ps(r, centre));
        let moved = _mm256_mul_ps(low, _mm256_permutevar8x32_ps(arm, first_two));
        let moved = _mm256_fmadd_ps(high, _mm256_permutevar8x32_ps(arm, last_two), moved);
        let sum = _mm_add_ps(_mm256_castps256_ps128(moved), _mm256_extractf128_ps::<1>(moved));
        lost = _mm_or_ps(lost, store_point(_mm_add_ps(r, sum), position));
    }
    _mm_movemask_ps(lost) == 0
}

#[target_feature(enable = "avx2")]
fn load_map(map: &Map) -> [__m256; 2] {
    let [low, high] = map.as_chunks::<2>().0 else {
        unreachable!("a map has four columns");
    };
    // SAFETY: two columns are eight floats.
    unsafe {
        [
            _mm256_loadu_ps(low.as_flattened().as_ptr()),
            _mm256_loadu_ps(high.as_flattened().as_ptr()),
        ]
    }
}

/// Weights as shares of one.
#[target_feature(enable = "avx2")]
pub(in crate::simd) fn load_weights(weights: &[u16; SKIN_NODES]) -> __m128 {
    // SAFETY: four halves of a word are eight bytes.
    let bits = unsafe { _mm_loadl_epi64(weights.as_ptr().cast()) };
    _mm_mul_ps(_mm_cvtepi32_ps(_mm_cvtepu16_epi32(bits)), _mm_set1_ps(UNIT))
}

/// x y z and zero.
#[target_feature(enable = "avx2")]
pub(in crate::simd) fn load_point(point: &[f32; 3]) -> __m128 {
    let [x, y, z] = *point;
    _mm_setr_ps(x, y, z, 0.0)
}

/// Writes x y z; a lane is set where it is not finite.
#[target_feature(enable = "avx2")]
pub(in crate::simd) fn store_point(point: __m128, target: &mut [f32; 3]) -> __m128 {
    let mut lanes = [0.0; 4];
    // SAFETY: lanes are four floats.
    unsafe { _mm_storeu_ps(lanes.as_mut_ptr(), point) }
    *target = [lanes[0], lanes[1], lanes[2]];
    let magnitude = _mm_andnot_ps(_mm_set1_ps(-0.0), point);
    _mm_cmp_ps::<_CMP_NLE_UQ>(magnitude, _mm_set1_ps(f32::MAX))
}
