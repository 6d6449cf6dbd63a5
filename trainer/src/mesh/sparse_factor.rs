//! Cholesky factor of a sparse symmetric positive definite matrix over the mesh graph, in f64: behind the heat method and
//! the trainer's Poisson solve.
//!
//! Simplicial and on one thread: bits do not depend on the thread count, and for a few right-hand sides it is the fastest.

use core::fmt;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Par, Side};

use super::topology::Topology;

/// Why a matrix has no factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// More vertices or entries than the factor can index, or no memory for it.
    #[error("the sparse factor of {vertex_count} vertices does not fit into memory: use a coarser mesh")]
    TooLarge {
        /// V.
        vertex_count: usize,
    },
    /// A pivot is not positive: weights or positions that are not finite, or magnitudes beyond f64.
    #[error(
        "the matrix over {vertex_count} vertices is not positive definite: check the rest shape for extreme coordinates"
    )]
    NotPositiveDefinite {
        /// V.
        vertex_count: usize,
    },
}

/// Factor of a V x V matrix; solving takes `&self` and is safe from many threads.
pub struct SparseFactor {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    vertex_count: usize,
}

impl fmt::Debug for SparseFactor {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "SparseFactor {{ vertex_count: {}, entries: {} }}",
            self.vertex_count,
            self.values.len()
        )
    }
}

impl SparseFactor {
    /// Factor of the matrix with `diagonal` (shape `[V]`) and `off_diagonal` (shape that of [`Topology::ring`], symmetric).
    pub fn new(topology: &Topology, diagonal: &[f64], off_diagonal: &[f64]) -> Result<Self, FactorError> {
        let vertex_count = topology.vertex_count;
        let mut lower = Vec::with_capacity(vertex_count + off_diagonal.len() / 2);
        for v in 0..vertex_count {
            lower.push(Triplet::new(v, v, diagonal[v]));
            for entry in topology.entries_of(v) {
                let j = topology.ring[entry] as usize;
                if j > v {
                    lower.push(Triplet::new(j, v, off_diagonal[entry]));
                }
            }
        }
        Self::from_lower(vertex_count, &lower)
    }

    /// Factor of the matrix whose lower triangle is the sum of `lower`, in a fixed order.
    pub fn from_lower(vertex_count: usize, lower: &[Triplet<usize, usize, f64>]) -> Result<Self, FactorError> {
        let too_large = FactorError::TooLarge { vertex_count };
        let matrix = SparseColMat::try_new_from_triplets(vertex_count, vertex_count, lower).map_err(|_| too_large)?;
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..CholeskySymbolicParams::default()
        };
        let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, SymmetricOrdering::Amd, parameters)
            .map_err(|_| too_large)?;
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large)?;
        symbolic
            .factorize_numeric_llt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|_| FactorError::NotPositiveDefinite { vertex_count })?;
        if values.iter().all(|value| value.is_finite()) {
            Ok(SparseFactor {
                symbolic,
                values,
                vertex_count,
            })
        } else {
            Err(FactorError::NotPositiveDefinite { vertex_count })
        }
    }

    /// Turns right-hand sides into solutions, in place. `columns` holds `C` of them, interleaved. Shape: `[V][C]`.
    pub fn solve<const C: usize>(&self, columns: &mut [[f64; C]]) {
        assert_eq!(
            columns.len(),
            self.vertex_count,
            "one row of the right-hand side for every vertex"
        );
        if C == 0 || columns.is_empty() {
            return;
        }
        let right = MatMut::from_row_major_slice_mut(columns.as_flattened_mut(), self.vertex_count, C);
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(C, Par::Seq));
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            right,
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::sphere;

    /// Residual of a well-conditioned 66 x 66 system in f64.
    const RESIDUAL_TOLERANCE: f64 = 1e-12;

    #[test]
    fn solves_and_refuses() {
        let (rest, faces) = sphere(2);
        let topology = Topology::new(&faces, &rest);
        let off_diagonal = vec![-1.0; topology.ring.len()];
        let diagonal: Vec<f64> = (0..rest.len())
            .map(|v| topology.ring_of(v).len() as f64 + 0.5)
            .collect();
        let factor = SparseFactor::new(&topology, &diagonal, &off_diagonal).expect("positive definite");
        let mut solution = rest.clone();
        factor.solve(&mut solution);
        for v in 0..rest.len() {
            for c in 0..3 {
                let neighbours: f64 = topology.ring_of(v).iter().map(|&j| solution[j as usize][c]).sum();
                let residual = diagonal[v] * solution[v][c] - neighbours - rest[v][c];
                assert!(residual.abs() < RESIDUAL_TOLERANCE);
            }
        }
        let refused = SparseFactor::new(&topology, &vec![-1.0; rest.len()], &off_diagonal).map(|_| ());
        assert_eq!(
            refused,
            Err(FactorError::NotPositiveDefinite {
                vertex_count: rest.len()
            })
        );
        let refused = SparseFactor::new(&topology, &vec![f64::NAN; rest.len()], &off_diagonal).map(|_| ());
        assert_eq!(
            refused,
            Err(FactorError::NotPositiveDefinite {
                vertex_count: rest.len()
            })
        );
    }
}
