//! Gradients of convolutions, summed over shapes and vertices.

use sinew_formats::package::{FEATURE_COUNT, GraphConvRecord};

use super::lanes::{Features, Registers, store, sum_lanes};
use super::simd::{Group, Simd};
use crate::network::weights::zero_convolution;

/// A convolution's gradient over a chunk of vertices, still spread over lanes.
pub(crate) struct ConvolutionSums<G> {
    point: [Features<G>; FEATURE_COUNT],
    neighbour: [Features<G>; FEATURE_COUNT],
    pending: [Triple<G>; PENDING],
    pending_count: usize,
}

/// Sums of a tile are this many squared; with their factors they fill sixteen registers.
const TILE: usize = 3;

/// Triples that wait until there are so many: a tile of sums stays in registers while they go by. To read and write
/// every sum for every triple would cost twice the products.
const PENDING: usize = 8;

/// What one vertex and group adds to a convolution's gradient.
#[derive(Clone, Copy)]
struct Triple<G> {
    /// The block's own input.
    x: Features<G>,
    /// Gradient of what the convolution answers.
    g: Features<G>,
    /// The transposed ring mean of that gradient. `sum_v mean_v g_v = sum_v x_v gathered_v`: who gathers the gradient
    /// needs no mean of inputs a second time.
    gathered: Features<G>,
}

impl<G: Group> ConvolutionSums<G> {
    pub(crate) const ZERO: Self = Self {
        point: [[G::ZERO; FEATURE_COUNT]; FEATURE_COUNT],
        neighbour: [[G::ZERO; FEATURE_COUNT]; FEATURE_COUNT],
        pending: [Triple {
            x: [G::ZERO; FEATURE_COUNT],
            g: [G::ZERO; FEATURE_COUNT],
            gathered: [G::ZERO; FEATURE_COUNT],
        }; PENDING],
        pending_count: 0,
    };

    /// `point += g xᵀ`, `neighbour += gathered xᵀ`, now or later.
    #[inline(always)]
    pub(crate) fn push<S: Simd<G>>(
        &mut self,
        simd: S,
        g: &Registers<S, G>,
        gathered: &Registers<S, G>,
        x: &Registers<S, G>,
    ) {
        let triple = &mut self.pending[self.pending_count];
        store(simd, g, &mut triple.g);
        store(simd, gathered, &mut triple.gathered);
        store(simd, x, &mut triple.x);
        self.pending_count += 1;
        if self.pending_count == PENDING {
            self.flush(simd);
        }
    }

    #[inline(always)]
    fn flush<S: Simd<G>>(&mut self, simd: S) {
        let triples = &self.pending[..self.pending_count];
        for o in (0..FEATURE_COUNT).step_by(TILE) {
            for i in (0..FEATURE_COUNT).step_by(TILE) {
                add_tile(simd, &mut self.point, o, i, triples, |triple| &triple.g);
                add_tile(simd, &mut self.neighbour, o, i, triples, |triple| &triple.gathered);
            }
        }
        self.pending_count = 0;
    }

    /// The sums over lanes; the bias, which is summed elsewhere, is zero.
    #[inline(always)]
    pub(crate) fn total<S: Simd<G>>(mut self, simd: S) -> GraphConvRecord {
        self.flush(simd);
        let mut total = zero_convolution();
        for o in 0..FEATURE_COUNT {
            total.point[o] = self.point[o].map(sum_lanes);
            total.neighbour[o] = self.neighbour[o].map(sum_lanes);
        }
        total
    }
}

#[inline(always)]
fn add_tile<S: Simd<G>, G: Group>(
    simd: S,
    sums: &mut [Features<G>; FEATURE_COUNT],
    o: usize,
    i: usize,
    triples: &[Triple<G>],
    gradient: impl Fn(&Triple<G>) -> &Features<G>,
) {
    let mut tile = [[simd.splat(0.0); TILE]; TILE];
    for a in 0..TILE {
        for b in 0..TILE {
            tile[a][b] = simd.load(&sums[o + a][i + b]);
        }
    }
    for triple in triples {
        let g = gradient(triple);
        let mut x = [simd.splat(0.0); TILE];
        for b in 0..TILE {
            x[b] = simd.load(&triple.x[i + b]);
        }
        for a in 0..TILE {
            let g = simd.load(&g[o + a]);
            for b in 0..TILE {
                tile[a][b] = simd.mul_add(g, x[b], tile[a][b]);
            }
        }
    }
    for a in 0..TILE {
        for b in 0..TILE {
            sums[o + a][i + b] = simd.store(tile[a][b]);
        }
    }
}
