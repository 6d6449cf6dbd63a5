//! The solve, sixteen lanes: a register holds a tile, or four nodes of x y z and zero. What it computes is said at the
//! scalar kernel. The right-hand side gains nothing here: its columns have four lanes, and eight-lane kernels run it.
//!
//! Tile times block: within the quarter of a row, each entry in turn is copied over the quarter and multiplied by the node
//! of its column. All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole
//! elements, for which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use crate::simd::Kernels;
use crate::simd::scalar::poisson::{Block, FLUSH_BELOW, Factor};

/// Tiles that the solve fetches ahead: the factor comes from the third-level cache. Halves the time; 8 to 64 do the same.
const PREFETCHED_TILES: isize = 24;

/// See [`substitute`](crate::simd::scalar::poisson::substitute).
pub(crate) fn substitute(factor: &Factor<'_>, x: &mut [Block]) {
    assert!(Kernels::Avx512.run_here());
    // SAFETY: the instructions are present.
    unsafe { substitute_avx512(factor, x) }
}

#[target_feature(enable = "avx512f")]
fn substitute_avx512(factor: &Factor<'_>, x: &mut [Block]) {
    let (offsets, rows, tiles) = (factor.offsets, factor.rows, factor.tiles);
    for column in 0..x.len() {
        let (own, kept) = flushed(load_block(&x[column]));
        store_block(own, &mut x[column]);
        if kept == 0 {
            continue;
        }
        let nodes = spread(own);
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]) {
            let target = &mut x[row as usize];
            prefetch(tile, PREFETCHED_TILES);
            let tile = load_tile(tile);
            let mut block = load_block(target);
            block = _mm512_fnmadd_ps(_mm512_permute_ps::<0x00>(tile), nodes[0], block);
            block = _mm512_fnmadd_ps(_mm512_permute_ps::<0x55>(tile), nodes[1], block);
            block = _mm512_fnmadd_ps(_mm512_permute_ps::<0xaa>(tile), nodes[2], block);
            block = _mm512_fnmadd_ps(_mm512_permute_ps::<0xff>(tile), nodes[3], block);
            store_block(block, target);
        }
    }
    for column in (0..x.len()).rev() {
        let nodes = spread(load_block(&x[column]));
        let inverse = load_tile(&factor.inverse_diagonals[column]);
        let mut own = _mm512_mul_ps(_mm512_permute_ps::<0x00>(inverse), nodes[0]);
        own = _mm512_fmadd_ps(_mm512_permute_ps::<0x55>(inverse), nodes[1], own);
        own = _mm512_fmadd_ps(_mm512_permute_ps::<0xaa>(inverse), nodes[2], own);
        own = _mm512_fmadd_ps(_mm512_permute_ps::<0xff>(inverse), nodes[3], own);
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        let mut sums = [_mm512_setzero_ps(); 4];
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]).rev() {
            prefetch(tile, -PREFETCHED_TILES);
            let (tile, block) = (load_tile(tile), load_block(&x[row as usize]));
            sums[0] = _mm512_fmadd_ps(_mm512_permute_ps::<0x00>(tile), block, sums[0]);
            sums[1] = _mm512_fmadd_ps(_mm512_permute_ps::<0x55>(tile), block, sums[1]);
            sums[2] = _mm512_fmadd_ps(_mm512_permute_ps::<0xaa>(tile), block, sums[2]);
            sums[3] = _mm512_fmadd_ps(_mm512_permute_ps::<0xff>(tile), block, sums[3]);
        }
        let (own, _) = flushed(_mm512_sub_ps(own, quarters_summed(sums)));
        store_block(own, &mut x[column]);
    }
}

/// Quarter n of the result is the sum of the quarters of vector n.
#[target_feature(enable = "avx512f")]
pub(super) fn quarters_summed(vectors: [__m512; 4]) -> __m512 {
    let halves = |a, b| {
        let (low, high) = (_mm512_shuffle_f32x4::<0x44>(a, b), _mm512_shuffle_f32x4::<0xee>(a, b));
        _mm512_add_ps(low, high)
    };
    let [a, b, c, d] = vectors;
    let (ab, cd) = (halves(a, b), halves(c, d));
    let (even, odd) = (
        _mm512_shuffle_f32x4::<0x88>(ab, cd),
        _mm512_shuffle_f32x4::<0xdd>(ab, cd),
    );
    _mm512_add_ps(even, odd)
}

/// Each node of a block over all quarters.
#[target_feature(enable = "avx512f")]
fn spread(block: __m512) -> [__m512; 4] {
    [
        _mm512_shuffle_f32x4::<0x00>(block, block),
        _mm512_shuffle_f32x4::<0x55>(block, block),
        _mm512_shuffle_f32x4::<0xaa>(block, block),
        _mm512_shuffle_f32x4::<0xff>(block, block),
    ]
}

/// Zero for what is too near to it, and where something is left; NaN stays.
#[target_feature(enable = "avx512f")]
fn flushed(block: __m512) -> (__m512, __mmask16) {
    let kept = _mm512_cmp_ps_mask::<_CMP_NLT_UQ>(_mm512_abs_ps(block), _mm512_set1_ps(FLUSH_BELOW));
    (_mm512_maskz_mov_ps(kept, block), kept)
}

/// Asks for the tile that lies so many tiles further on. Reads nothing; an address without memory is ignored.
#[target_feature(enable = "avx512f")]
fn prefetch(tile: &[f32; 16], distance: isize) {
    let address = core::ptr::from_ref(tile).wrapping_offset(distance);
    _mm_prefetch::<_MM_HINT_T0>(address.cast());
}

#[target_feature(enable = "avx512f")]
fn load_tile(tile: &[f32; 16]) -> __m512 {
    // SAFETY: a tile is sixteen floats.
    unsafe { _mm512_loadu_ps(tile.as_ptr()) }
}

#[target_feature(enable = "avx512f")]
fn load_block(block: &Block) -> __m512 {
    load_tile(bytemuck::cast_ref(block))
}

#[target_feature(enable = "avx512f")]
fn store_block(values: __m512, block: &mut Block) {
    let floats: &mut [f32; 16] = bytemuck::cast_mut(block);
    // SAFETY: a block is sixteen floats.
    unsafe { _mm512_storeu_ps(floats.as_mut_ptr(), values) }
}
