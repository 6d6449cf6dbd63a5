//! The skin, eight lanes: a register holds two columns of a node's map, each x y z and zero. What it computes is said at the
//! scalar kernel.
//!
//! All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole elements, for
//! which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use sinew_formats::package::SKIN_NODES;

use crate::simd::Kernels;
use crate::simd::scalar::poisson::Lane;
use crate::simd::scalar::skin::{Map, Skin, Skinned, UNIT};
use crate::simd::scalar::surface::Bounds;

/// See [`skin`](crate::simd::scalar::skin::skin).
pub(crate) fn skin(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { skin_avx2(skin, maps, skinned) }
}

#[target_feature(enable = "avx2,fma")]
fn skin_avx2(skin: &Skin<'_>, maps: &[Map], skinned: Skinned<'_>) -> Option<Bounds> {
    let [x, y, z] = skin.centre;
    // The arm gets a one as its fourth coordinate, which takes the offset.
    let centre = _mm_setr_ps(x, y, z, -1.0);
    let (first_two, last_two) = (
        _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1),
        _mm256_setr_epi32(2, 2, 2, 2, 3, 3, 3, 3),
    );
    let mut extent = Extent::new();
    let rows = skin.nodes.iter().zip(skin.weights).zip(skin.rest);
    for ((((nodes, weights), r), posed), &v) in rows.zip(skinned.posed).zip(skin.vertex_from_lane) {
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
        extent.store(_mm_add_ps(r, sum), posed, &mut skinned.positions[v as usize]);
    }
    extent.bounds()
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
fn load_weights(weights: &[u16; SKIN_NODES]) -> __m128 {
    // SAFETY: four halves of a word are eight bytes.
    let bits = unsafe { _mm_loadl_epi64(weights.as_ptr().cast()) };
    _mm_mul_ps(_mm_cvtepi32_ps(_mm_cvtepu16_epi32(bits)), _mm_set1_ps(UNIT))
}

/// x y z and zero.
#[target_feature(enable = "avx2")]
fn load_point(point: &[f32; 3]) -> __m128 {
    let [x, y, z] = *point;
    _mm_setr_ps(x, y, z, 0.0)
}

/// The box of what was stored, and whether all of it was finite.
struct Extent {
    least: __m128,
    greatest: __m128,
    /// Set lanes have held what is not finite.
    lost: __m128,
}

impl Extent {
    #[target_feature(enable = "avx2")]
    fn new() -> Self {
        Self {
            least: _mm_set1_ps(f32::INFINITY),
            greatest: _mm_set1_ps(f32::NEG_INFINITY),
            lost: _mm_setzero_ps(),
        }
    }

    /// Writes x y z and zero, and x y z.
    #[target_feature(enable = "avx2")]
    fn store(&mut self, point: __m128, posed: &mut Lane, position: &mut [f32; 3]) {
        // SAFETY: a lane is four floats.
        unsafe { _mm_storeu_ps(posed.as_mut_ptr(), point) }
        *position = [posed[0], posed[1], posed[2]];
        self.least = _mm_min_ps(self.least, point);
        self.greatest = _mm_max_ps(self.greatest, point);
        let magnitude = _mm_andnot_ps(_mm_set1_ps(-0.0), point);
        let lost = _mm_cmp_ps::<_CMP_NLE_UQ>(magnitude, _mm_set1_ps(f32::MAX));
        self.lost = _mm_or_ps(self.lost, lost);
    }

    /// Nothing where something was not finite.
    #[target_feature(enable = "avx2")]
    fn bounds(&self) -> Option<Bounds> {
        let point = |lanes: __m128| {
            let mut point = [0.0; 4];
            // SAFETY: a lane is four floats.
            unsafe { _mm_storeu_ps(point.as_mut_ptr(), lanes) }
            [point[0], point[1], point[2]]
        };
        let all_finite = _mm_movemask_ps(self.lost) == 0;
        all_finite.then(|| Bounds {
            minimum: point(self.least),
            maximum: point(self.greatest),
        })
    }
}
