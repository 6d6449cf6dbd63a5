//! Refinement of the fitted gradients, so that the solve gives the shape back: called by
//! [`GradientFit::gradients`](super::gradient::GradientFit::gradients).
//!
//! Fit and solve are two least-squares problems, and gradients that are best ring by ring are not the best to solve from.
//! Of all changes G this takes the one with the least
//! `sum_i tr(G_i A_i G_i^T) + (rho - B G)^T L^-1 (rho - B G) / AGREEMENT`: A the moments of the fit, L the Laplacian of the
//! solve, B its right-hand side, `rho = L p - B T` what the solve misses of the shape p. Its answer is `G = B^T y A^-1` with
//! `(B A^-1 B^T + AGREEMENT L) y = rho`: one factor a mesh, one solve a shape.

use faer::sparse::Triplet;
use nalgebra::{Matrix3, Vector3};

use crate::mesh::sparse_factor::{FactorError, SparseFactor};
use crate::mesh::topology::Topology;
use crate::mesh::vector::difference;

/// How much a change of gradients costs against what the solve misses. On the gallop, at normal weight 1, 1 leaves three
/// quarters of the miss, 0.3 half, 0.1 a third, and 0.01 a tenth but flips rings.
const AGREEMENT: f64 = 0.3;

/// The factored problem of one mesh. V vertices.
#[derive(Debug)]
pub(super) struct Refinement {
    weights: Vec<f64>,
    /// A^-1; zero for a ring that must not change. Shape: `[V]`.
    inverses: Vec<Matrix3<f64>>,
    /// `c_ij / 2 (r_i - r_j)`. Shape: that of [`Topology::ring`].
    half_spokes: Vec<Vector3<f64>>,
    factor: SparseFactor,
}

impl Refinement {
    /// Factors the problem; `weights` are the solve's.
    pub(super) fn new(
        topology: &Topology,
        rest: &[[f64; 3]],
        weights: Vec<f64>,
        inverses: Vec<Matrix3<f64>>,
    ) -> Result<Self, FactorError> {
        let mut half_spokes = vec![Vector3::zeros(); topology.ring.len()];
        for v in 0..topology.vertex_count {
            for entry in topology.entries_of(v) {
                let j = topology.ring[entry] as usize;
                half_spokes[entry] = Vector3::from(difference(rest[j], rest[v])) * (0.5 * weights[entry]);
            }
        }
        let mut lower = Vec::new();
        let mut trace = 0.0;
        let mut column: Vec<(usize, Vector3<f64>)> = Vec::new();
        for v in 0..topology.vertex_count {
            let entries = topology.entries_of(v);
            // Column v of B: on v itself the sum of its half spokes, on each neighbour the spoke turned round.
            column.clear();
            column.push((v, half_spokes[entries.clone()].iter().sum()));
            column.extend(
                entries
                    .clone()
                    .map(|entry| (topology.ring[entry] as usize, -half_spokes[entry])),
            );
            for &(a, left) in &column {
                let left = inverses[v] * left;
                for &(b, right) in column.iter().filter(|&&(b, _)| b <= a) {
                    lower.push(Triplet::new(a, b, left.dot(&right)));
                }
                trace += left.dot(&column[0].1).max(0.0);
            }
            let sum: f64 = weights[entries.clone()].iter().sum();
            trace += AGREEMENT * sum;
            lower.push(Triplet::new(v, v, AGREEMENT * sum));
            for entry in entries {
                let j = topology.ring[entry] as usize;
                if j < v {
                    lower.push(Triplet::new(v, j, -AGREEMENT * weights[entry]));
                }
            }
        }
        if topology.vertex_count > 0 {
            // Both terms know no translation, and rho sums to zero: any anchor serves.
            let mean = trace / topology.vertex_count as f64;
            lower.push(Triplet::new(0, 0, if mean > 0.0 { mean } else { 1.0 }));
        }
        let factor = SparseFactor::from_lower(topology.vertex_count, &lower)?;
        Ok(Refinement {
            weights,
            inverses,
            half_spokes,
            factor,
        })
    }

    /// Moves `gradients` (shape `[V]`) of `shape` (`[V][3]`).
    pub(super) fn refine(&self, topology: &Topology, shape: &[[f64; 3]], gradients: &mut [Matrix3<f64>]) {
        let mut multipliers: Vec<[f64; 3]> = (0..topology.vertex_count)
            .map(|v| {
                let mut missed = Vector3::zeros();
                for entry in topology.entries_of(v) {
                    let j = topology.ring[entry] as usize;
                    missed += Vector3::from(difference(shape[j], shape[v])) * self.weights[entry];
                    missed -= (gradients[v] + gradients[j]) * self.half_spokes[entry];
                }
                missed.into()
            })
            .collect();
        self.factor.solve(&mut multipliers);
        for v in 0..topology.vertex_count {
            let mut change = Matrix3::zeros();
            for entry in topology.entries_of(v) {
                let j = topology.ring[entry] as usize;
                let step = Vector3::from(difference(multipliers[j], multipliers[v]));
                change += step * self.half_spokes[entry].transpose();
            }
            gradients[v] += change * self.inverses[v];
        }
    }
}
