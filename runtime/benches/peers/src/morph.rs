//! Dense morph targets, as engines blend them on the CPU: `p = rest + sum_k w_k d_k` over all coordinates. Three loops that
//! give the same sums; a benchmark quotes the fastest.

use crate::widest;

/// Targets in one array. Shape: `deltas` `[K][3 V]`, `rest` `[3 V]`.
#[derive(Debug, Clone)]
pub struct MorphTargets {
    rest: Vec<f32>,
    deltas: Vec<f32>,
}

/// Coordinates that stay in the first-level cache while all targets pass.
const BLOCK: usize = 2048;

impl MorphTargets {
    /// `target_count` smooth targets over `rest`. Shape: `[V]`.
    pub fn new(rest: &[[f32; 3]], target_count: usize) -> Self {
        let rest = rest.as_flattened().to_vec();
        let deltas = (0..target_count)
            .flat_map(|k| (0..rest.len()).map(move |i| 0.01 * ((0.001 * i as f32 + k as f32).sin())))
            .collect();
        Self { rest, deltas }
    }

    /// K.
    pub fn target_count(&self) -> usize {
        self.deltas.len() / self.rest.len()
    }

    /// The loops by name.
    pub fn loops() -> [(&'static str, fn(&Self, &[f32], &mut [f32])); 3] {
        [
            ("target by target", |morph, weights, out| {
                by_target(&morph.rest, &morph.deltas, weights, out)
            }),
            ("in blocks", |morph, weights, out| {
                in_blocks(&morph.rest, &morph.deltas, weights, out)
            }),
            ("in blocks, four targets at once", |morph, weights, out| {
                by_fours(&morph.rest, &morph.deltas, weights, out);
            }),
        ]
    }
}

#[inline(always)]
fn by_target_body(rest: &[f32], deltas: &[f32], weights: &[f32], out: &mut [f32]) {
    out.copy_from_slice(rest);
    for (delta, &w) in deltas.chunks_exact(rest.len()).zip(weights) {
        for (x, d) in out.iter_mut().zip(delta) {
            *x = d.mul_add(w, *x);
        }
    }
}

#[inline(always)]
fn in_blocks_body(rest: &[f32], deltas: &[f32], weights: &[f32], out: &mut [f32]) {
    let blocks = out.chunks_mut(BLOCK).zip(rest.chunks(BLOCK)).enumerate();
    for (n, (out, block)) in blocks {
        out.copy_from_slice(block);
        for (delta, &w) in deltas.chunks_exact(rest.len()).zip(weights) {
            let delta = &delta[n * BLOCK..][..out.len()];
            for (x, d) in out.iter_mut().zip(delta) {
                *x = d.mul_add(w, *x);
            }
        }
    }
}

#[inline(always)]
fn by_fours_body(rest: &[f32], deltas: &[f32], weights: &[f32], out: &mut [f32]) {
    let stride = rest.len();
    for (n, (out, block)) in out.chunks_mut(BLOCK).zip(rest.chunks(BLOCK)).enumerate() {
        out.copy_from_slice(block);
        for (four, w) in weights.chunks(4).enumerate() {
            let of = |k: usize| {
                let k = (4 * four + k).min(weights.len() - 1);
                &deltas[k * stride + n * BLOCK..][..out.len()]
            };
            let weight = |k: usize| w.get(k).copied().unwrap_or(0.0);
            let (a, b, c, d) = (of(0), of(1), of(2), of(3));
            let (wa, wb, wc, wd) = (weight(0), weight(1), weight(2), weight(3));
            for i in 0..out.len() {
                out[i] = d[i].mul_add(wd, c[i].mul_add(wc, b[i].mul_add(wb, a[i].mul_add(wa, out[i]))));
            }
        }
    }
}

widest! {
    /// One target after the other over the whole mesh. Shapes: `rest` and `out` `[3 V]`, `deltas` `[K][3 V]`, `weights` `[K]`.
    pub fn by_target(rest: &[f32], deltas: &[f32], weights: &[f32], out: &mut [f32]) = by_target_body
}
widest! {
    /// All targets over a block that stays in cache. Shapes: those of [`by_target`].
    pub fn in_blocks(rest: &[f32], deltas: &[f32], weights: &[f32], out: &mut [f32]) = in_blocks_body
}
widest! {
    /// The same, four targets a pass over the block. Shapes: those of [`by_target`].
    pub fn by_fours(rest: &[f32], deltas: &[f32], weights: &[f32], out: &mut [f32]) = by_fours_body
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loops_agree() {
        /// Sums of ten products near 0.01 in another order.
        const TOLERANCE: f32 = 1e-6;
        let rest: Vec<[f32; 3]> = (0..1500).map(|v| [v as f32 * 0.001, 0.5, 1.0]).collect();
        let morph = MorphTargets::new(&rest, 10);
        assert_eq!(morph.target_count(), 10);
        let weights: Vec<f32> = (0..10).map(|k| 0.3 * k as f32 - 1.0).collect();
        let outs = MorphTargets::loops().map(|(_, run)| {
            let mut out = vec![0.0; 3 * rest.len()];
            run(&morph, &weights, &mut out);
            out
        });
        assert!(outs[0] != morph.rest);
        for other in &outs[1..] {
            assert!(outs[0].iter().zip(other).all(|(a, b)| (a - b).abs() < TOLERANCE));
        }
    }
}
