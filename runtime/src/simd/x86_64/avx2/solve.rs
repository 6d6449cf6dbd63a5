//! Right-hand side and solve, eight lanes: a register holds x and y of a quad, or z and zeros. What they compute is said at the
//! reference; how, at the kernels of sixteen lanes.
//!
//! All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole elements, for
//! which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;
use core::ops::Range;

use sinew_formats::package::{Index, QUAD, TILE_ENTRIES};

use crate::simd::Kernels;
use crate::simd::generic::lanes::Gradient;
use crate::simd::generic::solve::{FLUSH_BELOW, Factor, Quad, Rings, Xyz0, put};

/// Tiles that the solve fetches ahead: the factor comes from the third-level cache.
const PREFETCHED_TILES: isize = 24;

/// See [`right_hand_side`](crate::simd::generic::solve::right_hand_side).
pub(crate) fn right_hand_side<I: Index>(
    rings: &Rings<'_, I>,
    rest: &[[f32; 3]],
    gradients: &[Gradient],
    slots: Range<usize>,
    b: &mut [Quad],
) {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { right_hand_side_avx2(rings, rest, gradients, slots, b) }
}

/// See [`substitute`](crate::simd::generic::solve::substitute).
pub(crate) fn substitute<I: Index>(factor: &Factor<'_, I>, x: &mut [Quad]) {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { substitute_avx2(factor, x) }
}

#[target_feature(enable = "avx2,fma")]
fn right_hand_side_avx2<I: Index>(
    rings: &Rings<'_, I>,
    rest: &[[f32; 3]],
    gradients: &[Gradient],
    slots: Range<usize>,
    b: &mut [Quad],
) {
    let mut start = rings.offsets[slots.start] as usize;
    let own = rest[slots.clone()].iter().zip(&gradients[slots.clone()]);
    let ends = &rings.offsets[slots.start + 1..=slots.end];
    for ((&solver, (r, d)), &end) in rings.solver_from_slot[slots].iter().zip(own).zip(ends) {
        let end = end as usize;
        let r = load_point(r);
        let (mut sums, mut total) = ([_mm_setzero_ps(); 3], _mm_setzero_ps());
        for (&j, &weight) in rings.neighbours[start..end].iter().zip(&rings.weights[start..end]) {
            let difference = _mm_sub_ps(r, load_point(&rest[j.at()]));
            let edge = _mm_mul_ps(_mm_set1_ps(weight), difference);
            total = _mm_add_ps(total, edge);
            add_product(&mut sums, &gradients[j.at()], edge);
        }
        start = end;
        add_product(&mut sums, d, total);
        let both = _mm_add_ps(_mm_add_ps(sums[0], sums[1]), sums[2]);
        let half = _mm_mul_ps(both, _mm_set1_ps(0.5));
        let kept = _mm_cmp_ps::<_CMP_NLT_UQ>(_mm_andnot_ps(_mm_set1_ps(-0.0), half), _mm_set1_ps(FLUSH_BELOW));
        let [x, y, z, _] = numbers(_mm_and_ps(kept, half));
        put(b, solver, [x, y, z]);
    }
}

/// A column of the gradient for each coordinate of the edge.
#[target_feature(enable = "avx2,fma")]
fn add_product(sums: &mut [__m128; 3], gradient: &Gradient, edge: __m128) {
    let [x, y, z] = gradient;
    sums[0] = _mm_fmadd_ps(load_row(x), _mm_permute_ps::<0x00>(edge), sums[0]);
    sums[1] = _mm_fmadd_ps(load_row(y), _mm_permute_ps::<0x55>(edge), sums[1]);
    sums[2] = _mm_fmadd_ps(load_row(z), _mm_permute_ps::<0xaa>(edge), sums[2]);
}

#[target_feature(enable = "avx2,fma")]
fn substitute_avx2<I: Index>(factor: &Factor<'_, I>, x: &mut [Quad]) {
    let (offsets, rows, tiles) = (factor.offsets, factor.rows, factor.tiles);
    for column in 0..x.len() {
        let (own, is_zero) = flushed(load_quad(&x[column]));
        store_quad(own, &mut x[column]);
        if is_zero {
            continue;
        }
        let places = spread(own);
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]) {
            let target = &mut x[row.at()];
            prefetch(tile, PREFETCHED_TILES);
            let [mut xy, mut z] = load_quad(target);
            for (entries, place) in tile.as_chunks::<QUAD>().0.iter().zip(places) {
                let entries = load_column(entries);
                xy = _mm256_fnmadd_ps(entries, place[0], xy);
                z = _mm256_fnmadd_ps(entries, place[1], z);
            }
            store_quad([xy, z], target);
        }
    }
    for column in (0..x.len()).rev() {
        let places = spread(load_quad(&x[column]));
        let mut own = [_mm256_setzero_ps(); 2];
        let inverse = factor.inverse_diagonals[column].as_chunks::<QUAD>().0;
        for (entries, place) in inverse.iter().zip(places) {
            let entries = load_column(entries);
            own[0] = _mm256_fmadd_ps(entries, place[0], own[0]);
            own[1] = _mm256_fmadd_ps(entries, place[1], own[1]);
        }
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        let mut sums = [[_mm256_setzero_ps(); 2]; QUAD];
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]).rev() {
            prefetch(tile, -PREFETCHED_TILES);
            let quad = load_quad(&x[row.at()]);
            for (sum, entries) in sums.iter_mut().zip(tile.as_chunks::<QUAD>().0) {
                let entries = load_column(entries);
                sum[0] = _mm256_fmadd_ps(entries, quad[0], sum[0]);
                sum[1] = _mm256_fmadd_ps(entries, quad[1], sum[1]);
            }
        }
        let half = |n: usize| rows_summed([sums[0][n], sums[1][n], sums[2][n], sums[3][n]]);
        let (own, _) = flushed([_mm256_sub_ps(own[0], half(0)), _mm256_sub_ps(own[1], half(1))]);
        store_quad(own, &mut x[column]);
    }
}

/// Lane n of each half is the sum of the lanes of that half of vector n: first and second, third and fourth, both.
#[target_feature(enable = "avx2,fma")]
fn rows_summed([a, b, c, d]: [__m256; QUAD]) -> __m256 {
    let [ab, cd] = [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)];
    let [ab_high, cd_high] = [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)];
    let first = _mm256_add_ps(_mm256_shuffle_ps::<0x44>(ab, cd), _mm256_shuffle_ps::<0xee>(ab, cd));
    let second = _mm256_add_ps(
        _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
        _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
    );
    _mm256_add_ps(first, second)
}

/// Each place of a quad over its halves.
#[target_feature(enable = "avx2,fma")]
fn spread(quad: [__m256; 2]) -> [[__m256; 2]; QUAD] {
    [
        quad.map(|half| _mm256_permute_ps::<0x00>(half)),
        quad.map(|half| _mm256_permute_ps::<0x55>(half)),
        quad.map(|half| _mm256_permute_ps::<0xaa>(half)),
        quad.map(|half| _mm256_permute_ps::<0xff>(half)),
    ]
}

/// Zero for what is too near to it, and whether nothing is left; NaN stays.
#[target_feature(enable = "avx2,fma")]
fn flushed(quad: [__m256; 2]) -> ([__m256; 2], bool) {
    let kept = quad.map(|half| {
        let magnitude = _mm256_andnot_ps(_mm256_set1_ps(-0.0), half);
        _mm256_cmp_ps::<_CMP_NLT_UQ>(magnitude, _mm256_set1_ps(FLUSH_BELOW))
    });
    let is_zero = _mm256_movemask_ps(_mm256_or_ps(kept[0], kept[1])) == 0;
    (
        [_mm256_and_ps(kept[0], quad[0]), _mm256_and_ps(kept[1], quad[1])],
        is_zero,
    )
}

/// Asks for the tile that lies so many tiles further on. Reads nothing; an address without memory is ignored.
#[target_feature(enable = "avx2,fma")]
fn prefetch(tile: &[f32; TILE_ENTRIES], distance: isize) {
    let address = core::ptr::from_ref(tile).wrapping_offset(distance);
    _mm_prefetch::<_MM_HINT_T0>(address.cast());
}

/// A column of a tile into both halves.
#[target_feature(enable = "avx2,fma")]
fn load_column(entries: &[f32; QUAD]) -> __m256 {
    // SAFETY: a column is four floats.
    let column = unsafe { _mm_loadu_ps(entries.as_ptr()) };
    _mm256_set_m128(column, column)
}

#[target_feature(enable = "avx2,fma")]
fn load_quad(quad: &Quad) -> [__m256; 2] {
    let numbers = quad.as_flattened();
    // SAFETY: a quad is sixteen floats.
    unsafe {
        [
            _mm256_loadu_ps(numbers.as_ptr()),
            _mm256_loadu_ps(numbers.as_ptr().add(8)),
        ]
    }
}

#[target_feature(enable = "avx2,fma")]
fn store_quad(values: [__m256; 2], quad: &mut Quad) {
    let numbers = quad.as_flattened_mut();
    // SAFETY: a quad is sixteen floats.
    unsafe {
        _mm256_storeu_ps(numbers.as_mut_ptr(), values[0]);
        _mm256_storeu_ps(numbers.as_mut_ptr().add(8), values[1]);
    }
}

#[target_feature(enable = "avx2,fma")]
fn load_row(row: &Xyz0) -> __m128 {
    // SAFETY: a row is four floats.
    unsafe { _mm_loadu_ps(row.as_ptr()) }
}

#[target_feature(enable = "avx2,fma")]
fn numbers(row: __m128) -> Xyz0 {
    let mut numbers = Xyz0::default();
    // SAFETY: a row is four floats.
    unsafe { _mm_storeu_ps(numbers.as_mut_ptr(), row) }
    numbers
}

#[target_feature(enable = "avx2,fma")]
fn load_point(point: &[f32; 3]) -> __m128 {
    // SAFETY: a point is three floats, and the mask keeps the load off what follows.
    unsafe { _mm_maskload_ps(point.as_ptr(), _mm_setr_epi32(-1, -1, -1, 0)) }
}
