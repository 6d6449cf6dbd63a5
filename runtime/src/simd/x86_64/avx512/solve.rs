//! The solve, sixteen lanes: a register holds a quad, its x, y, z and zeros. What it computes is said at the reference. The
//! right-hand side gains nothing here: its rows have four lanes, and eight-lane kernels run it.
//!
//! Tile times quad: a column of the tile is loaded into every quarter at once, which costs no permutation, and multiplied by one
//! place of the quad, spread over its quarter. All accesses are to elements of slices, checked as ever; unsafe are only the
//! loads and stores of whole elements, for which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use sinew_formats::package::{Index, QUAD, TILE_ENTRIES};

use crate::simd::Kernels;
use crate::simd::generic::solve::{FLUSH_BELOW, Factor, Quad};

/// Tiles that the solve fetches ahead: the factor comes from the third-level cache. Halves the time; 8 to 64 do the same.
const PREFETCHED_TILES: isize = 24;

/// See [`substitute`](crate::simd::generic::solve::substitute).
pub(crate) fn substitute<I: Index>(factor: &Factor<'_, I>, x: &mut [Quad]) {
    assert!(Kernels::Avx512.run_here());
    // SAFETY: the instructions are present.
    unsafe { substitute_avx512(factor, x) }
}

#[target_feature(enable = "avx512f,avx512dq")]
fn substitute_avx512<I: Index>(factor: &Factor<'_, I>, x: &mut [Quad]) {
    let (offsets, rows, tiles) = (factor.offsets, factor.rows, factor.tiles);
    for column in 0..x.len() {
        let (own, kept) = flushed(load_quad(&x[column]));
        store_quad(own, &mut x[column]);
        if kept == 0 {
            continue;
        }
        let places = spread(own);
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]) {
            let target = &mut x[row.at()];
            prefetch(tile, PREFETCHED_TILES);
            let mut quad = load_quad(target);
            for (entries, place) in tile.as_chunks::<QUAD>().0.iter().zip(places) {
                quad = _mm512_fnmadd_ps(load_column(entries), place, quad);
            }
            store_quad(quad, target);
        }
    }
    for column in (0..x.len()).rev() {
        let places = spread(load_quad(&x[column]));
        let mut own = _mm512_setzero_ps();
        let inverse = factor.inverse_diagonals[column].as_chunks::<QUAD>().0;
        for (entries, place) in inverse.iter().zip(places) {
            own = _mm512_fmadd_ps(load_column(entries), place, own);
        }
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        let mut sums = [_mm512_setzero_ps(); QUAD];
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]).rev() {
            prefetch(tile, -PREFETCHED_TILES);
            let quad = load_quad(&x[row.at()]);
            for (sum, entries) in sums.iter_mut().zip(tile.as_chunks::<QUAD>().0) {
                *sum = _mm512_fmadd_ps(load_column(entries), quad, *sum);
            }
        }
        let (own, _) = flushed(_mm512_sub_ps(own, rows_summed(sums)));
        store_quad(own, &mut x[column]);
    }
}

/// Lane n of each quarter is the sum of the lanes of that quarter of vector n: first and second, third and fourth, both.
#[target_feature(enable = "avx512f")]
fn rows_summed([a, b, c, d]: [__m512; QUAD]) -> __m512 {
    let [ab, cd] = [_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d)];
    let [ab_high, cd_high] = [_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d)];
    let first = _mm512_add_ps(_mm512_shuffle_ps::<0x44>(ab, cd), _mm512_shuffle_ps::<0xee>(ab, cd));
    let second = _mm512_add_ps(
        _mm512_shuffle_ps::<0x44>(ab_high, cd_high),
        _mm512_shuffle_ps::<0xee>(ab_high, cd_high),
    );
    _mm512_add_ps(first, second)
}

/// Each place of a quad over its quarters.
#[target_feature(enable = "avx512f")]
fn spread(quad: __m512) -> [__m512; QUAD] {
    [
        _mm512_permute_ps::<0x00>(quad),
        _mm512_permute_ps::<0x55>(quad),
        _mm512_permute_ps::<0xaa>(quad),
        _mm512_permute_ps::<0xff>(quad),
    ]
}

/// Zero for what is too near to it, and where something is left; NaN stays.
#[target_feature(enable = "avx512f")]
fn flushed(quad: __m512) -> (__m512, __mmask16) {
    let kept = _mm512_cmp_ps_mask::<_CMP_NLT_UQ>(_mm512_abs_ps(quad), _mm512_set1_ps(FLUSH_BELOW));
    (_mm512_maskz_mov_ps(kept, quad), kept)
}

/// Asks for the tile that lies so many tiles further on. Reads nothing; an address without memory is ignored.
#[target_feature(enable = "avx512f")]
fn prefetch(tile: &[f32; TILE_ENTRIES], distance: isize) {
    let address = core::ptr::from_ref(tile).wrapping_offset(distance);
    _mm_prefetch::<_MM_HINT_T0>(address.cast());
}

/// A column of a tile into every quarter.
#[target_feature(enable = "avx512f")]
fn load_column(entries: &[f32; QUAD]) -> __m512 {
    // SAFETY: a column is four floats.
    _mm512_broadcast_f32x4(unsafe { _mm_loadu_ps(entries.as_ptr()) })
}

#[target_feature(enable = "avx512f")]
fn load_quad(quad: &Quad) -> __m512 {
    // SAFETY: a quad is sixteen floats.
    unsafe { _mm512_loadu_ps(quad.as_flattened().as_ptr()) }
}

#[target_feature(enable = "avx512f")]
fn store_quad(values: __m512, quad: &mut Quad) {
    // SAFETY: a quad is sixteen floats.
    unsafe { _mm512_storeu_ps(quad.as_flattened_mut().as_mut_ptr(), values) }
}
