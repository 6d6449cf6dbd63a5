//! From features back to positions, in f64: the trainer's oracle of the runtime's solve, and what the baker and the
//! closed-form start take their matrices from.
//!
//! Method section 1: `L d = b(T - I)` with the cotangent Laplacian of the rest shape, solved for the displacement `d`.

use nalgebra::{Matrix3, Vector3};

use super::acap::{gradient_of_feature, widened_feature};
use crate::mesh::cotangent::EdgeWeights;
use crate::mesh::sparse_factor::{FactorError, SparseFactor};
use crate::mesh::topology::Topology;

/// The factored system of one mesh. V vertices.
#[derive(Debug)]
pub struct PoissonSystem {
    topology: Topology,
    weights: EdgeWeights,
    rest: Vec<[f64; 3]>,
    anchor: usize,
    diagonal: Vec<f64>,
    factor: SparseFactor,
}

/// The matrix `L + anchor`: `diagonal[v]` on the diagonal, `-off_diagonal[entry]` for every ring entry.
#[derive(Debug, Clone, Copy)]
pub struct PoissonMatrix<'a> {
    /// Sum of the row's weights; the anchor's also carries the mean of all. Shape: `[V]`.
    pub diagonal: &'a [f64],
    /// Edge weights c_ij, positive; the matrix has `-c_ij`. Shape: that of [`Topology::ring`].
    pub off_diagonal: &'a [f64],
    /// Row offsets. Shape: `[V + 1]`.
    pub ring_offsets: &'a [u32],
    /// Columns, ascending within a row.
    pub ring: &'a [u32],
}

impl PoissonSystem {
    /// Factors `L + anchor`, where `L_ij = -c_ij`, `L_ii = sum_j c_ij`, and `anchor` (below V) has the mean diagonal
    /// added to its own. Right-hand sides sum to zero, so the anchor's displacement is zero.
    pub fn new(
        topology: &Topology,
        weights: &EdgeWeights,
        rest: &[[f64; 3]],
        anchor: usize,
    ) -> Result<Self, FactorError> {
        let mut diagonal: Vec<f64> = (0..topology.vertex_count)
            .map(|v| topology.entries_of(v).map(|entry| weights.weights[entry]).sum())
            .collect();
        let mean = diagonal.iter().sum::<f64>() / diagonal.len().max(1) as f64;
        // A mesh of one vertex has no edges; 1 keeps it definite.
        diagonal[anchor] += if mean > 0.0 { mean } else { 1.0 };
        let off_diagonal: Vec<f64> = weights.weights.iter().map(|weight| -weight).collect();
        let factor = SparseFactor::new(topology, &diagonal, &off_diagonal)?;
        Ok(PoissonSystem {
            topology: topology.clone(),
            weights: weights.clone(),
            rest: rest.to_vec(),
            anchor,
            diagonal,
            factor,
        })
    }

    /// The vertex that stays where it is.
    pub fn anchor(&self) -> usize {
        self.anchor
    }

    /// The rest shape. Shape: `[V][3]`.
    pub fn rest(&self) -> &[[f64; 3]] {
        &self.rest
    }

    /// The matrix that was factored.
    pub fn matrix(&self) -> PoissonMatrix<'_> {
        PoissonMatrix {
            diagonal: &self.diagonal,
            off_diagonal: &self.weights.weights,
            ring_offsets: &self.topology.ring_offsets,
            ring: &self.topology.ring,
        }
    }

    /// `b_i = 1/2 sum_j c_ij (D_i + D_j)(r_i - r_j)` of `deviations` D = T - I, shape `[V]`. Sums to zero over i.
    pub fn right_hand_side(&self, deviations: &[Matrix3<f64>]) -> Vec<[f64; 3]> {
        (0..self.topology.vertex_count)
            .map(|v| {
                let mut sum = Vector3::zeros();
                for entry in self.topology.entries_of(v) {
                    let j = self.topology.ring[entry] as usize;
                    sum += (deviations[v] + deviations[j]) * (self.spoke(v, j) * (0.5 * self.weights.weights[entry]));
                }
                sum.into()
            })
            .collect()
    }

    /// Transpose of [`right_hand_side`](Self::right_hand_side): `G_i = 1/2 sum_j c_ij (y_i - y_j)(r_i - r_j)^T` of
    /// `vectors` y, shape `[V]`, so that `<b(D), y> = sum_i <D_i, G_i>` for every D.
    pub fn right_hand_side_adjoint(&self, vectors: &[[f64; 3]]) -> Vec<Matrix3<f64>> {
        (0..self.topology.vertex_count)
            .map(|v| {
                let mut sum = Matrix3::zeros();
                for entry in self.topology.entries_of(v) {
                    let j = self.topology.ring[entry] as usize;
                    let step = Vector3::from(vectors[v]) - Vector3::from(vectors[j]);
                    sum += step * (self.spoke(v, j) * (0.5 * self.weights.weights[entry])).transpose();
                }
                sum
            })
            .collect()
    }

    /// Turns right-hand sides into displacements, in place. Shape: `[V][C]`, any number C of columns.
    pub fn solve<const C: usize>(&self, values: &mut [[f64; C]]) {
        self.factor.solve(values);
    }

    /// Positions of the shape that `features` (shape `[V][9]`, unscaled) describe, the anchor at rest.
    pub fn reconstruct(&self, features: &[[f64; 9]]) -> Vec<[f64; 3]> {
        let deviations: Vec<Matrix3<f64>> = features
            .iter()
            .map(|feature| gradient_of_feature(feature) - Matrix3::identity())
            .collect();
        let mut positions = self.right_hand_side(&deviations);
        self.solve(&mut positions);
        for (position, rest) in positions.iter_mut().zip(&self.rest) {
            for c in 0..3 {
                position[c] += rest[c];
            }
        }
        positions
    }

    /// Displacements, shape `[V][3]`, that small changes of the features about the reference make, to first order:
    /// `L^-1 b([r]x + s)`. `changes` has shape `[V][9]`: log-rotation, then the upper triangle of S - I.
    pub fn linear_displacements(&self, changes: &[[f64; 9]]) -> Vec<[f64; 3]> {
        let deviations: Vec<Matrix3<f64>> = changes.iter().map(widened_feature).collect();
        let mut displacements = self.right_hand_side(&deviations);
        self.solve(&mut displacements);
        displacements
    }

    /// Transpose of [`linear_displacements`](Self::linear_displacements). Shape: `[V][3]` to `[V][9]`.
    pub fn linear_displacements_adjoint(&self, vectors: &[[f64; 3]]) -> Vec<[f64; 9]> {
        let mut solved = vectors.to_vec();
        self.solve(&mut solved);
        self.right_hand_side_adjoint(&solved)
            .iter()
            .map(|g| {
                [
                    g[(2, 1)] - g[(1, 2)],
                    g[(0, 2)] - g[(2, 0)],
                    g[(1, 0)] - g[(0, 1)],
                    g[(0, 0)],
                    g[(0, 1)] + g[(1, 0)],
                    g[(0, 2)] + g[(2, 0)],
                    g[(1, 1)],
                    g[(1, 2)] + g[(2, 1)],
                    g[(2, 2)],
                ]
            })
            .collect()
    }

    fn spoke(&self, v: usize, j: usize) -> Vector3<f64> {
        Vector3::from(self.rest[v]) - Vector3::from(self.rest[j])
    }
}

/// The vertex to hold still: the one that moves least over the aligned `shapes` (`[N][V][3]`), of equals the one nearest
/// to the centroid of `rest`, of equals the first.
pub fn choose_anchor(rest: &[[f64; 3]], shapes: impl IntoIterator<Item = Vec<[f64; 3]>>) -> usize {
    let mut motion = vec![0.0; rest.len()];
    for shape in shapes {
        for (v, position) in shape.into_iter().enumerate() {
            motion[v] += (Vector3::from(position) - Vector3::from(rest[v])).norm_squared();
        }
    }
    let centroid = rest.iter().fold(Vector3::zeros(), |sum, p| sum + Vector3::from(*p)) / rest.len().max(1) as f64;
    let offset = |v: usize| (Vector3::from(rest[v]) - centroid).norm_squared();
    (0..rest.len())
        .min_by(|&a, &b| {
            motion[a]
                .total_cmp(&motion[b])
                .then_with(|| offset(a).total_cmp(&offset(b)))
        })
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{grid, merged, moved, sphere, tube};
    use nalgebra::Rotation3;

    /// Rounding of a solve of some hundred unknowns in f64, against a mesh of size 1.
    const TOLERANCE: f64 = 1e-10;

    fn system(mesh: &(Vec<[f64; 3]>, Vec<[u32; 3]>), anchor: usize) -> PoissonSystem {
        let topology = Topology::new(&mesh.1, &mesh.0);
        let weights = EdgeWeights::new(&topology, &mesh.0);
        PoissonSystem::new(&topology, &weights, &mesh.0, anchor).expect("the Laplacian with an anchor is definite")
    }

    #[test]
    fn one_gradient_everywhere_is_one_affine_map() {
        let pieces = merged(&[
            sphere(2),
            moved(&grid(4, 4, 0.3), [2.0, 0.0, 0.0]),
            moved(&tube(6, 4, 1.0), [0.0, 4.0, 0.0]),
        ]);
        let system = system(&pieces, 7);
        let turn = Rotation3::from_euler_angles(0.3, 0.8, -0.2).into_inner();
        let gradient = turn * Matrix3::new(1.3, 0.1, 0.0, 0.1, 0.9, 0.05, 0.0, 0.05, 1.1);
        let mut positions = system.right_hand_side(&vec![gradient - Matrix3::identity(); pieces.0.len()]);
        system.solve(&mut positions);
        let held = Vector3::from(pieces.0[7]);
        for (displacement, rest) in positions.iter().zip(&pieces.0) {
            let rest = Vector3::from(*rest);
            let expected = gradient * (rest - held) + held;
            assert!((Vector3::from(*displacement) + rest - expected).norm() < TOLERANCE);
        }
    }

    #[test]
    fn neutral_features_are_the_rest_shape() {
        let mesh = tube(8, 5, 2.0);
        let positions =
            system(&mesh, 0).reconstruct(&vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; mesh.0.len()]);
        assert_eq!(positions, mesh.0);
    }

    #[test]
    fn adjoints_are_transposes() {
        let mesh = sphere(2);
        let system = system(&mesh, 3);
        let wave = |n: usize| (n as f64 * 0.7).sin();
        let changes: Vec<[f64; 9]> = (0..mesh.0.len())
            .map(|v| core::array::from_fn(|c| wave(9 * v + c)))
            .collect();
        let vectors: Vec<[f64; 3]> = (0..mesh.0.len())
            .map(|v| core::array::from_fn(|c| wave(31 * v + 5 * c + 2)))
            .collect();
        let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let there = system.linear_displacements(&changes);
        let back = system.linear_displacements_adjoint(&vectors);
        let (left, right) = (
            inner(there.as_flattened(), vectors.as_flattened()),
            inner(changes.as_flattened(), back.as_flattened()),
        );
        assert!((left - right).abs() < TOLERANCE * left.abs().max(1.0), "{left} {right}");
    }

    #[test]
    fn the_linear_map_is_the_derivative() {
        /// Second-order remainder of a step of 1e-5, relative to the step.
        const DERIVATIVE_TOLERANCE: f64 = 1e-3;
        let mesh = sphere(2);
        let system = system(&mesh, 3);
        let step = 1e-5;
        let changes: Vec<[f64; 9]> = (0..mesh.0.len())
            .map(|v| core::array::from_fn(|c| ((9 * v + c) as f64).cos() * step))
            .collect();
        let features: Vec<[f64; 9]> = changes
            .iter()
            .map(|x| core::array::from_fn(|c| x[c] + if matches!(c, 3 | 6 | 8) { 1.0 } else { 0.0 }))
            .collect();
        let linear = system.linear_displacements(&changes);
        for (v, position) in system.reconstruct(&features).iter().enumerate() {
            let exact = Vector3::from(*position) - Vector3::from(mesh.0[v]);
            assert!((exact - Vector3::from(linear[v])).norm() < DERIVATIVE_TOLERANCE * step);
        }
    }

    #[test]
    fn the_anchor_is_what_moves_least() {
        let rest = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        assert_eq!(choose_anchor(&rest, []), 1);
        let mut shape = rest.clone();
        shape[1][1] = 0.5;
        assert_eq!(choose_anchor(&rest, [shape]), 2);
    }
}
