//! The passes from the loss back to every weight, in the reverse order of `forward` and with its layout.

use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::forward::energy;
use super::lanes::{
    Features, Field, LANE_COUNT, Lane, ZERO_FEATURES, ZERO_LANE, add_product, add_scaled, add_transposed, ring_mean,
    sum_lanes, wide,
};
use crate::network::ring::RingMean;
use crate::network::weights::zero_convolution;

/// A convolution's gradient, still spread over lanes.
#[derive(Clone)]
pub(crate) struct ConvolutionSums {
    point: [Features; FEATURE_COUNT],
    neighbour: [Features; FEATURE_COUNT],
    bias: Features,
}

impl ConvolutionSums {
    pub(crate) const ZERO: Self = Self {
        point: [ZERO_FEATURES; FEATURE_COUNT],
        neighbour: [ZERO_FEATURES; FEATURE_COUNT],
        bias: ZERO_FEATURES,
    };

    /// Adds up lanes within chunks, then chunks in order, in double precision.
    pub(crate) fn total<'a>(chunks: impl Iterator<Item = &'a Self> + Clone) -> GraphConvRecord {
        let sum = |pick: &dyn Fn(&Self) -> f32| chunks.clone().map(|sums| f64::from(pick(sums))).sum::<f64>() as f32;
        let mut total = zero_convolution();
        for o in 0..FEATURE_COUNT {
            for i in 0..FEATURE_COUNT {
                total.point[o][i] = sum(&|sums| sum_lanes(&sums.point[o][i]));
                total.neighbour[o][i] = sum(&|sums| sum_lanes(&sums.neighbour[o][i]));
            }
            total.bias[o] = sum(&|sums| sum_lanes(&sums.bias[o]));
        }
        total
    }

    /// `point += g xᵀ`, `neighbour += g meanᵀ` for some triples, in their order. A tile of sums stays in registers while
    /// all triples go by: to read and write every sum for every triple would cost twice the products.
    #[inline(always)]
    fn add<const FUSED: bool>(&mut self, triples: &[Triple]) {
        for o in (0..FEATURE_COUNT).step_by(TILE) {
            for i in (0..FEATURE_COUNT).step_by(TILE) {
                add_tile::<FUSED>(&mut self.point, o, i, triples, |triple| &triple.x);
                add_tile::<FUSED>(&mut self.neighbour, o, i, triples, |triple| &triple.mean);
            }
        }
    }
}

/// Sums of a tile are this many squared; with their factors they fill sixteen registers.
const TILE: usize = 3;

/// Triples that wait until there are so many.
const PENDING: usize = 8;

/// What one vertex and group adds to a convolution's gradient.
#[derive(Clone, Copy)]
struct Triple {
    g: Features,
    x: Features,
    mean: Features,
}

impl Triple {
    const ZERO: Self = Self {
        g: ZERO_FEATURES,
        x: ZERO_FEATURES,
        mean: ZERO_FEATURES,
    };
}

#[inline(always)]
fn add_tile<const FUSED: bool>(
    sums: &mut [Features; FEATURE_COUNT],
    o: usize,
    i: usize,
    triples: &[Triple],
    factor: impl Fn(&Triple) -> &Features,
) {
    let mut tile: [[Lane; TILE]; TILE] = core::array::from_fn(|a| core::array::from_fn(|b| sums[o + a][i + b]));
    for triple in triples {
        let x = factor(triple);
        for a in 0..TILE {
            for b in 0..TILE {
                add_product::<FUSED>(&mut tile[a][b], &triple.g[o + a], &x[i + b]);
            }
        }
    }
    for a in 0..TILE {
        for b in 0..TILE {
            sums[o + a][i + b] = tile[a][b];
        }
    }
}

/// Triples on their way into the sums.
struct Pending {
    triples: [Triple; PENDING],
    len: usize,
}

impl Pending {
    const NONE: Self = Self {
        triples: [Triple::ZERO; PENDING],
        len: 0,
    };

    #[inline(always)]
    fn push<const FUSED: bool>(&mut self, triple: Triple, sums: &mut ConvolutionSums) {
        self.triples[self.len] = triple;
        self.len += 1;
        if self.len == PENDING {
            self.flush::<FUSED>(sums);
        }
    }

    #[inline(always)]
    fn flush<const FUSED: bool>(&mut self, sums: &mut ConvolutionSums) {
        sums.add::<FUSED>(&self.triples[..self.len]);
        self.len = 0;
    }
}

/// What a pass needs to rebuild dL/dx and dL/dy of a block before its own layers: the error's gradient, the gradient
/// that comes back through the residual from the level below (empty for the last level), and the block's own term.
#[derive(Clone, Copy)]
pub(crate) struct ResidualGradient<'a> {
    /// dL/de. Shape: `[V][width]`.
    pub(crate) error: &'a [Features],
    /// dL/d(x - y) from the children. Shape: `[V][width]`, or empty.
    pub(crate) children: &'a [Features],
    /// Twice the factor of the block's reconstruction term.
    pub(crate) block_factor: f32,
    /// Shape: `[V]`.
    pub(crate) vertex_weights: &'a [f32],
}

impl ResidualGradient<'_> {
    /// dL/d(x - y) of the block: its own term and its children's.
    #[inline(always)]
    fn own(&self, index: usize, v: usize, x: &Features, y: &Features) -> Features {
        let mut gradient = if self.children.is_empty() {
            ZERO_FEATURES
        } else {
            self.children[index]
        };
        let factor = self.block_factor * self.vertex_weights[v];
        for c in 0..FEATURE_COUNT {
            for n in 0..LANE_COUNT {
                gradient[c][n] += factor * (x[c][n] - y[c][n]);
            }
        }
        gradient
    }
}

wide! {
    /// Turns the error into dL/de in place: `2 factor w_v e + sum_i projection_i g_i` (projections already scaled).
    fn differentiate_error(
        start: usize,
        factor: f32,
        vertex_weights: &[f32],
        modes: &[f32],
        mode_count: usize,
        projections: &[Lane],
        group_count: usize,
        error: &mut [Features],
    ) {
        for (index, e) in error.iter_mut().enumerate() {
            let (v, p) = (start + index / group_count, index % group_count);
            for c in 0..FEATURE_COUNT {
                let mut gradient = e[c].map(|value| factor * vertex_weights[v] * value);
                let mode = &modes[(v * FEATURE_COUNT + c) * mode_count..][..mode_count];
                for (projection, &g) in projections[p * mode_count..(p + 1) * mode_count].iter().zip(mode) {
                    add_scaled::<FUSED>(&mut gradient, g, projection);
                }
                e[c] = gradient;
            }
        }
    }
}

wide! {
    /// Back through the decoder's tanh: adds to dL/dz, turns `hat` into its own gradient, sums the bias.
    /// `latents_transposed`: `[shape][width]` lanes of k.
    fn decode_back(
        start: usize,
        x: &[Features],
        output: &[Features],
        residual: ResidualGradient<'_>,
        component_count: usize,
        latents_transposed: &[Lane],
        rest: &[f32; FEATURE_COUNT],
        group_count: usize,
        hat: &mut [Features],
        latent_gradient: &mut [Lane],
        sums: &mut ConvolutionSums,
    ) {
        let width = component_count.div_ceil(LANE_COUNT);
        let mut gradients = vec![ZERO_FEATURES; group_count];
        for i in 0..hat.len() / width {
            let v = start + i;
            for (p, gradient) in gradients.iter_mut().enumerate() {
                let index = v * group_count + p;
                let y = &output[index];
                let own = residual.own(index, v, &x[index], y);
                for c in 0..FEATURE_COUNT {
                    let slope_at_rest = 1.0 - rest[c] * rest[c];
                    for n in 0..LANE_COUNT {
                        let t = y[c][n] + rest[c];
                        let towards_output = -(residual.error[index][c][n] + own[c][n]);
                        gradient[c][n] = towards_output * (1.0 - t * t);
                        sums.bias[c][n] += gradient[c][n] - towards_output * slope_at_rest;
                    }
                }
                for k in 0..component_count {
                    let row = &hat[i * width + k / LANE_COUNT];
                    let z = &mut latent_gradient[p * component_count + k];
                    for c in 0..FEATURE_COUNT {
                        add_scaled::<FUSED>(z, row[c][k % LANE_COUNT], &gradient[c]);
                    }
                }
            }
            for q in 0..width {
                hat[i * width + q] = expand::<FUSED>(&gradients, latents_transposed, width, q);
            }
        }
    }
}

/// `sum over shapes of field[shape] z[shape]`, the gradient of a product with the latents, lanes of k.
#[inline(always)]
fn expand<const FUSED: bool>(field: &[Features], latents_transposed: &[Lane], width: usize, q: usize) -> Features {
    let mut sum = ZERO_FEATURES;
    for (p, values) in field.iter().enumerate() {
        for n in 0..LANE_COUNT {
            let z = &latents_transposed[(p * LANE_COUNT + n) * width + q];
            for c in 0..FEATURE_COUNT {
                add_scaled::<FUSED>(&mut sum[c], values[c][n], z);
            }
        }
    }
    sum
}

wide! {
    /// Back through the latents and the encoder: adds to dL/dC, sums the convolution, and, where the block has a parent,
    /// turns `output` into dL/dx less the neighbours' part and `hidden` into what `gather` spreads for that part.
    fn encode_back(
        start: usize,
        x: &[Features],
        ring: &RingMean,
        convolution: &GraphConvRecord,
        rest: &[f32; FEATURE_COUNT],
        components: &[Features],
        component_count: usize,
        latent_gradient: &[Lane],
        latent_gradient_transposed: &[Lane],
        residual: ResidualGradient<'_>,
        group_count: usize,
        has_parent: bool,
        hidden: &mut [Features],
        output: &mut [Features],
        component_gradient: &mut [Features],
        sums: &mut ConvolutionSums,
    ) {
        let width = component_count.div_ceil(LANE_COUNT);
        let mut moved = vec![ZERO_FEATURES; group_count];
        let mut pending = Pending::NONE;
        for i in 0..hidden.len() / group_count {
            let v = start + i;
            for p in 0..group_count {
                let index = v * group_count + p;
                let mut gradient = ZERO_FEATURES;
                for k in 0..component_count {
                    let row = &components[v * width + k / LANE_COUNT];
                    let z = &latent_gradient[p * component_count + k];
                    for c in 0..FEATURE_COUNT {
                        add_scaled::<FUSED>(&mut gradient[c], row[c][k % LANE_COUNT], z);
                    }
                }
                let t = &mut hidden[i * group_count + p];
                for c in 0..FEATURE_COUNT {
                    let slope_at_rest = 1.0 - rest[c] * rest[c];
                    let (value, towards_hidden) = (t[c], gradient[c]);
                    let mut slope = ZERO_LANE;
                    for n in 0..LANE_COUNT {
                        slope[n] = 1.0 - value[n] * value[n];
                    }
                    for n in 0..LANE_COUNT {
                        moved[p][c][n] = value[n] - rest[c];
                    }
                    for n in 0..LANE_COUNT {
                        gradient[c][n] = towards_hidden[n] * slope[n];
                    }
                    for n in 0..LANE_COUNT {
                        sums.bias[c][n] += gradient[c][n] - towards_hidden[n] * slope_at_rest;
                    }
                }
                let mean = ring_mean(ring, Field { values: x, width: group_count, group: p }, v);
                pending.push::<FUSED>(Triple { g: gradient, x: x[index], mean }, sums);
                if has_parent {
                    *t = ZERO_FEATURES;
                    add_transposed::<FUSED>(t, &convolution.neighbour, &gradient);
                    let y = &mut output[i * group_count + p];
                    let mut towards_input = residual.own(index, v, &x[index], y);
                    add_transposed::<FUSED>(&mut towards_input, &convolution.point, &gradient);
                    *y = towards_input;
                }
            }
            for q in 0..width {
                let own = expand::<FUSED>(&moved, latent_gradient_transposed, width, q);
                let sum = &mut component_gradient[i * width + q];
                for c in 0..FEATURE_COUNT {
                    for n in 0..LANE_COUNT {
                        sum[c][n] += own[c][n];
                    }
                }
            }
        }
        pending.flush::<FUSED>(sums);
    }
}

wide! {
    /// Back through `convolve_components`: adds to dL/dC, sums the convolution, turns `hat_gradient` into what `gather` spreads.
    fn convolve_components_back(
        start: usize,
        components: &[Features],
        width: usize,
        ring: &RingMean,
        convolution: &GraphConvRecord,
        hat_gradient: &mut [Features],
        component_gradient: &mut [Features],
        sums: &mut ConvolutionSums,
    ) {
        let mut pending = Pending::NONE;
        for (i, gradient) in hat_gradient.iter_mut().enumerate() {
            let v = start + i / width;
            let field = Field { values: components, width, group: i % width };
            let triple = Triple { g: *gradient, x: *field.at(v), mean: ring_mean(ring, field, v) };
            pending.push::<FUSED>(triple, sums);
            add_transposed::<FUSED>(&mut component_gradient[i], &convolution.point, gradient);
            let mut spread = ZERO_FEATURES;
            add_transposed::<FUSED>(&mut spread, &convolution.neighbour, gradient);
            *gradient = spread;
        }
        pending.flush::<FUSED>(sums);
    }
}

wide! {
    /// The transpose of the ring mean: `sum_v += spread_j / degree_j` over all j whose ring holds v.
    fn gather(start: usize, spread: &[Features], width: usize, ring: &RingMean, sum: &mut [Features]) {
        for (i, own) in sum.iter_mut().enumerate() {
            let field = Field { values: spread, width, group: i % width };
            for &j in ring.transposed_ring(start + i / width) {
                let share = ring.inverse_degree[j as usize];
                let other = field.at(j as usize);
                for c in 0..FEATURE_COUNT {
                    add_scaled::<FUSED>(&mut own[c], share, &other[c]);
                }
            }
        }
    }
}

wide! {
    /// Back through `attend` and `attend_residual`: dL/d(x - y) from the children, and the masks' part of dL/dC.
    fn attend_back(
        start: usize,
        x: &[Features],
        output: &[Features],
        masks: &[Lane],
        components: &[Features],
        component_count: usize,
        floor: f32,
        children: &[&[Features]],
        group_count: usize,
        residual_gradient: &mut [Features],
        component_gradient: &mut [Features],
    ) {
        let width = component_count.div_ceil(LANE_COUNT);
        let mut mask_gradient = vec![0.0_f32; component_count];
        let mut energies = vec![ZERO_LANE; width];
        for i in 0..residual_gradient.len() / group_count {
            let v = start + i;
            let mask = |k: usize| masks[v * width + k / LANE_COUNT][k % LANE_COUNT];
            let own = &mut residual_gradient[i * group_count..(i + 1) * group_count];
            own.fill(ZERO_FEATURES);
            for (k, child) in children.iter().enumerate() {
                let mut product = ZERO_LANE;
                for p in 0..group_count {
                    let index = v * group_count + p;
                    let gradient = &child[index];
                    for c in 0..FEATURE_COUNT {
                        add_scaled::<FUSED>(&mut own[p][c], mask(k), &gradient[c]);
                        let mut residual = ZERO_LANE;
                        for n in 0..LANE_COUNT {
                            residual[n] = x[index][c][n] - output[index][c][n];
                        }
                        add_product::<FUSED>(&mut product, &gradient[c], &residual);
                    }
                }
                mask_gradient[k] = sum_lanes(&product);
            }
            let rows = &components[v * width..(v + 1) * width];
            let total = energy::<FUSED>(rows, &mut energies) + component_count as f32 * floor;
            let mut mean = 0.0;
            for k in 0..component_count {
                mean += mask(k) * mask_gradient[k];
            }
            for k in 0..component_count {
                let factor = 2.0 * (mask_gradient[k] - mean) / total;
                let (q, lane) = (k / LANE_COUNT, k % LANE_COUNT);
                for c in 0..FEATURE_COUNT {
                    component_gradient[i * width + q][c][lane] += factor * rows[q][c][lane];
                }
            }
        }
    }
}
