//! The passes from shapes to residuals, one chunk of vertices each (method section 2).
//!
//! Layout: fields are `[V][width]` groups of eight; a chunk's first vertex is `start`, its mutable slices begin there,
//! its shared slices begin at vertex 0. `rest` is tanh of the bias, subtracted so that rest maps to rest.

use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::lanes::{
    Features, Field, LANE_COUNT, Lane, ZERO_LANE, add_product, add_scaled, convolve, sum_lanes, tanh_features, wide,
};
use crate::network::ring::RingMean;

wide! {
    /// Encoder convolution and its share of the latents: `hidden = tanh(conv(x))`, `z[p][k] += C_k . (hidden - rest)`.
    fn encode(
        start: usize,
        x: &[Features],
        ring: &RingMean,
        convolution: &GraphConvRecord,
        rest: &[f32; FEATURE_COUNT],
        components: &[Features],
        component_count: usize,
        group_count: usize,
        hidden: &mut [Features],
        latents: &mut [Lane],
    ) {
        let width = component_count.div_ceil(LANE_COUNT);
        for i in 0..hidden.len() / group_count {
            let v = start + i;
            for p in 0..group_count {
                let mut t = convolve::<FUSED>(ring, convolution, Field { values: x, width: group_count, group: p }, v);
                for c in 0..FEATURE_COUNT {
                    t[c].iter_mut().for_each(|value| *value += convolution.bias[c]);
                }
                tanh_features::<FUSED>(&mut t);
                hidden[i * group_count + p] = t;
                for c in 0..FEATURE_COUNT {
                    t[c].iter_mut().for_each(|value| *value -= rest[c]);
                }
                for k in 0..component_count {
                    let row = &components[v * width + k / LANE_COUNT];
                    let z = &mut latents[p * component_count + k];
                    for c in 0..FEATURE_COUNT {
                        add_scaled::<FUSED>(z, row[c][k % LANE_COUNT], &t[c]);
                    }
                }
            }
        }
    }
}

wide! {
    /// The decoder's convolution of the components instead of the shapes: `hat = W_point C + W_neighbour mean C`.
    fn convolve_components(
        start: usize,
        components: &[Features],
        width: usize,
        ring: &RingMean,
        convolution: &GraphConvRecord,
        hat: &mut [Features],
    ) {
        for (i, row) in hat.iter_mut().enumerate() {
            let field = Field { values: components, width, group: i % width };
            *row = convolve::<FUSED>(ring, convolution, field, start + i / width);
        }
    }
}

wide! {
    /// `y = tanh(sum_k z_k hat_k + bias) - rest`; answers the chunk's share of the weighted `|x - y|^2`.
    fn decode(
        start: usize,
        x: &[Features],
        hat: &[Features],
        component_count: usize,
        latents: &[Lane],
        bias: &[f32; FEATURE_COUNT],
        rest: &[f32; FEATURE_COUNT],
        vertex_weights: &[f32],
        group_count: usize,
        output: &mut [Features],
    ) -> f32 {
        let width = component_count.div_ceil(LANE_COUNT);
        let mut loss = ZERO_LANE;
        for i in 0..output.len() / group_count {
            let v = start + i;
            for p in 0..group_count {
                let mut y = bias.map(|value| [value; LANE_COUNT]);
                for k in 0..component_count {
                    let row = &hat[v * width + k / LANE_COUNT];
                    let z = &latents[p * component_count + k];
                    for c in 0..FEATURE_COUNT {
                        add_scaled::<FUSED>(&mut y[c], row[c][k % LANE_COUNT], z);
                    }
                }
                tanh_features::<FUSED>(&mut y);
                let input = &x[v * group_count + p];
                let mut squares = ZERO_LANE;
                for c in 0..FEATURE_COUNT {
                    let mut residual = ZERO_LANE;
                    for n in 0..LANE_COUNT {
                        y[c][n] -= rest[c];
                        residual[n] = input[c][n] - y[c][n];
                    }
                    add_product::<FUSED>(&mut squares, &residual, &residual);
                }
                add_scaled::<FUSED>(&mut loss, vertex_weights[v], &squares);
                output[i * group_count + p] = y;
            }
        }
        sum_lanes(&loss)
    }
}

wide! {
    /// Attention masks: `(am_k + floor) / (sum_k am_k + K floor)` with `am_k = |C_k,v|^2`. Shape: `[V][width]` lanes of k.
    fn attend(
        start: usize,
        components: &[Features],
        component_count: usize,
        floor: f32,
        masks: &mut [Lane],
    ) {
        let width = component_count.div_ceil(LANE_COUNT);
        for i in 0..masks.len() / width {
            let rows = &components[(start + i) * width..(start + i + 1) * width];
            let total = energy::<FUSED>(rows, &mut masks[i * width..(i + 1) * width]) + component_count as f32 * floor;
            for lane in &mut masks[i * width..(i + 1) * width] {
                lane.iter_mut().for_each(|value| *value = (*value + floor) / total);
            }
        }
    }
}

/// Writes `|C_k,v|^2` of one vertex into `lanes`, answers their sum.
#[inline(always)]
pub(super) fn energy<const FUSED: bool>(rows: &[Features], lanes: &mut [Lane]) -> f32 {
    let mut total = 0.0;
    for (row, lane) in rows.iter().zip(lanes) {
        let mut squares = ZERO_LANE;
        for c in 0..FEATURE_COUNT {
            add_product::<FUSED>(&mut squares, &row[c], &row[c]);
        }
        total += sum_lanes(&squares);
        *lane = squares;
    }
    total
}

wide! {
    /// What the block under component `k` sees: `AM_k (x - y)` of its parent.
    fn attend_residual(
        start: usize,
        parent_input: &[Features],
        parent_output: &[Features],
        masks: &[Lane],
        width: usize,
        k: usize,
        group_count: usize,
        child_input: &mut [Features],
    ) {
        for (i, child) in child_input.iter_mut().enumerate() {
            let index = start * group_count + i;
            let (x, y) = (&parent_input[index], &parent_output[index]);
            let mask = masks[(index / group_count) * width + k / LANE_COUNT][k % LANE_COUNT];
            for c in 0..FEATURE_COUNT {
                for n in 0..LANE_COUNT {
                    child[c][n] = mask * (x[c][n] - y[c][n]);
                }
            }
        }
    }
}

wide! {
    /// `error -= y`.
    fn subtract(start: usize, output: &[Features], group_count: usize, error: &mut [Features]) {
        for (i, e) in error.iter_mut().enumerate() {
            let y = &output[start * group_count + i];
            for c in 0..FEATURE_COUNT {
                for n in 0..LANE_COUNT {
                    e[c][n] -= y[c][n];
                }
            }
        }
    }
}

wide! {
    /// The chunk's share of the weighted `|e|^2` and, added to `projections[p][i]`, of `g_i . e`.
    fn measure_error(
        start: usize,
        error: &[Features],
        vertex_weights: &[f32],
        modes: &[f32],
        mode_count: usize,
        group_count: usize,
        projections: &mut [Lane],
    ) -> f32 {
        let mut loss = ZERO_LANE;
        for (index, e) in error.iter().enumerate() {
            let (v, p) = (start + index / group_count, index % group_count);
            let mut squares = ZERO_LANE;
            for c in 0..FEATURE_COUNT {
                add_product::<FUSED>(&mut squares, &e[c], &e[c]);
                let mode = &modes[(v * FEATURE_COUNT + c) * mode_count..][..mode_count];
                for (sum, &g) in projections[p * mode_count..(p + 1) * mode_count].iter_mut().zip(mode) {
                    add_scaled::<FUSED>(sum, g, &e[c]);
                }
            }
            add_scaled::<FUSED>(&mut loss, vertex_weights[v], &squares);
        }
        sum_lanes(&loss)
    }
}
