//! Right-hand side and solve, eight lanes: a register holds half a tile, or two nodes of x y z and zero. What they compute
//! is said at the scalar kernels; how, at the ones of sixteen lanes.
//!
//! All accesses are to elements of slices, checked as ever; unsafe are only the loads and stores of whole elements, for
//! which there is no safe form.
#![allow(unsafe_code)]

use core::arch::x86_64::*;

use crate::simd::Kernels;
use crate::simd::lanes::Gradient;
use crate::simd::scalar::poisson::{Block, FLUSH_BELOW, Factor, Lane, Rings};

/// Tiles that the solve fetches ahead: the factor comes from the third-level cache.
const PREFETCHED_TILES: isize = 24;

/// See [`right_hand_side`](crate::simd::scalar::poisson::right_hand_side).
pub(crate) fn right_hand_side(rings: &Rings<'_>, rest: &[[f32; 3]], gradients: &[Gradient], b: &mut [Lane]) {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { right_hand_side_avx2(rings, rest, gradients, b) }
}

/// See [`substitute`](crate::simd::scalar::poisson::substitute).
pub(crate) fn substitute(factor: &Factor<'_>, x: &mut [Block]) {
    assert!(Kernels::Avx2.run_here());
    // SAFETY: the instructions are present.
    unsafe { substitute_avx2(factor, x) }
}

#[target_feature(enable = "avx2,fma")]
fn right_hand_side_avx2(rings: &Rings<'_>, rest: &[[f32; 3]], gradients: &[Gradient], b: &mut [Lane]) {
    let mut start = rings.offsets[0] as usize;
    for (i, (&solver, (r, d))) in rings
        .solver_from_lane
        .iter()
        .zip(rest.iter().zip(gradients))
        .enumerate()
    {
        let end = rings.offsets[i + 1] as usize;
        let r = load_point(r);
        let (mut sums, mut total) = ([_mm_setzero_ps(); 3], _mm_setzero_ps());
        for (&j, &weight) in rings.neighbours[start..end].iter().zip(&rings.weights[start..end]) {
            let difference = _mm_sub_ps(r, load_point(&rest[j as usize]));
            let edge = _mm_mul_ps(_mm_set1_ps(weight), difference);
            total = _mm_add_ps(total, edge);
            add_product(&mut sums, &gradients[j as usize], edge);
        }
        start = end;
        add_product(&mut sums, d, total);
        let both = _mm_add_ps(_mm_add_ps(sums[0], sums[1]), sums[2]);
        let half = _mm_mul_ps(both, _mm_set1_ps(0.5));
        let kept = _mm_cmp_ps::<_CMP_NLT_UQ>(_mm_andnot_ps(_mm_set1_ps(-0.0), half), _mm_set1_ps(FLUSH_BELOW));
        // SAFETY: a lane is four floats.
        unsafe { _mm_storeu_ps(b[solver as usize].as_mut_ptr(), _mm_and_ps(kept, half)) }
    }
}

/// A column of the gradient for each coordinate of the edge.
#[target_feature(enable = "avx2,fma")]
fn add_product(sums: &mut [__m128; 3], gradient: &Gradient, edge: __m128) {
    let [x, y, z] = gradient;
    sums[0] = _mm_fmadd_ps(load_lane(x), _mm_permute_ps::<0x00>(edge), sums[0]);
    sums[1] = _mm_fmadd_ps(load_lane(y), _mm_permute_ps::<0x55>(edge), sums[1]);
    sums[2] = _mm_fmadd_ps(load_lane(z), _mm_permute_ps::<0xaa>(edge), sums[2]);
}

#[target_feature(enable = "avx2,fma")]
fn substitute_avx2(factor: &Factor<'_>, x: &mut [Block]) {
    let (offsets, rows, tiles) = (factor.offsets, factor.rows, factor.tiles);
    for column in 0..x.len() {
        let (own, is_zero) = flushed(load_block(&x[column]));
        store_block(own, &mut x[column]);
        if is_zero {
            continue;
        }
        let nodes = spread(&x[column]);
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]) {
            let target = &mut x[row as usize];
            prefetch(tile, PREFETCHED_TILES);
            let (tile, mut block) = (load_tile(tile), load_block(target));
            for half in 0..2 {
                block[half] = _mm256_fnmadd_ps(_mm256_permute_ps::<0x00>(tile[half]), nodes[0], block[half]);
                block[half] = _mm256_fnmadd_ps(_mm256_permute_ps::<0x55>(tile[half]), nodes[1], block[half]);
                block[half] = _mm256_fnmadd_ps(_mm256_permute_ps::<0xaa>(tile[half]), nodes[2], block[half]);
                block[half] = _mm256_fnmadd_ps(_mm256_permute_ps::<0xff>(tile[half]), nodes[3], block[half]);
            }
            store_block(block, target);
        }
    }
    for column in (0..x.len()).rev() {
        let nodes = spread(&x[column]);
        let inverse = load_tile(&factor.inverse_diagonals[column]);
        let mut own = [_mm256_setzero_ps(); 2];
        for half in 0..2 {
            own[half] = _mm256_mul_ps(_mm256_permute_ps::<0x00>(inverse[half]), nodes[0]);
            own[half] = _mm256_fmadd_ps(_mm256_permute_ps::<0x55>(inverse[half]), nodes[1], own[half]);
            own[half] = _mm256_fmadd_ps(_mm256_permute_ps::<0xaa>(inverse[half]), nodes[2], own[half]);
            own[half] = _mm256_fmadd_ps(_mm256_permute_ps::<0xff>(inverse[half]), nodes[3], own[half]);
        }
        let range = offsets[column] as usize..offsets[column + 1] as usize;
        let mut sums = [_mm256_setzero_ps(); 4];
        for (&row, tile) in rows[range.clone()].iter().zip(&tiles[range]).rev() {
            prefetch(tile, -PREFETCHED_TILES);
            let (tile, block) = (load_tile(tile), load_block(&x[row as usize]));
            for half in 0..2 {
                sums[0] = _mm256_fmadd_ps(_mm256_permute_ps::<0x00>(tile[half]), block[half], sums[0]);
                sums[1] = _mm256_fmadd_ps(_mm256_permute_ps::<0x55>(tile[half]), block[half], sums[1]);
                sums[2] = _mm256_fmadd_ps(_mm256_permute_ps::<0xaa>(tile[half]), block[half], sums[2]);
                sums[3] = _mm256_fmadd_ps(_mm256_permute_ps::<0xff>(tile[half]), block[half], sums[3]);
            }
        }
        let sums = halves_summed(sums);
        let (own, _) = flushed([_mm256_sub_ps(own[0], sums[0]), _mm256_sub_ps(own[1], sums[1])]);
        store_block(own, &mut x[column]);
    }
}

/// Half n of the four that result is the sum of the halves of vector n.
#[target_feature(enable = "avx2,fma")]
fn halves_summed(vectors: [__m256; 4]) -> [__m256; 2] {
    let pair = |a, b| {
        _mm256_add_ps(
            _mm256_permute2f128_ps::<0x20>(a, b),
            _mm256_permute2f128_ps::<0x31>(a, b),
        )
    };
    let [a, b, c, d] = vectors;
    [pair(a, b), pair(c, d)]
}

/// Each node of a block over both halves.
#[target_feature(enable = "avx2,fma")]
fn spread(block: &Block) -> [__m256; 4] {
    block.each_ref().map(|lane| {
        let lane = load_lane(lane);
        _mm256_set_m128(lane, lane)
    })
}

/// Zero for what is too near to it, and whether nothing is left; NaN stays.
#[target_feature(enable = "avx2,fma")]
fn flushed(block: [__m256; 2]) -> ([__m256; 2], bool) {
    let kept = block.map(|half| {
        let magnitude = _mm256_andnot_ps(_mm256_set1_ps(-0.0), half);
        _mm256_cmp_ps::<_CMP_NLT_UQ>(magnitude, _mm256_set1_ps(FLUSH_BELOW))
    });
    let is_zero = _mm256_movemask_ps(_mm256_or_ps(kept[0], kept[1])) == 0;
    (
        [_mm256_and_ps(kept[0], block[0]), _mm256_and_ps(kept[1], block[1])],
        is_zero,
    )
}

/// Asks for the tile that lies so many tiles further on. Reads nothing; an address without memory is ignored.
#[target_feature(enable = "avx2,fma")]
fn prefetch(tile: &[f32; 16], distance: isize) {
    let address = core::ptr::from_ref(tile).wrapping_offset(distance);
    _mm_prefetch::<_MM_HINT_T0>(address.cast());
}

#[target_feature(enable = "avx2,fma")]
fn load_tile(tile: &[f32; 16]) -> [__m256; 2] {
    // SAFETY: a tile is sixteen floats.
    unsafe { [_mm256_loadu_ps(tile.as_ptr()), _mm256_loadu_ps(tile.as_ptr().add(8))] }
}

#[target_feature(enable = "avx2,fma")]
fn load_block(block: &Block) -> [__m256; 2] {
    load_tile(bytemuck::cast_ref(block))
}

#[target_feature(enable = "avx2,fma")]
fn store_block(values: [__m256; 2], block: &mut Block) {
    let floats: &mut [f32; 16] = bytemuck::cast_mut(block);
    // SAFETY: a block is sixteen floats.
    unsafe {
        _mm256_storeu_ps(floats.as_mut_ptr(), values[0]);
        _mm256_storeu_ps(floats.as_mut_ptr().add(8), values[1]);
    }
}

#[target_feature(enable = "avx2,fma")]
fn load_lane(lane: &Lane) -> __m128 {
    // SAFETY: a lane is four floats.
    unsafe { _mm_loadu_ps(lane.as_ptr()) }
}

#[target_feature(enable = "avx2,fma")]
fn load_point(point: &[f32; 3]) -> __m128 {
    // SAFETY: a point is three floats, and the mask keeps the load off what follows.
    unsafe { _mm_maskload_ps(point.as_ptr(), _mm_setr_epi32(-1, -1, -1, 0)) }
}
