//! The skin, sixteen lanes: a register holds a node's map, four columns of x y z and zero. What it computes is said at the
//! scalar kernel.
//!
//! All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole elements, for
//! which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use crate::simd::Kernels;
use crate::simd::avx2::skin::{Extent, load_point, load_weights};
use crate::simd::scalar::skin::{Map, Skin, Skinned};
use crate::simd::scalar::surface::Bounds;

/// See [`skin`](crate::simd::scalar::skin::skin).
pub(crate) fn skin(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    assert!(Kernels::Avx512.run_here());
    // SAFETY: the instructions are present.
    unsafe { skin_avx512(skin, maps, skinned) }
}

#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
fn skin_avx512(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    let [x, y, z] = skin.centre;
    // The arm gets a one as its fourth coordinate, which takes the offset.
    let centre = _mm_setr_ps(x, y, z, -1.0);
    let over_columns = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    let mut extent = Extent::new();
    let rows = skin.nodes.iter().zip(skin.weights).zip(skin.rest);
    for ((((nodes, weights), r), posed), &v) in rows.zip(skinned.posed).zip(skin.vertex_from_lane) {
        let weights = _mm512_castps128_ps512(load_weights(weights));
        let weight = |n| _mm512_permutexvar_ps(_mm512_set1_epi32(n), weights);
        let map = |n: usize| load_map(&maps[usize::from(nodes[n])]);
        let mut blended = _mm512_mul_ps(weight(0), map(0));
        blended = _mm512_fmadd_ps(weight(1), map(1), blended);
        blended = _mm512_fmadd_ps(weight(2), map(2), blended);
        blended = _mm512_fmadd_ps(weight(3), map(3), blended);
        let r = load_point(r);
        let arm = _mm512_castps128_ps512(_mm_sub_ps(r, centre));
        let moved = _mm512_mul_ps(blended, _mm512_permutexvar_ps(over_columns, arm));
        let halves = _mm256_add_ps(_mm512_castps512_ps256(moved), _mm512_extractf32x8_ps::<1>(moved));
        let sum = _mm_add_ps(_mm256_castps256_ps128(halves), _mm256_extractf128_ps::<1>(halves));
        extent.store(_mm_add_ps(r, sum), posed, &mut skinned.positions[v as usize]);
    }
    extent.bounds()
}

#[target_feature(enable = "avx512f")]
fn load_map(map: &Map) -> __m512 {
    // SAFETY: a map is sixteen floats.
    unsafe { _mm512_loadu_ps(map.as_flattened().as_ptr()) }
}
