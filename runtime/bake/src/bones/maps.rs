//! The maps that would be best under a given skin, pose by pose: least squares over all vertices. The matrix does not depend
//! on the pose, so it is factored once.

use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;

use super::cells::Cells;
use super::poses::Samples;
use super::{Matrix, Source, Vector};

/// Bones and weights of one vertex; weights are positive and sum to one.
pub(super) type SkinRow = Vec<(usize, f64)>;

/// What holds a bone's gradient to the one that it has, as a share of what the vertices say.
const GRADIENT_HOLD: f64 = 1e-2;
/// What holds a displacement: only enough for a bone that nobody follows.
const PLACE_HOLD: f64 = 1e-6;

/// Numbers of a map, a row each: displacement, then the three columns of the gradient.
const ROWS: usize = 4;

/// The skin of a mesh on its bones.
pub(super) struct Skinned<'a> {
    pub(super) source: &'a Source<'a>,
    pub(super) samples: &'a Samples,
    pub(super) cells: &'a Cells,
    /// Shape: `[V]`, source order.
    pub(super) skin: &'a [SkinRow],
}

impl Skinned<'_> {
    fn bone_count(&self) -> usize {
        self.cells.centres.len()
    }

    fn arm(&self, v: usize, bone: usize) -> Vector {
        Vector::from(self.source.surface.rest[v]) - self.cells.centres[bone]
    }

    /// Gradients `T` of the bones that bring the vertices nearest to the exact ones in some poses. Shape: `poses` are places among
    /// the samples; `near` `[poses][B]`, what they are held to.
    pub(super) fn best_gradients(&self, poses: &[usize], near: &[Vec<Matrix>]) -> Vec<Vec<Matrix>> {
        let bones = self.bone_count();
        let mut gram = DMatrix::<f64>::zeros(ROWS * bones, ROWS * bones);
        let numbers = |v: usize, bone: usize| {
            let arm = self.arm(v, bone);
            [1.0, arm[0], arm[1], arm[2]]
        };
        for (v, row) in self.skin.iter().enumerate() {
            for &(i, of_i) in row {
                for &(j, of_j) in row {
                    let (a, b) = (numbers(v, i), numbers(v, j));
                    for p in 0..ROWS {
                        for q in 0..ROWS {
                            gram[(ROWS * i + p, ROWS * j + q)] += of_i * of_j * a[p] * b[q];
                        }
                    }
                }
            }
        }
        let mut holds = vec![0.0; ROWS * bones];
        for bone in 0..bones {
            let own = |p: usize| gram[(ROWS * bone + p, ROWS * bone + p)];
            holds[ROWS * bone] = PLACE_HOLD * own(0).max(1e-12);
            let spread = (1..ROWS).map(own).sum::<f64>() / 3.0;
            holds[ROWS * bone + 1..ROWS * (bone + 1)]
                .fill(GRADIENT_HOLD * spread + 1e-12 * self.samples.diagonal.powi(2));
        }
        holds.iter().enumerate().for_each(|(n, hold)| gram[(n, n)] += hold);
        // Definite: a sum of squares and a positive diagonal.
        let Some(factor) = gram.cholesky() else {
            return near.to_vec();
        };
        let best = |(&pose, near): (&usize, &Vec<Matrix>)| {
            let mut side = DMatrix::<f64>::zeros(ROWS * bones, 3);
            for (v, row) in self.skin.iter().enumerate() {
                let middle: Vector = row.iter().map(|&(bone, share)| share * self.cells.centres[bone]).sum();
                let wanted = self.samples.position(pose, v) - middle;
                for &(bone, share) in row {
                    for (p, number) in numbers(v, bone).into_iter().enumerate() {
                        for c in 0..3 {
                            side[(ROWS * bone + p, c)] += share * number * wanted[c];
                        }
                    }
                }
            }
            for (bone, near) in near.iter().enumerate() {
                for p in 1..ROWS {
                    let row = ROWS * bone + p;
                    (0..3).for_each(|c| side[(row, c)] += holds[row] * near[(c, p - 1)]);
                }
            }
            let solved = factor.solve(&side);
            let gradient = |bone: usize| Matrix::from_fn(|r, c| solved[(ROWS * bone + 1 + c, r)]);
            (0..bones).map(gradient).collect()
        };
        poses.par_iter().zip(near).map(best).collect()
    }

    /// Displacements of the bones that bring the vertices nearest, with gradients as they are. Shape: `gradients` `[M][B]`.
    pub(super) fn best_places(&self, gradients: &[Vec<Matrix>]) -> Vec<Vec<Vector>> {
        let Some(factor) = self.place_factor() else {
            return vec![vec![Vector::zeros(); self.bone_count()]; gradients.len()];
        };
        let best = |(pose, gradients): (usize, &Vec<Matrix>)| {
            let mut side = DMatrix::<f64>::zeros(self.bone_count(), 3);
            for (v, row) in self.skin.iter().enumerate() {
                let mut wanted = self.samples.position(pose, v);
                for &(bone, share) in row {
                    wanted -= share * (self.cells.centres[bone] + gradients[bone] * self.arm(v, bone));
                }
                for &(bone, share) in row {
                    (0..3).for_each(|c| side[(bone, c)] += share * wanted[c]);
                }
            }
            let solved = factor.solve(&side);
            (0..self.bone_count())
                .map(|bone| Vector::from_fn(|c, _| solved[(bone, c)]))
                .collect()
        };
        gradients.par_iter().enumerate().map(best).collect()
    }

    fn place_factor(&self) -> Option<Cholesky<f64, Dyn>> {
        let bones = self.bone_count();
        let mut gram = DMatrix::<f64>::zeros(bones, bones);
        for row in self.skin {
            for &(i, of_i) in row {
                for &(j, of_j) in row {
                    gram[(i, j)] += of_i * of_j;
                }
            }
        }
        let hold = PLACE_HOLD * gram.trace() / bones as f64 + 1e-12;
        (0..bones).for_each(|bone| gram[(bone, bone)] += hold);
        gram.cholesky()
    }
}
