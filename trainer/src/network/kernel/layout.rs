//! Between the plain order of numbers outside the kernel and the kernel's lanes. `order`: the mesh's vertex at each of
//! the kernel's rows.

use rayon::prelude::*;
use sinew_formats::package::FEATURE_COUNT;

use super::CHUNK;
use super::lanes::{Features, LANE_COUNT, Narrow};
use super::simd::Group;
use crate::network::weights::BlockWeights;

/// `[N][V][9]` to `[V][groups]`; lanes without a shape are zero, and stay without effect since zero maps to zero.
pub(super) fn shapes_into_lanes<G: Group>(shapes: &[f32], order: &[u32], lanes: &mut Vec<Features<G>>) {
    let vertex_count = order.len();
    let shape_len = vertex_count * FEATURE_COUNT;
    let group_count = (shapes.len() / shape_len).div_ceil(G::LEN);
    lanes.resize(vertex_count * group_count, [G::ZERO; FEATURE_COUNT]);
    lanes
        .par_chunks_mut((CHUNK * group_count).max(1))
        .enumerate()
        .for_each(|(chunk, rows)| {
            for (i, row) in rows.iter_mut().enumerate() {
                let (v, p) = (order[chunk * CHUNK + i / group_count] as usize, i % group_count);
                *row = [G::ZERO; FEATURE_COUNT];
                for (n, shape) in shapes.chunks_exact(shape_len).skip(p * G::LEN).take(G::LEN).enumerate() {
                    for (c, value) in shape[v * FEATURE_COUNT..(v + 1) * FEATURE_COUNT].iter().enumerate() {
                        row[c].as_mut()[n] = *value;
                    }
                }
            }
        });
}

/// The inverse of [`shapes_into_lanes`].
pub(super) fn shapes_from_lanes<G: Group>(lanes: &[Features<G>], order: &[u32], shapes: &mut [f32]) {
    let vertex_count = order.len();
    let group_count = lanes.len() / vertex_count;
    shapes
        .par_chunks_mut(vertex_count * FEATURE_COUNT)
        .enumerate()
        .for_each(|(m, shape)| {
            let values = shape.as_chunks_mut::<FEATURE_COUNT>().0;
            for (row, &v) in order.iter().enumerate() {
                let (row, values) = (&lanes[row * group_count + m / G::LEN], &mut values[v as usize]);
                for c in 0..FEATURE_COUNT {
                    values[c] = row[c].as_ref()[m % G::LEN];
                }
            }
        });
}

/// `[block][K][V][9]` to `[blocks][V][groups of eight components]`; lanes without a component are zero.
pub(super) fn components_into_lanes(
    blocks: &[BlockWeights],
    order: &[u32],
    component_count: usize,
    lanes: &mut Vec<Features<Narrow>>,
) {
    let vertex_count = order.len();
    let width = component_count.div_ceil(LANE_COUNT);
    lanes.resize(blocks.len() * vertex_count * width, [Narrow::ZERO; FEATURE_COUNT]);
    let of_blocks = lanes.par_chunks_mut(vertex_count * width).zip(blocks);
    of_blocks.for_each(|(lanes, block)| {
        let rows: Vec<&[[f32; FEATURE_COUNT]]> = block
            .components
            .chunks_exact(vertex_count * FEATURE_COUNT)
            .map(|row| row.as_chunks().0)
            .collect();
        for (&v, lanes) in order.iter().zip(lanes.chunks_exact_mut(width)) {
            for (lanes, rows) in lanes.iter_mut().zip(rows.chunks(LANE_COUNT)) {
                let mut features = [Narrow::ZERO; FEATURE_COUNT];
                for (n, row) in rows.iter().enumerate() {
                    for c in 0..FEATURE_COUNT {
                        features[c][n] = row[v as usize][c];
                    }
                }
                *lanes = features;
            }
        }
    });
}

/// The inverse of [`components_into_lanes`].
pub(super) fn components_from_lanes(lanes: &[Features<Narrow>], order: &[u32], blocks: &mut [BlockWeights]) {
    let vertex_count = order.len();
    let block_len = lanes.len() / blocks.len();
    let of_blocks = lanes.par_chunks(block_len).zip(blocks);
    of_blocks.for_each(|(lanes, block)| {
        let rows = block.components.chunks_exact_mut(vertex_count * FEATURE_COUNT);
        let mut rows: Vec<&mut [[f32; FEATURE_COUNT]]> = rows.map(|row| row.as_chunks_mut().0).collect();
        for (&v, lanes) in order.iter().zip(lanes.chunks_exact(block_len / vertex_count)) {
            for (lanes, rows) in lanes.iter().zip(rows.chunks_mut(LANE_COUNT)) {
                for (n, row) in rows.iter_mut().enumerate() {
                    for c in 0..FEATURE_COUNT {
                        row[v as usize][c] = lanes[c][n];
                    }
                }
            }
        }
    });
}

/// A field `[blocks][len of a block]` cut into chunks of vertices, each with its part of every block.
pub(super) fn chunks_of_blocks<T>(field: &mut [T], block_count: usize, chunk_len: usize) -> Vec<Vec<&mut [T]>> {
    let block_len = field.len() / block_count;
    let mut chunks: Vec<Vec<&mut [T]>> = Vec::new();
    chunks.resize_with(block_len.div_ceil(chunk_len), || Vec::with_capacity(block_count));
    for block in field.chunks_exact_mut(block_len.max(1)) {
        for (chunk, part) in chunks.iter_mut().zip(block.chunks_mut(chunk_len)) {
            chunk.push(part);
        }
    }
    chunks
}

/// `[blocks][groups][K]` to `[blocks][shapes][groups of eight components]`, shapes that fill no lane left out.
pub(super) fn transpose_latents<G: Group>(
    latents: &[G],
    block_count: usize,
    group_count: usize,
    shape_count: usize,
) -> Vec<Narrow> {
    let component_count = latents.len() / (block_count * group_count);
    let width = component_count.div_ceil(LANE_COUNT);
    let mut transposed = vec![[0.0; LANE_COUNT]; block_count * shape_count * width];
    for (b, latents) in latents.chunks_exact(group_count * component_count).enumerate() {
        for m in 0..shape_count {
            for k in 0..component_count {
                let z = latents[m / G::LEN * component_count + k].as_ref()[m % G::LEN];
                transposed[(b * shape_count + m) * width + k / LANE_COUNT][k % LANE_COUNT] = z;
            }
        }
    }
    transposed
}

/// Adds up chunks in order, in double precision.
pub(super) fn add_lanes<G: Group>(chunks: &[Vec<G>], len: usize) -> Vec<G> {
    let mut sums = vec![0.0_f64; len * G::LEN];
    for chunk in chunks {
        for (sums, group) in sums.chunks_exact_mut(G::LEN).zip(chunk) {
            sums.iter_mut()
                .zip(group.as_ref())
                .for_each(|(sum, value)| *sum += f64::from(*value));
        }
    }
    let mut lanes = vec![G::ZERO; len];
    for (group, sums) in lanes.iter_mut().zip(sums.chunks_exact(G::LEN)) {
        group
            .as_mut()
            .iter_mut()
            .zip(sums)
            .for_each(|(value, sum)| *value = *sum as f32);
    }
    lanes
}
