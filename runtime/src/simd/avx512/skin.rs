//! The skin, sixteen lanes: a register holds a node's map, four columns of x y z and zero, or four vertices. What it computes
//! is said at the scalar kernel, which runs the last vertices that make no four.
//!
//! All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole elements, for
//! which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use sinew_formats::package::SKIN_NODES;

use super::poisson::quarters_summed;
use crate::simd::Kernels;
use crate::simd::scalar;
use crate::simd::scalar::poisson::Lane;
use crate::simd::scalar::skin::{Map, Skin, Skinned, UNIT};
use crate::simd::scalar::surface::Bounds;

/// Vertices of a register.
const VERTICES: usize = 4;

/// See [`skin`](crate::simd::scalar::skin::skin).
pub(crate) fn skin(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    assert!(Kernels::Avx512.run_here());
    let whole = skin.rest.len() / VERTICES * VERTICES;
    let (nodes, last_nodes) = skin.nodes.split_at(whole);
    let (weights, last_weights) = skin.weights.split_at(whole);
    let (rest, last_rest) = skin.rest.split_at(whole);
    let (vertex_from_lane, last_vertices) = skin.vertex_from_lane.split_at(whole);
    let (posed, last_posed) = skinned.posed.split_at_mut(whole);
    let positions = skinned.positions;
    let first = Skin {
        rest,
        nodes,
        weights,
        vertex_from_lane,
        ..*skin
    };
    let last = Skin {
        rest: last_rest,
        nodes: last_nodes,
        weights: last_weights,
        vertex_from_lane: last_vertices,
        ..*skin
    };
    // SAFETY: the instructions are present.
    let bounds = unsafe { skin_avx512(&first, maps, Skinned { posed, positions }) }?;
    let skinned = Skinned {
        posed: last_posed,
        positions,
    };
    let mut all = scalar::skin::skin(&last, maps, skinned)?;
    if whole > 0 {
        all.include(&bounds.minimum);
        all.include(&bounds.maximum);
    }
    Some(all)
}

/// A multiple of four vertices.
#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
fn skin_avx512(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    let [x, y, z] = skin.centre;
    // The arm gets a one as its fourth coordinate, which takes the offset.
    let centre = _mm512_broadcast_f32x4(_mm_setr_ps(x, y, z, -1.0));
    let over_columns = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    let mut extent = Extent::new();
    let rows = skin.nodes.as_chunks::<VERTICES>().0.iter();
    let rows = rows.zip(skin.weights.as_chunks::<VERTICES>().0);
    let rows = rows.zip(skin.rest.as_chunks::<VERTICES>().0);
    let rows = rows.zip(skin.vertex_from_lane.as_chunks::<VERTICES>().0);
    for ((((nodes, weights), rest), vertices), posed) in rows.zip(skinned.posed.as_chunks_mut::<VERTICES>().0) {
        let weights = load_weights(weights);
        let rest = load_points(rest);
        let arms = _mm512_sub_ps(rest, centre);
        let mut moved = [_mm512_setzero_ps(); VERTICES];
        for (n, (moved, nodes)) in moved.iter_mut().zip(nodes).enumerate() {
            let first = (SKIN_NODES * n) as i32;
            let weight = |k: i32| _mm512_permutexvar_ps(_mm512_set1_epi32(first + k), weights);
            let map = |k: usize| load_map(&maps[usize::from(nodes[k])]);
            let mut blended = _mm512_mul_ps(weight(0), map(0));
            blended = _mm512_fmadd_ps(weight(1), map(1), blended);
            blended = _mm512_fmadd_ps(weight(2), map(2), blended);
            blended = _mm512_fmadd_ps(weight(3), map(3), blended);
            let own = _mm512_add_epi32(over_columns, _mm512_set1_epi32(first));
            *moved = _mm512_mul_ps(blended, _mm512_permutexvar_ps(own, arms));
        }
        let points = _mm512_add_ps(rest, quarters_summed(moved));
        extent.include(points);
        // SAFETY: four lanes are sixteen floats.
        unsafe { _mm512_storeu_ps(posed.as_flattened_mut().as_mut_ptr(), points) }
        let points = [
            _mm512_castps512_ps128(points),
            _mm512_extractf32x4_ps::<1>(points),
            _mm512_extractf32x4_ps::<2>(points),
            _mm512_extractf32x4_ps::<3>(points),
        ];
        for (point, &v) in points.into_iter().zip(vertices) {
            let [x, y, z, _] = numbers(point);
            skinned.positions[v as usize] = [x, y, z];
        }
    }
    extent.bounds()
}

#[target_feature(enable = "avx512f")]
fn load_map(map: &Map) -> __m512 {
    // SAFETY: a map is sixteen floats.
    unsafe { _mm512_loadu_ps(map.as_flattened().as_ptr()) }
}

/// Weights as shares of one.
#[target_feature(enable = "avx512f")]
fn load_weights(weights: &[[u16; SKIN_NODES]; VERTICES]) -> __m512 {
    // SAFETY: sixteen halves of a word are 32 bytes.
    let bits = unsafe { _mm256_loadu_si256(weights.as_ptr().cast()) };
    _mm512_mul_ps(_mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(bits)), _mm512_set1_ps(UNIT))
}

/// x y z and zero of each.
#[target_feature(enable = "avx512f")]
fn load_points(points: &[[f32; 3]; VERTICES]) -> __m512 {
    // SAFETY: four points are twelve floats, and the mask keeps the load off what follows.
    let packed = unsafe { _mm512_maskz_loadu_ps(0x0fff, points.as_flattened().as_ptr()) };
    let spread = _mm512_setr_epi32(0, 1, 2, 15, 3, 4, 5, 15, 6, 7, 8, 15, 9, 10, 11, 15);
    _mm512_permutexvar_ps(spread, packed)
}

#[target_feature(enable = "avx512f")]
fn numbers(lane: __m128) -> Lane {
    let mut numbers = Lane::default();
    // SAFETY: a lane is four floats.
    unsafe { _mm_storeu_ps(numbers.as_mut_ptr(), lane) }
    numbers
}

/// The box of the points, and whether all of them were finite.
struct Extent {
    least: __m512,
    greatest: __m512,
    /// Set lanes have held what is not finite.
    lost: __mmask16,
}

impl Extent {
    #[target_feature(enable = "avx512f")]
    fn new() -> Self {
        Self {
            least: _mm512_set1_ps(f32::INFINITY),
            greatest: _mm512_set1_ps(f32::NEG_INFINITY),
            lost: 0,
        }
    }

    #[target_feature(enable = "avx512f")]
    fn include(&mut self, points: __m512) {
        self.least = _mm512_min_ps(self.least, points);
        self.greatest = _mm512_max_ps(self.greatest, points);
        self.lost |= _mm512_cmp_ps_mask::<_CMP_NLE_UQ>(_mm512_abs_ps(points), _mm512_set1_ps(f32::MAX));
    }

    /// Nothing where something was not finite.
    #[target_feature(enable = "avx512f")]
    fn bounds(&self) -> Option<Bounds> {
        let mut bounds = Bounds::EMPTY;
        for vectors in [self.least, self.greatest] {
            let mut lanes = [Lane::default(); VERTICES];
            // SAFETY: four lanes are sixteen floats.
            unsafe { _mm512_storeu_ps(lanes.as_flattened_mut().as_mut_ptr(), vectors) }
            lanes.iter().for_each(|[x, y, z, _]| bounds.include(&[*x, *y, *z]));
        }
        (self.lost == 0).then_some(bounds)
    }
}
