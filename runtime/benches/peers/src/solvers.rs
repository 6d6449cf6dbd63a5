//! Sparse solvers on the runtime's own matrix: faer's simplicial Cholesky in f64 with memory that is kept, and the same
//! matrix as others want it.

use faer::{
    Conj, MatMut, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    linalg::cholesky::llt::factor::LltRegularization,
    sparse::{
        SparseColMat, Triplet,
        linalg::{
            SupernodalThreshold,
            cholesky::{
                CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
            },
        },
    },
};
use sinew_bake::factor::AnchoredLaplacian;

/// The lower triangle by columns, rows ascending.
#[derive(Debug, Clone, PartialEq)]
pub struct LowerTriangle {
    /// Shape: `[V + 1]`.
    pub offsets: Vec<i32>,
    /// Each column starts with its diagonal.
    pub rows: Vec<i32>,
    /// Shape: that of `rows`.
    pub values: Vec<f64>,
}

impl LowerTriangle {
    /// Of the matrix that the baker factors.
    pub fn of(laplacian: &AnchoredLaplacian<'_>) -> Self {
        let mut lower = Self {
            offsets: vec![0],
            rows: Vec::new(),
            values: Vec::new(),
        };
        for (column, &diagonal) in laplacian.diagonal().iter().enumerate() {
            lower.rows.push(column as i32);
            lower.values.push(diagonal);
            for entry in laplacian.ring_offsets[column] as usize..laplacian.ring_offsets[column + 1] as usize {
                if laplacian.ring[entry] as usize > column {
                    lower.rows.push(laplacian.ring[entry] as i32);
                    lower.values.push(-laplacian.weights[entry]);
                }
            }
            lower.offsets.push(lower.rows.len() as i32);
        }
        lower
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.offsets.len() - 1
    }
}

/// faer's factor and the memory of its solve.
pub struct FaerSimplicial {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    memory: MemBuffer,
}

impl FaerSimplicial {
    /// Factors. Panics where the matrix is not positive definite: a benchmark's subject is.
    pub fn new(lower: &LowerTriangle) -> Self {
        let vertex_count = lower.vertex_count();
        let triplets: Vec<Triplet<usize, usize, f64>> = (0..vertex_count)
            .flat_map(|column| {
                let entries = lower.offsets[column] as usize..lower.offsets[column + 1] as usize;
                entries.map(move |e| Triplet::new(lower.rows[e] as usize, column, lower.values[e]))
            })
            .collect();
        let matrix = SparseColMat::try_new_from_triplets(vertex_count, vertex_count, &triplets).expect("in range");
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..CholeskySymbolicParams::default()
        };
        let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, SymmetricOrdering::Amd, parameters)
            .expect("memory for the pattern");
        let mut values = vec![0.0; symbolic.len_val()];
        let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
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
            .expect("positive definite");
        let memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(3, Par::Seq));
        Self {
            symbolic,
            values,
            memory,
        }
    }

    /// Solves for three columns in place. Shape: `[3][V]`.
    pub fn solve(&mut self, columns: &mut [f64]) {
        let right = MatMut::from_column_major_slice_mut(columns, self.symbolic.nrows(), 3);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            right,
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}
