//! The solver's matrix, its elimination order and its factor: `L + anchor = F D F^T`, computed once in f64 by faer,
//! stored in f32 for the frame path (factoring in f32 costs three digits, solving in f32 does not).

use faer::{
    Side,
    dyn_stack::{MemBuffer, MemStack},
    sparse::{
        SparseColMat, SymbolicSparseColMat,
        linalg::{
            SupernodalThreshold,
            cholesky::{
                CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
                factorize_symbolic_cholesky, simplicial,
            },
        },
    },
};

use super::BakeError;

/// Cotangent Laplacian of the rest shape, held at one vertex: `L_ij = -c_ij`, `L_ii = sum_j c_ij`, and the mean diagonal
/// once more on the anchor's. Source order.
#[derive(Debug, Clone, Copy)]
pub struct AnchoredLaplacian<'a> {
    /// Compressed rows over `ring`. Shape: `[V + 1]`.
    pub ring_offsets: &'a [u32],
    /// Neighbours, ascending within a row, never the row itself; symmetric.
    pub ring: &'a [u32],
    /// `c_ij`, symmetric; positive, or such that the matrix is definite all the same. Shape: that of `ring`.
    pub weights: &'a [f64],
    /// The vertex that does not move.
    pub anchor_vertex: usize,
}

impl AnchoredLaplacian<'_> {
    fn vertex_count(&self) -> usize {
        self.ring_offsets.len() - 1
    }

    fn row(&self, v: usize) -> core::ops::Range<usize> {
        self.ring_offsets[v] as usize..self.ring_offsets[v + 1] as usize
    }

    /// Diagonal, anchor included. Shape: `[V]`.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut diagonal: Vec<f64> = (0..self.vertex_count())
            .map(|v| self.weights[self.row(v)].iter().sum())
            .collect();
        let mean = diagonal.iter().sum::<f64>() / diagonal.len() as f64;
        diagonal[self.anchor_vertex] += mean;
        diagonal
    }

    /// Upper triangle with row `i` standing for vertex `vertex_from_row[i]`.
    fn upper_triangle(
        &self,
        vertex_from_row: impl Fn(usize) -> usize,
        row_from_vertex: impl Fn(usize) -> usize,
    ) -> SparseColMat<usize, f64> {
        let diagonal = self.diagonal();
        let vertex_count = self.vertex_count();
        let mut offsets = vec![0];
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for column in 0..vertex_count {
            let v = vertex_from_row(column);
            let mut entries: Vec<(usize, f64)> = self
                .row(v)
                .map(|e| (row_from_vertex(self.ring[e] as usize), -self.weights[e]))
                .filter(|&(row, _)| row < column)
                .collect();
            entries.sort_unstable_by_key(|&(row, _)| row);
            entries.push((column, diagonal[v]));
            rows.extend(entries.iter().map(|entry| entry.0));
            values.extend(entries.iter().map(|entry| entry.1));
            offsets.push(rows.len());
        }
        let pattern = SymbolicSparseColMat::new_checked(vertex_count, vertex_count, offsets, None, rows);
        SparseColMat::new(pattern, values)
    }
}

/// An order of elimination that keeps the factor sparse (approximate minimum degree), and the factor's pattern in it.
#[derive(Debug)]
pub struct EliminationOrder {
    /// Shape: `[V]`, a permutation.
    pub vertex_from_solver: Vec<u32>,
    /// Shape: `[V]`, its inverse.
    pub solver_from_vertex: Vec<u32>,
    symbolic: SymbolicCholesky<usize>,
}

impl EliminationOrder {
    /// Orders the matrix's rows. Deterministic.
    pub fn new(laplacian: &AnchoredLaplacian<'_>) -> Result<Self, BakeError> {
        let matrix = laplacian.upper_triangle(|row| row, |vertex| vertex);
        let symbolic = factorize_symbolic_cholesky(
            matrix.symbolic(),
            Side::Upper,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams {
                // The exported form is the simplicial one, and for three right-hand sides it is the faster one.
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
                ..Default::default()
            },
        )
        .map_err(|_| BakeError::FactorTooLarge {
            vertex_count: laplacian.vertex_count(),
        })?;
        let narrow = |indices: &[usize]| indices.iter().map(|&i| i as u32).collect::<Vec<u32>>();
        let (vertex_from_solver, solver_from_vertex) = match symbolic.perm() {
            Some(order) => (narrow(order.arrays().0), narrow(order.arrays().1)),
            None => {
                let identity: Vec<u32> = (0..laplacian.vertex_count() as u32).collect();
                (identity.clone(), identity)
            }
        };
        Ok(Self {
            vertex_from_solver,
            solver_from_vertex,
            symbolic,
        })
    }
}

/// Columns of the unit lower factor below the diagonal, and the inverse pivots, as the frame path reads them.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Shape: `[V + 1]`.
    pub offsets: Vec<u32>,
    /// Solver indices, ascending within a column, greater than the column.
    pub rows: Vec<u32>,
    /// Shape: that of `rows`.
    pub values: Vec<f32>,
    /// `1 / D`, positive. Shape: `[V]`.
    pub inverse_pivots: Vec<f32>,
}

impl Factor {
    /// Factors the matrix in the given order.
    /// Errors: a pivot that is not positive (the weights are not those of a connected surface), or no memory.
    pub fn new(laplacian: &AnchoredLaplacian<'_>, order: &EliminationOrder) -> Result<Self, BakeError> {
        let vertex_count = laplacian.vertex_count();
        let too_large = BakeError::FactorTooLarge { vertex_count };
        let SymbolicCholeskyRaw::Simplicial(symbolic) = order.symbolic.raw() else {
            return Err(too_large);
        };
        let matrix = laplacian.upper_triangle(
            |row| order.vertex_from_solver[row] as usize,
            |vertex| order.solver_from_vertex[vertex] as usize,
        );
        let mut values = vec![0.0_f64; symbolic.len_val()];
        let scratch = simplicial::factorize_simplicial_numeric_ldlt_scratch::<usize, f64>(vertex_count);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large)?;
        simplicial::factorize_simplicial_numeric_ldlt(
            &mut values,
            matrix.as_ref(),
            Default::default(),
            symbolic,
            MemStack::new(&mut memory),
        )
        .map_err(|_| BakeError::NotPositive {
            vertex: laplacian.anchor_vertex,
        })?;

        let mut factor = Self {
            offsets: vec![0],
            rows: Vec::new(),
            values: Vec::new(),
            inverse_pivots: Vec::new(),
        };
        for (column, bounds) in symbolic.col_ptr().windows(2).enumerate() {
            // Each column starts with its pivot.
            let inverse_pivot = (1.0 / values[bounds[0]]) as f32;
            if !(inverse_pivot > 0.0 && inverse_pivot.is_finite()) {
                return Err(BakeError::NotPositive {
                    vertex: order.vertex_from_solver[column] as usize,
                });
            }
            factor.inverse_pivots.push(inverse_pivot);
            for e in bounds[0] + 1..bounds[1] {
                factor.rows.push(symbolic.row_idx()[e] as u32);
                factor.values.push(values[e] as f32);
            }
            factor.offsets.push(factor.rows.len() as u32);
        }
        Ok(factor)
    }
}
