//! The solver's matrix, its elimination order and its factor: `L + anchor = F D F^T`, computed once in f64 by faer,
//! gathered into tiles and stored in f32 for the frame path (factoring in f32 costs three digits, solving in f32 does not).

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

use sinew_formats::package::{QUAD, TILE_ENTRIES};

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
        // A lone vertex has no edge, and must be held all the same.
        diagonal[self.anchor_vertex] += if mean > 0.0 { mean } else { 1.0 };
        diagonal
    }

    /// Why the matrix has no factor: a vertex that no edge ties to the anchor, or else numbers, which show at `pivot` where that
    /// is known.
    fn not_positive(&self, pivot: Option<usize>) -> BakeError {
        let mut met = vec![false; self.vertex_count()];
        let mut open = vec![self.anchor_vertex];
        met[self.anchor_vertex] = true;
        while let Some(v) = open.pop() {
            for &j in &self.ring[self.row(v)] {
                if !core::mem::replace(&mut met[j as usize], true) {
                    open.push(j as usize);
                }
            }
        }
        match met.iter().position(|&met| !met) {
            Some(vertex) => BakeError::NotConnected { vertex },
            None => BakeError::NotPositive { vertex: pivot },
        }
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

/// The factor by tiles of 4 x 4, as the frame path reads it: `F` block unit lower triangular, `D` block diagonal.
/// T = ceil(V / 4) quads of solver places that follow each other; what the last quad lacks is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Columns of tiles over `rows`. Shape: `[T + 1]`.
    pub offsets: Vec<u32>,
    /// Quad of rows of each tile, ascending within a column, greater than the column.
    pub rows: Vec<u32>,
    /// Column-major, not all zero. Shape: that of `rows`.
    pub tiles: Vec<[f32; TILE_ENTRIES]>,
    /// `1 / D`, symmetric. Shape: `[T]`.
    pub inverse_diagonals: Vec<[f32; TILE_ENTRIES]>,
}

/// Entries of `F` nearer to zero count as zero: a thousandth of what f32 keeps of the diagonal. No product with a number of
/// the solve, which are flushed at 1e-20, can then be denormal.
const NEGLIGIBLE: f64 = 1e-10;

type Tile = [[f64; QUAD]; QUAD];

impl Factor {
    /// Factors the matrix in the given order.
    /// Errors: a pivot that is not positive (the weights are not those of a connected surface), or no memory.
    pub fn new(laplacian: &AnchoredLaplacian<'_>, order: &EliminationOrder) -> Result<Self, BakeError> {
        let scalar = ScalarFactor::new(laplacian, order)?;
        let column_count = laplacian.vertex_count().div_ceil(QUAD);
        let mut factor = Self {
            offsets: vec![0],
            rows: Vec::new(),
            tiles: Vec::new(),
            inverse_diagonals: Vec::new(),
        };
        // Place of the tile that stands on a quad of rows, in the column at hand.
        let mut places = vec![usize::MAX; column_count];
        for column in 0..column_count {
            let (mut rows, mut tiles): (Vec<u32>, Vec<Tile>) = (Vec::new(), Vec::new());
            let mut diagonal = identity();
            let mut inverse_pivots = [0.0; QUAD];
            for (c, inverse_pivot) in inverse_pivots.iter_mut().enumerate() {
                let solver = column * QUAD + c;
                if solver == laplacian.vertex_count() {
                    break;
                }
                *inverse_pivot = scalar.inverse_pivots[solver];
                for (row, value) in scalar.column(solver) {
                    let (quad, r) = (row / QUAD, row % QUAD);
                    if quad == column {
                        diagonal[r][c] = value;
                        continue;
                    }
                    if places[quad] == usize::MAX {
                        places[quad] = tiles.len();
                        rows.push(quad as u32);
                        tiles.push(Tile::default());
                    }
                    tiles[places[quad]][r][c] = value;
                }
            }
            rows.iter().for_each(|&quad| places[quad as usize] = usize::MAX);
            factor.push_column(rows, &tiles, &inverse_of_unit_lower(&diagonal), &inverse_pivots);
        }
        Ok(factor)
    }

    /// With `L` of a quad's diagonal: tiles become `tile L^-1`, the pivots `L D L^T`.
    fn push_column(&mut self, rows: Vec<u32>, tiles: &[Tile], inverse: &Tile, inverse_pivots: &[f64; QUAD]) {
        let mut column: Vec<(u32, [f32; TILE_ENTRIES])> = rows
            .into_iter()
            .zip(tiles)
            .map(|(row, tile)| (row, narrowed(&product(tile, inverse))))
            .filter(|(_, tile)| *tile != [0.0; TILE_ENTRIES])
            .collect();
        column.sort_unstable_by_key(|&(row, _)| row);
        self.rows.extend(column.iter().map(|&(row, _)| row));
        self.tiles.extend(column.iter().map(|&(_, tile)| tile));
        self.offsets.push(self.rows.len() as u32);
        self.inverse_diagonals.push(core::array::from_fn(|n| {
            let (i, j) = (n / QUAD, n % QUAD);
            let terms = (0..QUAD).map(|k| inverse[k][i] * inverse_pivots[k] * inverse[k][j]);
            terms.sum::<f64>() as f32
        }));
    }
}

fn identity() -> Tile {
    core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }))
}

fn product(a: &Tile, b: &Tile) -> Tile {
    a.map(|row| core::array::from_fn(|j| row.iter().zip(b).map(|(value, other)| value * other[j]).sum()))
}

fn inverse_of_unit_lower(lower: &Tile) -> Tile {
    let mut inverse = identity();
    for i in 0..QUAD {
        for j in 0..i {
            inverse[i][j] = -(j..i).map(|k| lower[i][k] * inverse[k][j]).sum::<f64>();
        }
    }
    inverse
}

/// By columns.
fn narrowed(tile: &Tile) -> [f32; TILE_ENTRIES] {
    core::array::from_fn(|n| {
        let value = tile[n % QUAD][n / QUAD];
        if value.abs() < NEGLIGIBLE { 0.0 } else { value as f32 }
    })
}

/// faer's factor: columns of the unit lower triangle below the diagonal, and the inverse pivots, in f64.
struct ScalarFactor<'a> {
    symbolic: &'a simplicial::SymbolicSimplicialCholesky<usize>,
    /// Each column starts with its pivot.
    values: Vec<f64>,
    /// `1 / D`, positive. Shape: `[V]`.
    inverse_pivots: Vec<f64>,
}

impl<'a> ScalarFactor<'a> {
    fn new(laplacian: &AnchoredLaplacian<'_>, order: &'a EliminationOrder) -> Result<Self, BakeError> {
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
        .map_err(|_| laplacian.not_positive(None))?;
        let starts = &symbolic.col_ptr()[..vertex_count];
        let inverse_pivots: Vec<f64> = starts.iter().map(|&start| 1.0 / values[start]).collect();
        let sound = |inverse: f64| inverse as f32 > 0.0 && (inverse as f32).is_finite();
        match inverse_pivots.iter().position(|&inverse| !sound(inverse)) {
            Some(column) => Err(laplacian.not_positive(Some(order.vertex_from_solver[column] as usize))),
            None => Ok(Self {
                symbolic,
                values,
                inverse_pivots,
            }),
        }
    }

    /// Rows and values below the diagonal, rows ascending.
    fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.symbolic.col_ptr()[column] + 1..self.symbolic.col_ptr()[column + 1];
        range.map(|entry| (self.symbolic.row_idx()[entry], self.values[entry]))
    }
}
